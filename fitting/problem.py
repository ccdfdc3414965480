"""One candidate on one dataset: from search coordinates to coefficients and sums."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from lobefit.fitting.dataset import Dataset
from lobefit.fitting.projection import coordinates, solve_bounded
from lobefit.fitting.scale import SearchScale
from lobefit.kernels import Candidate, FitError
from lobefit.kernels.evaluate import basis_values
from lobefit.kernels.program import model_program
from lobefit.kernels.sums import Observations, normal_equations

__all__ = ["Problem"]

Array = NDArray[np.float64]

# Gauss-Newton steps for coefficients where the metric makes them nonlinear.
INNER_STEPS = 12
# Half width of the central differences, in search coordinates (a relative
# change on a logarithmic scale); the error of the derivative is its square.
STEP = {"double": 1e-4, "single": 2e-3}


class Problem:
    """A candidate fitted to a dataset.

    Parameters
    ----------
    candidate : Candidate
        What is fitted.
    dataset : Dataset
        To what.
    options : mapping of str to str, optional
        Pieces the model is compiled with.

    Raises
    ------
    FitError
        A searched parameter with one value per channel.

    Attributes
    ----------
    coordinates : Coordinates
        Of the coefficients.
    scale : SearchScale
        Of the searched parameters.
    evaluations : int
        Sets of parameters that were tried so far.
    """

    def __init__(
        self, candidate: Candidate, dataset: Dataset, options: Mapping[str, str] | None = None
    ) -> None:
        own = [p.name for p in candidate.searched if p.per_channel]
        if own:
            raise FitError(
                f"{candidate.name}: {', '.join(own)} is nonlinear and differs by channel; fit the "
                "channels one at a time (evaluation takes a list, the search one value)"
            )
        self.candidate = candidate
        self.dataset = dataset
        self.program = model_program(candidate.model, options)
        self.coordinates = coordinates(candidate)
        self.scale = SearchScale(candidate.searched)
        self.evaluations = 0
        searched = [p.name for p in candidate.searched]
        # d(full parameters) / d(searched ones): ones where own or tied.
        self.spread = np.array(
            [
                [float(candidate.tied.get(p.name, p.name) == name) for name in searched]
                for p in candidate.model.nonlinear
            ]
        ).reshape(len(candidate.model.nonlinear), len(searched))

    def parameters(self, t: Array) -> Array:
        """Give all nonlinear parameters, shape (..., n_x), of search coordinates (..., n)."""
        return self.candidate.expand(self.scale.to_parameters(t))

    def steps(self, t: Array) -> Array:
        """Give the half widths of the differences for `parameters` of one t, shape (1, n_x)."""
        x = self.scale.to_parameters(t)
        free = STEP[self.dataset.precision] * self.scale.slope(x)
        full = self.spread @ free
        # Held parameters are not moved, but a zero step would divide by zero.
        return np.where(full > 0.0, full, STEP[self.dataset.precision])[None, :]

    def nodes(self) -> Array:
        """Give the nodes of the start scan, shape (P, n), each label once."""
        t = self.scale.nodes()
        axes = self.candidate.model.lobe.axes
        names = [p.name for p in self.candidate.searched]
        if axes and set(axes) <= set(names):
            wide, narrow = names.index(axes[0]), names.index(axes[1])
            t = t[t[:, wide] >= t[:, narrow] - 1e-12]
        return t

    def scan(self, t: Array) -> tuple[Array, Array]:
        """Try many points in one launch, on the scan's rows.

        Parameters
        ----------
        t : ndarray, shape (P, n)
            Search coordinates.

        Returns
        -------
        value : ndarray, shape (P,)
            Sum of squared weighted residuals at the best coefficients.
        c : ndarray, shape (P, C, K)
            Those coefficients.
        """
        sums = normal_equations(self.program, self.dataset.scan, self.parameters(t))
        self.evaluations += len(t)
        d = self._solve(sums.gram, sums.rhs, np.zeros(sums.rhs.shape))
        c = self.coordinates.coefficients(d)
        value = sums.chi_square - 2.0 * np.einsum("pck,pck->pc", sums.rhs, c)
        value += np.einsum("pck,pckl,pcl->pc", c, sums.gram, c)
        return value.sum(axis=1), c

    def _solve(self, gram: Array, rhs: Array, anchor: Array) -> Array:
        """Solve for coordinates (..., D), given sums (..., K) of residuals at the anchor."""
        k = self.coordinates
        offset = (gram @ (anchor - k.c0)[..., None])[..., 0]
        shape = rhs.shape[:-1]
        size = k.T.shape[1]
        G = (k.T.T @ gram @ k.T).reshape(-1, size, size)
        r = ((rhs + offset) @ k.T).reshape(-1, size)
        return solve_bounded(G, r, k.low, k.high).reshape(*shape, size)

    def project(self, data: Observations, t: Array, c: Array) -> tuple[float, Array]:
        """Find the best coefficients for one t.

        Residuals are summed against the coefficients at hand, so that nothing
        cancels near the optimum.

        Parameters
        ----------
        data : Observations
            All rows or the thinned ones.
        t : ndarray, shape (n,)
            Search coordinates.
        c : ndarray, shape (C, K)
            Coefficients to start from.

        Returns
        -------
        value : float
            Sum of weighted squared residuals in the metric.
        c : ndarray, shape (C, K)
        """
        x = self.parameters(t)[None, :]
        linear = data.metric == "identity"
        best = np.full(len(c), np.inf)
        kept = c
        trial = c
        for _ in range(1 if linear else INNER_STEPS):
            sums = normal_equations(self.program, data, x, trial[None])
            self.evaluations += 1
            value, rhs, gram = sums.chi_square[0], sums.rhs[0], sums.gram[0]
            if linear:
                new = self.coordinates.coefficients(self._solve(gram, rhs, trial))
                change = new - trial
                bent = (gram @ change[:, :, None])[:, :, 0]
                return float(value.sum() + np.sum(change * (bent - 2.0 * rhs))), new
            worse = ~(value <= best)
            better = ~worse
            gain = np.where(np.isfinite(best), best - value, np.inf)
            kept = np.where(better[:, None], trial, kept)
            best = np.where(better, value, best)
            if (better & (gain < 1e-7 * np.abs(best))).all():
                break
            step = self.coordinates.coefficients(self._solve(gram, rhs, trial))
            # A step that made things worse is halved, per channel.
            trial = np.where(worse[:, None], 0.5 * (trial + kept), step)
        return float(best.sum()), kept

    def start_coefficients(self, data: Observations, t: Array, c: Array) -> Array:
        """Make coefficients fit for the metric: strictly inside, where it takes logarithms."""
        if data.metric == "identity":
            return c
        sums = normal_equations(self.program, self.dataset.scan, self.parameters(t)[None, :])
        T = self.coordinates.T
        G, r = T.T @ sums.gram[0] @ T, sums.rhs[0] @ T
        alone = np.maximum(r, 0.0) / np.maximum(np.einsum("cdd->cd", G), 1e-300)
        d = np.maximum(self.coordinates.coordinates(c), 0.02 * alone)
        return self.coordinates.coefficients(np.minimum(d, self.coordinates.high))

    def values(self, t: Array, c: Array) -> Array:
        """Give the model's values at all rows, shape (C, N)."""
        basis = basis_values(
            self.program, self.dataset.full.directions, self.parameters(t)[None, :]
        )
        values: Array = c @ basis[0]
        return values

    def column_map(self, t: Array, c: Array) -> Array:
        """Map summed columns to derivatives along (t, d), shape (C, n + D, M)."""
        n, k = len(t), self.program.n_basis
        slope = self.scale.slope(self.scale.to_parameters(t))
        L = np.zeros((len(c), n + k, k + len(self.program.derivatives)))
        for column, (basis, j) in enumerate(self.program.derivatives):
            for m in range(n):
                L[:, m, k + column] = c[:, basis] * self.spread[j, m] * slope[m]
        L[:, n:, :k] = np.eye(k)
        A = np.zeros((n + self.coordinates.T.shape[1], n + k))
        A[:n, :n] = np.eye(n)
        A[n:, n:] = self.coordinates.T.T
        mapped: Array = A @ L
        return mapped
