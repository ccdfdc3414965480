"""NLopt on one texel, in double precision, where the refinement in batch did not converge."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lobefit.fitting.projection import solve_bounded
from lobefit.fitting.search import minimise
from lobefit.fitting.texel_model import TexelModel
from lobefit.fitting.texel_noise import TexelNoise
from lobefit.kernels.evaluate import basis_values
from lobefit.kernels.geometry import Directions

__all__ = ["TexelPolish"]

Array = NDArray[np.float64]

# Weigh, search, weigh again: the first search starts close to the end.
ROUNDS = 2
XTOL = 1e-5
FTOL_REL = 1e-10
MOST_EVALUATIONS = 300


class TexelPolish:
    """Variable projection of a single texel, without derivatives.

    Parameters
    ----------
    model : TexelModel
    directions : Directions
        N directions in double precision.
    noise : TexelNoise
        How readings are weighed.
    """

    def __init__(self, model: TexelModel, directions: Directions, noise: TexelNoise) -> None:
        self.model = model
        self.directions = directions
        self.noise = noise

    def run(
        self, readings: NDArray[np.floating], present: object, start: Array
    ) -> tuple[Array, bool]:
        """Search from a start.

        Parameters
        ----------
        readings : ndarray, shape (N, C)
            BRDF in 1/sr.
        present : ndarray of bool, shape (N, C), or None
            Which readings are there; None for all.
        start : ndarray, shape (n,)
            Search coordinates.

        Returns
        -------
        t : ndarray, shape (n,)
            Search coordinates of the lowest point seen.
        reached : bool
            The search ended by its tolerance, not by its limit of evaluations.
        """
        used = np.ones(readings.shape, bool) if present is None else np.asarray(present, bool)
        values = np.where(used, readings, 0.0).astype(np.float64)
        scale = self.model.scale
        t = np.clip(start.astype(np.float64), scale.low, scale.high)
        weights, reached = used.astype(np.float64), True
        for _ in range(1 if self.noise.constant else ROUNDS):
            if not self.noise.constant:
                _, f = self._project(t, values, weights)
                weights = self.noise.weights(f, values, used)

            def objective(at: Array, weights: Array = weights) -> float:
                return self._project(at, values, weights)[0]

            found = minimise(
                objective, t, scale.low, scale.high, 0.1 * scale.spacing,
                xtol=XTOL, ftol_rel=FTOL_REL, max_evaluations=MOST_EVALUATIONS,
            )  # fmt: skip
            t, reached = found.point, found.evaluations < MOST_EVALUATIONS
        return t, reached

    def _project(self, t: Array, values: Array, weights: Array) -> tuple[float, Array]:
        """Give the weighted sum of squared residuals and the model, shape (N, C)."""
        candidate, linear = self.model.candidate, self.model.linear
        x = candidate.expand(self.model.scale.to_parameters(t))
        basis = basis_values(self.model.program.program, self.directions, x[None])[0]
        columns, fixed = linear.T.T @ basis, linear.c0 @ basis
        gram = np.einsum("dn,nc,en->cde", columns, weights, columns)
        rhs = np.einsum("dn,nc->cd", columns, weights * (values - fixed[:, None]))
        d = solve_bounded(gram, rhs, linear.low, linear.high)
        f = fixed[:, None] + columns.T @ d.T
        return float(np.sum(weights * (values - f) ** 2)), f
