"""Lambert: the ideal diffuse surface.

Formula
-------
f = k_d / pi

Convention
----------
k_d is the albedo: the directional albedo is k_d at every angle.

Domain
------
k_d >= 0 per channel. Above 1 the surface would give out more than it receives; a
fit may say so, and the report then does. No measured surface is Lambertian beyond
about 60 degrees; it is the term that the other models are added to.

Source
------
J. H. Lambert, Photometria, 1760.

Verified against
----------------
The closed form, and values of Mitsuba 3.9.1 (`diffuse`).
"""

from __future__ import annotations

import math

from lobefit.kernels.library import Lobe, Parameter, Reference

__all__ = ["LOBE"]

LOBE = Lobe(
    name="lambert",
    title="Lambert, the ideal diffuse surface",
    convention="albedo: f = k_d / pi",
    source="Lambert 1760",
    energy="conserves energy for k_d <= 1",
    parameters=(
        Parameter(
            name="k_d",
            unit="1",
            meaning="albedo of the diffuse term",
            bounds=(0.0, math.inf),
            default=0.5,
            linear=True,
            per_channel=True,
        ),
    ),
    coefficients=(("k_d",),),
    reciprocal=True,
    isotropic=True,
    diffuse=False,
    sets=("quick", "standard", "all"),
    references=(
        Reference(
            params={"k_d": 0.5},
            theta_i=0,
            phi_i=0,
            theta_o=0,
            phi_o=0,
            value=0.15915494309189535,
            source="k_d / pi",
        ),
        Reference(
            params={"k_d": 1.0},
            theta_i=60,
            phi_i=0,
            theta_o=80,
            phi_o=45,
            value=0.3183098861837907,
            source="1 / pi",
        ),
        Reference(
            params={"k_d": 0.3},
            theta_i=81.099842814,
            phi_i=216.539408744,
            theta_o=78.078153969,
            phi_o=39.803700321,
            value=0.09549296585513721,
            source="0.3 / pi; Mitsuba 3.9.1 gives 0.0954929641",
        ),
    ),
)
