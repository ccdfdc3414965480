"""EON: Portsmouth, Kutz, Hill, JCGT 14(1), 2025, with the exact albedo of the FON term.

f = rho / pi A_F (1 + r s/t) + rho_ms / pi (1 - E(n.o)) (1 - E(n.i)) / (1 - <E>), s = i.o - n.i n.o,
t = max(n.i, n.o) where s > 0 and 1 elsewhere, rho_ms = rho^2 <E> / (1 - rho (1 - <E>)).
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from tests.kernels.transcriptions import Array, geometry, per_channel

__all__ = ["brdf", "fujii_albedo"]


def fujii_albedo(cosine: Array, r: float) -> Array:
    """Directional albedo E_F [N] of the FON term with rho = 1."""
    S = np.sqrt(1 - cosine**2)
    A = 1 / (1 + (1 / 2 - 2 / (3 * np.pi)) * r)
    wide = S * (np.arccos(cosine) - S * cosine)
    tail = 2 / 3 * ((S / cosine) * (1 - S**3) - S)
    return np.asarray(A + r * A / np.pi * (wide + tail))


def brdf(
    theta_i: npt.ArrayLike,
    phi_i: npt.ArrayLike,
    theta_o: npt.ArrayLike,
    phi_o: npt.ArrayLike,
    *,
    rho: float | list[float],
    r: float,
) -> Array:
    """Give f [C, N] in 1/sr."""
    g = geometry(theta_i, phi_i, theta_o, phi_o)
    albedo = per_channel(rho)
    A = 1 / (1 + (1 / 2 - 2 / (3 * np.pi)) * r)
    s = np.sum(g.i[:2] * g.o[:2], axis=0)
    t = np.where(s > 0, np.maximum(g.i[2], g.o[2]), 1)
    mean = A * (1 + (2 / 3 - 28 / (15 * np.pi)) * r)
    rho_ms = albedo**2 * mean / (1 - albedo * (1 - mean))
    lost = (1 - fujii_albedo(g.i[2], r)) * (1 - fujii_albedo(g.o[2], r))
    # r = 0 loses nothing, and the ratio of what is lost would be 0/0.
    returned = rho_ms * lost / (1 - mean) if mean < 1 else 0 * lost
    return g.where_lit((albedo * A * (1 + r * s / t) + returned) / np.pi)
