"""Blinn's microfacets: J. Blinn, SIGGRAPH 1977; B. Walter and others, EGSR 2007, eq. 30."""

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
    n: float,
    masking: str = "v_cavity",
    fresnel: str = "schlick",
    **material: Value,
) -> Array:
    """Give f [C, N] in 1/sr."""
    g = geometry(theta_i, phi_i, theta_o, phi_o)
    # n.h = 1 / sqrt(1 + tan^2), whose logarithm keeps its digits for the largest exponents.
    D = (n + 2) / (2 * np.pi) * np.exp(-n / 2 * np.log1p(g.tan2_h))
    return microfacet(
        g, D, smith=no_lambda, masking=masking, fresnel=fresnel, k_d=k_d, k_s=k_s, material=material
    )
