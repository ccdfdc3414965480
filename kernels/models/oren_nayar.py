"""Oren-Nayar, the qualitative model: a diffuse surface of rough V-shaped grooves.

Formula
-------
f = k_d/pi (A + B max(0, cos(phi_o - phi_i)) sin(a) tan(b)),
a and b the larger and the smaller of theta_i and theta_o,
A = 1 - 0.5 sigma^2/(sigma^2 + 0.33),  B = 0.45 sigma^2/(sigma^2 + 0.09)

Convention
----------
"Qualitative": one bounce, the shape of the full model without its terms C_3 and L_2. k_d is
the albedo of the groove's walls, not of the surface; sigma is the standard deviation of the
walls' slope angle in rad. sigma = 0 is `lambert`.

Domain
------
sigma from 0 to pi/2. The surface looks flat like the full moon: brighter than Lambert towards
the light, at grazing angles above all. It is darker than its k_d (albedo 0.624 k_d at normal
incidence for sigma = 1), since light that bounces twice in a groove is lost; `eon` gives it
back. For small sigma it gains a little at grazing incidence: 1.015 k_d at 89.9 degrees for
sigma = 0.2.

Source
------
M. Oren, S. K. Nayar, Generalization of Lambert's reflectance model, SIGGRAPH 1994, eq. 30.

Verified against
----------------
Directional albedos by independent quadrature (0.8929, 0.9599, 0.9987 at 0, 60, 85 degrees for
sigma = 0.3; 0.6241, 0.7471, 0.8183 for sigma = 1) and 50-digit arithmetic.
"""

from __future__ import annotations

import math

from lobefit.kernels.library import Lobe, Parameter, Reference

__all__ = ["LOBE"]

LOBE = Lobe(
    name="oren_nayar",
    title="Oren-Nayar, a rough diffuse surface",
    convention="qualitative model: k_d/pi (A + B max(0, cos(phi_o - phi_i)) sin(a) tan(b))",
    source="Oren & Nayar 1994, eq. 30",
    energy="conserves energy for k_d <= 0.98; for k_d <= 1 only up to 60 degrees or where sigma >= 0.35",
    parameters=(
        Parameter(
            name="k_d",
            unit="1",
            meaning="albedo of the groove's walls",
            bounds=(0.0, math.inf),
            default=0.5,
            linear=True,
            per_channel=True,
        ),
        Parameter(
            name="sigma",
            unit="rad",
            meaning="standard deviation of the walls' slope angle",
            bounds=(0.0, math.pi / 2),
            default=0.3,
            nodes=17,
        ),
    ),
    coefficients=(("k_d",),),
    reciprocal=True,
    isotropic=True,
    diffuse=False,
    uses=("tangential.h",),
    references=(
        Reference(
            params={"k_d": 0.5, "sigma": 0.3},
            theta_i=30,
            phi_i=0,
            theta_o=40,
            phi_o=180,
            value=0.1421026277606208,
            source="the formula in 50-digit arithmetic (mpmath)",
        ),
        Reference(
            params={"k_d": 0.8, "sigma": 1.0},
            theta_i=50,
            phi_i=30,
            theta_o=70,
            phi_o=55,
            value=0.2656179976028244,
            source="the formula in 50-digit arithmetic (mpmath)",
        ),
        Reference(
            params={"k_d": 0.3, "sigma": 0.6},
            theta_i=85,
            phi_i=5,
            theta_o=80,
            phi_o=0,
            value=0.2640650920296563,
            source="the formula in 50-digit arithmetic (mpmath)",
        ),
    ),
)
