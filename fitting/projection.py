"""Variable projection: the linear coefficients that suit given nonlinear parameters best.

The physical limits (k_d >= 0, k_s >= 0, 0 <= F0 <= its bound) become plain
bounds of a few coordinates d with ``c = T d + c0``. For a Schlick lobe with
coefficients ``c_a = k_s F0`` and ``c_b = k_s`` these are ``c_a = M u`` and
``c_b = u + v`` with u, v >= 0, where M is F0's upper bound: 0 <= F0 <= M holds
by construction.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from lobefit.kernels import Candidate

__all__ = ["Coordinates", "beside", "coordinates", "solve_bounded"]

Array = NDArray[np.float64]

# Relative ridge that keeps a Gram matrix invertible when two columns coincide
# for the given directions; far below the rounding of the sums.
RIDGE = 1e-13


@dataclass(frozen=True, slots=True)
class Coordinates:
    """Coefficients as bounded coordinates: ``c = T d + c0``, ``low <= d <= high``.

    Attributes
    ----------
    T : ndarray, shape (K, D)
    c0 : ndarray, shape (K,)
    low, high : ndarray, shape (D,)
    """

    T: Array
    c0: Array
    low: Array
    high: Array

    def coefficients(self, d: Array) -> Array:
        """Give coefficients (..., K) from coordinates (..., D)."""
        c: Array = d @ self.T.T + self.c0
        return c

    def coordinates(self, c: Array) -> Array:
        """Give coordinates (..., D) from coefficients (..., K), clipped into the bounds."""
        d = (c - self.c0) @ np.linalg.pinv(self.T).T
        clipped: Array = np.clip(d, self.low, self.high)
        return clipped


def coordinates(candidate: Candidate) -> Coordinates:
    """Derive the coordinates from a candidate's record."""
    bounds = {p.name: p.bounds for p in candidate.model.linear}
    products = candidate.model.coefficients
    alone = {names[0]: k for k, names in enumerate(products) if len(names) == 1}
    ratios = {names[0]: (names[1], k) for k, names in enumerate(products) if len(names) == 2}
    size = len(products)
    c0 = np.zeros(size)
    columns: list[Array] = []
    limits: list[tuple[float, float]] = []

    def column(values: dict[int, float], low: float, high: float) -> None:
        unit = np.zeros(size)
        for k, value in values.items():
            unit[k] = value
        columns.append(unit)
        limits.append((low, high))

    for k, names in enumerate(products):
        if not names:
            c0[k] = 1.0
    for name, k in alone.items():
        low, high = bounds[name]
        fixed = candidate.fixed.get(name)
        if name not in ratios:
            if fixed is None:
                column({k: 1.0}, low, high)
            else:
                c0[k] = fixed
            continue
        ratio, a = ratios[name]
        ratio_high = bounds[ratio][1]
        ratio_fixed = candidate.fixed.get(ratio)
        if fixed is not None:
            c0[k] = fixed
            if ratio_fixed is None:
                column({a: 1.0}, 0.0, fixed * ratio_high)
            else:
                c0[a] = fixed * ratio_fixed
        elif ratio_fixed is not None:
            column({k: 1.0, a: ratio_fixed}, low, high)
        else:
            column({a: ratio_high, k: 1.0}, 0.0, np.inf)
            column({k: 1.0}, 0.0, np.inf)
    T = np.stack(columns, axis=1) if columns else np.zeros((size, 0))
    lows: Array = np.array([pair[0] for pair in limits])
    highs: Array = np.array([pair[1] for pair in limits])
    return Coordinates(T, c0, lows, highs)


def beside(linear: Coordinates, low: Array, high: Array) -> Coordinates:
    """Put a channel's own searched parameters, as they are, behind its coefficients."""
    (size, columns), own = linear.T.shape, len(low)
    T = np.zeros((size + own, columns + own))
    T[:size, :columns] = linear.T
    T[size:, columns:] = np.eye(own)
    return Coordinates(
        T,
        np.concatenate([linear.c0, np.zeros(own)]),
        np.concatenate([linear.low, low]),
        np.concatenate([linear.high, high]),
    )


def solve_bounded(gram: Array, rhs: Array, low: Array, high: Array) -> Array:
    """Minimise ``d G d / 2 - rhs d`` under ``low <= d <= high``, for many systems at once.

    Parameters
    ----------
    gram : ndarray, shape (S, D, D)
        Positive semidefinite.
    rhs : ndarray, shape (S, D)
        Right-hand sides.
    low, high : ndarray, shape (D,)
        Bounds; ``high`` may be infinite.

    Returns
    -------
    ndarray, shape (S, D)
        The exact minimum: for so few unknowns every active set is tried.
    """
    systems, size = rhs.shape
    if size == 0:
        return np.zeros((systems, 0))
    scale = np.sqrt(np.einsum("sdd->sd", gram))
    dead = ~(scale > 0.0)  # the basis vanishes at all these directions
    scale = np.where(dead, 1.0, scale)
    G = gram / (scale[:, :, None] * scale[:, None, :])
    G = G + np.eye(size) * np.where(dead, 1.0, RIDGE)[:, :, None]
    r = np.where(dead, 0.0, rhs / scale)
    lo, hi = low * scale, high * scale

    best = np.linalg.solve(G, r[:, :, None])[:, :, 0]
    # Strictly inside is optimal; the others are searched through.
    open_ = ~((best >= lo) & (best <= hi)).all(axis=1)
    if open_.any():
        best[open_] = _enumerate(G[open_], r[open_], lo[open_], hi[open_])
    best = np.where(dead, np.clip(0.0, lo, hi), best)
    solution: Array = np.clip(best / scale, low, high)
    return solution


def _enumerate(G: Array, r: Array, lo: Array, hi: Array) -> Array:
    systems, size = r.shape
    best = np.clip(np.zeros_like(r), lo, hi)
    lowest = np.full(systems, np.inf)
    states = [
        ("free", "low", "high") if np.isfinite(hi[:, d]).all() else ("free", "low")
        for d in range(size)
    ]
    for state in product(*states):
        d = np.zeros_like(r)
        free = [k for k in range(size) if state[k] == "free"]
        held = [k for k in range(size) if state[k] != "free"]
        for k in held:
            d[:, k] = lo[:, k] if state[k] == "low" else hi[:, k]
        if free:
            rest = r[:, free] - np.einsum("sfh,sh->sf", G[:, free][:, :, held], d[:, held])
            d[:, free] = np.linalg.solve(G[:, free][:, :, free], rest[:, :, None])[:, :, 0]
        feasible = ((d >= lo) & (d <= hi)).all(axis=1)
        value = 0.5 * np.einsum("sd,sde,se->s", d, G, d) - np.einsum("sd,sd->s", r, d)
        better = feasible & (value < lowest)
        best[better] = d[better]
        lowest[better] = value[better]
    return best
