"""Ashikhmin and Shirley, An anisotropic Phong BRDF model, JGT 5(2), 2000.

f = 28 k_d / (23 pi) (1 - (1 - n.i/2)^5) (1 - (1 - n.o/2)^5)
    + k_s sqrt((nx + 1) (ny + 1)) / (8 pi) (n.h)^e / (i.h max(n.i, n.o)) F,
e = (nx (h.x)^2 + ny (h.y)^2) / (1 - (n.h)^2), F = F0 + (1 - F0) (1 - i.h)^5, n = 2 / alpha^2; the
axis x stands at azimuth phi_x. F can be a dielectric's instead.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from tests.kernels.transcriptions import Array, geometry, per_channel
from tests.kernels.transcriptions.microfacet import Value, fresnel_term

__all__ = ["brdf"]


def brdf(
    theta_i: npt.ArrayLike,
    phi_i: npt.ArrayLike,
    theta_o: npt.ArrayLike,
    phi_o: npt.ArrayLike,
    *,
    k_d: Value,
    k_s: Value,
    alpha_x: float,
    alpha_y: float,
    phi_x: float,
    fresnel: str = "schlick",
    **material: Value,
) -> Array:
    """Give f [C, N] in 1/sr."""
    g = geometry(theta_i, phi_i, theta_o, phi_o)
    n_x, n_y = 2 / alpha_x**2, 2 / alpha_y**2
    x = g.H[0] * np.cos(phi_x) + g.H[1] * np.sin(phi_x)
    y = -g.H[0] * np.sin(phi_x) + g.H[1] * np.cos(phi_x)
    across2 = x**2 + y**2
    e = (n_x * x**2 + n_y * y**2) / np.where(across2 > 0, across2, 1)
    # ln n.h from the tangent: n.h itself has lost the small angles that a large e magnifies.
    power = np.exp(-e / 2 * np.log1p(g.tan2_h))
    shape = np.sqrt((n_x + 1) * (n_y + 1)) / (8 * np.pi) * power
    lobe = shape / (g.cos_d * np.maximum(g.i[2], g.o[2]))
    F = fresnel_term(fresnel, g, material)
    light, eye = (1 - (1 - direction[2] / 2) ** 5 for direction in (g.i, g.o))
    return g.where_lit(
        28 * per_channel(k_d) / (23 * np.pi) * light * eye + per_channel(k_s) * F * lobe
    )
