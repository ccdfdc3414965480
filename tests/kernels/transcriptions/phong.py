"""Phong, CACM 18(6), 1975: the highlight (r.o)^n, over n.i to be a BRDF.

f = k_d / pi + k_s max(r.o, 0)^n / n.i, with r the mirror image of i.
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
    n: float,
) -> Array:
    """Give f [C, N] in 1/sr."""
    g = geometry(theta_i, phi_i, theta_o, phi_o)
    # r - o = (-Hx, -Hy, iz - oz) and r.o = 1 - |r - o|^2 / 2, exact for large n.
    below_one = (g.H[0] ** 2 + g.H[1] ** 2 + (g.i[2] - g.o[2]) ** 2) / 2
    in_front = below_one < 1
    power = np.exp(n * np.log1p(-np.where(in_front, below_one, 0)))
    highlight = np.where(in_front, power, 0) / g.i[2]
    return g.where_lit(per_channel(k_d) / np.pi + per_channel(k_s) * highlight)
