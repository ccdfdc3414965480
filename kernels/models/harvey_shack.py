"""Harvey-Shack, three parameters: scatter with a shoulder and a power law about the mirror.

Formula
-------
f = k_d/pi + b (1 + (x/l)^2)^(s/2),   x = |i_xy + o_xy|
with the components i_xy and o_xy of the directions along the surface: x is the distance of
the projected wo from the projected mirror direction, |beta - beta_0| in the terms of stray
light, and in the plane of incidence |sin(theta_o) - sin(theta_i)|.

Convention
----------
"BSDF": f in 1/sr, the radiance scattered over the irradiance, without a cosine and without
the mirror's own reflection; b, l and s as optical design programs write b_0, L and S. b is
the peak, l the shoulder, s the (negative) slope beyond it on logarithmic axes.

Domain
------
l from 1e-5 to 1, s from -6 to -0.1; polished optics have l of 1e-4 to 0.01 and s of -2.5
to -0.5. Shift-invariant: the shape in x does not change with the angle of incidence, which
holds for roughness far below the wavelength. Total integrated scatter (TIS), the albedo at
normal incidence, is 2 pi b l^2 ((1 + 1/l^2)^(s/2 + 1) - 1)/(s + 2), and
pi b l^2 ln(1 + 1/l^2) for s = -2. Where the data do not reach the shoulder only b l^(-s)
is determined. `abg` has the same limits and another knee; for s = -2 the two are one.

Source
------
J. E. Harvey, Light-scattering characteristics of optical surfaces, dissertation, University
of Arizona, 1976; E. C. Fest, Stray Light Analysis and Control, SPIE Press 2013, chapter on
surface roughness scatter, for the three parameters.

Verified against
----------------
The closed form of the TIS, ABg at s = -2, and 50-digit arithmetic.
"""

from __future__ import annotations

import math

from lobefit.kernels.library import Lobe, Parameter, Reference

__all__ = ["LOBE"]

LOBE = Lobe(
    name="harvey_shack",
    title="Harvey-Shack, three parameters (stray light)",
    convention="BSDF in 1/sr: b (1 + (|beta - beta_0|/l)^2)^(s/2)",
    source="Harvey 1976; Fest 2013",
    energy="conserves energy where k_d + 2 pi b l^2 ((1 + 1/l^2)^(s/2 + 1) - 1)/(s + 2) <= 1",
    parameters=(
        Parameter(
            name="b",
            unit="1/sr",
            meaning="peak, at the mirror direction",
            bounds=(0.0, math.inf),
            default=0.1,
            linear=True,
            per_channel=True,
        ),
        Parameter(
            name="l",
            unit="1",
            meaning="shoulder: distance from the mirror where the power law begins",
            bounds=(1e-5, 1.0),
            default=0.05,
            scale="log",
            nodes=20,
        ),
        Parameter(
            name="s",
            unit="1",
            meaning="slope beyond the shoulder on logarithmic axes",
            bounds=(-6.0, -0.1),
            default=-1.5,
            nodes=12,
        ),
    ),
    coefficients=(("b",),),
    reciprocal=True,
    isotropic=True,
    sets=("all",),
    uses=("projected.h",),
    references=(
        Reference(
            params={"k_d": 0.01, "b": 2.0, "l": 0.01, "s": -1.5},
            theta_i=30,
            phi_i=0,
            theta_o=40,
            phi_o=180,
            value=0.04011490342110242,
            source="the formula in 50-digit arithmetic (mpmath)",
        ),
        Reference(
            params={"k_d": 0.0, "b": 50.0, "l": 0.002, "s": -2.5},
            theta_i=75,
            phi_i=10,
            theta_o=70,
            phi_o=195,
            value=0.003985833766720534,
            source="the formula in 50-digit arithmetic (mpmath)",
        ),
        Reference(
            params={"k_d": 0.1, "b": 0.3, "l": 0.2, "s": -4.0},
            theta_i=60,
            phi_i=20,
            theta_o=45,
            phi_o=170,
            value=0.04095702659352727,
            source="the formula in 50-digit arithmetic (mpmath)",
        ),
    ),
)
