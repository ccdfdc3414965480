"""Torrance-Sparrow: K. Torrance, E. Sparrow, JOSA 57(9), 1967; V-cavities.

The Gaussian of the facet angle is normalised so that the integral of D n.h is 1, by the error
function of a complex argument: sin(2 t) is the imaginary part of exp(2 i t).
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.special import erf

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
    masking: str = "v_cavity",
    fresnel: str = "schlick",
    **material: Value,
) -> Array:
    """Give f [C, N] in 1/sr."""
    g = geometry(theta_i, phi_i, theta_o, phi_o)
    theta_h = np.arctan(np.sqrt(g.tan2_h))
    ends = erf(np.pi / 2 / alpha - 1j * alpha) - erf(-1j * alpha)
    integral = np.pi * alpha * np.exp(-(alpha**2)) * np.sqrt(np.pi) / 2 * ends.imag
    D = np.exp(-((theta_h / alpha) ** 2)) / integral
    return microfacet(
        g, D, smith=no_lambda, masking=masking, fresnel=fresnel, k_d=k_d, k_s=k_s, material=material
    )
