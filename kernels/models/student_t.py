"""Student's t distribution of slopes (STD); masking and Fresnel term by choice.

Formula
-------
f = k_d/pi + k_s D G F / (4 cos_theta_i cos_theta_o)
D = (1 + tan^2(theta_h)/s^2)^-gamma / (pi alpha^2 cos^4(theta_h)),  s^2 = (gamma - 1) alpha^2
G = 1 / (1 + L(theta_i) + L(theta_o))
L = R (1 + m^2)^(1 - gamma) sqrt(1 + m^2) / (m (2 gamma - 3)) - T,  m = 1/(s tan(theta))
R = Gamma(gamma - 1/2) / (sqrt(pi) Gamma(gamma - 1))
T = I_w(gamma - 1, gamma - 1), the incomplete beta function at w = (1 - m/sqrt(1 + m^2))/2
F = F0 + (1 - F0)(1 - cos_theta_d)^5
Options `masking`: `smith_correlated` (above, the default), `smith_separable`, `v_cavity`;
`fresnel`: `schlick` (above, the default), `none`, `dielectric`, `conductor`, `f82`; see `ggx`.

Convention
----------
"N = 4": D is normalised (the integral of D cos_theta_h is 1) and the denominator is 4.

Domain
------
alpha from 1e-4 to 2, gamma from 1.51 to 40. gamma sets the tail: 2 is `ggx`, lower is longer,
and towards infinity the distribution becomes `beckmann` of the same alpha. At gamma = 1.5
the mean slope diverges, and with it Smith's Lambda.

Source
------
M. Ribardiere, B. Bringier, D. Meneveaux, L. Simonot, STD: Student's t-distribution of slopes
for microfacet based BSDFs, Computer Graphics Forum 36(2), 2017 (masking: eq. 23, replaced
here by L above, which follows from Smith's definition in E. Heitz, JCGT 3(2), 2014); T by
the continued fraction of A. DiDonato, A. Morris, ACM TOMS 18(3), 1992.

Verified against
----------------
`ggx` at gamma = 2, Lambda by quadrature of the slopes in 50-digit arithmetic, and the
integral of D cos_theta_h by quadrature.
"""

from __future__ import annotations

from lobefit.kernels.library import Lobe, Parameter, Reference, Variant
from lobefit.kernels.shared_options import FRESNEL, FRESNEL_CHOICES, MASKING
from lobefit.kernels.shared_parameters import K_S

__all__ = ["LOBE"]

LOBE = Lobe(
    name="student_t",
    title="Student's t distribution of slopes, Smith masking",
    convention="N = 4, normalised D: k_s D G F / (4 cos_theta_i cos_theta_o)",
    source="Ribardiere et al. 2017, eq. 23; Heitz 2014, eq. 99",
    energy="conserves energy for k_d + k_s <= 1",
    parameters=(
        K_S,
        Parameter(
            name="alpha",
            unit="1",
            meaning="roughness; that of GGX where gamma is 2",
            bounds=(1e-4, 2.0),
            default=0.2,
            scale="log",
            nodes=32,
        ),
        Parameter(
            name="gamma",
            unit="1",
            meaning="exponent of the tail: 2 is GGX, 40 nearly Beckmann",
            bounds=(1.51, 40.0),
            default=2.0,
            scale="log",
            nodes=10,
        ),
    ),
    coefficients=(("k_s",),),
    reciprocal=True,
    isotropic=True,
    sets=("standard", "all"),
    uses=("fresnel.h", "masking.h", "distributions.h", "student_t.h"),
    options={"masking": MASKING, "fresnel": FRESNEL},
    choices=FRESNEL_CHOICES,
    variants=(Variant(name="k_s=1", fixed={"k_s": 1.0}),),
    references=(
        Reference(
            params={"k_d": 0.2, "k_s": 1.0, "F0": 0.04, "alpha": 0.3, "gamma": 1.75},
            theta_i=30,
            phi_i=0,
            theta_o=40,
            phi_o=180,
            value=0.1050573305339615,
            source="the formula in 50-digit arithmetic (mpmath)",
        ),
        Reference(
            params={"k_d": 0.0, "k_s": 1.0, "F0": 0.9, "alpha": 0.1, "gamma": 12.0},
            theta_i=75,
            phi_i=10,
            theta_o=70,
            phi_o=195,
            value=10.51211479733133,
            source="the formula in 50-digit arithmetic (mpmath)",
        ),
        Reference(
            params={"k_d": 0.1, "k_s": 0.5, "F0": 0.5, "alpha": 0.6, "gamma": 3.0},
            theta_i=60,
            phi_i=20,
            theta_o=45,
            phi_o=170,
            value=0.1424137917472023,
            source="the formula in 50-digit arithmetic (mpmath)",
        ),
    ),
)
