"""Student's t distribution of slopes: M. Ribardiere and others, CGF 36(2), 2017.

Smith's Lambda from its definition in E. Heitz, JCGT 3(2), 2014: the mean of q - mu over the
slopes q beyond mu, divided by mu. q along a direction has Student's t distribution with
2 gamma - 2 degrees of freedom, the integral of q P(q) closes, and that of P(q) is an incomplete
beta function, which scipy has in double.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.special import betainc, poch

from tests.kernels.transcriptions import Array, geometry
from tests.kernels.transcriptions.microfacet import Value, microfacet

__all__ = ["brdf", "smith_lambda"]


def smith_lambda(direction: Array, alpha: float, gamma: float) -> Array:
    """Give Lambda [N] of unit directions [3, N]."""
    x, y, z = direction
    s2 = (gamma - 1) * alpha**2
    # 1e-100: a direction along the normal, where nothing is hidden
    tan2 = np.maximum(np.asarray((x**2 + y**2) / z**2, dtype=np.float64), 1e-100)
    m2 = 1 / (s2 * tan2)
    density = poch(gamma - 1, 0.5) / np.sqrt(np.pi)
    mean = density * (1 + m2) ** (1.5 - gamma) / ((2 * gamma - 3) * np.sqrt(m2))
    return np.asarray(mean - betainc(gamma - 1, 0.5, 1 / (1 + m2)) / 2)


def brdf(
    theta_i: npt.ArrayLike,
    phi_i: npt.ArrayLike,
    theta_o: npt.ArrayLike,
    phi_o: npt.ArrayLike,
    *,
    k_d: Value,
    k_s: Value,
    alpha: float,
    gamma: float,
    masking: str = "smith_correlated",
    fresnel: str = "schlick",
    **material: Value,
) -> Array:
    """Give f [C, N] in 1/sr."""
    g = geometry(theta_i, phi_i, theta_o, phi_o)
    cos4_h = (1 + g.tan2_h) ** -2
    D = (1 + g.tan2_h / ((gamma - 1) * alpha**2)) ** -gamma / (np.pi * alpha**2 * cos4_h)
    return microfacet(
        g,
        D,
        smith=lambda v: smith_lambda(v, alpha, gamma),
        masking=masking,
        fresnel=fresnel,
        k_d=k_d,
        k_s=k_s,
        material=material,
    )
