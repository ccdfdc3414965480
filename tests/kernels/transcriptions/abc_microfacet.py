"""ABC for microfacets: J. Low and others, ACM TOG 31(1), 2012, eq. 15.

f = k_d / pi + A G F / ((1 + B (1 - n.h))^C n.i n.o), with the V-cavity G and Fresnel's F of a
dielectric in the form of R. Cook, K. Torrance, ACM TOG 1(1), 1982.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from tests.kernels.transcriptions import Array, geometry, per_channel
from tests.kernels.transcriptions.cook_torrance import v_cavity

__all__ = ["brdf", "fresnel"]


def fresnel(c: Array, eta: float) -> Array:
    """Give F [N] of a dielectric of index eta >= 1 where the cosine of incidence is c [N]."""
    g = np.sqrt(eta**2 + c**2 - 1)
    p_over_s = (c * (g + c) - 1) / (c * (g - c) + 1)
    return np.asarray(((g - c) / (g + c)) ** 2 * (1 + p_over_s**2) / 2)


def brdf(
    theta_i: npt.ArrayLike,
    phi_i: npt.ArrayLike,
    theta_o: npt.ArrayLike,
    phi_o: npt.ArrayLike,
    *,
    k_d: float | list[float],
    A: float | list[float],
    B: float,
    C: float,
    eta: float,
) -> Array:
    """Give f [C, N] in 1/sr."""
    g = geometry(theta_i, phi_i, theta_o, phi_o)
    x, y, z = g.H / np.sqrt(g.H2)
    one_minus_nh = (x**2 + y**2) / (1 + z)
    lobe = v_cavity(g) * fresnel(g.cos_d, eta) / ((1 + B * one_minus_nh) ** C * g.i[2] * g.o[2])
    return g.where_lit(per_channel(k_d) / np.pi + per_channel(A) * lobe)
