"""Gauss-Newton on all rows: the last digits, the gradient, and the curvature for the errors.

Searched parameters t are shared by the channels and coefficients d belong to
one channel each, so the normal matrix is an arrowhead: the coefficients are
eliminated channel by channel and only a system in t remains.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lobefit.fitting.problem import Problem
from lobefit.kernels.sums import Observations

__all__ = ["Curvature", "Polished", "eliminate", "polish", "sums_at"]

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

MAX_ITERATIONS = 40
# Largest move of a searched parameter in one step: a factor e, or 1 rad.
MAX_MOVE = 1.0
# The promised gain, in units of the weighted variance, below which a parameter
# would move by less than a hundredth of its standard error.
GAIN = 1e-4
# Sums of single precision terms are this repeatable, relative to their size.
ROUNDING = {"double": 1e-13, "single": 1e-8}


@dataclass(frozen=True, slots=True)
class Curvature:
    """Normal matrices and gradients per channel over (t, d), in units of the objective.

    Attributes
    ----------
    matrix : ndarray, shape (C, n + D, n + D)
    gradient : ndarray, shape (C, n + D)
        Downhill: half the negative derivative of the objective.
    """

    matrix: Array
    gradient: Array


@dataclass(frozen=True, slots=True)
class Polished:
    """Where Gauss-Newton ended."""

    t: Array
    c: Array
    value: float
    curvature: Curvature
    iterations: int
    converged: bool
    reason: str


def sums_at(
    problem: Problem, t: Array, c: Array, data: Observations | None = None
) -> tuple[float, Curvature]:
    """Give the objective and its curvature at a point: of all rows, or of other data."""
    data = data or problem.dataset.full
    sums = problem.sums(data, t, c, derivatives=bool(problem.candidate.searched))
    L = problem.column_map(t, c)[:, :, : sums.rhs.shape[2]]
    matrix = L @ sums.gram[0] @ L.transpose(0, 2, 1)
    gradient = np.einsum("cam,cm->ca", L, sums.rhs[0])
    return float(sums.chi_square.sum()), Curvature(matrix, gradient)


def eliminate(matrix: Array, vector: Array, n: int, free: Mask) -> tuple[Array, Array, Array]:
    """Eliminate the free coefficients of each channel.

    Returns
    -------
    schur : ndarray, shape (n, n)
    reduced : ndarray, shape (n,)
    inverse : ndarray, shape (C, D, D)
        Of the coefficients' blocks; zero rows and columns where held.
    """
    both = free[:, :, None] & free[:, None, :]
    size = free.shape[1]
    block = np.where(both, matrix[:, n:, n:], 0.0)
    scale = np.sqrt(np.maximum(np.einsum("cdd->cd", block), 0.0))
    scale = np.where(scale > 0.0, scale, 1.0)
    scaled = block / (scale[:, :, None] * scale[:, None, :])
    scaled = scaled + np.eye(size) * np.where(free, 1e-13, 1.0)[:, :, None]
    inverse = np.where(both, np.linalg.inv(scaled), 0.0) / (scale[:, :, None] * scale[:, None, :])
    cross = matrix[:, :n, n:]
    schur = matrix[:, :n, :n].sum(axis=0) - np.einsum("cnd,cde,cme->nm", cross, inverse, cross)
    reduced = vector[:, :n].sum(axis=0) - np.einsum("cnd,cde,ce->n", cross, inverse, vector[:, n:])
    return schur, reduced, inverse


def _solve_symmetric(matrix: Array, vector: Array, damping: float) -> Array:
    """Solve a small semidefinite system; directions it does not determine do not move."""
    if not len(vector):
        return vector
    diagonal = np.diag(matrix).copy()
    scale = np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))
    scaled = matrix / np.outer(scale, scale) + damping * np.eye(len(vector))
    return (
        np.asarray(np.linalg.pinv(scaled, rcond=1e-10, hermitian=True) @ (vector / scale)) / scale
    )


def _step(
    problem: Problem, t: Array, d: Array, curvature: Curvature, damping: float
) -> tuple[Array, Array]:
    """Bounded Gauss-Newton step in (t, d)."""
    n = len(t)
    k, scale = problem.coordinates, problem.scale
    H, g = curvature.matrix, curvature.gradient
    held = ((d <= k.low) & (g[:, n:] <= 0.0)) | ((d >= k.high) & (g[:, n:] >= 0.0))
    still = ((t <= scale.low) & (g[:, :n].sum(axis=0) <= 0.0)) | (
        (t >= scale.high) & (g[:, :n].sum(axis=0) >= 0.0)
    )
    moved_d = np.zeros_like(d)
    for _ in range(d.shape[1] + 1):
        fixed = np.where(held, moved_d, 0.0)
        vector = g.copy()
        vector -= np.einsum("cad,cd->ca", H[:, :, n:], fixed)
        schur, reduced, inverse = eliminate(H, vector, n, ~held)
        move = np.zeros(n)
        go = ~still
        move[go] = _solve_symmetric(schur[np.ix_(go, go)], reduced[go], damping)
        move = np.clip(move, -MAX_MOVE, MAX_MOVE)
        move = np.clip(move, scale.low - t, scale.high - t)
        rest = vector[:, n:] - np.einsum("cnd,n->cd", H[:, :n, n:], move)
        moved_d = fixed + np.einsum("cde,ce->cd", inverse, rest)
        below, above = d + moved_d < k.low, d + moved_d > k.high
        if not (below | above).any():
            break
        moved_d = np.where(below, k.low - d, np.where(above, k.high - d, moved_d))
        held = held | below | above
    return move, moved_d


def polish(problem: Problem, t: Array, c: Array, dof: int) -> Polished:
    """Improve a point until the gradient vanishes.

    Parameters
    ----------
    problem : Problem
        With its weights set.
    t : ndarray, shape (n,)
        Search coordinates to start from.
    c : ndarray, shape (C, K)
        Coefficients to start from.
    dof : int
        Degrees of freedom, which set the tolerance.

    Returns
    -------
    Polished
        Never worse than the start.
    """
    k = problem.coordinates
    rounding = ROUNDING[problem.dataset.precision]
    d = k.coordinates(c)
    c = k.coefficients(d)
    value, curvature = sums_at(problem, t, c)
    damping, rejected = 0.0, 0
    for iteration in range(MAX_ITERATIONS):
        move, moved_d = _step(problem, t, d, curvature, damping)
        joint = np.concatenate([np.broadcast_to(move, (len(d), len(t))), moved_d], axis=1)
        promised = 2.0 * float((curvature.gradient * joint).sum()) - float(
            np.einsum("ca,cab,cb->", joint, curvature.matrix, joint)
        )
        if promised <= max(GAIN * GAIN * value / dof, rounding * abs(value)):
            return Polished(t, c, value, curvature, iteration, True, "the gradient vanished")
        new_t = t + move
        if len(problem.candidate.own):
            own = slice(d.shape[1] - len(problem.candidate.own), None)
            moved_d[:, own] = np.clip(moved_d[:, own], -MAX_MOVE, MAX_MOVE)
        new_d = np.clip(d + moved_d, k.low, k.high)
        new_value, new_curvature = sums_at(problem, new_t, k.coefficients(new_d))
        if np.isfinite(new_value) and new_value <= value:
            t, d, value, curvature = new_t, new_d, new_value, new_curvature
            c = k.coefficients(d)
            damping, rejected = (0.1 * damping if damping > 1e-4 else 0.0), 0
        else:
            damping, rejected = max(10.0 * damping, 1e-2), rejected + 1
            if rejected == 8:
                small = promised <= 1e-2 * value / dof
                reason = "no step lowers the residuals any more"
                return Polished(t, c, value, curvature, iteration, small, reason)
    return Polished(t, c, value, curvature, MAX_ITERATIONS, False, "limit of iterations")
