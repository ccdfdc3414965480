"""The hemisphere integral over an environment, each part by the quadrature that suits it.

Broad lobes see the environment as some thousand directional lights
(`lobefit.kernels.environment_lights`), narrow ones at half vectors that crowd where the lobe is
(`lobefit.kernels.lobe_nodes`). The diffuse part takes the first; for the specular part both are
tried where the first is not good enough, and that of the smaller estimated error is kept for these
parameters. An error is estimated as the difference from the same with a quarter of the nodes.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from lobefit.kernels.environment_lights import environment_lights
from lobefit.kernels.lights import Environment
from lobefit.kernels.shaded_points import Lobes, ShadedPoints

__all__ = ["EnvironmentIntegral"]

Values = NDArray[Any]

ENOUGH = 2e-3  # of the mean radiance: an estimated error for which nothing else is tried


class EnvironmentIntegral:
    """Radiance that points reflect from an environment.

    Parameters
    ----------
    points : ShadedPoints
        Where.
    environment : Environment
        What is reflected.
    nodes : tuple of int
        For narrow lobes: panels of two nodes from the normal to the horizon, and azimuths.
    cells : int
        For broad lobes: about how many directional lights.
    """

    def __init__(
        self, points: ShadedPoints, environment: Environment, nodes: tuple[int, int], cells: int
    ) -> None:
        self.points, self.environment = points, environment
        self.nodes, self.cells = nodes, cells
        self._narrow: dict[tuple[Any, ...], bool] = {}
        self._lights: dict[int, NDArray[np.float64]] = {}

    def __call__(self, lobes: Lobes, estimate: bool) -> tuple[Values, Values, float]:
        """Integrate.

        Parameters
        ----------
        lobes : Lobes
            What reflects.
        estimate : bool
            Whether to estimate the error too.

        Returns
        -------
        values : ndarray, shape (sets, C, 2, padded points)
            Diffuse and specular radiance.
        error : ndarray, shape (sets, C, 1, padded points)
            Estimated error of their sum; 0 where it was not asked for.
        seconds : float
            On the device, without what only estimates.
        """
        made = [self._one(one, estimate) for one in lobes.singly()]
        values, errors = (np.concatenate([m[k] for m in made]) for k in (0, 1))
        return values, errors, sum(m[2] for m in made)

    def _one(self, lobes: Lobes, estimate: bool) -> tuple[Values, Values, float]:
        """Integrate one set; shapes as above."""
        broad, seconds = self._cells(lobes, self.cells)
        specular = bool(lobes.coefficients[..., ~lobes.diffuse].any())
        narrow = specular and self._is_narrow(lobes, broad)
        values = broad
        if narrow:
            sharp, more = self._halves(lobes, self.nodes)
            values = np.concatenate([broad[:, :, :1], sharp[:, :, 1:]], axis=2)
            seconds += more
        error = np.zeros_like(values[:, :, :1])
        if estimate:
            coarse = self._cells(lobes, self.cells // 4)[0]
            if narrow:
                sharp = self._halves(lobes, self._half_as_many)[0]
                coarse = np.concatenate([coarse[:, :, :1], sharp[:, :, 1:]], axis=2)
            error = np.abs((values - coarse).sum(axis=2, keepdims=True))
        return values, error, seconds

    def _is_narrow(self, lobes: Lobes, broad: Values) -> bool:
        """Tell which quadrature the specular part takes; found out once for these parameters."""
        key = (lobes.program.text, lobes.x.tobytes(), lobes.coefficients.tobytes())
        if key not in self._narrow:
            off = np.abs(broad - self._cells(lobes, self.cells // 4)[0])[:, :, 1].mean()
            self._narrow[key] = bool(off > ENOUGH * broad.sum(axis=2).mean())
            if self._narrow[key]:
                fine, coarse = (self._halves(lobes, n)[0] for n in (self.nodes, self._half_as_many))
                self._narrow[key] = bool(np.abs(fine - coarse)[:, :, 1].mean() < off)
        return self._narrow[key]

    @property
    def _half_as_many(self) -> tuple[int, int]:
        return self.nodes[0] // 2, self.nodes[1] // 2

    def _halves(self, lobes: Lobes, nodes: tuple[int, int]) -> tuple[Values, float]:
        return self.points.under_environment(lobes, self.environment, nodes)

    def _cells(self, lobes: Lobes, count: int) -> tuple[Values, float]:
        channels = lobes.coefficients.shape[1]
        if count not in self._lights:
            self._lights[count] = environment_lights(self.environment, count)
        found = self._lights[count]
        power = np.broadcast_to(found[:, 4:], (len(found), channels))
        rows = np.concatenate([found[:, :4], power], axis=1)
        return self.points.under_lights(lobes, rows, np.zeros((1, channels)))
