"""ABC for microfacets: a power law of the half vector, V-cavity masking, a dielectric's F.

Formula
-------
f = k_d/pi + A (1 + B (1 - cos_theta_h))^(-C) G F(theta_d; eta) / (cos_theta_i cos_theta_o)
G = min(1, 2 cos_theta_h cos_theta_i/cos_theta_d, 2 cos_theta_h cos_theta_o/cos_theta_d)
F = (r_s^2 + r_p^2)/2, Fresnel's reflectance of a dielectric for unpolarised light

Convention
----------
"Low 2012, eq. 15": the distribution is not normalised and no factor stands beside the
cosines; A takes all of it in. The numbers of the paper's supplement (fits of the MERL
materials) are for a denominator pi cos_theta_i cos_theta_o: divide their A by pi before
they are used here. In terms of a microfacet model with N = 4 and a distribution D whose
integral with cos_theta_h is 1, A (1 + B (1 - cos_theta_h))^(-C) is k_s D/4.

Domain
------
B from 1 to 1e8, C from 0.01 to 10, eta from 1.01 to 100; the paper's fits of 100 materials
have B from 11 to 8.1e6, C from 0.024 to 2.67 and, for some metals, eta near 100, where F is
nearly constant. At small theta_d only A F(0) is determined.

Source
------
J. Low, J. Kronander, A. Ynnerman, J. Unger, BRDF models for accurate and efficient
rendering of glossy surfaces, ACM TOG 31(1), 2012, eq. 15; masking and Fresnel term after
R. L. Cook, K. E. Torrance, ACM TOG 1(1), 1982.

Verified against
----------------
The closed form of the distribution's integral for C = 3 (albedo at normal incidence of a
narrow lobe), Fresnel's equations at the mirror direction, and 50-digit arithmetic.
"""

from __future__ import annotations

import math

from lobefit.kernels.library import Lobe, Parameter, Reference

__all__ = ["LOBE"]

LOBE = Lobe(
    name="abc_microfacet",
    title="ABC of Low et al. 2012 for microfacets",
    convention="Low 2012, eq. 15: A (...)^(-C) G F / (cos_theta_i cos_theta_o), not normalised",
    source="Low et al. 2012, eq. 15",
    energy="conserves energy where k_d + 8 pi A (integral of u (1 + B (1 - u))^(-C), 0 to 1) <= 1",
    parameters=(
        Parameter(
            name="A",
            unit="1/sr",
            meaning="amplitude of the facet distribution, the factor 1/4 taken in",
            bounds=(0.0, math.inf),
            default=1.0,
            linear=True,
            per_channel=True,
        ),
        Parameter(
            name="B",
            unit="1",
            meaning="inverse width of the distribution in 1 - cos_theta_h",
            bounds=(1.0, 1e8),
            default=100.0,
            scale="log",
            nodes=20,
        ),
        Parameter(
            name="C",
            unit="1",
            meaning="exponent of its fall",
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
    uses=("fresnel.h", "masking.h"),
    references=(
        Reference(
            params={"k_d": 0.05, "A": 5.0, "B": 300.0, "C": 0.9, "eta": 1.5},
            theta_i=30,
            phi_i=0,
            theta_o=40,
            phi_o=180,
            value=0.1794373852681227,
            source="the formula in 50-digit arithmetic (mpmath)",
        ),
        Reference(
            params={"k_d": 0.0, "A": 100.0, "B": 20000.0, "C": 1.3, "eta": 2.4},
            theta_i=75,
            phi_i=10,
            theta_o=70,
            phi_o=195,
            value=0.3213492805269614,
            source="the formula in 50-digit arithmetic (mpmath)",
        ),
        Reference(
            params={"k_d": 0.2, "A": 0.8, "B": 15.0, "C": 0.4, "eta": 50.0},
            theta_i=60,
            phi_i=20,
            theta_o=45,
            phi_o=170,
            value=1.671420077593066,
            source="the formula in 50-digit arithmetic (mpmath)",
        ),
    ),
)
