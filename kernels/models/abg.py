"""ABg: the power law of scatter from polished surfaces, in stray-light terms.

Formula
-------
f = k_d/pi + A / (B + x^g),   x = |i_xy + o_xy|
with the components i_xy and o_xy of the directions along the surface: x is the distance of
the projected wo from the projected mirror direction, |beta - beta_0| in the terms of stray
light, and in the plane of incidence |sin(theta_o) - sin(theta_i)|.

Convention
----------
"BSDF": f in 1/sr, the radiance scattered over the irradiance, without a cosine and without
the mirror's own reflection; A, B and g as optical design programs write them. A has the
unit of f times that of B. The peak is A/B; the knee, where f has fallen to half, lies at
x = B^(1/g); beyond it f falls as x^(-g). Harvey-Shack, b (1 + (x/l)^2)^(s/2), has the same
limits for b = A/B, l = B^(1/g), s = -g and another knee; for g = 2 the two are one.

Domain
------
B from 1e-12 to 10, g from 0.2 to 6; polished optics have g of 1 to 3. Shift-invariant: the
shape in x does not change with the angle of incidence, which holds for roughness far below
the wavelength. Total integrated scatter (TIS), the albedo at normal incidence, is
2 pi A times the integral of x/(B + x^g) from 0 to 1: pi A ln(1 + 1/B) for g = 2. For
g < 2 it stays finite as B -> 0, at 2 pi A/(2 - g), and most of the light is far from the
mirror: B may then be too small to be seen, and A and g are what a measurement determines.
For g >= 2 most of the light is inside the knee and TIS grows without a bound as B -> 0: a
measurement that does not reach the knee says nothing of the TIS. x counts as 1e-12 where
it is smaller, so that the peak is A/(B + 1e-12^g): A/B unless g is far below 1 or B at
its bound. A large B leaves a constant that k_d gives too; the variant `abg:k_d=0` has no
diffuse term, as A, B and g are usually quoted.

Source
------
J. E. Harvey, Light-scattering characteristics of optical surfaces, dissertation, University
of Arizona, 1976, for the shift-invariant x; E. C. Fest, Stray Light Analysis and Control,
SPIE Press 2013, chapter on surface roughness scatter, for A, B and g.

Verified against
----------------
The closed forms of the TIS for g = 2 and for B -> 0, Harvey-Shack at g = 2, and 50-digit
arithmetic.
"""

from __future__ import annotations

import math

from lobefit.kernels.library import Lobe, Parameter, Reference, Variant

__all__ = ["LOBE"]

LOBE = Lobe(
    name="abg",
    title="ABg, a power law about the mirror direction (stray light)",
    convention="BSDF in 1/sr: A / (B + |beta - beta_0|^g)",
    source="Harvey 1976; Fest 2013",
    energy="conserves energy where k_d + 2 pi A (integral of x/(B + x^g) from 0 to 1) <= 1",
    parameters=(
        Parameter(
            name="A",
            unit="1/sr",
            meaning="amplitude of the power law: f = A x^(-g) beyond the knee",
            bounds=(0.0, math.inf),
            default=0.01,
            linear=True,
            per_channel=True,
        ),
        Parameter(
            name="B",
            unit="1",
            meaning="level of the knee, which lies at x = B^(1/g)",
            bounds=(1e-12, 10.0),
            default=1e-3,
            scale="log",
            nodes=28,
        ),
        Parameter(
            name="g",
            unit="1",
            meaning="slope of the fall beyond the knee",
            bounds=(0.2, 6.0),
            default=2.0,
            nodes=14,
        ),
    ),
    coefficients=(("A",),),
    reciprocal=True,
    isotropic=True,
    sets=("standard", "all"),
    variants=(Variant(name="k_d=0", fixed={"k_d": 0.0}, sets=("all",)),),
    uses=("projected.h",),
    references=(
        Reference(
            params={"k_d": 0.01, "A": 0.002, "B": 0.001, "g": 2.0},
            theta_i=30,
            phi_i=0,
            theta_o=40,
            phi_o=180,
            value=0.0966921604332115,
            source="the formula in 50-digit arithmetic (mpmath)",
        ),
        Reference(
            params={"k_d": 0.0, "A": 0.0001, "B": 1e-06, "g": 1.5},
            theta_i=75,
            phi_i=10,
            theta_o=70,
            phi_o=195,
            value=0.003886324935078636,
            source="the formula in 50-digit arithmetic (mpmath)",
        ),
        Reference(
            params={"k_d": 0.1, "A": 0.05, "B": 0.02, "g": 3.2},
            theta_i=60,
            phi_i=20,
            theta_o=45,
            phi_o=170,
            value=0.5888912320121141,
            source="the formula in 50-digit arithmetic (mpmath)",
        ),
    ),
)
