"""ABC for smooth surfaces: a power law about the mirror, with a dielectric's Fresnel term.

Formula
-------
f = k_d/pi + A (1 + B x^2)^(-C) F(theta_d; eta),   x = |i_xy + o_xy|
cos(theta_d) = sqrt(1 - |i_xy - o_xy|^2/4)
F = (r_s^2 + r_p^2)/2, Fresnel's reflectance of a dielectric for unpolarised light,
with the components i_xy and o_xy of the directions along the surface.

Convention
----------
"Low 2012": no normalisation, A takes it in; no masking; F is 1 at grazing incidence and
((eta - 1)/(eta + 1))^2 at normal incidence, so that A alone is not the peak. theta_d is the
paper's, of the projected directions: at the mirror direction it is the angle of incidence,
elsewhere less than the angle between wi and the half vector.

Domain
------
B from 1 to 1e8, C from 0.01 to 10, eta from 1.01 to 100. The paper fits metals too, with a
large eta that makes F nearly constant. At small theta_d only A F(0) is determined. For
C < 1 and a large B most of the light is far from the mirror.

Source
------
J. Low, J. Kronander, A. Ynnerman, J. Unger, BRDF models for accurate and efficient
rendering of glossy surfaces, ACM TOG 31(1), 2012, eq. 10, 12 and 14; the Fresnel term after
R. L. Cook, K. E. Torrance, ACM TOG 1(1), 1982.

Verified against
----------------
Harvey-Shack with l = B^(-1/2), s = -2 C, times Fresnel's equations; 50-digit arithmetic.
"""

from __future__ import annotations

import math

from lobefit.kernels.library import Lobe, Parameter, Reference

__all__ = ["LOBE"]

LOBE = Lobe(
    name="abc",
    title="ABC of Low et al. 2012 for smooth surfaces",
    convention="Low 2012: A (1 + B x^2)^(-C) F, not normalised, no masking",
    source="Low et al. 2012, eq. 12",
    energy="conserves energy where k_d + pi A ((1 + B)^(1 - C) - 1)/(B (1 - C)) <= 1",
    parameters=(
        Parameter(
            name="A",
            unit="1/sr",
            meaning="amplitude; the peak is A F",
            bounds=(0.0, math.inf),
            default=1.0,
            linear=True,
            per_channel=True,
        ),
        Parameter(
            name="B",
            unit="1",
            meaning="inverse square of the distance where the fall begins",
            bounds=(1.0, 1e8),
            default=100.0,
            scale="log",
            nodes=20,
        ),
        Parameter(
            name="C",
            unit="1",
            meaning="half the slope of the fall",
            bounds=(0.01, 10.0),
            default=1.0,
            scale="log",
            nodes=12,
        ),
        Parameter(
            name="eta",
            unit="1",
            meaning="refractive index of the Fresnel term",
            bounds=(1.01, 100.0),
            default=1.5,
            scale="log",
            nodes=6,
        ),
    ),
    coefficients=(("A",),),
    reciprocal=True,
    isotropic=True,
    sets=("all",),
    uses=("projected.h", "fresnel.h"),
    references=(
        Reference(
            params={"k_d": 0.05, "A": 5.0, "B": 300.0, "C": 0.9, "eta": 1.5},
            theta_i=30,
            phi_i=0,
            theta_o=40,
            phi_o=180,
            value=0.05267493100114624,
            source="the formula in 50-digit arithmetic (mpmath)",
        ),
        Reference(
            params={"k_d": 0.0, "A": 100.0, "B": 20000.0, "C": 1.3, "eta": 2.4},
            theta_i=75,
            phi_i=10,
            theta_o=70,
            phi_o=195,
            value=0.04218545145949469,
            source="the formula in 50-digit arithmetic (mpmath)",
        ),
        Reference(
            params={"k_d": 0.2, "A": 0.8, "B": 15.0, "C": 0.4, "eta": 50.0},
            theta_i=60,
            phi_i=20,
            theta_o=45,
            phi_o=170,
            value=0.4918158639546566,
            source="the formula in 50-digit arithmetic (mpmath)",
        ),
    ),
)
