"""Student's t in the point fit: readings that are far off lose their weight.

The scale mixture of Gaussians (Lange, Little & Taylor 1989): with z the residual over sigma, a
reading has the weight ``u = (nu + 1) / (nu + z^2)`` beside its 1/sigma^2. Weights, noise, nu and
fit are found in turn: iteratively reweighted least squares, an EM algorithm, which lowers
-2 ln L in each round but for the noise's dependence on the model.

A start that one reading has pulled away might stay in its valley. So there are two: where least
squares end, and where the residuals of the logarithm are least.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from lobefit.fitting.dataset import Dataset
from lobefit.fitting.noise import GROSS, estimate_noise, level, variance
from lobefit.fitting.polish import Polished
from lobefit.fitting.problem import Problem
from lobefit.fitting.reweigh import Weighed, judged_with, refitted
from lobefit.fitting.valley import descend

__all__ = [
    "NUS",
    "fit_robustly",
    "student_deviance",
    "student_spread",
    "student_terms",
    "student_weights",
]

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

# Degrees of freedom that are tried; the last one is a Gaussian to within a percent.
NUS = (2.0, 3.0, 4.0, 6.0, 10.0, 20.0, 50.0, 200.0)
# Rounds of weights and fit; the slowest of them (nu = 2) gain a factor of 2.5 each.
ROUNDS = 40
# Rounds of weights, noise and nu at a fixed model, before the first fit and between others.
FIRST, BETWEEN = 30, 3
# Readings that choose nu; more would only cost time.
ENOUGH = 8192
# Parameters have settled when a round moves them by less, relatively.
SETTLED = 1e-6
# Deviances that differ by less are those of one point.
EQUAL = 1e-3


def student_weights(z2: Array, nu: float) -> Array:
    """Give the weights of squared standardised residuals."""
    weights: Array = (nu + 1.0) / (nu + z2)
    return weights


def student_deviance(residuals: Array, v: Array, used: Mask, nu: float) -> float:
    """Give -2 ln L of residuals under Student's t with scales sqrt(v), all constants included.

    Parameters
    ----------
    residuals, v : ndarray, shape (C, N)
        In 1/sr, and their squares.
    used : ndarray of bool, shape (C, N)
        Which values count.
    nu : float
        Degrees of freedom.
    """
    return float(np.sum(student_terms(residuals, v, nu), where=used))


def student_terms(residuals: Array, v: Array, nu: float) -> Array:
    """Give -2 ln of the density of each residual."""
    norm = 2.0 * (math.lgamma(0.5 * nu) - math.lgamma(0.5 * (nu + 1.0)))
    terms: Array = (
        norm + np.log(nu * np.pi * v) + (nu + 1.0) * np.log1p(residuals * residuals / (nu * v))
    )
    return terms


def student_spread(z: Array, nu: float, dof: int) -> float:
    """Give what the inverse of the weighted normal matrix is multiplied with for a covariance.

    Parameters
    ----------
    z : ndarray
        Standardised residuals of the readings that count.
    nu : float
        Degrees of freedom.
    dof : int
        Readings less parameters.

    Returns
    -------
    float
        Huber 1981, section 7.6: of an estimator with psi(z) = u z the variance goes with
        mean(psi^2) / mean(psi')^2, whatever distribution z has.
    """
    z2 = z * z
    u = student_weights(z2, nu)
    slope = max(float(np.mean((nu + 1.0) * (nu - z2) / (nu + z2) ** 2)), 0.1)
    return float(np.mean(u) * np.mean(u * u * z2) / slope**2 * len(z) / dof)


def fit_robustly(problem: Problem, polished: Polished, n_parameters: int, dof: int) -> Weighed:
    """Fit with Student's t from the point where least squares ended.

    Parameters
    ----------
    problem : Problem
        Its dataset's weights are changed. Where the measurement states its sigma, that is the
        scale; else both scales of the noise are estimated.
    polished : Polished
        Where to start.
    n_parameters, dof : int
        Free parameters and degrees of freedom.

    Returns
    -------
    Weighed
        With nu.
    """
    dataset = problem.dataset
    first = _rounds(problem, polished, n_parameters, dof, gross=False)
    found, c = descend(problem, dataset.logarithmic, polished.t, polished.c)
    start = replace(polished, t=found.point, c=c)
    other = _rounds(problem, start, n_parameters, dof, gross=False)
    weighed = min(first, other, key=lambda run: run[0] + EQUAL * (run is other))[1]
    if not dataset.uses_sigma and weighed.relative.max() > GROSS:
        return _rounds(problem, start, n_parameters, dof, gross=True)[1]
    if weighed is not other[1]:  # its weights are those in force
        weighed, weights, _ = _noise(problem, weighed, n_parameters, BETWEEN)
        weighed = replace(weighed, polished=judged_with(problem, weighed.polished, weights))
    return weighed


def _rounds(
    problem: Problem, start: Polished, n_parameters: int, dof: int, *, gross: bool
) -> tuple[float, Weighed]:
    channels = problem.dataset.measurement.n_channels
    zeros = np.zeros(channels)
    weighed = Weighed(start, zeros, zeros, gross, NUS[0])
    best: tuple[float, Weighed] | None = None
    for round_ in range(ROUNDS):
        weighed, weights, deviance = _noise(
            problem, weighed, n_parameters, BETWEEN if round_ else FIRST
        )
        if best is None or deviance < best[0]:
            best = deviance, weighed
        problem.dataset.set_weights(weights)
        polished = refitted(problem, weighed.polished, dof, anew=round_ == 0)
        before = np.concatenate([weighed.polished.c.ravel(), weighed.polished.t])
        now = np.concatenate([polished.c.ravel(), polished.t])
        weighed = replace(weighed, polished=polished)
        if np.allclose(now, before, rtol=SETTLED, atol=1e-12):
            return deviance, weighed
    assert best is not None
    return best


def _noise(
    problem: Problem, at: Weighed, n_parameters: int, rounds: int
) -> tuple[Weighed, Array, float]:
    """Find noise and nu at a point; returns them with the weights and the deviance."""
    dataset = problem.dataset
    measured, used = dataset.measurement.values, dataset.used
    f = problem.values(at.polished.t, at.polished.c)
    r = np.where(used, measured - f, 0.0)
    h = level(f, measured, gross=at.gross)
    additive, relative, nu = at.additive, at.relative, at.nu or NUS[0]
    v = _start(dataset, r, h) if not additive.any() else variance(h, additive, relative)
    for _ in range(rounds):
        u = student_weights(r * r / v, nu)
        if not dataset.uses_sigma:
            additive, relative = estimate_noise(
                r * np.sqrt(u), h, used, n_parameters, relative=dataset.metric == "relative"
            )
            v = variance(h, additive, relative)
        nu = _best_nu(r, v, used)
    weights = np.where(used, student_weights(r * r / v, nu) / v, 0.0)
    found = replace(at, additive=additive, relative=relative, nu=nu)
    return found, weights, student_deviance(r, v, used, nu)


def _start(dataset: Dataset, r: Array, h: Array) -> Array:
    """Give variances to begin with: the stated ones, or from the median residual."""
    used, sigma = dataset.used, dataset.measurement.sigma
    if dataset.uses_sigma and sigma is not None:
        return np.where(used, sigma, 1.0) ** 2
    v = np.ones_like(h)
    for c, counted in enumerate(used):
        size = np.abs(h[c])
        floor = 0.05 * float(np.median(size[counted])) if counted.any() else 1.0
        size = np.maximum(size, max(floor, 1e-300))
        if dataset.metric != "relative":
            size = np.ones_like(size)
        scatter = float(np.median((np.abs(r[c]) / size)[counted])) if counted.any() else 1.0
        v[c] = np.maximum(1.4826 * scatter * size, 1e-150) ** 2
    return v


def _best_nu(r: Array, v: Array, used: Mask) -> float:
    """Choose the most likely nu."""
    z2 = (r * r / v)[used]
    z2 = z2[:: -(-z2.size // ENOUGH)]
    cost = [
        2.0 * z2.size * (math.lgamma(0.5 * nu) - math.lgamma(0.5 * (nu + 1.0)))
        + z2.size * math.log(nu)
        + (nu + 1.0) * float(np.log1p(z2 / nu).sum())
        for nu in NUS
    ]
    return NUS[int(np.argmin(cost))]
