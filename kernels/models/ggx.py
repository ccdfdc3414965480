"""GGX: the Trowbridge-Reitz distribution, Smith masking, a Fresnel term by choice.

Formula
-------
f = k_d/pi + k_s D G F / (4 cos_theta_i cos_theta_o)
D = 1 / (pi alpha^2 cos^4(theta_h) (1 + tan^2(theta_h)/alpha^2)^2)
G = 1 / (1 + L(theta_i) + L(theta_o)),  L = (sqrt(1 + alpha^2 tan^2(theta)) - 1)/2
F = F0 + (1 - F0)(1 - cos_theta_d)^5
Option `masking`: `smith_correlated` (above, the default); `smith_separable`, which is
G = 1 / ((1 + L(theta_i))(1 + L(theta_o))); `v_cavity`, as in `cook_torrance`.
Option `fresnel`: `schlick` (above, the default); `none`, F = 1; `dielectric`, exact with
the index eta; `conductor`, exact with eta + i k per channel; `f82`, Schlick's F with the
error term of Lazanyi and Szirmay-Kalos such that F(cos_theta_d = 1/7) = F82.

Convention
----------
"N = 4": D is normalised (the integral of D cos_theta_h is 1) and the denominator is 4.

Domain
------
alpha from 1e-4 to 2. The tails of the lobe are long: polished and coated surfaces often
follow it where Beckmann's Gaussian falls off too fast. At small theta_d only the product
k_s F0 is determined. The variant `ggx:k_s=1` fixes the scale; `ggx:conductor` and `ggx:f82`
are metals, `ggx:dielectric` is a clear coat or a plastic, each with k_s = 1. One bounce only: at
alpha = 1 the albedo of F0 = 1 is 1 - ln 2 = 0.307 at normal incidence.

Source
------
T. S. Trowbridge, K. P. Reitz, JOSA 65(5), 1975; B. Walter et al., Microfacet models for
refraction, EGSR 2007, eq. 20, 33, 34; E. Heitz, JCGT 3(2), 2014, eq. 99; C. Schlick,
1994, eq. 15; M. Born, E. Wolf, Principles of Optics, sections 1.5.2 and 14.2 (exact
Fresnel); P. Kutz, M. Hasan, D. Edmondson, Novel aspects of the Adobe Standard Material,
2021 (f82).

Verified against
----------------
Directional albedos by independent quadrature (1 - ln 2 for alpha = 1; 0.88638 at 85
degrees for alpha = 0.1), Mitsuba 3.9.1 (`roughconductor`: separable masking, exact
conductor), the transfer-matrix package tmm (Fresnel terms) and 50-digit arithmetic.
"""

from __future__ import annotations

from lobefit.kernels.library import Lobe, Parameter, Reference, Variant
from lobefit.kernels.shared_options import FRESNEL, FRESNEL_CHOICES, MASKING
from lobefit.kernels.shared_parameters import K_S

__all__ = ["LOBE"]

LOBE = Lobe(
    name="ggx",
    title="GGX (Trowbridge-Reitz), Smith, Schlick or exact Fresnel",
    convention="N = 4, normalised D: k_s D G F / (4 cos_theta_i cos_theta_o)",
    source="Walter et al. 2007, eq. 20, 33; Heitz 2014, eq. 99",
    energy="conserves energy for k_d + k_s <= 1",
    parameters=(
        K_S,
        Parameter(
            name="alpha",
            unit="1",
            meaning="roughness; half width of the slope distribution",
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
    options={"masking": MASKING, "fresnel": FRESNEL},
    choices=FRESNEL_CHOICES,
    variants=(
        Variant(name="k_s=1", fixed={"k_s": 1.0}),
        Variant(
            name="dielectric",
            fixed={"k_s": 1.0},
            options={"fresnel": "dielectric"},
            sets=("all",),
        ),
        Variant(
            name="conductor",
            fixed={"k_s": 1.0},
            options={"fresnel": "conductor"},
            sets=("all",),
        ),
        Variant(name="f82", fixed={"k_s": 1.0}, options={"fresnel": "f82"}, sets=("all",)),
    ),
    partners={"ggx": ("standard", "all"), "retro": ("all",)},
    references=(
        Reference(
            params={"k_d": 0.2, "k_s": 1.0, "F0": 0.04, "alpha": 0.3},
            theta_i=30,
            phi_i=0,
            theta_o=40,
            phi_o=180,
            value=0.1088128732372293,
            source="the formula in 50-digit arithmetic (mpmath)",
        ),
        Reference(
            params={"k_d": 0.0, "k_s": 1.0, "F0": 0.9, "alpha": 0.1},
            theta_i=75,
            phi_i=10,
            theta_o=70,
            phi_o=195,
            value=8.470680977466199,
            source="the formula in 50-digit arithmetic (mpmath)",
        ),
        Reference(
            params={"k_d": 0.1, "k_s": 0.5, "F0": 0.5, "alpha": 0.6},
            theta_i=60,
            phi_i=20,
            theta_o=45,
            phi_o=170,
            value=0.1149338477112848,
            source="the formula in 50-digit arithmetic (mpmath)",
        ),
    ),
)
