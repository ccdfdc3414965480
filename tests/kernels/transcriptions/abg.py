"""ABg: E. Fest, Stray Light Analysis and Control, SPIE Press 2013, after J. Harvey 1976.

f = k_d / pi + A / (B + |beta - beta_0|^g), beta and beta_0 the tangential components of the
direction to the eye and of the mirror direction. The distance counts as 1e-12 at least.
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
    A: float | list[float],
    B: float,
    g: float,
) -> Array:
    """Give f [C, N] in 1/sr."""
    pair = geometry(theta_i, phi_i, theta_o, phi_o)
    beta_0 = -pair.i[:2]
    distance = np.maximum(np.hypot(*(pair.o[:2] - beta_0)), 1e-12)
    return pair.where_lit(per_channel(k_d) / np.pi + per_channel(A) / (B + distance**g))
