"""The Fisher information of a point fit over relative changes of the model's parameters.

Relative, because an instrument's user asks for "how many percent": one unit is a factor e
of a parameter that is positive, or the whole range of one that is not on such a scale (an
angle, an exponent that may be negative).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lobefit.fitting.point import PointFit
from lobefit.fitting.polish import Curvature, eliminate
from lobefit.fitting.problem import Problem
from lobefit.fitting.scale import canonical

__all__ = ["Information", "information", "information_of_all", "labels", "linear_value"]

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Information:
    """What the data say about the parameters that one channel's values depend on.

    Attributes
    ----------
    names : tuple of str
        Free parameters whose value is not 0 (at 0 no relative change exists).
    relative : tuple of bool
        One unit is a factor e; otherwise the whole range.
    values : ndarray, shape (p,)
    matrix : ndarray, shape (p, p)
        Fisher information over changes in these units, all other channels' own
        parameters being free.
    """

    names: tuple[str, ...]
    relative: tuple[bool, ...]
    values: Array
    matrix: Array

    @property
    def errors(self) -> Array:
        """Standard errors with all other parameters free, shape (p,)."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def covariance(self) -> Array:
        """Inverse of the matrix; directions without information have a huge variance."""
        values, vectors = np.linalg.eigh(self.matrix)
        # What eigh leaves of a zero is rounding of the largest.
        floor = max(1e-15 * float(values[-1]), 1e-300) if len(values) else 0.0
        inverse: Array = (vectors / np.maximum(values, floor)) @ vectors.T
        return inverse

    def along(self, weights: Array) -> float:
        """Give the standard error of a weighted sum of changes, however vague its parts are.

        Found by eliminating everything across it: adding up the parts' covariances
        would lose its digits where they cancel.
        """
        length = float(np.linalg.norm(weights))
        turn, _ = np.linalg.qr(np.column_stack([weights / length, np.eye(len(weights))]))
        turned = turn.T @ self.matrix @ turn
        rest = turned[1:, 1:]
        scale = np.sqrt(np.maximum(np.diag(rest), 1e-300))
        known = np.linalg.pinv(rest / np.outer(scale, scale), rcond=1e-13, hermitian=True)
        lever = turned[0, 1:] / scale
        left = float(turned[0, 0] - lever @ known @ lever)
        return float(length / np.sqrt(max(left, 1e-300)))


def labels(problem: Problem, t: Array) -> list[str]:
    """Name the shared search coordinates as the results do, where two axes may be exchanged."""
    names = [p.name for p in problem.candidate.shared]
    x = problem.scale.to_parameters(t)
    labelled = canonical(problem.candidate, x)
    for wide, narrow, _ in problem.candidate.model.axes:
        if {wide, narrow} <= set(names):
            a, b = names.index(wide), names.index(narrow)
            if labelled[a] != x[a]:
                names[a], names[b] = narrow, wide
    return names


def information_of_all(fit: PointFit, curvature: Curvature, scale: float) -> list[Information]:
    """Give `information` of every channel."""
    return [information(fit, curvature, scale, k) for k in range(len(fit.polished.c))]


def information(fit: PointFit, curvature: Curvature, scale: float, channel: int) -> Information:
    """Turn the curvature in search coordinates into information about parameters.

    Parameters
    ----------
    fit : PointFit
        Where.
    curvature : Curvature
        Its curvature, or that with hypothetical readings added.
    scale : float
        Variance in units of the objective.
    channel : int
        Whose parameters, beside the shared ones.

    Returns
    -------
    Information
    """
    problem, point = fit.problem, fit.polished
    n, k = len(point.t), problem.program.n_basis
    d = problem.coordinates.coordinates(point.c)
    # The other channels are eliminated; what rests on a bound there is not free.
    free = (d > problem.coordinates.low) & (d < problem.coordinates.high)
    free[channel] = False
    marginal = curvature.matrix[channel].copy()
    marginal[:n, :n] = eliminate(curvature.matrix, curvature.gradient, n, free)[0]

    c = point.c[channel]
    names, relative, values, columns = [], [], [], []

    def add(name: str, is_relative: bool, value: float, column: Array) -> None:
        if column.any():
            names.append(name)
            relative.append(is_relative)
            values.append(value)
            columns.append(column)

    x = problem.scale.to_parameters(point.t)
    for j, (name, p) in enumerate(
        zip(labels(problem, point.t), problem.candidate.shared, strict=True)
    ):
        unit = np.zeros(len(marginal))
        unit[j] = problem.scale.units[j]
        add(name, p.scale == "log", float(x[j]), unit)
    model = problem.candidate.model
    back = np.linalg.pinv(problem.linear.T)
    for p in problem.candidate.solved:
        moved = np.array(
            [c[j] if p.name in names_ else 0.0 for j, names_ in enumerate(model.coefficients)]
        )
        unit = np.zeros(len(marginal))
        unit[n : n + len(back)] = back @ moved
        add(p.name, True, linear_value(model.coefficients, c, p.name), unit)
    own_x = problem.own.to_parameters(c[k:])
    for j, p in enumerate(problem.candidate.own):
        unit = np.zeros(len(marginal))
        unit[n + len(back) + j] = problem.own.units[j]
        add(p.name, p.scale == "log", float(own_x[j]), unit)
    K = np.stack(columns, axis=1) if columns else np.zeros((len(marginal), 0))
    with np.errstate(over="ignore", invalid="ignore"):
        matrix = K.T @ marginal @ K / max(scale, 1e-300)
    # Where a sum overflowed there is no information that could be used.
    return Information(
        tuple(names),
        tuple(relative),
        np.array(values),
        np.nan_to_num(matrix, posinf=0.0, neginf=0.0),
    )


def linear_value(products: tuple[tuple[str, ...], ...], c: Array, name: str) -> float:
    """Give a linear parameter of one channel from its coefficients; 0 for a ratio to nothing."""
    for k, names in enumerate(products):
        if names == (name,):
            return float(c[k])
        if len(names) == 2 and names[1] == name:
            scale = c[products.index(names[:1])]
            return float(c[k] / scale) if scale > 0.0 else 0.0
    return 0.0
