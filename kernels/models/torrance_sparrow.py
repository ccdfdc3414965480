"""Torrance-Sparrow: a Gaussian of the facet angle, V-cavities, a Fresnel term by choice.

Formula
-------
f = k_d/pi + k_s D G F / (4 cos_theta_i cos_theta_o)
D = exp(-theta_h^2/alpha^2) / N
N = pi * integral of exp(-t^2/alpha^2) sin(2 t) dt over t from 0 to pi/2
G = min(1, 2 cos_theta_h cos_theta_i/cos_theta_d, 2 cos_theta_h cos_theta_o/cos_theta_d)
F = F0 + (1 - F0)(1 - cos_theta_d)^5
Option `masking`: `v_cavity` only. Option `fresnel`: `schlick` (above, the default), `none`,
`dielectric`, `conductor`, `f82`; see `ggx`.

Convention
----------
"N = 4": D is normalised (the integral of D cos_theta_h is 1) and the denominator is 4.
The paper leaves the factor before the Gaussian open.

Domain
------
alpha from 1e-4 to 2 rad. The angle itself is distributed, not its tangent as for
`cook_torrance`; the two agree for narrow lobes, and for wide ones this one keeps facets that
stand upright.

Source
------
K. E. Torrance, E. M. Sparrow, Theory for off-specular reflection from roughened surfaces,
JOSA 57(9), 1967, the Gaussian as J. F. Blinn, SIGGRAPH 1977, gives it too; denominator of
B. Walter et al., EGSR 2007, eq. 20; C. Schlick, 1994, eq. 15.

Verified against
----------------
50-digit arithmetic; the integral of D cos_theta_h by quadrature; `cook_torrance` for narrow
lobes.
"""

from __future__ import annotations

from lobefit.kernels.library import Lobe, Parameter, Reference, Variant
from lobefit.kernels.shared_options import FRESNEL, FRESNEL_CHOICES
from lobefit.kernels.shared_parameters import K_S

__all__ = ["LOBE"]

LOBE = Lobe(
    name="torrance_sparrow",
    title="Torrance-Sparrow: Gaussian of the facet angle, V-cavity",
    convention="N = 4, normalised D: k_s D G F / (4 cos_theta_i cos_theta_o)",
    source="Torrance & Sparrow 1967; Walter et al. 2007, eq. 20",
    energy="conserves energy for k_d + k_s <= 1",
    parameters=(
        K_S,
        Parameter(
            name="alpha",
            unit="rad",
            meaning="angle at which the density of facet normals is down to 1/e",
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
    options={"masking": ("v_cavity",), "fresnel": FRESNEL},
    choices=FRESNEL_CHOICES,
    variants=(Variant(name="k_s=1", fixed={"k_s": 1.0}),),
    references=(
        Reference(
            params={"k_d": 0.2, "k_s": 1.0, "F0": 0.04, "alpha": 0.3},
            theta_i=30,
            phi_i=0,
            theta_o=40,
            phi_o=180,
            value=0.1159000192095818,
            source="the formula in 50-digit arithmetic (mpmath)",
        ),
        Reference(
            params={"k_d": 0.0, "k_s": 1.0, "F0": 0.9, "alpha": 0.1},
            theta_i=75,
            phi_i=10,
            theta_o=70,
            phi_o=195,
            value=10.4114212653804,
            source="the formula in 50-digit arithmetic (mpmath)",
        ),
        Reference(
            params={"k_d": 0.1, "k_s": 0.5, "F0": 0.5, "alpha": 0.6},
            theta_i=60,
            phi_i=20,
            theta_o=45,
            phi_o=170,
            value=0.1743169810942239,
            source="the formula in 50-digit arithmetic (mpmath)",
        ),
    ),
)
