"""What the microfacet models share: f = k_d / pi + k_s D G F / (4 n.i n.o), N = 4.

G and F are chosen by the names that the models' options have. The conductor is worked out in
complex numbers and the dielectric from Snell's law, as in M. Born, E. Wolf, Principles of
Optics, sections 1.5.2 and 14.2.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from tests.kernels.transcriptions import Array, Geometry, per_channel

__all__ = [
    "Value",
    "along_axes",
    "beckmann_d",
    "fresnel_term",
    "masking_term",
    "microfacet",
    "no_lambda",
    "v_cavity",
]

Value = float | list[float]
# Smith's Lambda [N] of unit directions [3, N].
Lambda = Callable[[Array], Array]


def along_axes(vector: Array, phi_x: float) -> Array:
    """Give the components of vectors [3, N] along the axis at phi_x, across it, and up."""
    x, y, z = vector
    # Cosine and sine are rounded to the vectors' precision, not to that of phi_x.
    cos, sin = (f(np.asarray(phi_x, dtype=x.dtype)) for f in (np.cos, np.sin))
    return np.stack([cos * x + sin * y, cos * y - sin * x, z])


def no_lambda(direction: Array) -> Array:
    """Stand for Smith's Lambda of a distribution that has none in closed form."""
    raise NotImplementedError


def beckmann_d(tan2: Array, cos4: Array, widths: float) -> Array:
    """Give Beckmann's D, where tan2 has been divided by the squares of the widths."""
    return np.asarray(np.exp(-tan2) / (np.pi * widths * cos4))


def v_cavity(g: Geometry) -> Array:
    """Give G [N]: with h = H/|H| and i.h = |H|/2, 2 n.h n.i / i.h is 4 Hz n.i / |H|^2."""
    cavity = 4 * g.H[2] / g.H2
    return np.asarray(np.minimum(1, cavity * np.minimum(g.i[2], g.o[2])))


def masking_term(masking: str, g: Geometry, smith: Lambda) -> Array:
    """Give G [N]: Smith's as in Heitz, JCGT 3(2), 2014, or Torrance and Sparrow's V-cavities."""
    if masking == "v_cavity":
        return v_cavity(g)
    lambda_i, lambda_o = smith(g.i), smith(g.o)
    if masking == "smith_separable":
        return 1 / ((1 + lambda_i) * (1 + lambda_o))
    assert masking == "smith_correlated"
    return 1 / (1 + lambda_i + lambda_o)


def fresnel_term(fresnel: str, g: Geometry, material: dict[str, Value]) -> Array:
    """Give F [C, N], or [1, N], from the parameters that this Fresnel term has."""
    values = {name: per_channel(value) for name, value in material.items()}
    terms: dict[str, Callable[..., Array]] = {
        "none": lambda g: np.ones((1, g.lit.size)),
        "schlick": _schlick,
        "dielectric": _dielectric,
        "conductor": _conductor,
        "f82": _f82,
    }
    return terms[fresnel](g, **values)


def microfacet(
    g: Geometry,
    D: Array,
    *,
    smith: Lambda,
    masking: str,
    fresnel: str,
    k_d: Value,
    k_s: Value,
    material: dict[str, Value],
) -> Array:
    """Give f [C, N] in 1/sr."""
    lobe = D * masking_term(masking, g, smith) / (4 * g.i[2] * g.o[2])
    F = fresnel_term(fresnel, g, material)
    return g.where_lit(per_channel(k_d) / np.pi + per_channel(k_s) * F * lobe)


def _sin2_d(g: Geometry) -> Array:
    return np.asarray(np.sum((g.i - g.o) ** 2, axis=0) / 4)


def _schlick(g: Geometry, F0: Array) -> Array:
    return F0 + (1 - F0) * g.one_minus_cos_d**5


def _dielectric(g: Geometry, eta: Array) -> Array:
    c = g.cos_d
    refracted = np.sqrt(1 - _sin2_d(g) / eta**2)
    r_s = (c - eta * refracted) / (c + eta * refracted)
    r_p = (eta * c - refracted) / (eta * c + refracted)
    return np.asarray((r_s**2 + r_p**2) / 2)


def _conductor(g: Geometry, eta: Array, k: Array) -> Array:
    c = g.cos_d
    index = eta.astype(np.result_type(c, np.complex128)) + 1j * k
    # The branch that is damped inside, k = 0 beyond the critical angle included.
    refracted = np.sqrt(1 - _sin2_d(g) / index**2)
    r_s = (c - index * refracted) / (c + index * refracted)
    r_p = (index * c - refracted) / (index * c + refracted)
    return np.asarray((np.abs(r_s) ** 2 + np.abs(r_p) ** 2) / 2)


def _f82(g: Geometry, F0: Array, F82: Array) -> Array:
    """Schlick's term less b c (1 - c)^6, b such that the value at c = 1/7 is F82."""
    at = 1 / np.longdouble(7)
    b = (F0 + (1 - F0) * (1 - at) ** 5 - F82) / (at * (1 - at) ** 6)
    lacking = b * g.cos_d * g.one_minus_cos_d**6
    return np.clip(_schlick(g, F0) - lacking, 0, 1)
