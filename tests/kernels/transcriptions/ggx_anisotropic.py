"""GGX with two roughnesses: B. Burley, SIGGRAPH 2012 course notes, appendix B.

Smith's Lambda after E. Heitz, JCGT 3(2), 2014.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from tests.kernels.transcriptions import Array, geometry
from tests.kernels.transcriptions.microfacet import Value, along_axes, microfacet

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
    cos4_h = (1 + g.tan2_h) ** -2
    stretched = (x / alpha_x / z) ** 2 + (y / alpha_y / z) ** 2
    D = 1 / (np.pi * alpha_x * alpha_y * cos4_h * (1 + stretched) ** 2)

    def smith(direction: Array) -> Array:
        x, y, z = along_axes(direction, phi_x)
        return np.asarray((np.sqrt(1 + (alpha_x * x / z) ** 2 + (alpha_y * y / z) ** 2) - 1) / 2)

    return microfacet(
        g, D, smith=smith, masking=masking, fresnel=fresnel, k_d=k_d, k_s=k_s, material=material
    )
