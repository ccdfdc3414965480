"""Modified Phong: E. Lafortune, Y. Willems, KU Leuven report CW197 (1994).

f = k_d / pi + k_s (n + 2) / (2 pi) max(r.o, 0)^n, with r the mirror image of i.
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
    # r - o = (-Hx, -Hy, iz - oz) and r.o = 1 - |r - o|^2 / 2: for large n the power needs
    # the distance of r.o from 1, which the dot product itself has lost.
    below_one = (g.H[0] ** 2 + g.H[1] ** 2 + (g.i[2] - g.o[2]) ** 2) / 2
    in_front = below_one < 1
    power = np.exp(n * np.log1p(-np.where(in_front, below_one, 0)))
    lobe = (n + 2) / (2 * np.pi) * np.where(in_front, power, 0)
    return g.where_lit(per_channel(k_d) / np.pi + per_channel(k_s) * lobe)
