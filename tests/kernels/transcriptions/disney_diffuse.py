"""Burley, Physically based shading at Disney, SIGGRAPH 2012 course: the diffuse term.

f = k_d / pi (1 + (F90 - 1) (1 - n.i)^5) (1 + (F90 - 1) (1 - n.o)^5), F90 = 1/2 + 2 roughness (i.h)^2.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from tests.kernels.transcriptions import Array, geometry, per_channel

__all__ = ["brdf"]


def brdf(
    theta_i: npt.ArrayLike,
    phi_i: npt.ArrayLike,
    theta_o: npt.ArrayLike,
    phi_o: npt.ArrayLike,
    *,
    k_d: float | list[float],
    roughness: float,
) -> Array:
    """Give f [C, N] in 1/sr."""
    g = geometry(theta_i, phi_i, theta_o, phi_o)
    F90 = 0.5 + 2 * roughness * g.cos_d**2
    light, eye = (1 + (F90 - 1) * (1 - direction[2]) ** 5 for direction in (g.i, g.o))
    return g.where_lit(per_channel(k_d) / np.pi * light * eye)
