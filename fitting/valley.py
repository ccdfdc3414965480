"""The valleys of a candidate's objective: found by a scan, walked down by NLopt."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lobefit.fitting.own_valleys import bottoms
from lobefit.fitting.problem import Problem
from lobefit.fitting.search import Found, minimise
from lobefit.kernels.sums import Observations

__all__ = ["descend", "starts"]

Array = NDArray[np.float64]

# Separate valleys of the scan that NLopt starts from.
STARTS = 3
# ... if their nodes are no worse than this many times the best one.
RIVAL = 2.0
# Points per dimension of the finer look, by the number of dimensions.
ZOOM = (9, 7, 5, 3)


def starts(problem: Problem) -> list[tuple[Array, Array]]:
    """Scan for the valleys: points (t, c) to start from, the best first."""
    t = problem.nodes()
    value, c = problem.scan(t)
    spacing = problem.scale.spacing
    valleys: list[int] = []
    for k in np.argsort(value, kind="stable"):
        near = any(np.all(np.abs(t[k] - t[j]) <= 1.5 * spacing) for j in valleys)
        if not near and np.isfinite(value[k]):
            valleys.append(int(k))
        if len(valleys) == STARTS or (valleys and value[k] > RIVAL * value[valleys[0]]):
            break
    if len(valleys) < 2 or not t.shape[1]:
        return [(t[k], row) for k in valleys for row in bottoms(problem, t[k], c[k])]
    # Several are as good: a finer look around each tells them apart.
    steps = np.linspace(-0.5, 0.5, ZOOM[min(t.shape[1], len(ZOOM)) - 1])
    offsets = np.stack(
        [a.ravel() for a in np.meshgrid(*[steps] * t.shape[1], indexing="ij")], axis=-1
    )
    close = t[valleys][:, None, :] + offsets * spacing
    close = np.clip(close, problem.scale.low, problem.scale.high)
    value, c = problem.scan(close.reshape(-1, t.shape[1]))
    value = value.reshape(len(valleys), -1)
    c = c.reshape(len(valleys), len(offsets), *c.shape[1:])
    lowest = np.argmin(value, axis=1)
    best = value[np.arange(len(valleys)), lowest]
    return [
        (close[k, lowest[k]], row)
        for k in np.argsort(best, kind="stable")
        if best[k] <= RIVAL * best.min()
        for row in bottoms(problem, close[k, lowest[k]], c[k, lowest[k]])
    ]


def _why_none(problem: Problem) -> str:
    own = ", ".join(p.name for p in problem.candidate.own)
    return f"each channel was solved for its {own}" if own else "the problem is linear"


def descend(problem: Problem, data: Observations, t: Array, c: Array) -> tuple[Found, Array]:
    """Run NLopt on thinned rows from one start; returns the coefficients too."""
    best, best_value = problem.start_coefficients(data, t, c), np.inf

    def objective(at: Array) -> float:
        nonlocal best, best_value
        value, solved = problem.project(data, at, best)
        if value < best_value:
            best, best_value = solved, value
        return value

    if not len(t):
        value, c = problem.project(data, t, best)
        return Found(t, value, "none", _why_none(problem), 1), c
    scale = problem.scale
    how = problem.dataset.how
    found = minimise(
        objective,
        t,
        scale.low,
        scale.high,
        0.5 * scale.spacing,
        xtol=how.tolerance,
        ftol_rel=how.tolerance / 20.0,
        max_evaluations=how.max_evaluations,
        settings=how,
        gradient=lambda at: problem.gradient(data, at, best),
    )
    return found, best
