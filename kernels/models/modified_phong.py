"""Modified Phong: a cosine-power lobe about the mirror direction, made reciprocal.

Formula
-------
f = k_d/pi + k_s (n + 2)/(2 pi) max(r.wo, 0)^n,    r the mirror direction of wi

Convention
----------
"Lewis": the factor (n + 2)/(2 pi) makes the albedo of the lobe at normal incidence k_s.

Domain
------
n from 1 to 1e6. The albedo falls with the angle of incidence (to k_s cos(theta_i) for
n -> infinity), so metals fitted with it come out too dark at grazing incidence.

Source
------
R. R. Lewis, Making shaders more physically plausible, Eurographics 1993;
E. Lafortune, Y. Willems, report CW 197, KU Leuven 1994, eq. 9.

Verified against
----------------
Closed forms of the albedo (1 at normal incidence; 0.609, 0.505, 0.500 at 60 degrees
for n = 1, 10, 100) and 50-digit arithmetic.
"""

from __future__ import annotations

from lobefit.kernels.library import Lobe, Parameter, Reference
from lobefit.kernels.shared_parameters import K_S

__all__ = ["LOBE"]

LOBE = Lobe(
    name="modified_phong",
    title="Modified Phong, a reciprocal cosine lobe",
    convention="Lewis: k_s (n+2)/(2 pi) (r.o)^n",
    source="Lewis 1993; Lafortune & Willems 1994, eq. 9",
    energy="conserves energy for k_d + k_s <= 1",
    parameters=(
        K_S,
        Parameter(
            name="n",
            unit="1",
            meaning="exponent; the lobe's width is about sqrt(2/n) rad",
            bounds=(1.0, 1e6),
            default=20.0,
            scale="log",
            nodes=64,
        ),
    ),
    coefficients=(("k_s",),),
    reciprocal=True,
    isotropic=True,
    sets=("quick", "standard", "all"),
    references=(
        Reference(
            params={"k_d": 0.2, "k_s": 0.5, "n": 10.0},
            theta_i=30,
            phi_i=0,
            theta_o=40,
            phi_o=180,
            value=0.8830431329153716,
            source="the formula in 50-digit arithmetic (mpmath)",
        ),
        Reference(
            params={"k_d": 0.0, "k_s": 1.0, "n": 1000.0},
            theta_i=75,
            phi_i=10,
            theta_o=70,
            phi_o=195,
            value=0.1092765296698308,
            source="the formula in 50-digit arithmetic (mpmath)",
        ),
        Reference(
            params={"k_d": 0.1, "k_s": 0.4, "n": 50.0},
            theta_i=60,
            phi_i=20,
            theta_o=45,
            phi_o=170,
            value=0.03874347399253625,
            source="the formula in 50-digit arithmetic (mpmath)",
        ),
    ),
)
