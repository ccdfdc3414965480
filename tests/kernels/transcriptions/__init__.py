"""The models once more, in numpy, to hold the kernels against.

One module per model, found by the model's name. Each is written from the formula of the
paper it cites, with vectors, and shares nothing with the OpenCL code. The arithmetic keeps
the type of the angles, so that angles in `numpy.longdouble` give a more exact reference.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

__all__ = ["HORIZON", "Array", "Geometry", "Transcription", "geometry", "load", "per_channel"]

Array = npt.NDArray[np.floating[Any]]
Transcription = Callable[..., Array]

# A direction whose cosine with the normal is not above this counts as below the horizon.
HORIZON = 1e-7


def load(model: str) -> Transcription:
    """Give the function ``brdf(theta_i, phi_i, theta_o, phi_o, **params) -> [C, N]`` of a model."""
    module = importlib.import_module(f"{__name__}.{model}")
    brdf: Transcription = module.brdf
    return brdf


def per_channel(value: float | list[float]) -> Array:
    """Turn a scalar or a list with one value per channel into a column [C, 1]."""
    return np.atleast_1d(np.asarray(value, dtype=np.float64))[:, np.newaxis]


@dataclass(frozen=True)
class Geometry:
    """Two unit vectors, both away from the surface, and the sum that stays exact near the mirror.

    Where a direction is not above the horizon both vectors are replaced by the normal, so
    that no formula divides by zero; ``lit`` says where the replacement was not needed.
    """

    i: Array  # [3, N]
    o: Array  # [3, N]
    lit: npt.NDArray[np.bool_]  # [N]

    @property
    def H(self) -> Array:
        """Sum i + o: the half vector before it is normalised."""
        return self.i + self.o

    @property
    def H2(self) -> Array:
        """Squared length of H, which is 2 + 2 i.o."""
        return np.asarray(np.sum(self.H**2, axis=0))

    @property
    def tan2_h(self) -> Array:
        """Squared tangent of the half vector's zenith angle, without the detour over its cosine."""
        x, y, z = self.H
        return np.asarray((x**2 + y**2) / z**2)

    @property
    def cos_d(self) -> Array:
        """Cosine between the half vector and either direction: i.H/|H| = |H|/2."""
        return np.sqrt(self.H2) / 2

    @property
    def one_minus_cos_d(self) -> Array:
        """1 - cos_d by way of sin_d = |i - o|/2, exact towards retroreflection."""
        return np.asarray(np.sum((self.i - self.o) ** 2, axis=0) / 4 / (1 + self.cos_d))

    def where_lit(self, values: Array) -> Array:
        """Set values [C, N] to zero where either direction is below the horizon."""
        return np.where(self.lit, values, 0)


def _unit(theta: npt.ArrayLike, phi: npt.ArrayLike) -> Array:
    theta, phi = np.broadcast_arrays(np.atleast_1d(theta), np.atleast_1d(phi))
    return np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)])


def geometry(
    theta_i: npt.ArrayLike, phi_i: npt.ArrayLike, theta_o: npt.ArrayLike, phi_o: npt.ArrayLike
) -> Geometry:
    """Make the vectors of N pairs of directions from angles in radians."""
    i, o = np.broadcast_arrays(_unit(theta_i, phi_i), _unit(theta_o, phi_o))
    lit = (i[2] > HORIZON) & (o[2] > HORIZON)
    normal = np.array([0.0, 0.0, 1.0])[:, np.newaxis]
    return Geometry(np.where(lit, i, normal), np.where(lit, o, normal), lit)
