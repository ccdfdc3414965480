"""The scales on which nonlinear parameters are searched: logarithm, or as they are."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from lobefit.kernels import Candidate, Parameter

__all__ = ["SearchScale", "canonical"]

Array = NDArray[np.float64]


class SearchScale:
    """Map between parameters x and search coordinates t = log(x) or x.

    Attributes
    ----------
    low, high : ndarray, shape (n,)
        Bounds of t; an angle may go half a period beyond either end.
    spacing : ndarray, shape (n,)
        Distance of the scan's nodes in t.
    """

    def __init__(self, parameters: Sequence[Parameter]) -> None:
        self.parameters = tuple(parameters)
        self._log = np.array([p.scale == "log" for p in parameters], dtype=bool)
        bounds = np.array([p.bounds for p in parameters]).reshape(-1, 2)
        self.floor, self.ceiling = bounds[:, 0], bounds[:, 1]
        edges = self.to_search(bounds.T)
        self.spacing = (edges[1] - edges[0]) / np.array(
            [p.nodes if p.period else p.nodes - 1 for p in parameters], dtype=float
        )
        beyond = np.array([p.period or 0.0 for p in parameters])
        self.low, self.high = edges[0] - beyond, edges[1] + beyond
        self.periodic = beyond > 0.0

    def to_search(self, x: Array) -> Array:
        """Give t of x, shape (..., n)."""
        t = np.array(x, dtype=np.float64)
        t[..., self._log] = np.log(t[..., self._log])
        return t

    def to_parameters(self, t: Array) -> Array:
        """Give x of t, shape (..., n), inside the bounds."""
        x = np.array(t, dtype=np.float64)
        x[..., self._log] = np.exp(x[..., self._log])
        inside = np.clip(x, self.floor, self.ceiling)
        return np.where(self.periodic, x, inside)

    def slope(self, x: Array) -> Array:
        """Give dx/dt, shape (..., n)."""
        return np.where(self._log, x, 1.0)

    def nodes(self) -> Array:
        """Give the nodes of the start scan in t, shape (P, n)."""
        axes = []
        for k, p in enumerate(self.parameters):
            low = self.to_search(self.floor)[k]
            axes.append(low + self.spacing[k] * np.arange(p.nodes))
        if not axes:
            return np.zeros((1, 0))
        return np.stack([a.ravel() for a in np.meshgrid(*axes, indexing="ij")], axis=-1)


def canonical(candidate: Candidate, x: Array) -> Array:
    """Give the unique label of a set of free parameters: angles in range, alpha_x >= alpha_y."""
    x = x.copy()
    index = {p.name: k for k, p in enumerate(candidate.searched)}
    axes = candidate.model.lobe.axes
    if axes is not None and all(name in index for name in axes):
        i_x, i_y, i_phi = (index[name] for name in axes)
        if x[i_x] < x[i_y]:
            x[i_x], x[i_y] = x[i_y], x[i_x]
            x[i_phi] += 0.5 * np.pi
    for k, p in enumerate(candidate.searched):
        if p.period:
            x[k] = p.bounds[0] + np.mod(x[k] - p.bounds[0], p.period)
    return x
