"""Ashikhmin-Shirley: an anisotropic Phong lobe of the half vector over a diffuse base.

Formula
-------
f = 28 k_d/(23 pi) (1 - (1 - cos_theta_i/2)^5) (1 - (1 - cos_theta_o/2)^5)
    + k_s sqrt((n_x + 1)(n_y + 1))/(8 pi) cos_theta_h^(n_x cos^2(phi_h) + n_y sin^2(phi_h)) F
      / (cos_theta_d max(cos_theta_i, cos_theta_o)),
n_x = 2/alpha_x^2,  n_y = 2/alpha_y^2,  F = F0 + (1 - F0)(1 - cos_theta_d)^5,
phi_h the azimuth of the half vector from the axis x, which stands at phi_x
Option `fresnel`: `schlick` (above, the default); `dielectric`, exact with the index eta.

Convention
----------
The paper's R_s is F0, with k_s = 1; k_s scales the lobe for surfaces that reflect less than
the model's. The paper's diffuse reflectance R_d is under the gloss: k_d = R_d (1 - R_s), so
R_d = k_d/(1 - F0). The paper's exponents are n_u = 2/alpha_x^2 and n_v = 2/alpha_y^2: with
alpha, as elsewhere, the wider axis has the larger number. For small alpha the lobe has the
shape of `ward`'s and Beckmann's with the same alpha. Low 2012 has the lobe with the exact F and
one exponent over `lambert` instead of the base.

Domain
------
alpha_x >= alpha_y from 1e-3 to 1.4, so n from 2e6 to 1.02; phi_x in [0, pi), the azimuth of
the wider axis. The variant `ashikhmin_shirley:isotropic` has one alpha and is the only one
fitted where the sample was not turned. At small theta_d only the product k_s F0 is
determined. The diffuse base fades at grazing angles (0.969, 0.763, 0.200 k_d at 0, 60, 85
degrees); so does the lobe (F0 = 1, n = 100: 0.961, 0.846, 0.583).

Source
------
M. Ashikhmin, P. Shirley, An anisotropic Phong BRDF model, Journal of Graphics Tools 5(2),
2000, eq. 4 (lobe) and 5 (base); J. Low et al., ACM TOG 31(1), 2012 (exact F); M. Born, E. Wolf,
Principles of Optics, section 1.5.2.

Verified against
----------------
Directional albedos by independent quadrature (base as above; lobe with F0 = 1 at normal
incidence 0.696, 0.961, 0.996 for n = 10, 100, 1000) and 50-digit arithmetic.
"""

from __future__ import annotations

import math

from lobefit.kernels.library import Lobe, Parameter, Reference, Variant
from lobefit.kernels.shared_options import FRESNEL_CHOICES
from lobefit.kernels.shared_parameters import K_S

__all__ = ["LOBE"]

FRESNEL = ("schlick", "dielectric")

LOBE = Lobe(
    name="ashikhmin_shirley",
    title="Ashikhmin-Shirley, an anisotropic Phong lobe over its own diffuse base",
    convention="n = 2/alpha^2, k_d = R_d (1 - R_s), F0 = R_s; k_s = 1 is the paper's",
    source="Ashikhmin & Shirley 2000, eq. 4, 5",
    energy="conserves energy for k_s <= 1 and k_d <= 1 - F0",
    parameters=(
        Parameter(
            name="k_d",
            unit="1",
            meaning="R_d (1 - R_s): strength of the diffuse base",
            bounds=(0.0, math.inf),
            default=0.5,
            linear=True,
            per_channel=True,
        ),
        K_S,
        Parameter(
            name="alpha_x",
            unit="1",
            meaning="roughness along the wider axis; the exponent is 2/alpha^2",
            bounds=(1e-3, 1.4),
            default=0.2,
            scale="log",
            nodes=12,
        ),
        Parameter(
            name="alpha_y",
            unit="1",
            meaning="roughness along the narrower axis; the exponent is 2/alpha^2",
            bounds=(1e-3, 1.4),
            default=0.2,
            scale="log",
            nodes=12,
        ),
        Parameter(
            name="phi_x",
            unit="rad",
            meaning="azimuth of the wider axis",
            bounds=(0.0, math.pi),
            default=0.0,
            period=math.pi,
            nodes=6,
        ),
    ),
    coefficients=(("k_d",), ("k_s",)),
    reciprocal=True,
    isotropic=False,
    diffuse=False,
    uses=("axes.h", "fresnel.h"),
    axes=("alpha_x", "alpha_y", "phi_x"),
    options={"fresnel": FRESNEL},
    choices={name: FRESNEL_CHOICES[name] for name in FRESNEL},
    variants=(Variant(name="isotropic", fixed={"phi_x": 0.0}, tied={"alpha_y": "alpha_x"}),),
    references=(
        Reference(
            params={
                "k_d": 0.3,
                "k_s": 1.0,
                "F0": 0.04,
                "alpha_x": 0.3,
                "alpha_y": 0.1,
                "phi_x": 0.0,
            },
            theta_i=30,
            phi_i=0,
            theta_o=40,
            phi_o=180,
            value=0.2411350805336361,
            source="the formula in 50-digit arithmetic (mpmath)",
        ),
        Reference(
            params={
                "k_d": 0.0,
                "k_s": 1.0,
                "F0": 0.9,
                "alpha_x": 0.5,
                "alpha_y": 0.2,
                "phi_x": 0.4,
            },
            theta_i=75,
            phi_i=10,
            theta_o=70,
            phi_o=195,
            value=4.50032969591718,
            source="the formula in 50-digit arithmetic (mpmath)",
        ),
        Reference(
            params={"k_d": 0.2, "k_s": 0.5, "F0": 0.5, "alpha_x": 0.2, "alpha_y": 0.2},
            theta_i=60,
            phi_i=20,
            theta_o=45,
            phi_o=170,
            value=0.1054883451106375,
            source="the formula in 50-digit arithmetic (mpmath)",
        ),
        Reference(
            params={
                "k_d": 0.1,
                "k_s": 0.8,
                "eta": 1.5,
                "alpha_x": 0.3,
                "alpha_y": 0.15,
                "phi_x": 0.4,
            },
            options={"fresnel": "dielectric"},
            theta_i=60,
            phi_i=10,
            theta_o=70,
            phi_o=195,
            value=0.5826744011548718,
            source="the formula in 50-digit arithmetic (mpmath)",
        ),
    ),
)
