"""Beckmann's distribution with two roughnesses; masking and Fresnel term by choice.

Formula
-------
f = k_d/pi + k_s D G F / (4 cos_theta_i cos_theta_o)
D = exp(-e) / (pi alpha_x alpha_y cos^4(theta_h)),
e = (h_x^2/alpha_x^2 + h_y^2/alpha_y^2)/h_z^2
G = 1 / (1 + L(theta_i) + L(theta_o))
L = (erf(a) - 1)/2 + exp(-a^2)/(2 a sqrt(pi)),  a = 1/(alpha tan(theta))
with alpha^2 = alpha_x^2 cos^2(phi) + alpha_y^2 sin^2(phi) of each direction in L, and azimuths
counted from the axis of alpha_x at phi_x.
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
alpha_x >= alpha_y, phi_x in [0, pi); fitted only where the sample was turned.

Source
------
P. Beckmann, A. Spizzichino, 1963; B. Walter et al., Microfacet models for refraction,
EGSR 2007, eq. 25; E. Heitz, JCGT 3(2), 2014, eq. 72, 83, 99.

Verified against
----------------
Directional albedos by independent quadrature,
Mitsuba 3.9.1 (`roughconductor`, whose G1 is a rational approximation), 50-digit arithmetic.
"""

from __future__ import annotations

import math

from lobefit.kernels.library import Lobe, Parameter, Reference, Variant
from lobefit.kernels.shared_options import FRESNEL, FRESNEL_CHOICES, MASKING
from lobefit.kernels.shared_parameters import K_S

__all__ = ["LOBE"]

LOBE = Lobe(
    name="beckmann_anisotropic",
    title="Beckmann's distribution with two roughnesses",
    convention="N = 4, normalised D: k_s D G F / (4 cos_theta_i cos_theta_o)",
    source="Walter et al. 2007, eq. 25; Heitz 2014, eq. 72, 99",
    energy="conserves energy for k_d + k_s <= 1",
    parameters=(
        K_S,
        Parameter(
            name="alpha_x",
            unit="1",
            meaning="roughness along the wider axis",
            bounds=(1e-4, 2.0),
            default=0.2,
            scale="log",
            nodes=14,
        ),
        Parameter(
            name="alpha_y",
            unit="1",
            meaning="roughness along the narrower axis",
            bounds=(1e-4, 2.0),
            default=0.2,
            scale="log",
            nodes=14,
        ),
        Parameter(
            name="phi_x",
            unit="rad",
            meaning="azimuth of the wider axis",
            bounds=(0.0, math.pi),
            default=0.0,
            period=math.pi,
            nodes=6,
        ),
    ),
    coefficients=(("k_s",),),
    reciprocal=True,
    isotropic=False,
    sets=("all",),
    uses=("fresnel.h", "masking.h", "distributions.h", "axes.h"),
    options={"masking": MASKING, "fresnel": FRESNEL},
    choices=FRESNEL_CHOICES,
    axes=("alpha_x", "alpha_y", "phi_x"),
    variants=(
        Variant(name="k_s=1", fixed={"k_s": 1.0}, isotropic=False),
        Variant(
            name="conductor",
            fixed={"k_s": 1.0},
            options={"fresnel": "conductor"},
            isotropic=False,
            sets=("all",),
        ),
    ),
    references=(
        Reference(
            params={
                "k_d": 0.2,
                "k_s": 1.0,
                "F0": 0.04,
                "alpha_x": 0.3,
                "alpha_y": 0.1,
                "phi_x": 0.0,
            },
            theta_i=30,
            phi_i=0,
            theta_o=40,
            phi_o=180,
            value=0.2135073806434328,
            source="the formula in 50-digit arithmetic (mpmath)",
        ),
        Reference(
            params={
                "k_d": 0.0,
                "k_s": 1.0,
                "F0": 0.9,
                "alpha_x": 0.5,
                "alpha_y": 0.2,
                "phi_x": 0.4,
            },
            theta_i=75,
            phi_i=10,
            theta_o=70,
            phi_o=195,
            value=4.130213674529319,
            source="the formula in 50-digit arithmetic (mpmath)",
        ),
        Reference(
            params={
                "k_d": 0.1,
                "k_s": 0.5,
                "F0": 0.5,
                "alpha_x": 0.6,
                "alpha_y": 0.25,
                "phi_x": 1.2,
            },
            theta_i=60,
            phi_i=20,
            theta_o=45,
            phi_o=170,
            value=0.3600846876109912,
            source="the formula in 50-digit arithmetic (mpmath)",
        ),
    ),
)
