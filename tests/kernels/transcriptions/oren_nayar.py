"""Oren and Nayar, SIGGRAPH 1994, eq. 30: the qualitative model.

f = k_d / pi (A + B max(0, cos(phi_o - phi_i)) sin(a) tan(b)), a and b the larger and the smaller
zenith angle. cos(phi_o - phi_i) sin(a) tan(b) is the product of the two tangential parts over the
larger cosine.
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
    sigma: float,
) -> Array:
    """Give f [C, N] in 1/sr."""
    g = geometry(theta_i, phi_i, theta_o, phi_o)
    A = 1 - 0.5 * sigma**2 / (sigma**2 + 0.33)
    B = 0.45 * sigma**2 / (sigma**2 + 0.09)
    across = np.sum(g.i[:2] * g.o[:2], axis=0)
    rise = np.maximum(across, 0) / np.maximum(g.i[2], g.o[2])
    return g.where_lit(per_channel(k_d) / np.pi * (A + B * rise))
