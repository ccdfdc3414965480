"""Retro-reflective lobe: L. Belcour and others, JOSA A 31(12), 2014, the back vector.

f = k_d / pi + k_s D G / (4 n.i n.o), with GGX's D (B. Walter and others, EGSR 2007, eq. 33) of
the half vector between o and the mirrored i, and Smith's height-correlated G.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from tests.kernels.transcriptions import Array, geometry, per_channel
from tests.kernels.transcriptions.ggx import smith_lambda

__all__ = ["brdf"]


def brdf(
    theta_i: npt.ArrayLike,
    phi_i: npt.ArrayLike,
    theta_o: npt.ArrayLike,
    phi_o: npt.ArrayLike,
    *,
    k_d: float | list[float],
    k_s: float | list[float],
    alpha: float,
) -> Array:
    """Give f [C, N] in 1/sr."""
    g = geometry(theta_i, phi_i, theta_o, phi_o)
    back = g.o + g.i * np.array([-1.0, -1.0, 1.0])[:, np.newaxis]
    x, y, z = back
    tan2 = (x**2 + y**2) / z**2
    D = (1 + tan2) ** 2 / (np.pi * alpha**2 * (1 + tan2 / alpha**2) ** 2)
    G = 1 / (1 + smith_lambda(g.i, alpha) + smith_lambda(g.o, alpha))
    lobe = D * G / (4 * g.i[2] * g.o[2])
    return g.where_lit(per_channel(k_d) / np.pi + per_channel(k_s) * lobe)
