"""Lafortune, Foo, Torrance, Greenberg, SIGGRAPH 1997, eq. 4, with C_x = C_y.

f = k_d / pi + k_s (n + 2) / (2 pi) max(C_xy (ix ox + iy oy) + C_z iz oz, 0)^n, where the larger of
|C_xy| and C_z is 1: C_xy = -clamp(C, -1, 1) and C_z = min(1, 2 - |C|).
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
    k_s: float | list[float],
    C: float,
    n: float,
) -> Array:
    """Give f [C, N] in 1/sr."""
    g = geometry(theta_i, phi_i, theta_o, phi_o)
    C_xy, C_z = -min(max(C, -1.0), 1.0), min(1.0, 2.0 - abs(C))
    base = C_xy * (g.i[0] * g.o[0] + g.i[1] * g.o[1]) + C_z * g.i[2] * g.o[2]
    power = np.exp(n * np.log(np.where(base > 0, base, 1)))
    lobe = (n + 2) / (2 * np.pi) * np.where(base > 0, power, 0)
    return g.where_lit(per_channel(k_d) / np.pi + per_channel(k_s) * lobe)
