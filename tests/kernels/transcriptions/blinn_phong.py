"""Blinn-Phong: J. F. Blinn, SIGGRAPH 1977, with the normalised distribution and no masking.

f = k_d / pi + k_s (n + 2) / (8 pi) (n.h)^n, which is k_s D / 4 with D = (n + 2) / (2 pi) (n.h)^n.
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
    # (n.h)^2 = 1 / (1 + tan^2): the power of a number that may be very close to 1.
    power = np.exp(-n / 2 * np.log1p(g.tan2_h))
    return g.where_lit(per_channel(k_d) / np.pi + per_channel(k_s) * (n + 2) / (8 * np.pi) * power)
