"""Ward-Dur: A. Dur, Journal of Graphics Tools 11(1), 2006.

f = k_d / pi + k_s exp(-(hx^2/ax^2 + hy^2/ay^2) / hz^2) / (4 pi ax ay n.i n.o),
where hx and hy are the components of h along the sample's axes: x at azimuth phi_x, and y
90 degrees further.
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
    alpha_x: float,
    alpha_y: float,
    phi_x: float,
) -> Array:
    """Give f [C, N] in 1/sr."""
    g = geometry(theta_i, phi_i, theta_o, phi_o)
    x_axis = np.array([np.cos(phi_x), np.sin(phi_x), 0.0])
    y_axis = np.array([-np.sin(phi_x), np.cos(phi_x), 0.0])
    slope_x = x_axis @ g.H / g.H[2]
    slope_y = y_axis @ g.H / g.H[2]
    gaussian = np.exp(-((slope_x / alpha_x) ** 2 + (slope_y / alpha_y) ** 2))
    lobe = gaussian / (4 * np.pi * alpha_x * alpha_y * g.i[2] * g.o[2])
    return g.where_lit(per_channel(k_d) / np.pi + per_channel(k_s) * lobe)
