"""Harvey-Shack: J. Harvey, University of Arizona 1976, in its form of three parameters.

f = k_d / pi + b (1 + (|beta - beta_0| / l)^2)^(s/2), beta and beta_0 the tangential
components of the direction to the eye and of the mirror direction.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from tests.kernels.transcriptions import Array, geometry, per_channel

__all__ = ["brdf"]


def brdf(
    theta_i: npt.ArrayLike,
    phi_i: npt.ArrayLike,
    theta_o: npt.ArrayLike,
    phi_o: npt.ArrayLike,
    *,
    k_d: float | list[float],
    b: float | list[float],
    l: float,
    s: float,
) -> Array:
    """Give f [C, N] in 1/sr."""
    g = geometry(theta_i, phi_i, theta_o, phi_o)
    beta_0 = -g.i[:2]
    distance = np.hypot(*(g.o[:2] - beta_0))
    lobe = (1 + (distance / l) ** 2) ** (s / 2)
    return g.where_lit(per_channel(k_d) / np.pi + per_channel(b) * lobe)
