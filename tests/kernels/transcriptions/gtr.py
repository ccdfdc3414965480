"""GTR: B. Burley, SIGGRAPH 2012 course notes, appendix B; V-cavities."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from tests.kernels.transcriptions import Array, geometry
from tests.kernels.transcriptions.microfacet import Value, microfacet, no_lambda

__all__ = ["brdf"]


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
    masking: str = "v_cavity",
    fresnel: str = "schlick",
    **material: Value,
) -> Array:
    """Give f [C, N] in 1/sr."""
    g = geometry(theta_i, phi_i, theta_o, phi_o)
    exact = np.longdouble(alpha)
    # 1 + (alpha^2 - 1) cos^2, with cos^2 = 1 / (1 + tan^2)
    q = (exact**2 + g.tan2_h) / (1 + g.tan2_h)
    below_1, log_alpha2 = (exact - 1) * (exact + 1), 2 * np.log1p(exact - 1)
    if alpha == 1:
        norm = np.longdouble(1)
    elif gamma == 1:
        norm = below_1 / log_alpha2
    else:
        exponent = np.longdouble(gamma) - 1
        norm = exponent * below_1 / -np.expm1(-exponent * log_alpha2)
    D = norm / np.pi * q ** -np.longdouble(gamma)
    return microfacet(
        g, D, smith=no_lambda, masking=masking, fresnel=fresnel, k_d=k_d, k_s=k_s, material=material
    )
