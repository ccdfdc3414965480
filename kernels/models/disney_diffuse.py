"""Disney diffuse: Burley's empirical diffuse term with a grazing rise or fall.

Formula
-------
f = k_d/pi (1 + (F90 - 1) (1 - cos_theta_i)^5) (1 + (F90 - 1) (1 - cos_theta_o)^5),
F90 = 0.5 + 2 roughness cos^2(theta_d)

Convention
----------
"2012": the diffuse term of the Disney principled BRDF, without subsurface and sheen. k_d is
its base colour, not the albedo.

Domain
------
roughness from 0 to 1. Smooth surfaces darken at grazing angles, rough ones brighten towards
the light. It gains energy: for roughness = 1 the albedo is 1.036 k_d at normal incidence,
1.401 k_d at 85 degrees and 1.554 k_d at 89.9 degrees.

Source
------
B. Burley, Physically-based shading at Disney, SIGGRAPH 2012 course notes, section 5.3.

Verified against
----------------
The directional albedo 1.40 at 85 degrees for roughness = 1, by independent quadrature, the
closed forms 41/42 and 29/28 at normal incidence for roughness 0 and 1, and 50-digit
arithmetic.
"""

from __future__ import annotations

import math

from lobefit.kernels.library import Lobe, Parameter, Reference

__all__ = ["LOBE"]

LOBE = Lobe(
    name="disney_diffuse",
    title="Disney diffuse (Burley 2012)",
    convention="2012: k_d/pi times two Schlick factors with F90 = 0.5 + 2 roughness cos^2(theta_d)",
    source="Burley 2012, section 5.3",
    energy="no: gains up to 1.56 k_d at grazing; conserves it for k_d <= 1 where roughness <= 0.4",
    parameters=(
        Parameter(
            name="k_d",
            unit="1",
            meaning="base colour; the albedo is near it",
            bounds=(0.0, math.inf),
            default=0.5,
            linear=True,
            per_channel=True,
        ),
        Parameter(
            name="roughness",
            unit="1",
            meaning="grazing darkening (0) to grazing retro-reflection (1)",
            bounds=(0.0, 1.0),
            default=0.5,
            nodes=17,
        ),
    ),
    coefficients=(("k_d",),),
    reciprocal=True,
    isotropic=True,
    diffuse=False,
    sets=("all",),
    references=(
        Reference(
            params={"k_d": 0.5, "roughness": 0.3},
            theta_i=30,
            phi_i=0,
            theta_o=40,
            phi_o=180,
            value=0.1591434093478191,
            source="the formula in 50-digit arithmetic (mpmath)",
        ),
        Reference(
            params={"k_d": 0.8, "roughness": 1.0},
            theta_i=50,
            phi_i=30,
            theta_o=70,
            phi_o=55,
            value=0.3001201420493535,
            source="the formula in 50-digit arithmetic (mpmath)",
        ),
        Reference(
            params={"k_d": 0.3, "roughness": 0.0},
            theta_i=85,
            phi_i=5,
            theta_o=80,
            phi_o=0,
            value=0.05266193964738925,
            source="the formula in 50-digit arithmetic (mpmath)",
        ),
    ),
)
