"""GGX: B. Walter and others, EGSR 2007, eq. 33, after Trowbridge and Reitz, JOSA 65 (1975).

Smith's Lambda after E. Heitz, JCGT 3(2), 2014, eq. 72.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from tests.kernels.transcriptions import Array, geometry
from tests.kernels.transcriptions.microfacet import Value, microfacet

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
    k_d: Value,
    k_s: Value,
    alpha: float,
    masking: str = "smith_correlated",
    fresnel: str = "schlick",
    **material: Value,
) -> Array:
    """Give f [C, N] in 1/sr."""
    g = geometry(theta_i, phi_i, theta_o, phi_o)
    cos4_h = (1 + g.tan2_h) ** -2
    D = 1 / (np.pi * alpha**2 * cos4_h * (1 + g.tan2_h / alpha**2) ** 2)
    return microfacet(
        g,
        D,
        smith=lambda v: smith_lambda(v, alpha),
        masking=masking,
        fresnel=fresnel,
        k_d=k_d,
        k_s=k_s,
        material=material,
    )
