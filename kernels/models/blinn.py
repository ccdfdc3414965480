"""Blinn: a cosine power of the facet angle, V-cavities, a Fresnel term by choice.

Formula
-------
f = k_d/pi + k_s D G F / (4 cos_theta_i cos_theta_o)
D = (n + 2)/(2 pi) cos^n(theta_h)
G = min(1, 2 cos_theta_h cos_theta_i/cos_theta_d, 2 cos_theta_h cos_theta_o/cos_theta_d)
F = F0 + (1 - F0)(1 - cos_theta_d)^5
Option `masking`: `v_cavity` only, since Smith's masking of this D has no closed form. Option
`fresnel`: `schlick` (above, the default), `none`, `dielectric`, `conductor`, `f82`; see `ggx`.

Convention
----------
"N = 4": D is normalised (the integral of D cos_theta_h is 1) and the denominator is 4.
`blinn_phong` has the same D without masking, Fresnel term and cosines.

Domain
------
n from 1 to 1e6; n is about 2/alpha^2 - 2 of `cook_torrance`, which it is close to.

Source
------
J. F. Blinn, Models of light reflection for computer synthesized pictures, SIGGRAPH 1977;
normalisation and denominator of B. Walter et al., EGSR 2007, eq. 20 and 30; C. Schlick,
1994, eq. 15.

Verified against
----------------
50-digit arithmetic and the integral of D cos_theta_h by quadrature.
"""

from __future__ import annotations

from lobefit.kernels.library import Lobe, Parameter, Reference, Variant
from lobefit.kernels.shared_options import FRESNEL, FRESNEL_CHOICES
from lobefit.kernels.shared_parameters import K_S

__all__ = ["LOBE"]

LOBE = Lobe(
    name="blinn",
    title="Blinn's microfacets: cosine power, V-cavity",
    convention="N = 4, normalised D: k_s D G F / (4 cos_theta_i cos_theta_o)",
    source="Blinn 1977; Walter et al. 2007, eq. 20, 30",
    energy="conserves energy for k_d + k_s <= 1",
    parameters=(
        K_S,
        Parameter(
            name="n",
            unit="1",
            meaning="exponent; about 2/alpha^2 of Beckmann's distribution",
            bounds=(1.0, 1e6),
            default=50.0,
            scale="log",
            nodes=64,
        ),
    ),
    coefficients=(("k_s",),),
    reciprocal=True,
    isotropic=True,
    sets=("all",),
    uses=("fresnel.h", "masking.h"),
    options={"masking": ("v_cavity",), "fresnel": FRESNEL},
    choices=FRESNEL_CHOICES,
    variants=(Variant(name="k_s=1", fixed={"k_s": 1.0}),),
    references=(
        Reference(
            params={"k_d": 0.2, "k_s": 1.0, "F0": 0.04, "n": 20.0},
            theta_i=30,
            phi_i=0,
            theta_o=40,
            phi_o=180,
            value=0.11279284189454,
            source="the formula in 50-digit arithmetic (mpmath)",
        ),
        Reference(
            params={"k_d": 0.0, "k_s": 1.0, "F0": 0.9, "n": 200.0},
            theta_i=75,
            phi_i=10,
            theta_o=70,
            phi_o=195,
            value=10.37059960543013,
            source="the formula in 50-digit arithmetic (mpmath)",
        ),
        Reference(
            params={"k_d": 0.1, "k_s": 0.5, "F0": 0.5, "n": 5.0},
            theta_i=60,
            phi_i=20,
            theta_o=45,
            phi_o=170,
            value=0.177801184400687,
            source="the formula in 50-digit arithmetic (mpmath)",
        ),
    ),
)
