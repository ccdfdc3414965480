"""Measurements that the checks of data are tried on."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

from lobefit.fitting import Measurement, simulate

GLOSSY: dict[str, Any] = {"k_d": 0.1, "F0": 0.3, "alpha": 0.1}
ROUGH: dict[str, Any] = {"k_d": 0.1, "F0": 0.5, "alpha": 0.35}
IN_PLANE = "in-plane incidences=10,20,30,40,50,60,70 step=2"
HEMISPHERE = "hemisphere incidences=20,40,60 theta_step=10 phi_step=30"


@cache
def glossy(geometry: str = IN_PLANE, seed: int = 1) -> Measurement:
    """Measure a glossy surface."""
    return simulate("ggx", GLOSSY, geometry, noise=(0.02, 1e-4), seed=seed)


@cache
def rough(geometry: str = IN_PLANE, seed: int = 1) -> Measurement:
    """Measure a rough one."""
    return simulate("ggx", ROUGH, geometry, noise=(0.02, 1e-4), seed=seed)


def times(m: Measurement, factor: Any) -> Measurement:
    """Multiply the values."""
    return replace(m, values=m.values * factor)
