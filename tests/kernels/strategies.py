"""Legal parameters and hard directions, drawn for every registered model alike."""

from __future__ import annotations

import itertools
import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from hypothesis import strategies as st

from lobefit.kernels import Model, Parameter

__all__ = ["Directions", "Params", "awkward_directions", "directions", "legal_params", "rotated"]

Params = dict[str, float | list[float]]

# Coefficients have no upper bound; 10 is far above any that a surface has.
LARGEST_COEFFICIENT = 10.0
N_CHANNELS = 3


class Directions(NamedTuple):
    """N pairs of directions, angles in radians."""

    theta_i: npt.NDArray[np.float64]
    phi_i: npt.NDArray[np.float64]
    theta_o: npt.NDArray[np.float64]
    phi_o: npt.NDArray[np.float64]

    def swapped(self) -> Directions:
        """Exchange light and eye."""
        return Directions(self.theta_o, self.phi_o, self.theta_i, self.phi_i)

    def exact(self) -> list[npt.NDArray[np.longdouble]]:
        """Give the same angles in extended precision, for a reference without rounding."""
        return [angle.astype(np.longdouble) for angle in self]


def rotated(d: Directions, angle: float) -> Directions:
    """Turn both directions about the normal."""
    return Directions(d.theta_i, d.phi_i + angle, d.theta_o, d.phi_o + angle)


def directions(count: int, seed: int, *, theta_max: float = 89.0) -> Directions:
    """Give pairs up to a zenith angle in degrees, half of them near the mirror direction.

    The distance from the mirror direction is log-uniform from 1e-5 to 1 rad, so that lobes of
    any width are seen at their peak, on their flank and in their tail.
    """
    rng = np.random.default_rng(seed)
    theta_i, theta_o = np.arccos(rng.uniform(math.cos(math.radians(theta_max)), 1, (2, count)))
    phi_i, phi_o = rng.uniform(0, 2 * np.pi, (2, count))
    near = np.arange(count) % 2 == 0
    distance = 10 ** rng.uniform(-5, 0, count)
    turn = rng.uniform(0, 2 * np.pi, count)
    near_theta = np.abs(theta_i + distance * np.cos(turn))
    near_phi = phi_i + np.pi + distance * np.sin(turn) / np.maximum(np.sin(theta_i), distance)
    near &= near_theta < math.radians(theta_max)
    return Directions(
        theta_i, phi_i, np.where(near, near_theta, theta_o), np.where(near, near_phi, phi_o)
    )


def awkward_directions() -> Directions:
    """Every pair of pole, near-pole, middle and grazing zenith angles at every odd azimuth.

    Among them are the exact mirror and the exact retroreflection at 89.9999 degrees.
    """
    theta = np.radians([0.0, 1e-7, 1e-3, 30.0, 45.0, 80.0, 89.9, 89.9999])
    phi_i = np.radians([0.0, 37.0, 180.0])
    turn = np.radians([0.0, 1e-7, 1e-3, 45.0, 90.0, 135.0, 179.999, 180.0, 270.0, 360.0])
    grid = np.array(list(itertools.product(theta, phi_i, theta, turn)))
    return Directions(grid[:, 0], grid[:, 1], grid[:, 2], grid[:, 1] + grid[:, 3])


@st.composite
def legal_params(draw: st.DrawFn, model: Model) -> Params:
    """Draw parameters within the record's bounds, the bounds themselves often among them."""
    params: Params = {}
    for parameter in model.parameters:
        values = _values(parameter)
        if parameter.per_channel:
            lists = st.lists(values, min_size=N_CHANNELS, max_size=N_CHANNELS)
            params[parameter.name] = draw(values | lists)
        else:
            params[parameter.name] = draw(values)
    if model.lobe.axes is not None:
        wide, narrow, _ = model.lobe.axes
        axes = draw(_values(_named(model, wide))), draw(_values(_named(model, narrow)))
        params[wide], params[narrow] = max(axes), min(axes)
    return params


def _values(parameter: Parameter) -> st.SearchStrategy[float]:
    low, high = parameter.bounds
    high = min(high, LARGEST_COEFFICIENT) if parameter.linear else high
    if parameter.scale == "log":
        inner = st.floats(math.log(low), math.log(high)).map(
            lambda logarithm: min(max(math.exp(logarithm), low), high)
        )
    else:
        inner = st.floats(low, high, allow_subnormal=False)
    return st.sampled_from([low, high, parameter.default]) | inner


def _named(model: Model, name: str) -> Parameter:
    return next(p for p in model.parameters if p.name == name)
