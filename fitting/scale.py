"""The scales on which nonlinear parameters are searched: logarithm, root, or as they are."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from lobefit.kernels import Candidate, Parameter

__all__ = ["MAX_NODES", "SearchScale", "canonical"]

Array = NDArray[np.float64]

# Nodes of a start scan.
MAX_NODES = 5000
FEWEST_NODES = 4


class SearchScale:
    """Map between parameters x and search coordinates t = log(x), sqrt(x) or x.

    Parameters
    ----------
    parameters : sequence of Parameter
        What is searched for.
    most : int
        Nodes of the start scan; where the records ask for more, the dimensions with
        most get fewer.
    density : float
        Nodes along each dimension, as a multiple of what the records ask for.

    Attributes
    ----------
    low, high : ndarray, shape (n,)
        Bounds of t; an angle may go half a period beyond either end.
    spacing : ndarray, shape (n,)
        Distance of the scan's nodes in t.
    units : ndarray, shape (n,)
        What counts as one change in t: a factor e, the period of an angle, else the whole range.
    """

    def __init__(
        self, parameters: Sequence[Parameter], most: int = MAX_NODES, density: float = 1.0
    ) -> None:
        self.parameters = tuple(parameters)
        self._log = np.array([p.scale == "log" for p in parameters], dtype=bool)
        self._root = np.array([p.scale == "root" for p in parameters], dtype=bool)
        bounds = np.array([p.bounds for p in parameters]).reshape(-1, 2)
        self.floor, self.ceiling = bounds[:, 0], bounds[:, 1]
        edges = self.to_search(bounds.T)
        self.counts = [max(round(density * p.nodes), min(p.nodes, 2)) for p in parameters]
        while np.prod(self.counts) > most and max(self.counts) > FEWEST_NODES:
            self.counts[int(np.argmax(self.counts))] -= 1
        self.spacing = (edges[1] - edges[0]) / np.array(
            [n if p.period else n - 1 for n, p in zip(self.counts, parameters, strict=True)],
            dtype=float,
        )
        beyond = np.array([p.period or 0.0 for p in parameters])
        self.low, self.high = edges[0] - beyond, edges[1] + beyond
        self.periodic = beyond > 0.0
        ranges = zip(parameters, edges[1] - edges[0], strict=True)
        self.units = np.array(
            [1.0 if p.scale == "log" else p.period or span for p, span in ranges], dtype=float
        )

    def to_search(self, x: Array) -> Array:
        """Give t of x, shape (..., n)."""
        t = np.array(x, dtype=np.float64)
        t[..., self._log] = np.log(t[..., self._log])
        t[..., self._root] = np.sqrt(t[..., self._root])
        return t

    def to_parameters(self, t: Array) -> Array:
        """Give x of t, shape (..., n), inside the bounds."""
        x = np.array(t, dtype=np.float64)
        x[..., self._log] = np.exp(x[..., self._log])
        x[..., self._root] = np.square(x[..., self._root])
        inside = np.clip(x, self.floor, self.ceiling)
        return np.where(self.periodic, x, inside)

    def slope(self, x: Array) -> Array:
        """Give dx/dt, shape (..., n)."""
        return np.where(self._log, x, np.where(self._root, 2.0 * np.sqrt(np.abs(x)), 1.0))

    def nodes(self) -> Array:
        """Give the nodes of the start scan in t, shape (P, n)."""
        axes = []
        for k in range(len(self.parameters)):
            low = self.to_search(self.floor)[k]
            axes.append(low + self.spacing[k] * np.arange(self.counts[k]))
        if not axes:
            return np.zeros((1, 0))
        return np.stack([a.ravel() for a in np.meshgrid(*axes, indexing="ij")], axis=-1)


def canonical(candidate: Candidate, x: Array) -> Array:
    """Give the unique label of the shared parameters: angles in range, alpha_x >= alpha_y."""
    x = x.copy()
    index = {p.name: k for k, p in enumerate(candidate.shared)}
    for axes in candidate.model.axes:
        if not all(name in index for name in axes):
            continue
        i_x, i_y, i_phi = (index[name] for name in axes)
        if x[i_x] < x[i_y]:
            x[i_x], x[i_y] = x[i_y], x[i_x]
            x[i_phi] += 0.5 * np.pi
    for k, p in enumerate(candidate.shared):
        if p.period:
            x[k] = p.bounds[0] + np.mod(x[k] - p.bounds[0], p.period)
    return x
