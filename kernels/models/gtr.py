"""GTR: Burley's generalised Trowbridge-Reitz, V-cavities, a Fresnel term by choice.

Formula
-------
f = k_d/pi + k_s D G F / (4 cos_theta_i cos_theta_o)
D = (gamma - 1)(alpha^2 - 1) / (pi (1 - alpha^(2 - 2 gamma))) / q^gamma,
q = 1 + (alpha^2 - 1) cos^2(theta_h)
G = min(1, 2 cos_theta_h cos_theta_i/cos_theta_d, 2 cos_theta_h cos_theta_o/cos_theta_d)
F = F0 + (1 - F0)(1 - cos_theta_d)^5
At gamma = 1 and at alpha = 1 D has limits, (alpha^2 - 1)/(pi ln(alpha^2) q) and 1/pi, which
are taken without a step. Option `masking`: `v_cavity` only, since Smith's masking has no
closed form but for gamma = 2, which is `ggx`. Option `fresnel`: `schlick` (above, the
default), `none`, `dielectric`, `conductor`, `f82`; see `ggx`.

Convention
----------
"N = 4": D is normalised (the integral of D cos_theta_h is 1) and the denominator is 4.

Domain
------
alpha from 1e-3 to 1, gamma from 1 to 30. gamma sets the tail: 1 is Berry's long one, 2 is
`ggx`, and for large gamma the lobe tends to a Gaussian of the width alpha/sqrt(gamma), so
that only that ratio is determined. Burley found values between 1 and 2 typical.

Source
------
B. Burley, Physically-based shading at Disney, SIGGRAPH 2012 course notes, section 5.4 and
appendix B; B. Walter et al., EGSR 2007, eq. 20; C. Schlick, 1994, eq. 15.

Verified against
----------------
`ggx` with V-cavities at gamma = 2, the integral of D cos_theta_h by quadrature and 50-digit
arithmetic.
"""

from __future__ import annotations

from lobefit.kernels.library import Lobe, Parameter, Reference, Variant
from lobefit.kernels.shared_options import FRESNEL, FRESNEL_CHOICES
from lobefit.kernels.shared_parameters import K_S

__all__ = ["LOBE"]

LOBE = Lobe(
    name="gtr",
    title="GTR: generalised Trowbridge-Reitz, V-cavity",
    convention="N = 4, normalised D: k_s D G F / (4 cos_theta_i cos_theta_o)",
    source="Burley 2012, appendix B; Walter et al. 2007, eq. 20",
    energy="conserves energy for k_d + k_s <= 1",
    parameters=(
        K_S,
        Parameter(
            name="alpha",
            unit="1",
            meaning="roughness; width of the lobe where gamma is 2",
            bounds=(1e-3, 1.0),
            default=0.2,
            scale="log",
            nodes=32,
        ),
        Parameter(
            name="gamma",
            unit="1",
            meaning="exponent of the tail: 2 is GGX, lower is longer",
            bounds=(1.0, 30.0),
            default=2.0,
            scale="log",
            nodes=10,
        ),
    ),
    coefficients=(("k_s",),),
    reciprocal=True,
    isotropic=True,
    sets=("all",),
    uses=("fresnel.h", "masking.h", "distributions.h"),
    options={"masking": ("v_cavity",), "fresnel": FRESNEL},
    choices=FRESNEL_CHOICES,
    variants=(Variant(name="k_s=1", fixed={"k_s": 1.0}),),
    references=(
        Reference(
            params={"k_d": 0.2, "k_s": 1.0, "F0": 0.04, "alpha": 0.3, "gamma": 1.5},
            theta_i=30,
            phi_i=0,
            theta_o=40,
            phi_o=180,
            value=0.09481802087353679,
            source="the formula in 50-digit arithmetic (mpmath)",
        ),
        Reference(
            params={"k_d": 0.0, "k_s": 1.0, "F0": 0.9, "alpha": 0.1, "gamma": 1.0},
            theta_i=75,
            phi_i=10,
            theta_o=70,
            phi_o=195,
            value=5.825194958157727,
            source="the formula in 50-digit arithmetic (mpmath)",
        ),
        Reference(
            params={"k_d": 0.1, "k_s": 0.5, "F0": 0.5, "alpha": 0.6, "gamma": 5.0},
            theta_i=60,
            phi_i=20,
            theta_o=45,
            phi_o=170,
            value=0.1933411476334002,
            source="the formula in 50-digit arithmetic (mpmath)",
        ),
    ),
)
