"""Parameters that several lobes have in common, written once."""

from __future__ import annotations

import math

from lobefit.kernels.library import Parameter

__all__ = ["F0", "K_S"]

K_S = Parameter(
    name="k_s",
    unit="1",
    meaning="strength of the lobe",
    bounds=(0.0, math.inf),
    default=1.0,
    linear=True,
    per_channel=True,
)

F0 = Parameter(
    name="F0",
    unit="1",
    meaning="Fresnel reflectance at normal incidence",
    bounds=(0.0, 1.0),
    default=0.04,
    linear=True,
    per_channel=True,
)
