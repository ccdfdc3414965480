"""Beckmann's distribution: B. Walter and others, EGSR 2007, eq. 25.

Smith's Lambda after E. Heitz, JCGT 3(2), 2014.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.special import erfc

from tests.kernels.transcriptions import Array, geometry
from tests.kernels.transcriptions.microfacet import Value, beckmann_d, microfacet

__all__ = ["beckmann_lambda", "brdf"]


def beckmann_lambda(tan: Array) -> Array:
    """Give Lambda where tan is alpha times the tangent of the zenith angle; erfc is double."""
    a = 1 / np.maximum(np.asarray(tan, dtype=np.float64), 1e-3)  # exp(-1e6) is 0 already
    return np.asarray(np.exp(-(a**2)) / (2 * a * np.sqrt(np.pi)) - erfc(a) / 2)


def brdf(
    theta_i: npt.ArrayLike,
    phi_i: npt.ArrayLike,
    theta_o: npt.ArrayLike,
    phi_o: npt.ArrayLike,
    *,
    k_d: Value,
    k_s: Value,
    alpha: float,
    masking: str = "smith_correlated",
    fresnel: str = "schlick",
    **material: Value,
) -> Array:
    """Give f [C, N] in 1/sr."""
    g = geometry(theta_i, phi_i, theta_o, phi_o)
    D = beckmann_d(g.tan2_h / alpha**2, (1 + g.tan2_h) ** -2, alpha**2)

    def smith(direction: Array) -> Array:
        x, y, z = direction
        return beckmann_lambda(alpha * np.sqrt(x**2 + y**2) / z)

    return microfacet(
        g, D, smith=smith, masking=masking, fresnel=fresnel, k_d=k_d, k_s=k_s, material=material
    )
