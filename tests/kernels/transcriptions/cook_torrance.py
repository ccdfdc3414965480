"""Cook-Torrance: R. Cook, K. Torrance, ACM Transactions on Graphics 1(1), 1982.

f = k_d / pi + k_s D G F / (4 n.i n.o), with Beckmann's D normalised so that the integral of
D n.h is 1 (Walter and others, EGSR 2007, eq. 25), the V-cavity
G = min(1, 2 n.h n.i / i.h, 2 n.h n.o / i.h), and Schlick's F (Computer Graphics Forum 1994).
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from tests.kernels.transcriptions import Array, Geometry, geometry, per_channel

__all__ = ["brdf", "v_cavity"]


def v_cavity(g: Geometry) -> Array:
    """Give G [N]: with h = H/|H| and i.h = |H|/2, 2 n.h n.i / i.h is 4 Hz n.i / |H|^2."""
    cavity = 4 * g.H[2] / g.H2
    return np.asarray(np.minimum(1, cavity * np.minimum(g.i[2], g.o[2])))


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
    D = np.exp(-g.tan2_h / alpha**2) / (np.pi * alpha**2 * cos4_h)
    F = per_channel(F0) + (1 - per_channel(F0)) * g.one_minus_cos_d**5
    lobe = D * v_cavity(g) / (4 * g.i[2] * g.o[2])
    return g.where_lit(per_channel(k_d) / np.pi + per_channel(k_s) * F * lobe)
