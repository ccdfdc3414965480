"""Beckmann's distribution of slopes, Smith masking; masking and Fresnel term by choice.

Formula
-------
f = k_d/pi + k_s D G F / (4 cos_theta_i cos_theta_o)
D = exp(-tan^2(theta_h)/alpha^2) / (pi alpha^2 cos^4(theta_h))
G = 1 / (1 + L(theta_i) + L(theta_o))
L = (erf(a) - 1)/2 + exp(-a^2)/(2 a sqrt(pi)),  a = 1/(alpha tan(theta))
F = F0 + (1 - F0)(1 - cos_theta_d)^5
Options `masking`: `smith_correlated` (above, the default), `smith_separable`, `v_cavity`;
`fresnel`: `schlick` (above, the default), `none`, `dielectric`, `conductor`, `f82`; see `ggx`.

Convention
----------
"N = 4": D is normalised (the integral of D cos_theta_h is 1) and the denominator is 4.

Domain
------
alpha from 1e-4 to 2. Gaussian slopes: the lobe falls off fast. Many polished and painted surfaces have longer
tails (`ggx`). alpha is the RMS slope times sqrt(2).

Source
------
P. Beckmann, A. Spizzichino, 1963; B. Walter et al., Microfacet models for refraction,
EGSR 2007, eq. 25; E. Heitz, JCGT 3(2), 2014, eq. 72, 83, 99.

Verified against
----------------
Directional albedos by independent quadrature (0.86936 at 60 degrees for alpha = 0.5),
Mitsuba 3.9.1 (`roughconductor`, whose G1 is a rational approximation), 50-digit arithmetic.
"""

from __future__ import annotations

from lobefit.kernels.library import Lobe, Parameter, Reference, Variant
from lobefit.kernels.shared_options import FRESNEL, FRESNEL_CHOICES, MASKING
from lobefit.kernels.shared_parameters import K_S

__all__ = ["LOBE"]

LOBE = Lobe(
    name="beckmann",
    title="Beckmann's distribution of slopes, Smith masking",
    convention="N = 4, normalised D: k_s D G F / (4 cos_theta_i cos_theta_o)",
    source="Walter et al. 2007, eq. 25; Heitz 2014, eq. 72, 99",
    energy="conserves energy for k_d + k_s <= 1",
    parameters=(
        K_S,
        Parameter(
            name="alpha",
            unit="1",
            meaning="roughness; RMS slope of the facets times sqrt(2)",
            bounds=(1e-4, 2.0),
            default=0.2,
            scale="log",
            nodes=64,
        ),
    ),
    coefficients=(("k_s",),),
    reciprocal=True,
    isotropic=True,
    sets=("all",),
    uses=("fresnel.h", "masking.h", "distributions.h"),
    options={"masking": MASKING, "fresnel": FRESNEL},
    choices=FRESNEL_CHOICES,
    variants=(
        Variant(name="k_s=1", fixed={"k_s": 1.0}),
        Variant(name="conductor", fixed={"k_s": 1.0}, options={"fresnel": "conductor"}),
    ),
    references=(
        Reference(
            params={"k_d": 0.2, "k_s": 1.0, "F0": 0.04, "alpha": 0.3},
            theta_i=30,
            phi_i=0,
            theta_o=40,
            phi_o=180,
            value=0.113610445038983,
            source="the formula in 50-digit arithmetic (mpmath)",
        ),
        Reference(
            params={"k_d": 0.0, "k_s": 1.0, "F0": 0.9, "alpha": 0.1},
            theta_i=75,
            phi_i=10,
            theta_o=70,
            phi_o=195,
            value=10.47335758619228,
            source="the formula in 50-digit arithmetic (mpmath)",
        ),
        Reference(
            params={"k_d": 0.1, "k_s": 0.5, "F0": 0.5, "alpha": 0.6},
            theta_i=60,
            phi_i=20,
            theta_o=45,
            phi_o=170,
            value=0.1675900297250792,
            source="the formula in 50-digit arithmetic (mpmath)",
        ),
    ),
)
