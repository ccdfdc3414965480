"""Beckmann's distribution with two roughnesses: B. Walter and others, EGSR 2007, eq. 25.

Smith's Lambda sees the roughness along the direction: E. Heitz, JCGT 3(2), 2014.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from tests.kernels.transcriptions import Array, geometry
from tests.kernels.transcriptions.beckmann import beckmann_lambda
from tests.kernels.transcriptions.microfacet import Value, along_axes, beckmann_d, microfacet

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
    masking: str = "smith_correlated",
    fresnel: str = "schlick",
    **material: Value,
) -> Array:
    """Give f [C, N] in 1/sr."""
    g = geometry(theta_i, phi_i, theta_o, phi_o)
    x, y, z = along_axes(g.H, phi_x)
    stretched = (x / alpha_x / z) ** 2 + (y / alpha_y / z) ** 2
    D = beckmann_d(stretched, (1 + g.tan2_h) ** -2, alpha_x * alpha_y)

    def smith(direction: Array) -> Array:
        x, y, z = along_axes(direction, phi_x)
        return beckmann_lambda(np.hypot(alpha_x * x, alpha_y * y) / z)

    return microfacet(
        g, D, smith=smith, masking=masking, fresnel=fresnel, k_d=k_d, k_s=k_s, material=material
    )
