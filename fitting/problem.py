"""One candidate on one dataset: from search coordinates to coefficients and sums.

What a channel has for itself stands in one row ``c``: its coefficients and, behind
them, the search coordinates of those nonlinear parameters that differ by channel
(the index of a metal). Both are solved for, per channel, inside the search over the
parameters ``t`` that the channels share.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lobefit.fitting.dataset import Dataset
from lobefit.fitting.projection import beside, coordinates, solve_bounded
from lobefit.fitting.scale import MAX_NODES, SearchScale
from lobefit.kernels import Candidate
from lobefit.kernels.evaluate import basis_values
from lobefit.kernels.geometry import Directions
from lobefit.kernels.program import model_program
from lobefit.kernels.sums import Observations, Sums, normal_equations

__all__ = ["Problem"]

Array = NDArray[np.float64]

# Nodes of the scan over a channel's own parameters, at every node of the shared ones.
MAX_OWN_NODES = 200
# Gauss-Newton steps for what the metric or the model makes nonlinear within a channel.
INNER_STEPS = 12
# Largest move of a channel's own searched parameter in one of them.
INNER_MOVE = 0.7
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

    Attributes
    ----------
    linear : Coordinates
        Of the coefficients alone.
    coordinates : Coordinates
        Of a row ``c``: the coefficients and the channel's own parameters.
    scale, own : SearchScale
        Of the searched parameters that channels share, and that each has for itself.
    evaluations : int
        Sets of parameters that were tried so far.
    """

    def __init__(self, candidate: Candidate, dataset: Dataset) -> None:
        self.candidate = candidate
        self.dataset = dataset
        self.program = model_program(candidate.model)
        self.linear = coordinates(candidate)
        density = dataset.how.scan_density
        most = max(round(4 * MAX_NODES * density), 1)
        self.own = SearchScale(candidate.own, MAX_OWN_NODES, density)
        self.scale = SearchScale(candidate.shared, most // len(self.own.nodes()), density)
        self.coordinates = beside(self.linear, self.own.low, self.own.high)
        self.evaluations = 0
        # An angle has no bounds that its formula would end at.
        self.bounds = (
            np.array(
                [(-np.inf, np.inf) if p.period else p.bounds for p in candidate.model.nonlinear]
            )
            .reshape(-1, 2)
            .T
        )
        nonlinear = [p.name for p in candidate.model.nonlinear]

        def spread(searched: list[str]) -> Array:
            # d(full parameters) / d(searched ones): ones where own or tied.
            return np.array(
                [[float(candidate.tied.get(n, n) == name) for name in searched] for n in nonlinear]
            ).reshape(len(nonlinear), len(searched))

        self.spread = spread([p.name for p in candidate.shared])
        self.own_spread = spread([p.name for p in candidate.own])
        self.order = [
            [p.name for p in (*candidate.shared, *candidate.own)].index(p.name)
            for p in candidate.searched
        ]

    def parameters(self, t: Array, c: Array) -> Array:
        """Give all nonlinear parameters.

        Parameters
        ----------
        t : ndarray, shape (n,)
            Search coordinates.
        c : ndarray, shape (C, K + m)
            Coefficients and each channel's own search coordinates.

        Returns
        -------
        ndarray, shape (n_x,) or (C, n_x)
            The latter where channels have parameters of their own.
        """
        shared = self.scale.to_parameters(t)
        if not self.candidate.own:
            return self.candidate.expand(shared)
        own = self.own.to_parameters(c[:, self.program.n_basis :])
        rows = np.concatenate([np.broadcast_to(shared, (len(c), len(t))), own], axis=1)
        return self.candidate.expand(rows[:, self.order])

    def steps(self, t: Array, c: Array) -> Array:
        """Give the half widths of the differences along `parameters`, shaped alike; 0 if held."""
        step = STEP[self.dataset.precision]
        x = self.scale.to_parameters(t)
        full = self.spread @ (step * self.scale.slope(x))
        if self.candidate.own:
            own = self.own.to_parameters(c[:, self.program.n_basis :])
            full = full + step * self.own.slope(own) @ self.own_spread.T
        return np.asarray(full)

    def sums(self, data: Observations, t: Array, c: Array, *, derivatives: bool = False) -> Sums:
        """Sum the normal equations around one point."""
        k = self.program.n_basis
        self.evaluations += 1
        x = self.parameters(t, c)[None]
        if not derivatives or not self.program.n_x:
            return normal_equations(self.program, data, x, c[None, :, :k])
        # Beside a bound the differences are taken a step inside it: beyond there may be none.
        low, high = self.bounds
        steps = np.minimum(self.steps(t, c), 0.25 * (high - low))
        centres = np.where(steps > 0.0, np.clip(x[0], low + steps, high - steps), x[0])
        return normal_equations(self.program, data, x, c[None, :, :k], steps[None], centres[None])

    def nodes(self) -> Array:
        """Give the nodes of the start scan, shape (P, n), each label once."""
        t = self.scale.nodes()
        names = [p.name for p in self.candidate.shared]
        for first, second in self.candidate.descending:
            t = t[t[:, names.index(first)] >= t[:, names.index(second)] - 1e-12]
        return t

    def scan(self, t: Array) -> tuple[Array, Array]:
        """Try many points in one launch, on the scan's rows.

        Parameters
        ----------
        t : ndarray, shape (P, n)
            Search coordinates; each is tried with every node of the own parameters.

        Returns
        -------
        value : ndarray, shape (P,)
            Sum of squared weighted residuals at the best row of each channel.
        c : ndarray, shape (P, C, K + m)
            Those rows.
        """
        own = self.own.nodes()
        shared = np.repeat(self.scale.to_parameters(t), len(own), axis=0)
        rows = np.concatenate([shared, np.tile(self.own.to_parameters(own), (len(t), 1))], axis=1)
        value, c = self.attempt(self.candidate.expand(rows[:, self.order]))
        # Channels are independent of one another at a given t.
        value = value.reshape(len(t), len(own), -1)
        lowest = np.argmin(np.where(np.isfinite(value), value, np.inf), axis=1)
        c = c.reshape(len(t), len(own), *c.shape[1:])
        best = np.take_along_axis(c, lowest[:, None, :, None], axis=1)[:, 0]
        least = np.take_along_axis(value, lowest[:, None, :], axis=1)[:, 0]
        return least.sum(axis=1), np.concatenate([best, own[lowest]], axis=2)

    def attempt(self, x: Array) -> tuple[Array, Array]:
        """Give the objective (P, C) and coefficients (P, C, K) at P sets, on the scan's rows."""
        sums = normal_equations(self.program, self.dataset.scan, x)
        self.evaluations += len(x)
        c = self.linear.coefficients(self._solve(sums.gram, sums.rhs, np.zeros(sums.rhs.shape)))
        value = sums.chi_square - 2.0 * np.einsum("pck,pck->pc", sums.rhs, c)
        return value + np.einsum("pck,pckl,pcl->pc", c, sums.gram, c), c

    def _solve(self, gram: Array, rhs: Array, anchor: Array) -> Array:
        """Solve for linear coordinates (..., D), given sums (..., K) of residuals at the anchor."""
        k = self.linear
        if not k.T.shape[1]:
            return np.zeros((*rhs.shape[:-1], 0))
        offset = (gram @ (anchor - k.c0)[..., None])[..., 0]
        shape = rhs.shape[:-1]
        size = k.T.shape[1]
        G = (k.T.T @ gram @ k.T).reshape(-1, size, size)
        r = ((rhs + offset) @ k.T).reshape(-1, size)
        return solve_bounded(G, r, k.low, k.high).reshape(*shape, size)

    def project(self, data: Observations, t: Array, c: Array) -> tuple[float, Array]:
        """Find the best rows for one t.

        Residuals are summed against the coefficients at hand, so that nothing
        cancels near the optimum.

        Parameters
        ----------
        data : Observations
            All rows or the thinned ones.
        t : ndarray, shape (n,)
            Search coordinates.
        c : ndarray, shape (C, K + m)
            Rows to start from.

        Returns
        -------
        value : float
            Sum of weighted squared residuals in the metric.
        c : ndarray, shape (C, K + m)
        """
        if data.metric == "identity" and not self.candidate.own:
            sums = self.sums(data, t, c)
            value, rhs, gram = sums.chi_square[0], sums.rhs[0], sums.gram[0]
            new = self.linear.coefficients(self._solve(gram, rhs, c))
            change = new - c
            bent = (gram @ change[:, :, None])[:, :, 0]
            return float(value.sum() + np.sum(change * (bent - 2.0 * rhs))), new
        best, kept = self.settle(data, t, c)
        return float(best.sum()), kept

    def gradient(self, data: Observations, t: Array, c: Array) -> Array:
        """Give the derivatives along t of what `project` gives, shape (n,).

        At the best rows the objective does not change with them to first order, nor does it
        where a bound holds them (the envelope theorem; Golub & Pereyra 1973).
        """
        c = self.project(data, t, c)[1]
        sums = self.sums(data, t, c, derivatives=True)
        L = self.column_map(t, c)[:, : len(t), : sums.rhs.shape[2]]
        downhill: Array = -2.0 * np.einsum("cam,cm->a", L, sums.rhs[0])
        return downhill

    def settle(self, data: Observations, t: Array, c: Array) -> tuple[Array, Array]:
        """Gauss-Newton on each channel's row at one t; returns the objectives (C,) too."""
        best = np.full(len(c), np.inf)
        kept = trial = c
        for _ in range(INNER_STEPS):
            sums = self.sums(data, t, trial, derivatives=bool(self.candidate.own))
            value = sums.chi_square[0]
            worse = ~(value <= best)
            better = ~worse
            gain = np.where(np.isfinite(best), best - value, np.inf)
            kept = np.where(better[:, None], trial, kept)
            best = np.where(better, value, best)
            if (better & (gain < 1e-7 * np.abs(best))).all():
                break
            step = self._inner_step(sums, t, trial)
            # A step that made things worse is halved, per channel.
            trial = np.where(worse[:, None], 0.5 * (trial + kept), step)
        return best, kept

    def _inner_step(self, sums: Sums, t: Array, c: Array) -> Array:
        """Take a bounded Gauss-Newton step of each channel's row, at a given t."""
        n, k = len(t), self.program.n_basis
        L = self.column_map(t, c)[:, n:, : sums.rhs.shape[2]]
        G = L @ sums.gram[0] @ L.transpose(0, 2, 1)
        d = self.coordinates.coordinates(c)
        r = np.einsum("cam,cm->ca", L, sums.rhs[0]) + (G @ d[:, :, None])[:, :, 0]
        new = self.coordinates.coefficients(
            solve_bounded(G, r, self.coordinates.low, self.coordinates.high)
        )
        moved = np.clip(new[:, k:] - c[:, k:], -INNER_MOVE, INNER_MOVE)
        return np.concatenate([new[:, :k], c[:, k:] + moved], axis=1)

    def start_coefficients(self, data: Observations, t: Array, c: Array) -> Array:
        """Make coefficients fit for the metric: strictly inside, where it takes logarithms."""
        if data.metric == "identity":
            return c
        k = self.program.n_basis
        x = self.parameters(t, c)[None]
        sums = normal_equations(self.program, self.dataset.scan, x)
        T = self.linear.T
        G, r = T.T @ sums.gram[0] @ T, sums.rhs[0] @ T
        alone = np.maximum(r, 0.0) / np.maximum(np.einsum("cdd->cd", G), 1e-300)
        d = np.maximum(self.linear.coordinates(c[:, :k]), 0.02 * alone)
        inside = self.linear.coefficients(np.minimum(d, self.linear.high))
        return np.concatenate([inside, c[:, k:]], axis=1)

    def values_at(self, directions: Directions, t: Array, c: Array) -> Array:
        """Give the model's values at any directions, shape (C, N)."""
        x = np.atleast_2d(self.parameters(t, c))
        basis = basis_values(self.program, directions, x)
        coefficients = c[:, : self.program.n_basis]
        if len(basis) == 1:  # a product of matrices, which is faster
            values: Array = coefficients @ basis[0]
            return values
        summed: Array = np.einsum("ck,ckn->cn", coefficients, basis)
        return summed

    def values(self, t: Array, c: Array) -> Array:
        """Give the model's values at all rows, shape (C, N)."""
        return self.values_at(self.dataset.full.directions, t, c)

    def column_map(self, t: Array, c: Array) -> Array:
        """Map summed columns to derivatives along (t, d), shape (C, n + D, M)."""
        n, k, m = len(t), self.program.n_basis, len(self.candidate.own)
        shared = self.spread * self.scale.slope(self.scale.to_parameters(t))
        own = self.own.to_parameters(c[:, k:])
        along = np.concatenate(
            [
                np.broadcast_to(shared, (len(c), *shared.shape)),
                self.own_spread * self.own.slope(own)[:, None, :],
            ],
            axis=2,
        )
        # Rows: t, the channel's own parameters, the coefficients.
        L = np.zeros((len(c), n + m + k, k + len(self.program.derivatives)))
        for column, (basis, j) in enumerate(self.program.derivatives):
            L[:, : n + m, k + column] = c[:, basis, None] * along[:, j]
        L[:, n + m :, :k] = np.eye(k)
        T, size = self.linear.T, self.linear.T.shape[1]
        A = np.zeros((n + size + m, n + m + k))
        A[:n, :n] = np.eye(n)
        A[n : n + size, n + m :] = T.T
        A[n + size :, n : n + m] = np.eye(m)
        mapped: Array = A @ L
        return mapped
