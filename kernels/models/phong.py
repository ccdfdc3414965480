"""Phong: the lighting model of 1975, read as a BRDF.

Formula
-------
f = k_d/pi + k_s max(r.wo, 0)^n / cos_theta_i,    r the mirror direction of wi

Convention
----------
Phong adds k_s (r.wo)^n to the reflected light itself. Radiance is f times irradiance, and
irradiance goes with cos_theta_i, so that the lobe is divided by it. No normalisation: k_s is
the highlight's height in 1/sr at normal incidence. The ambient term is left out, it has no
direction. `modified_phong` is the lobe without the division and with (n + 2)/(2 pi).

Domain
------
n from 1 to 1e6. Not reciprocal: f(wi, wo)/f(wo, wi) = cos_theta_o/cos_theta_i for the lobe.
No bound on the albedo: with k_s = (n + 2)/(2 pi), which reflects all light at normal
incidence, the lobe gives 1.13, 1.97, 7.56 and 71 times the light at 75, 85, 89 and 89.9
degrees for n = 10. Kept as what old renderers used, not as a model of a surface.

Source
------
B. T. Phong, Illumination for computer generated pictures, CACM 18(6), 1975, the equation for
S_p; as a BRDF: R. R. Lewis, Making shaders more physically plausible, Eurographics 1993.

Verified against
----------------
The ratio of swapped directions, albedos by independent quadrature (the closed form
2 pi k_s/(n + 2) at normal incidence), `modified_phong`, and 50-digit arithmetic.
"""

from __future__ import annotations

from lobefit.kernels.library import Lobe, Parameter, Reference
from lobefit.kernels.shared_parameters import K_S

__all__ = ["LOBE"]

LOBE = Lobe(
    name="phong",
    title="Phong 1975 as a BRDF, not reciprocal",
    convention="not normalised: k_s (r.o)^n / cos_theta_i",
    source="Phong 1975; Lewis 1993",
    energy="never: the albedo grows without bound towards grazing incidence",
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
    reciprocal=False,
    isotropic=True,
    sets=("all",),
    references=(
        Reference(
            params={"k_d": 0.2, "k_s": 0.5, "n": 10.0},
            theta_i=30,
            phi_i=0,
            theta_o=40,
            phi_o=180,
            value=0.559059650315214,
            source="the formula in 50-digit arithmetic (mpmath)",
        ),
        Reference(
            params={"k_d": 0.0, "k_s": 1.0, "n": 1000.0},
            theta_i=75,
            phi_i=10,
            theta_o=70,
            phi_o=195,
            value=0.002647541709827473,
            source="the formula in 50-digit arithmetic (mpmath)",
        ),
        Reference(
            params={"k_d": 0.1, "k_s": 0.4, "n": 50.0},
            theta_i=60,
            phi_i=20,
            theta_o=45,
            phi_o=170,
            value=0.03350146656218669,
            source="the formula in 50-digit arithmetic (mpmath)",
        ),
    ),
)
