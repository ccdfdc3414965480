"""Mirror through an aperture: the mean BRDF of F. Nicodemus and others, NBS Monograph 160.

f = k_d / pi + k_s / (Omega n.o) where the angle between o and the mirror direction of i is
below the aperture, with the cone's solid angle Omega = 2 pi (1 - cos(aperture)).
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
    k_s: float | list[float],
    aperture: float,
) -> Array:
    """Give f [C, N] in 1/sr."""
    g = geometry(theta_i, phi_i, theta_o, phi_o)
    mirrored = g.i * np.array([-1.0, -1.0, 1.0])[:, np.newaxis]
    # By the chord, as the cosine has no digits at a small angle.
    chord = np.sqrt(np.sum((g.o - mirrored) ** 2, axis=0))
    angle = 2 * np.arcsin(np.minimum(chord / 2, 1))
    solid_angle = 4 * np.pi * np.sin(aperture / 2) ** 2
    lobe = np.where(angle < aperture, 1 / (solid_angle * g.o[2]), 0)
    return g.where_lit(per_channel(k_d) / np.pi + per_channel(k_s) * lobe)
