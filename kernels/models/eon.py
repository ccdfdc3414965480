"""EON: Oren-Nayar without its loss of energy.

Formula
-------
f = rho/pi A (1 + r s/t) + rho_ms/pi (1 - E(theta_i)) (1 - E(theta_o))/(1 - E_mean),
s = cos(phi_o - phi_i) sin(theta_i) sin(theta_o),
t = max(cos_theta_i, cos_theta_o) where s > 0, else 1,
A = 1/(1 + (1/2 - 2/(3 pi)) r),  E_mean = A (1 + (2/3 - 28/(15 pi)) r),
rho_ms = rho^2 E_mean/(1 - rho (1 - E_mean)),
E = A + (r A/pi) (S (theta - S m) + (2/3) ((S/m) (1 - S^3) - S)),  m = cos(theta), S = sin(theta)

Convention
----------
E is the exact albedo of the first term for rho = 1, not the paper's polynomial. rho is the
albedo of one bounce; the surface's albedo is at most rho, and rho exactly for rho = 0, 1 or
r = 0. The roughness r in [0, 1] takes the place of sigma; r = 0 is `lambert` with k_d = rho.

Domain
------
rho from 0 to 1 per channel, r from 0 to 1. The BRDF is not linear in rho, since light that
bounces twice is coloured twice: rho is searched for, channel by channel.

Source
------
J. Portsmouth, P. Kutz, S. Hill, EON: a practical energy-preserving rough diffuse BRDF,
JCGT 14(1), 2025; the first term after Fujii's improved Oren-Nayar (FON in the paper).

Verified against
----------------
Directional albedos by independent quadrature: 1 at every angle for rho = 1 (to 1e-12); the
published 0.7765, 0.8653, 0.9777 at 0, 60, 85 degrees of the first term for r = 1; and
50-digit arithmetic.
"""

from __future__ import annotations

from lobefit.kernels.library import Lobe, Parameter, Reference

__all__ = ["LOBE"]

LOBE = Lobe(
    name="eon",
    title="EON, an energy-preserving Oren-Nayar",
    convention="exact albedo of the single-scattering term; rho is the albedo of one bounce",
    source="Portsmouth, Kutz, Hill 2025",
    energy="conserves energy for every rho and r; rho = 1 reflects all light",
    parameters=(
        Parameter(
            name="rho",
            unit="1",
            meaning="albedo of one bounce",
            bounds=(0.0, 1.0),
            default=0.5,
            per_channel=True,
            nodes=17,
        ),
        Parameter(
            name="r",
            unit="1",
            meaning="roughness",
            bounds=(0.0, 1.0),
            default=0.3,
            nodes=9,
        ),
    ),
    coefficients=((),),
    reciprocal=True,
    isotropic=True,
    diffuse=False,
    sets=("all",),
    uses=("tangential.h", "projected.h"),
    references=(
        Reference(
            params={"rho": 0.5, "r": 0.3},
            theta_i=30,
            phi_i=0,
            theta_o=40,
            phi_o=180,
            value=0.1391508162473855,
            source="the formula in 50-digit arithmetic (mpmath)",
        ),
        Reference(
            params={"rho": 0.8, "r": 1.0},
            theta_i=50,
            phi_i=30,
            theta_o=70,
            phi_o=55,
            value=0.4167430089503362,
            source="the formula in 50-digit arithmetic (mpmath)",
        ),
        Reference(
            params={"rho": 0.95, "r": 0.7},
            theta_i=85,
            phi_i=5,
            theta_o=80,
            phi_o=185,
            value=0.08014417983797119,
            source="the formula in 50-digit arithmetic (mpmath)",
        ),
        Reference(
            params={"rho": 0.6, "r": 0.0},
            theta_i=60,
            phi_i=20,
            theta_o=45,
            phi_o=170,
            value=0.1909859317102744,
            source="the formula in 50-digit arithmetic (mpmath)",
        ),
    ),
)
