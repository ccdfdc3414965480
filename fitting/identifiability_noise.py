"""How well the noise is known that the error of a parameter rests on.

An estimated noise comes from residuals. Where three readings of a narrow peak tell two parameters,
one residual is left to tell the noise of such bright readings, however many dark ones there are:
errors and limits are then those of Student's t with one degree of freedom. Satterthwaite's
approximation gives that number for each parameter, from the readings that its estimate follows.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lobefit.fitting.information import Information, labels
from lobefit.fitting.noise import FEW
from lobefit.fitting.point import PointFit

__all__ = ["Freedom", "NoiseFreedom", "student"]

Array = NDArray[np.float64]

# Half the width of the differences along search coordinates.
STEP = 1e-4
# Values beyond this are not looked at one by one; so many readings tell their noise.
MOST = 200_000
# Eigenvalues of scaled matrices below this are no information but rounding.
ROUNDING = 1e-7
# Residuals are never taken to be more than this times too small, as variances.
LARGEST = 10.0


@dataclass(frozen=True, slots=True)
class Freedom:
    """What is known of the noise in an estimate.

    Attributes
    ----------
    degrees : float
        Degrees of freedom of the variance; infinite where the noise is stated.
    factor : float
        By which the variance is too small on average: parameters follow readings.
    readings : float
        How many readings the estimate follows.
    """

    degrees: float
    factor: float
    readings: float

    def level(self, share: float) -> float:
        """Give the squared quantile of a one-sided probability, in units of the variance."""
        return self.factor * student(share, self.degrees) ** 2


class NoiseFreedom:
    """Degrees of freedom of an estimated noise.

    Parameters
    ----------
    fit : PointFit
        The best point.
    every : sequence of Information
        Of each channel.
    scale : float
        Variance in units of the objective, which they were computed with.
    correlation : float
        Neighbouring residuals that count as one.
    """

    def __init__(
        self, fit: PointFit, every: Sequence[Information], scale: float, correlation: float
    ) -> None:
        self.fit, self.every = fit, every
        dataset = fit.problem.dataset
        self.known = not dataset.estimates_noise or fit.values.size > MOST or not scale > 0.0
        if self.known:
            return
        self._used = dataset.used
        self._weights = np.where(dataset.used, 1.0 / fit.sigma**2, 0.0)
        # The share of each variance that is additive; the rest is relative noise.
        additive = np.minimum((fit.additive[:, None] / fit.sigma) ** 2, 1.0)
        self._shares = np.stack([additive, 1.0 - additive])
        self._jacobians = _jacobians(fit, every)
        self._covariances = [_inverse(known.matrix) for known in every]
        leverage = np.zeros_like(fit.values)
        for channel, (J, covariance) in enumerate(
            zip(self._jacobians, self._covariances, strict=True)
        ):
            spread = np.einsum("pn,pq,qn->n", J, covariance, J) * self._weights[channel]
            leverage[channel] = np.clip(spread / scale, 0.0, 1.0)
        few = self._used.sum(axis=1) < FEW
        groups = [[int(c)] for c in np.flatnonzero(~few)]
        if few.any():
            groups.append([int(c) for c in np.flatnonzero(few)])
        self._group = {c: k for k, group in enumerate(groups) for c in group}
        self._covariance, self._factors = [], []
        for group in groups:
            shares, used = self._shares[:, group], self._used[group]
            left = np.where(used, 1.0 - leverage[group], 0.0)
            all_of_them = 0.5 * np.einsum("acn,bcn,cn->ab", shares, shares, used.astype(float))
            free = 0.5 * np.einsum("acn,bcn,cn->ab", shares, shares, left) / correlation
            followed = 0.5 * np.einsum("acn,cn->a", shares, used - left)
            bias = np.linalg.pinv(all_of_them, rcond=ROUNDING, hermitian=True) @ followed
            self._covariance.append(np.linalg.pinv(free, rcond=ROUNDING, hermitian=True))
            self._factors.append(1.0 / np.clip(1.0 - bias, 1.0 / LARGEST, 1.0))

    def of_changes(self, changes: Array) -> Freedom:
        """Judge a difference between two models.

        Parameters
        ----------
        changes : ndarray, shape (C, N)
            Changes of the values, 1/sr.
        """
        if self.known:
            return Freedom(np.inf, 1.0, np.inf)
        parts = self._weights * changes**2
        total = float(parts.sum())
        if not (total > 0.0 and np.isfinite(total)):
            return Freedom(np.inf, 1.0, np.inf)
        groups = len(self._covariance)
        share = np.zeros((groups, 2))
        for channel, k in self._group.items():
            share[k] += (self._shares[:, channel] * parts[channel]).sum(axis=1) / total
        factors = np.stack(self._factors)
        factor = float((share * factors).sum())
        share *= factors / factor
        variance = sum(
            float(share[k] @ covariance @ share[k]) for k, covariance in enumerate(self._covariance)
        )
        readings = total**2 / float((parts**2).sum())
        return Freedom(2.0 / max(variance, 1e-12), factor, readings)

    def of(self, name: str, channel: int | None) -> Freedom:
        """Judge the estimate of a parameter; of a channel, or of all (None)."""
        weights = {name: 1.0}
        return self.along(weights, channel)

    def along(self, weights: dict[str, float], channel: int | None) -> Freedom:
        """Judge the estimate of a product: powers by name."""
        if self.known:
            return Freedom(np.inf, 1.0, np.inf)
        changes = np.zeros_like(self.fit.values)
        for c, known in enumerate(self.every):
            if channel not in (None, c) or not {*weights} <= {*known.names}:
                continue
            vector = np.array([weights.get(name, 0.0) for name in known.names])
            changes[c] = self._jacobians[c].T @ (self._covariances[c] @ vector)
        return self.of_changes(changes)


def _inverse(matrix: Array) -> Array:
    scale = np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    inverse = np.linalg.pinv(matrix / np.outer(scale, scale), rcond=ROUNDING, hermitian=True)
    found: Array = inverse / np.outer(scale, scale)
    return found


def _jacobians(fit: PointFit, every: Sequence[Information]) -> list[Array]:
    """Differentiate each channel's values along the parameters of its information, (p, N)."""
    problem, t, c = fit.problem, fit.polished.t, fit.polished.c
    k = problem.program.n_basis
    columns: dict[str, Array] = {}
    for j, name in enumerate(labels(problem, t)):
        shift = np.zeros(len(t))
        shift[j] = STEP
        difference = problem.values(t + shift, c) - problem.values(t - shift, c)
        columns[name] = difference * (problem.scale.units[j] / (2.0 * STEP))
    for p in problem.candidate.solved:
        holds = np.array([p.name in names for names in problem.candidate.model.coefficients])
        moved = c.copy()
        moved[:, :k] *= holds
        columns[p.name] = problem.values(t, moved)
    for j, p in enumerate(problem.candidate.own):
        up, down = c.copy(), c.copy()
        up[:, k + j] += STEP
        down[:, k + j] -= STEP
        difference = problem.values(t, up) - problem.values(t, down)
        columns[p.name] = difference * (problem.own.units[j] / (2.0 * STEP))
    return [
        np.stack([columns[name][channel] for name in known.names])
        if known.names
        else np.zeros((0, fit.values.shape[1]))
        for channel, known in enumerate(every)
    ]


def student(share: float, degrees: float) -> float:
    """Give the quantile of Student's t.

    Examples
    --------
    >>> round(student(0.95, 1.0), 3), round(student(0.95, 10.0), 3)
    (6.314, 1.812)
    """
    degrees = float(np.clip(degrees, 1.0, 1e4))
    # x = sqrt(degrees) tan(angle), where the density is a power of the cosine.
    angle = np.linspace(0.0, 0.5 * np.pi, 40_001)
    density = np.cos(angle) ** (degrees - 1.0)
    total = np.append(0.0, np.cumsum(0.5 * (density[1:] + density[:-1])))
    found = np.interp((2.0 * share - 1.0) * total[-1], total, angle)
    return float(np.sqrt(degrees) * np.tan(found))
