"""SGD: the shifted gamma distribution with a fitted masking and Fresnel factor, all per channel.

Formula
-------
f = k_d/pi + k_s F D G1(theta_i) G1(theta_o) / (pi cos_theta_i cos_theta_o)
D = K exp(-x) / (pi x^p cos^4(theta_h)),  x = alpha + tan^2(theta_h)/alpha
K = 1 / (alpha Gamma(1 - p, alpha)),  Gamma the upper incomplete gamma function
G1 = 1 + Lambda (1 - exp(c max(theta - theta0, 0)^k_g)),  c such that G1(90 degrees) = 0:
c = ln(1 + 1/Lambda) / (pi/2 - theta0)^k_g
F = F0 cos_theta_d + F_g (m - m^5) + m^5,  m = 1 - cos_theta_d

Convention
----------
"N = pi" with D normalised (the integral of D cos_theta_h is 1): k_s is the paper's, pi/4 of
that with a denominator of 4. The paper's Fresnel factor is F0' - F1' cos_theta_d +
(1 - F0') m^5, so that F_g = F0' and F0 = F0' - F1': both are reflectances and not negative.
K and c are no parameters: K follows from alpha and p, and the 300 published c are
those that make G1 zero at the horizon, to their six digits (at 90 degrees within 0.0003).

Domain
------
The ranges hold the published fits: alpha from 1e-5 to 2, p from 0 (Beckmann's Gaussian of
roughness sqrt(alpha)) to 2, Lambda from 1e-8 to 1e8, k_g from 2 to 1000, theta0 from -0.7 to
1.25, F_g up to 10. Seven of the 300 published sets (of three fabrics and a paint) have an F0
down to -0.073; the paper cuts F off at 0, here F0 >= 0. Nine numbers per channel are more than
most measurements determine: the model is fitted only where it is named. Variants: `sgd:schlick`,
F_g = F0, which is Schlick's Fresnel term; `sgd:lobe`, F = 1 and G1 = 1 up to 89 degrees, leaves
k_s, alpha and p.

Source
------
M. Bagher, C. Soler, N. Holzschuch, Accurate fitting of measured reflectances using a shifted
gamma micro-facet distribution, Computer Graphics Forum 31(4), 2012.

Verified against
----------------
K of the 300 published sets (largest relative deviation 4.2e-6, the rounding of their six
digits), the published formula with the published c for all of them, and 50-digit arithmetic.
"""

from __future__ import annotations

from lobefit.kernels.library import Lobe, Parameter, Reference, Variant
from lobefit.kernels.shared_parameters import K_S

__all__ = ["LOBE"]

LOBE = Lobe(
    name="sgd",
    title="SGD, shifted gamma distribution per channel",
    convention="N = pi, normalised D: k_s F D G1 G1 / (pi cos_theta_i cos_theta_o)",
    source="Bagher, Soler & Holzschuch 2012",
    energy="no bound on k_d + k_s conserves it: D, masking and F are free of one another",
    parameters=(
        K_S,
        Parameter(
            name="F0",
            unit="1",
            meaning="Fresnel factor at normal incidence; the paper's F0 - F1",
            bounds=(0.0, 1.0),
            default=0.5,
            per_channel=True,
            nodes=2,
        ),
        Parameter(
            name="F_g",
            unit="1",
            meaning="grazing end of the Fresnel factor's straight part; the paper's F0",
            bounds=(0.0, 10.0),
            default=0.5,
            per_channel=True,
            nodes=2,
        ),
        Parameter(
            name="alpha",
            unit="1",
            meaning="width; squared roughness where p = 0",
            bounds=(1e-5, 2.0),
            default=0.05,
            per_channel=True,
            scale="log",
            nodes=24,
        ),
        Parameter(
            name="p",
            unit="1",
            meaning="exponent of the tail; larger for a sharper peak",
            bounds=(0.0, 2.0),
            default=0.5,
            per_channel=True,
            nodes=4,
        ),
        Parameter(
            name="Lambda",
            unit="1",
            meaning="masking: weight of the exponential fall",
            bounds=(1e-8, 1e8),
            default=3.0,
            per_channel=True,
            scale="log",
            nodes=2,
        ),
        Parameter(
            name="k_g",
            unit="1",
            meaning="masking: exponent of the fall; the paper's k",
            bounds=(2.0, 1000.0),
            default=20.0,
            per_channel=True,
            scale="log",
            nodes=2,
        ),
        Parameter(
            name="theta0",
            unit="rad",
            meaning="masking: zenith angle where the fall begins",
            bounds=(-0.7, 1.25),
            default=0.0,
            per_channel=True,
            nodes=2,
        ),
    ),
    coefficients=(("k_s",),),
    reciprocal=True,
    isotropic=True,
    sets=(),
    variants=(
        Variant(name="schlick", tied={"F_g": "F0"}),
        Variant(
            name="lobe",
            fixed={"F0": 1.0, "F_g": 1.0, "Lambda": 1e-8, "k_g": 1000.0, "theta0": 0.0},
            sets=("all",),
        ),
    ),
    references=(
        Reference(
            params={
                "k_d": 0.1,
                "k_s": 0.3,
                "F0": 0.05,
                "F_g": 0.2,
                "alpha": 0.05,
                "p": 0.5,
                "Lambda": 3.0,
                "k_g": 20.0,
                "theta0": 0.1,
            },
            theta_i=30,
            phi_i=0,
            theta_o=40,
            phi_o=180,
            value=0.1295627223198979,
            source="the paper's formula in 50-digit arithmetic (mpmath)",
        ),
        Reference(
            params={
                "k_d": 0.0,
                "k_s": 1.0,
                "F0": 1.0,
                "F_g": 6.0,
                "alpha": 0.3,
                "p": 1.0,
                "Lambda": 0.5,
                "k_g": 8.0,
                "theta0": -0.2,
            },
            theta_i=75,
            phi_i=10,
            theta_o=70,
            phi_o=195,
            value=22.07986256160242,
            source="the paper's formula in 50-digit arithmetic (mpmath)",
        ),
        Reference(
            params={
                "k_d": 0.2,
                "k_s": 0.5,
                "F0": 0.6,
                "F_g": 0.1,
                "alpha": 0.7,
                "p": 1.7,
                "Lambda": 1e3,
                "k_g": 6.0,
                "theta0": 0.4,
            },
            theta_i=60,
            phi_i=20,
            theta_o=45,
            phi_o=170,
            value=0.2240389133810592,
            source="the paper's formula in 50-digit arithmetic (mpmath)",
        ),
        Reference(
            params={
                "k_d": 0.0,
                "k_s": 2.0,
                "F0": 0.9,
                "F_g": 0.9,
                "alpha": 0.001,
                "p": 0.0,
                "Lambda": 2e-8,
                "k_g": 100.0,
                "theta0": 0.8,
            },
            theta_i=50,
            phi_i=0,
            theta_o=52,
            phi_o=182,
            value=214.0741333945462,
            source="the paper's formula in 50-digit arithmetic (mpmath)",
        ),
    ),
)
