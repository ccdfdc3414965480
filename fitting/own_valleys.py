"""The valleys of what each channel has for itself, at one point of what they share.

The index of a metal has several: two pairs of n and k may reflect alike at most angles.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from lobefit.fitting.problem import Problem

__all__ = ["bottoms"]

Array = NDArray[np.float64]

# Valleys of the scan that are walked down.
STARTS = 4
# Bottoms that are followed by the search, if they are no worse than this many times the best.
DESCENTS, RIVAL = 3, 10.0


def bottoms(problem: Problem, t: Array, c: Array) -> list[Array]:
    """Look through the valleys of the channels' own parameters at one t.

    Parameters
    ----------
    problem : Problem
    t : ndarray, shape (n,)
        Search coordinates.
    c : ndarray, shape (C, K + m)
        Rows of the best node.

    Returns
    -------
    list of ndarray, shape (C, K + m)
        The bottoms of a few valleys of each channel, the best ones first. At another
        t another one may be the best.
    """
    if not problem.candidate.own:
        return [c]
    own = problem.own.nodes()
    rows = np.concatenate(
        [np.tile(problem.scale.to_parameters(t), (len(own), 1)), problem.own.to_parameters(own)],
        axis=1,
    )
    value, coefficients = problem.attempt(problem.candidate.expand(rows[:, problem.order]))
    order = _valleys(value, problem.own.counts)
    settled = [problem.settle(problem.dataset.scan, t, c)]
    for rank in order.T:
        start = np.concatenate(
            [np.stack([coefficients[k, j] for j, k in enumerate(rank)]), own[rank]], axis=1
        )
        settled.append(problem.settle(problem.dataset.scan, t, start))
    found, rows = (np.stack(part) for part in zip(*settled, strict=True))
    # Each channel's bottoms in ascending order; the same one twice is one.
    ascending = np.argsort(found, axis=0, kind="stable")
    found = np.take_along_axis(found, ascending, axis=0)
    rows = np.take_along_axis(rows, ascending[:, :, None], axis=0)
    distinct = [rows[0]]
    for k in range(1, len(rows)):
        other = found[k] > found[0] * (1.0 + 1e-3)
        rival = other & (found[k] <= RIVAL * found[0])
        if rival.any():
            distinct.append(np.where(rival[:, None], rows[k], rows[0]))
    return distinct[:DESCENTS]


def _valleys(value: Array, counts: Sequence[int]) -> NDArray[np.intp]:
    """Give, per channel, the nodes that are lower than their neighbours, the best first."""
    grid = np.where(np.isfinite(value), value, np.inf).T.reshape(-1, *counts)
    low = np.ones(grid.shape, dtype=bool)
    for axis in range(1, grid.ndim):
        near = np.full([n + 2 * (k == axis) for k, n in enumerate(grid.shape)], np.inf)
        inner = [slice(None)] * grid.ndim
        inner[axis] = slice(1, -1)
        near[tuple(inner)] = grid
        for shifted in (slice(0, -2), slice(2, None)):
            inner[axis] = shifted
            low &= grid <= near[tuple(inner)]
    ranked = np.where(low, grid, np.inf).reshape(len(grid), -1)
    return np.argsort(ranked, axis=1, kind="stable")[:, :STARTS]
