"""Lafortune: a cosine-power lobe about a direction other than the mirror's, isotropic.

Formula
-------
f = k_d/pi + k_s (n + 2)/(2 pi) max(C_xy (i_x o_x + i_y o_y) + C_z i_z o_z, 0)^n,
C_xy = -clamp(C, -1, 1),  C_z = min(1, 2 - |C|)

Convention
----------
Only the ratio of C_xy and C_z shapes the lobe: a common factor c is k_s c^n. So the larger of
|C_xy| and C_z is held at 1, and C runs once around what is left:
C = 1 mirror lobe (`modified_phong`), C = -1 retro-reflection, C = 0 powers of both cosines;
between them C_z = 1 and C_xy = -C. For |C| > 1 the lobe leans to grazing: C_xy = -+1 and
C_z = 2 - |C|, 0 at |C| = 2 and negative above.
From Lafortune 1997, sum of (C_xy' (i_x o_x + i_y o_y) + C_z' i_z o_z)^n: M = max(|C_xy'|, C_z'),
k_s = 2 pi M^n/(n + 2); C = -C_xy'/C_z' where C_z' = M, else C = (2 - C_z'/M) times the sign
of -C_xy'. A colour of C' becomes one of k_s; colours whose ratios or n differ need a lobe each.
From Ngan 2005, normalised by max(|C_xy'|, |C_z'|): the same C, and the same k_s as long as
C_z' >= -|C_xy'|.

Domain
------
n from 1 to 1e5; C from -2 to 5. Neither end is a limit of the formula: below -2 and above 5
the lobe is left over at grazing angles only. The BRDF has a kink in C at 1 and -1. At C = 1
the albedo falls to k_s cos(theta_i) as for `modified_phong`.

Source
------
E. P. F. Lafortune, S.-C. Foo, K. E. Torrance, D. P. Greenberg, Non-linear approximation of
reflectance functions, SIGGRAPH 1997, eq. 4, with C_x = C_y; A. Ngan, F. Durand, W. Matusik,
Experimental analysis of BRDF models, EGSR 2005 (normalisation).

Verified against
----------------
`modified_phong` at C = 1, the closed form cos^n(theta_i) of the albedo at C = 0, the paper's
three-lobe paint in its own parameters, and 50-digit arithmetic.
"""

from __future__ import annotations

from lobefit.kernels.library import Lobe, Parameter, Reference
from lobefit.kernels.shared_parameters import K_S

__all__ = ["LOBE"]

LOBE = Lobe(
    name="lafortune",
    title="Lafortune, one generalised cosine lobe, isotropic",
    convention="(n+2)/(2 pi), and max(|C_xy|, C_z) = 1: C_xy = -clamp(C, -1, 1), C_z = min(1, 2 - |C|)",
    source="Lafortune et al. 1997, eq. 4",
    energy="conserves energy for k_d + k_s <= 1",
    parameters=(
        K_S,
        Parameter(
            name="C",
            unit="1",
            meaning="direction: 1 mirror, -1 retro, 0 normal, beyond 1 towards grazing",
            bounds=(-2.0, 5.0),
            default=1.0,
            nodes=15,
        ),
        Parameter(
            name="n",
            unit="1",
            meaning="exponent; at C = 1 the lobe's width is about sqrt(2/n) rad",
            bounds=(1.0, 1e5),
            default=20.0,
            scale="log",
            nodes=64,
        ),
    ),
    coefficients=(("k_s",),),
    reciprocal=True,
    isotropic=True,
    peaks=("mirror", "back"),
    sets=("all",),
    uses=("projected.h", "tangential.h"),
    references=(
        Reference(
            params={"k_d": 0.2, "k_s": 0.5, "C": 1.0, "n": 10.0},
            theta_i=30,
            phi_i=0,
            theta_o=40,
            phi_o=180,
            value=0.8830431329153716,
            source="the formula in 50-digit arithmetic (mpmath)",
        ),
        Reference(
            params={"k_d": 0.0, "k_s": 1.0, "C": 1.5, "n": 30.0},
            theta_i=75,
            phi_i=10,
            theta_o=70,
            phi_o=195,
            value=1.041876662293605,
            source="the formula in 50-digit arithmetic (mpmath)",
        ),
        Reference(
            params={"k_d": 0.1, "k_s": 0.4, "C": -0.75, "n": 20.0},
            theta_i=50,
            phi_i=30,
            theta_o=70,
            phi_o=55,
            value=0.0332798973764333,
            source="the formula in 50-digit arithmetic (mpmath)",
        ),
        Reference(
            params={"k_d": 0.0, "k_s": 0.4, "C": 3.25, "n": 4.0},
            theta_i=85,
            phi_i=10,
            theta_o=82,
            phi_o=195,
            value=0.3348000778789672,
            source="the formula in 50-digit arithmetic (mpmath)",
        ),
    ),
)
