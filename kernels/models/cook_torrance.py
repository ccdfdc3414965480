"""Cook-Torrance: Beckmann's distribution, V-cavity masking, a Fresnel term by choice.

Formula
-------
f = k_d/pi + k_s D G F / (4 cos_theta_i cos_theta_o)
D = exp(-tan^2(theta_h)/alpha^2) / (pi alpha^2 cos^4(theta_h))
G = min(1, 2 cos_theta_h cos_theta_i/cos_theta_d, 2 cos_theta_h cos_theta_o/cos_theta_d)
F = F0 + (1 - F0)(1 - cos_theta_d)^5
Option `fresnel`: `schlick` (above, the default), `none`, `dielectric`, `conductor`, `f82`,
as for `ggx`.

Convention
----------
"N = 4": D is normalised (the integral of D cos_theta_h is 1) and the denominator is 4.
The paper of 1982 has pi and a D without 1/pi, which is 4 times this at equal k_s; Ngan's
tables of 2005 have pi and the normalised D, 4/pi times this.

Domain
------
alpha from 1e-4 to 2 (RMS slope alpha/sqrt(2)). At small angles of theta_d only the product
k_s F0 is determined. The variant `cook_torrance:k_s=1` fixes the scale.

Source
------
R. L. Cook, K. E. Torrance, ACM TOG 1(1), 1982; normalisation of B. Walter et al.,
Microfacet models for refraction, EGSR 2007, eq. 20 and 25; C. Schlick, 1994, eq. 15.

Verified against
----------------
Directional albedos by independent quadrature (0.89242 at 0 and 0.97720 at 85 degrees
for alpha = 0.5, F0 = 1), D against Mitsuba 3.9.1, and 50-digit arithmetic.
"""

from __future__ import annotations

from lobefit.kernels.library import Lobe, Parameter, Reference, Variant
from lobefit.kernels.shared_options import FRESNEL, FRESNEL_CHOICES
from lobefit.kernels.shared_parameters import K_S

__all__ = ["LOBE"]

LOBE = Lobe(
    name="cook_torrance",
    title="Cook-Torrance: Beckmann, V-cavity, Schlick or exact Fresnel",
    convention="N = 4, normalised D: k_s D G F / (4 cos_theta_i cos_theta_o)",
    source="Cook & Torrance 1982; Walter et al. 2007, eq. 20, 25",
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
    sets=("quick", "standard", "all"),
    uses=("fresnel.h", "masking.h", "distributions.h"),
    options={"fresnel": FRESNEL},
    choices=FRESNEL_CHOICES,
    variants=(Variant(name="k_s=1", fixed={"k_s": 1.0}, sets=("standard", "all")),),
    references=(
        Reference(
            params={"k_d": 0.2, "k_s": 1.0, "F0": 0.04, "alpha": 0.3},
            theta_i=30,
            phi_i=0,
            theta_o=40,
            phi_o=180,
            value=0.1136104450534276,
            source="the formula in 50-digit arithmetic (mpmath)",
        ),
        Reference(
            params={"k_d": 0.0, "k_s": 1.0, "F0": 0.9, "alpha": 0.1},
            theta_i=75,
            phi_i=10,
            theta_o=70,
            phi_o=195,
            value=10.47340685927116,
            source="the formula in 50-digit arithmetic (mpmath)",
        ),
        Reference(
            params={"k_d": 0.1, "k_s": 0.5, "F0": 0.5, "alpha": 0.6},
            theta_i=60,
            phi_i=20,
            theta_o=45,
            phi_o=170,
            value=0.1717535992673129,
            source="the formula in 50-digit arithmetic (mpmath)",
        ),
    ),
)
