"""Blinn-Phong: a cosine-power lobe of the half vector.

Formula
-------
f = k_d/pi + k_s (n + 2)/(8 pi) (n.h)^n

Convention
----------
"distribution over 4": D = (n + 2)/(2 pi) (n.h)^n is a normalised distribution of
normals (the integral of D cos(theta_h) is 1), divided by 4; no masking, no Fresnel,
no division by the cosines.

Domain
------
n from 1 to 1e6; n is about 2/alpha^2 - 2 of a microfacet lobe. Half-vector lobes follow
the lengthening of highlights at grazing incidence, unlike `modified_phong`.

Source
------
J. F. Blinn, Models of light reflection for computer synthesized pictures, SIGGRAPH 1977.

Verified against
----------------
50-digit arithmetic and the closed form at normal incidence.
"""

from __future__ import annotations

from lobefit.kernels.library import Lobe, Parameter, Reference
from lobefit.kernels.shared_parameters import K_S

__all__ = ["LOBE"]

LOBE = Lobe(
    name="blinn_phong",
    title="Blinn-Phong, a cosine lobe of the half vector",
    convention="distribution over 4: k_s (n+2)/(8 pi) (n.h)^n",
    source="Blinn 1977",
    energy="conserves energy for k_d + k_s <= 1",
    parameters=(
        K_S,
        Parameter(
            name="n",
            unit="1",
            meaning="exponent; about 2/alpha^2 of a microfacet lobe",
            bounds=(1.0, 1e6),
            default=50.0,
            scale="log",
            nodes=64,
        ),
    ),
    coefficients=(("k_s",),),
    reciprocal=True,
    isotropic=True,
    references=(
        Reference(
            params={"k_d": 0.2, "k_s": 0.5, "n": 10.0},
            theta_i=30,
            phi_i=0,
            theta_o=40,
            phi_o=180,
            value=0.2934638961601545,
            source="the formula in 50-digit arithmetic (mpmath)",
        ),
        Reference(
            params={"k_d": 0.0, "k_s": 1.0, "n": 1000.0},
            theta_i=75,
            phi_i=10,
            theta_o=70,
            phi_o=195,
            value=0.001199341639869217,
            source="the formula in 50-digit arithmetic (mpmath)",
        ),
        Reference(
            params={"k_d": 0.1, "k_s": 0.4, "n": 50.0},
            theta_i=60,
            phi_i=20,
            theta_o=45,
            phi_o=170,
            value=0.07086261582143275,
            source="the formula in 50-digit arithmetic (mpmath)",
        ),
    ),
)
