"""GGX: B. Walter and others, EGSR 2007, eq. 33, after Trowbridge and Reitz, JOSA 65 (1975).

f = k_d / pi + k_s D G F / (4 n.i n.o), with Smith's height-correlated
G = 1 / (1 + Lambda_i + Lambda_o) (E. Heitz, JCGT 3(2), 2014, eq. 99 and 72) and Schlick's F.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from tests.kernels.transcriptions import Array, geometry, per_channel

__all__ = ["brdf", "smith_lambda"]


def smith_lambda(direction: Array, alpha: float) -> Array:
    """Give Lambda [N] of unit directions [3, N] for an isotropic GGX surface."""
    x, y, z = direction
    return np.asarray((np.sqrt(1 + alpha**2 * (x**2 + y**2) / z**2) - 1) / 2)


def brdf(
    theta_i: npt.ArrayLike,
    phi_i: npt.ArrayLike,
    theta_o: npt.ArrayLike,
    phi_o: npt.ArrayLike,
    *,
    k_d: float | list[float],
    k_s: float | list[float],
    F0: float | list[float],
    alpha: float,
) -> Array:
    """Give f [C, N] in 1/sr."""
    g = geometry(theta_i, phi_i, theta_o, phi_o)
    cos4_h = (1 + g.tan2_h) ** -2
    D = 1 / (np.pi * alpha**2 * cos4_h * (1 + g.tan2_h / alpha**2) ** 2)
    G = 1 / (1 + smith_lambda(g.i, alpha) + smith_lambda(g.o, alpha))
    F = per_channel(F0) + (1 - per_channel(F0)) * g.one_minus_cos_d**5
    return g.where_lit(
        per_channel(k_d) / np.pi + per_channel(k_s) * D * G * F / (4 * g.i[2] * g.o[2])
    )
