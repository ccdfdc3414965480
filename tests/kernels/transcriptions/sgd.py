"""SGD: M. Bagher, C. Soler, N. Holzschuch, Computer Graphics Forum 31(4), 2012.

f = k_d / pi + k_s F D G1(i) G1(o) / (pi n.i n.o) with D = K exp(-x) / (pi x^p cos^4),
x = alpha + tan^2/alpha, K such that the integral of D n.h is 1, the masking
G1 = 1 + Lambda (1 - exp(c (theta - theta0)^k)), c such that G1 is 0 at 90 degrees, and
F = F0' - F1' i.h + (1 - F0')(1 - i.h)^5, F0' = F_g and F1' = F_g - F0.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from tests.kernels.transcriptions import Array, geometry, per_channel

__all__ = ["brdf", "masking", "normaliser"]


def normaliser(alpha: Array, p: Array) -> Array:
    """Give K = 1 / (alpha Gamma(1 - p, alpha)), the integral by quadrature.

    With x = alpha e^s the integrand of Gamma(1 - p, alpha) is
    e^-x x^(1 - p) over ds; beyond x = 60 it adds nothing.
    """
    nodes, weights = np.polynomial.legendre.leggauss(160)
    length = np.log(60 / alpha)
    s = (nodes + 1) / 2 * length
    x = alpha * np.exp(s)
    # e^(alpha - x) x^-p in units of its value at the lower end, so that it cannot overflow
    inner = np.sum(weights / 2 * length * np.exp(alpha - x + (1 - p) * s), axis=1, keepdims=True)
    return np.asarray(alpha ** (p - 2) * np.exp(alpha) / inner)


def masking(direction: Array, Lambda: Array, k_g: Array, theta0: Array) -> Array:
    """Give G1 [C, N] of unit directions [3, N]."""
    x, y, z = direction
    one = np.ones_like(z)
    right_angle = np.arctan2(one, 0 * one)
    theta = np.arctan2(np.hypot(x, y), z)
    beyond = np.maximum(theta - theta0, 0) / (right_angle - theta0)
    at_grazing = np.log1p(1 / Lambda)  # c (90 degrees - theta0)^k
    return np.asarray(np.clip(1 - Lambda * np.expm1(at_grazing * beyond**k_g), 0, 1))


def brdf(
    theta_i: npt.ArrayLike,
    phi_i: npt.ArrayLike,
    theta_o: npt.ArrayLike,
    phi_o: npt.ArrayLike,
    *,
    k_d: float | list[float],
    k_s: float | list[float],
    F0: float | list[float],
    F_g: float | list[float],
    alpha: float | list[float],
    p: float | list[float],
    Lambda: float | list[float],
    k_g: float | list[float],
    theta0: float | list[float],
) -> Array:
    """Give f [C, N] in 1/sr."""
    g = geometry(theta_i, phi_i, theta_o, phi_o)
    a, power = per_channel(alpha), per_channel(p)
    x = a + g.tan2_h / a
    cos4_h = (1 + g.tan2_h) ** -2
    D = normaliser(a, power) * np.exp(-x) / (np.pi * x**power * cos4_h)
    shape = per_channel(Lambda), per_channel(k_g), per_channel(theta0)
    G = masking(g.i, *shape) * masking(g.o, *shape)
    paper_F0, paper_F1 = per_channel(F_g), per_channel(F_g) - per_channel(F0)
    F = paper_F0 - paper_F1 * g.cos_d + (1 - paper_F0) * g.one_minus_cos_d**5
    lobe = F * D * G / (np.pi * g.i[2] * g.o[2])
    return g.where_lit(per_channel(k_d) / np.pi + per_channel(k_s) * lobe)
