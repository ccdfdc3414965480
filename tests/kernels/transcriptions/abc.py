"""ABC for smooth surfaces: J. Low and others, ACM TOG 31(1), 2012, eq. 10, 12 and 14.

f = k_d / pi + A F / (1 + B |i_xy + o_xy|^2)^C, with Fresnel's F of a dielectric at the angle
whose sine is |i_xy - o_xy| / 2.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from tests.kernels.transcriptions import Array, geometry, per_channel
from tests.kernels.transcriptions.abc_microfacet import fresnel

__all__ = ["brdf"]


def brdf(
    theta_i: npt.ArrayLike,
    phi_i: npt.ArrayLike,
    theta_o: npt.ArrayLike,
    phi_o: npt.ArrayLike,
    *,
    k_d: float | list[float],
    A: float | list[float],
    B: float,
    C: float,
    eta: float,
) -> Array:
    """Give f [C, N] in 1/sr."""
    g = geometry(theta_i, phi_i, theta_o, phi_o)
    distance2 = np.sum((g.i[:2] + g.o[:2]) ** 2, axis=0)
    # 1 - |i_xy - o_xy|^2 / 4 by the parallelogram law, which does not cancel at grazing.
    cos_d = np.sqrt((g.i[2] ** 2 + g.o[2] ** 2) / 2 + distance2 / 4)
    lobe = fresnel(cos_d, eta) / (1 + B * distance2) ** C
    return g.where_lit(per_channel(k_d) / np.pi + per_channel(A) * lobe)
