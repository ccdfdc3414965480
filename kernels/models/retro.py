"""Retro: a lobe about the direction of incidence, GGX of the back vector.

Formula
-------
f = k_d/pi + k_s D G / (4 cos_theta_i cos_theta_o)
D = 1 / (pi alpha^2 cos^4(theta_b) (1 + tan^2(theta_b)/alpha^2)^2)
G = 1 / (1 + L(theta_i) + L(theta_o)),  L = (sqrt(1 + alpha^2 tan^2(theta)) - 1)/2
with theta_b the zenith angle of the half vector between wo and the mirror direction of wi
(the back vector), which is the normal at exact retro-reflection.

Convention
----------
"N = 4", as GGX with F = 1: f(wi, wo) is that of a GGX lobe for the mirrored wi, and its
albedo therefore GGX's. There is no Fresnel term: what a glass bead or a corner cube does
with its several reflections is not known to the model, k_s takes it in.

Domain
------
alpha from 1e-3 to 2. Reciprocal and isotropic. Retro-reflective sheeting is often narrower
than the gap that a source in front of the detector leaves: no reading closer than a few
degrees bounds alpha from above only.

Source
------
L. Belcour, R. Pacanowski, M. Delahaie, A. Laville-Geay, L. Eupherte, Bidirectional
reflectance distribution function measurements and analysis of retroreflective materials,
JOSA A 31(12), 2014, for the back vector; B. Walter et al., EGSR 2007, eq. 33, and E. Heitz,
JCGT 3(2), 2014, eq. 99, for D and G.

Verified against
----------------
The GGX lobe with F = 1 and the light turned by half a turn, in value and in albedo;
50-digit arithmetic.
"""

from __future__ import annotations

from lobefit.kernels.library import Lobe, Parameter, Reference
from lobefit.kernels.shared_parameters import K_S

__all__ = ["LOBE"]

LOBE = Lobe(
    name="retro",
    title="Retro-reflective lobe: GGX of the back vector",
    convention="N = 4, normalised D: k_s D G / (4 cos_theta_i cos_theta_o)",
    source="Belcour et al. 2014; Walter et al. 2007, eq. 33; Heitz 2014, eq. 99",
    energy="conserves energy for k_d + k_s <= 1",
    parameters=(
        K_S,
        Parameter(
            name="alpha",
            unit="1",
            meaning="roughness; half width of the slope distribution",
            bounds=(1e-3, 2.0),
            default=0.2,
            scale="log",
            nodes=48,
        ),
    ),
    coefficients=(("k_s",),),
    reciprocal=True,
    isotropic=True,
    peaks=("back",),
    sets=("all",),
    uses=("masking.h", "distributions.h"),
    references=(
        Reference(
            params={"k_d": 0.1, "k_s": 0.5, "alpha": 0.3},
            theta_i=30,
            phi_i=0,
            theta_o=40,
            phi_o=10,
            value=0.5574941729973566,
            source="the formula in 50-digit arithmetic (mpmath)",
        ),
        Reference(
            params={"k_d": 0.0, "k_s": 1.0, "alpha": 0.05},
            theta_i=75,
            phi_i=10,
            theta_o=70,
            phi_o=15,
            value=4.172087663756145,
            source="the formula in 50-digit arithmetic (mpmath)",
        ),
        Reference(
            params={"k_d": 0.2, "k_s": 0.8, "alpha": 0.6},
            theta_i=60,
            phi_i=20,
            theta_o=45,
            phi_o=170,
            value=0.1514381358901752,
            source="the formula in 50-digit arithmetic (mpmath)",
        ),
    ),
)
