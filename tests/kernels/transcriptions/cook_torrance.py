"""Cook-Torrance: R. Cook, K. Torrance, ACM Transactions on Graphics 1(1), 1982.

Beckmann's D is normalised so that the integral of D n.h is 1 (Walter and others, EGSR 2007,
eq. 25); V-cavities and no other masking.
"""

from __future__ import annotations

import numpy.typing as npt

from tests.kernels.transcriptions import Array, geometry
from tests.kernels.transcriptions.microfacet import (
    Value,
    beckmann_d,
    microfacet,
    no_lambda,
    v_cavity,
)

__all__ = ["brdf", "v_cavity"]


def brdf(
    theta_i: npt.ArrayLike,
    phi_i: npt.ArrayLike,
    theta_o: npt.ArrayLike,
    phi_o: npt.ArrayLike,
    *,
    k_d: Value,
    k_s: Value,
    alpha: float,
    fresnel: str = "schlick",
    **material: Value,
) -> Array:
    """Give f [C, N] in 1/sr."""
    g = geometry(theta_i, phi_i, theta_o, phi_o)
    D = beckmann_d(g.tan2_h / alpha**2, (1 + g.tan2_h) ** -2, alpha**2)
    return microfacet(
        g,
        D,
        smith=no_lambda,
        masking="v_cavity",
        fresnel=fresnel,
        k_d=k_d,
        k_s=k_s,
        material=material,
    )
