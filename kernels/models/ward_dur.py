"""Ward-Dur 2006: Ward's Gaussian lobe over the cosines themselves.

Formula
-------
f = k_d/pi + k_s exp(-(h_x^2/alpha_x^2 + h_y^2/alpha_y^2)/h_z^2)
             / (4 pi alpha_x alpha_y cos_theta_i cos_theta_o),
with the half vector h in axes whose x stands at the azimuth phi_x.

Convention
----------
"Dur 2006": the product of the cosines, where Ward 1992 has its square root. Their k_s are
not each other's: at 60 degrees the lobes differ by a factor of 2.

Domain
------
alpha_x >= alpha_y from 1e-4 to 2; phi_x in [0, pi), the azimuth of the wider axis. The
variant `ward_dur:isotropic` has one alpha and is the only one fitted where the sample was
not turned. Narrow lobes keep their albedo up to grazing incidence, which Ward's do not
(0.977 against 0.120 at 85 degrees for alpha = 0.1); wide ones exceed 1 there (1.333 at 85
degrees for alpha = 0.5, k_s = 1), without a bound.

Source
------
A. Dur, An improved normalization for the Ward reflectance model, Journal of Graphics Tools
11(1), 2006: the normalisation that gives the paper its name; G. J. Ward, SIGGRAPH 1992,
eq. 4, for the lobe.

Verified against
----------------
Directional albedos by independent quadrature (0.981, 0.981, 0.977 at 0, 60, 85 degrees for
alpha = 0.1; 0.695, 0.657, 1.333 for alpha = 0.5) and 50-digit arithmetic.
"""

from __future__ import annotations

import math

from lobefit.kernels.library import Lobe, Parameter, Reference, Variant
from lobefit.kernels.shared_parameters import K_S

__all__ = ["LOBE"]

LOBE = Lobe(
    name="ward_dur",
    title="Ward-Dur 2006, Ward's lobe with the albedo of narrow lobes mended",
    convention="Dur 2006: over 4 pi alpha_x alpha_y cos_theta_i cos_theta_o",
    source="Dur 2006; the lobe of Ward 1992, eq. 4",
    energy="no bound on k_d + k_s conserves it at grazing: the albedo of wide lobes diverges",
    parameters=(
        K_S,
        Parameter(
            name="alpha_x",
            unit="1",
            meaning="roughness (slope) along the wider axis",
            bounds=(1e-4, 2.0),
            default=0.2,
            scale="log",
            nodes=12,
        ),
        Parameter(
            name="alpha_y",
            unit="1",
            meaning="roughness (slope) along the narrower axis",
            bounds=(1e-4, 2.0),
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
            scale="linear",
            period=math.pi,
            nodes=6,
        ),
    ),
    coefficients=(("k_s",),),
    reciprocal=True,
    isotropic=False,
    sets=("all",),
    uses=("ward.h",),
    axes=("alpha_x", "alpha_y", "phi_x"),
    variants=(Variant(name="isotropic", fixed={"phi_x": 0.0}, tied={"alpha_y": "alpha_x"}),),
    references=(
        Reference(
            params={"k_d": 0.1, "k_s": 0.3, "alpha_x": 0.3, "alpha_y": 0.1, "phi_x": 0.0},
            theta_i=30,
            phi_i=0,
            theta_o=40,
            phi_o=180,
            value=1.133547656744361,
            source="the formula in 50-digit arithmetic (mpmath)",
        ),
        Reference(
            params={"k_d": 0.0, "k_s": 1.0, "alpha_x": 0.5, "alpha_y": 0.2, "phi_x": 0.4},
            theta_i=75,
            phi_i=10,
            theta_o=70,
            phi_o=195,
            value=5.348159848308667,
            source="the formula in 50-digit arithmetic (mpmath)",
        ),
        Reference(
            params={"k_d": 0.2, "k_s": 0.5, "alpha_x": 0.2, "alpha_y": 0.2},
            theta_i=60,
            phi_i=20,
            theta_o=45,
            phi_o=170,
            value=0.1729102008904969,
            source="the formula in 50-digit arithmetic (mpmath)",
        ),
    ),
)
