"""Disney's principled model: B. Burley, Physically-based shading at Disney, SIGGRAPH 2012 course.

Diffuse term with the subsurface approximation (section 5.3), sheen (5.4), GTR-2 with two
roughnesses and a tinted Schlick F (5.4, B.2), and the GTR-1 clear coat. Masking is Smith's for
GGX with the roughness (0.5 + roughness/2)^2 (5.5).
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from tests.kernels.transcriptions import Array, Geometry, geometry, per_channel

__all__ = ["brdf", "smith_G1"]


def mix(a: Array | float, b: Array | float, share: Array | float) -> Array:
    """Go from a to b."""
    return np.asarray((1 - share) * a + share * b)


def smith_G1(direction: Array, alpha_g: float) -> Array:
    """Give G1 [N] of unit directions [3, N] for GGX of roughness alpha_g."""
    x, y, z = direction
    return np.asarray(2 / (1 + np.sqrt(1 + alpha_g**2 * (x**2 + y**2) / z**2)))


def gtr1(g: Geometry, alpha: float) -> Array:
    """Berry's distribution, normalised; (alpha^2 - 1) cos^2 + 1 by the tangent of theta_h."""
    return np.asarray(
        (alpha**2 - 1) / (np.pi * np.log(alpha**2)) * (1 + g.tan2_h) / (alpha**2 + g.tan2_h)
    )


def gtr2(g: Geometry, alpha_x: float, alpha_y: float, phi_x: float) -> Array:
    """GGX with two roughnesses, x at the azimuth phi_x."""
    along = np.array([np.cos(phi_x), np.sin(phi_x), 0.0]) @ g.H / g.H[2]
    across = np.array([-np.sin(phi_x), np.cos(phi_x), 0.0]) @ g.H / g.H[2]
    cos2_h = 1 / (1 + g.tan2_h)
    bracket = cos2_h * ((along / alpha_x) ** 2 + (across / alpha_y) ** 2 + 1)
    return np.asarray(1 / (np.pi * alpha_x * alpha_y * bracket**2))


def brdf(
    theta_i: npt.ArrayLike,
    phi_i: npt.ArrayLike,
    theta_o: npt.ArrayLike,
    phi_o: npt.ArrayLike,
    *,
    base_color: float | list[float],
    tint: float | list[float],
    metallic: float,
    subsurface: float,
    specular: float,
    specular_tint: float,
    roughness: float,
    anisotropic: float,
    sheen: float,
    sheen_tint: float,
    clearcoat: float,
    clearcoat_gloss: float,
    phi_x: float,
    masking: str = "burley2012",
) -> Array:
    """Give f [C, N] in 1/sr."""
    g = geometry(theta_i, phi_i, theta_o, phi_o)
    n_i, n_o = g.i[2], g.o[2]
    color, hue = per_channel(base_color), per_channel(tint)
    F_i, F_o, F_h = (1 - n_i) ** 5, (1 - n_o) ** 5, g.one_minus_cos_d**5

    F_d90 = 0.5 + 2 * g.cos_d**2 * roughness
    F_d = mix(1.0, F_d90, F_i) * mix(1.0, F_d90, F_o)
    F_ss90 = g.cos_d**2 * roughness
    F_ss = mix(1.0, F_ss90, F_i) * mix(1.0, F_ss90, F_o)
    subsurface_value = 1.25 * (F_ss * (1 / (n_i + n_o) - 0.5) + 0.5)
    diffuse = color / np.pi * mix(F_d, subsurface_value, subsurface)
    fabric = F_h * sheen * mix(1.0, hue, sheen_tint)

    aspect = np.sqrt(1 - 0.9 * anisotropic)
    alpha_x = max(0.001, roughness**2 / aspect)
    alpha_y = max(0.001, roughness**2 * aspect)
    F0 = mix(0.08 * specular * mix(1.0, hue, specular_tint), color, metallic)
    if masking == "burley2012":
        alpha_g = (0.5 + roughness / 2) ** 2
        G = smith_G1(g.i, alpha_g) * smith_G1(g.o, alpha_g)
    else:  # the addendum of 2014: the lobe's own roughnesses
        c, s = np.cos(phi_x), np.sin(phi_x)
        stretch = np.array(
            [[alpha_x * c, alpha_x * s, 0], [-alpha_y * s, alpha_y * c, 0], [0, 0, 1]]
        )
        G = smith_G1(stretch @ g.i, 1.0) * smith_G1(stretch @ g.o, 1.0)
    lobe = gtr2(g, alpha_x, alpha_y, phi_x) * mix(F0, 1.0, F_h) * G / (4 * n_i * n_o)

    G_coat = smith_G1(g.i, 0.25) * smith_G1(g.o, 0.25)
    D_coat = gtr1(g, mix(0.1, 0.001, clearcoat_gloss).item())
    coat = 0.25 * clearcoat * D_coat * mix(0.04, 1.0, F_h) * G_coat / (4 * n_i * n_o)
    return g.where_lit((diffuse + fabric) * (1 - metallic) + lobe + coat)
