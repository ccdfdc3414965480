"""Disney's principled model: diffuse and subsurface, metal, sheen and clear coat in one.

Formula
-------
f = (1 - metallic) (base_color/pi ((1 - subsurface) f_d + subsurface f_ss) + F_sheen)
    + D F G / (4 cos_theta_i cos_theta_o) + 0.25 clearcoat D_c F_c G_c / (4 cos_theta_i cos_theta_o)
With s(x) = (1 - cos x)^5 and r = roughness cos^2(theta_d):
f_d = (1 + (2 r - 0.5) s(theta_i)) (1 + (2 r - 0.5) s(theta_o))
f_ss = 1.25 ((1 + (r - 1) s(theta_i)) (1 + (r - 1) s(theta_o))
             (1/(cos_theta_i + cos_theta_o) - 0.5) + 0.5)
F_sheen = sheen (1 - sheen_tint + sheen_tint tint) s(theta_d)
D = GGX with alpha_x = max(0.001, roughness^2/a), alpha_y = max(0.001, roughness^2 a),
    a = sqrt(1 - 0.9 anisotropic), x at the azimuth phi_x
F = C + (1 - C) s(theta_d),
C = metallic base_color + (1 - metallic) 0.08 specular (1 - specular_tint + specular_tint tint)
D_c = (b^2 - 1) / (pi ln(b^2) (1 + (b^2 - 1) cos^2(theta_h))), b from 0.1 to 0.001 with
    clearcoat_gloss;  F_c = 0.04 + 0.96 s(theta_d);  G_c: Smith's for GGX of alpha = 0.25
G: Smith's for GGX, separable. Option `masking`: `burley2012` (the default), one alpha of
(0.5 + roughness/2)^2 for both axes; `burley2014`, the lobe's own alpha_x and alpha_y.

Convention
----------
base_color is linear, not gamma-encoded. tint is the paper's C_tint, base_color over its
luminance, and here a number of its own per channel: f is linear in base_color and in tint.
There is no further diffuse term. `burley2012` is what the course notes of 2012 describe; the
addendum of 2014 dropped the remapping, and Disney's BRDF Explorer now evaluates `burley2014`.

Domain
------
All from 0 to 1 but tint (0 to 10, which a saturated blue reaches) and the azimuth phi_x of the
wider axis. Energy is not conserved: sheen and clear coat are added on top, and the diffuse term
alone gives out 1.40 at 85 degrees for roughness 1. Eleven nonlinear numbers are more than a
measurement determines, so the full form is fitted only where it is named. Variants:
`disney_principled:plastic` leaves base_color, specular and roughness, and
`disney_principled:metal` base_color and roughness.

Source
------
B. Burley, Physically-based shading at Disney, course notes of SIGGRAPH 2012, sections 5.3 to
5.6 and appendix B; B. Burley, Extending the Disney BRDF to a BSDF, SIGGRAPH 2015 course notes
(the addendum on masking). C. Schlick, 1994.

Verified against
----------------
50-digit arithmetic, with both maskings; the diffuse term's albedo of 1.40 at 85 degrees;
`ggx` for a metal; Mitsuba 3.9.1 (`principled`) with `burley2014`: metal, also anisotropic,
diffuse term and subsurface (its `flatness`) agree to 5e-7. Mitsuba's dielectric has an exact
Fresnel term, and its clear coat is 4 cos_theta_i cos_theta_o times this one.
"""

from __future__ import annotations

import math

from lobefit.kernels.library import Lobe, Parameter, Reference, Variant

__all__ = ["LOBE"]


def _share(name: str, meaning: str, default: float, nodes: int = 2) -> Parameter:
    """Give a parameter from 0 to 1, as most are here."""
    return Parameter(
        name=name, unit="1", meaning=meaning, bounds=(0.0, 1.0), default=default, nodes=nodes
    )


# What the variants leave out.
_PLAIN = {
    "tint": 1.0,
    "subsurface": 0.0,
    "specular_tint": 0.0,
    "anisotropic": 0.0,
    "sheen": 0.0,
    "sheen_tint": 0.0,
    "clearcoat": 0.0,
    "clearcoat_gloss": 1.0,
    "phi_x": 0.0,
}

LOBE = Lobe(
    name="disney_principled",
    title="Disney principled 2012 (Burley)",
    convention="N = 4, normalised D; linear base_color, tint a number of its own",
    source="Burley 2012, sections 5.3 to 5.6",
    energy="not conserved: the diffuse term gains at grazing, sheen and clear coat are added to it",
    parameters=(
        Parameter(
            name="base_color",
            unit="1",
            meaning="albedo of the dielectric, F0 of the metal",
            bounds=(0.0, 1.0),
            default=0.5,
            linear=True,
            per_channel=True,
        ),
        Parameter(
            name="tint",
            unit="1",
            meaning="base_color over its luminance; acts with specular_tint and sheen_tint",
            bounds=(0.0, 10.0),
            default=1.0,
            linear=True,
            per_channel=True,
        ),
        _share("metallic", "0 a dielectric, 1 a metal", 0.0),
        _share("subsurface", "from the diffuse term to its flatter subsurface form", 0.0),
        _share("specular", "F0 of the dielectric over 0.08", 0.5),
        _share("specular_tint", "how far tint colours the dielectric's F0", 0.0),
        _share("roughness", "square root of alpha, and shape of the diffuse term", 0.5, nodes=4),
        _share("anisotropic", "alpha_y / alpha_x = 1 - 0.9 anisotropic", 0.0),
        _share("sheen", "strength of the rise at grazing of cloth", 0.0),
        _share("sheen_tint", "how far tint colours the sheen", 0.5),
        _share("clearcoat", "strength of a clear coat of index 1.5", 0.0),
        _share("clearcoat_gloss", "0 a satin coat, 1 a glossy one", 1.0),
        Parameter(
            name="phi_x",
            unit="rad",
            meaning="azimuth of the wider axis",
            bounds=(0.0, math.pi),
            default=0.0,
            period=math.pi,
            nodes=2,
        ),
    ),
    coefficients=(("base_color",), ("tint",), ()),
    reciprocal=True,
    isotropic=False,
    diffuse=False,
    sets=(),
    uses=("axes.h", "fresnel.h", "masking.h"),
    options={"masking": ("burley2012", "burley2014")},
    variants=(
        Variant(name="plastic", fixed={**_PLAIN, "metallic": 0.0}, sets=("all",)),
        Variant(name="metal", fixed={**_PLAIN, "metallic": 1.0, "specular": 0.5}, sets=("all",)),
    ),
    references=(
        Reference(
            params={"base_color": 0.5},
            theta_i=30,
            phi_i=0,
            theta_o=40,
            phi_o=180,
            value=0.2167275938866897,
            source="the formula in 50-digit arithmetic (mpmath)",
        ),
        Reference(
            params={
                "base_color": 0.7,
                "tint": 1.4,
                "metallic": 0.3,
                "subsurface": 0.4,
                "specular": 0.6,
                "specular_tint": 0.3,
                "roughness": 0.35,
                "anisotropic": 0.8,
                "sheen": 0.5,
                "sheen_tint": 0.6,
                "clearcoat": 0.7,
                "clearcoat_gloss": 0.9,
                "phi_x": 0.4,
            },
            theta_i=75,
            phi_i=10,
            theta_o=70,
            phi_o=195,
            value=0.7189005717690215,
            source="the formula in 50-digit arithmetic (mpmath)",
        ),
        Reference(
            params={
                "base_color": 0.2,
                "tint": 0.6,
                "metallic": 0.1,
                "subsurface": 1.0,
                "specular": 1.0,
                "specular_tint": 1.0,
                "roughness": 0.8,
                "anisotropic": 0.5,
                "sheen": 1.0,
                "sheen_tint": 0.2,
                "clearcoat": 1.0,
                "clearcoat_gloss": 0.3,
                "phi_x": 2.5,
            },
            theta_i=60,
            phi_i=20,
            theta_o=45,
            phi_o=170,
            value=0.08083482108691912,
            source="the formula in 50-digit arithmetic (mpmath)",
        ),
        Reference(
            params={
                "base_color": 0.7,
                "tint": 1.4,
                "metallic": 0.3,
                "subsurface": 0.4,
                "specular": 0.6,
                "specular_tint": 0.3,
                "roughness": 0.35,
                "anisotropic": 0.8,
                "sheen": 0.5,
                "sheen_tint": 0.6,
                "clearcoat": 0.7,
                "clearcoat_gloss": 0.9,
                "phi_x": 0.4,
            },
            options={"masking": "burley2014"},
            theta_i=75,
            phi_i=10,
            theta_o=70,
            phi_o=195,
            value=0.9008697171171779,
            source="the formula in 50-digit arithmetic (mpmath)",
        ),
    ),
)
