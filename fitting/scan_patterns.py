"""Scan patterns: the directions that a goniometer visits.

`InPlane` is the common instrument: the detector runs through the plane of incidence on both
sides of the normal. `Hemisphere` is the grid over all directions of view. A pattern is also
written as text, ``in-plane incidences=15,45,70 step=2.5``, in commands and in metadata.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, fields, replace
from difflib import get_close_matches
from math import ceil
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from lobefit.kernels.errors import MeasurementError

__all__ = ["MAX_DIRECTIONS", "PATTERNS", "Angles", "Hemisphere", "InPlane", "Pattern", "pattern"]

Array = NDArray[np.float64]
Angles = tuple[Array, Array, Array, Array]

MAX_DIRECTIONS = 10_000_000
"""More directions are a mistyped step, not a scan."""

# Two directions closer than this are one, as for the reader of files.
_PER_DEGREE = 1e9
# So that 80 degrees in steps of 0.1 do not end at 79.9.
_ROUNDING = 1e-9


@dataclass(frozen=True, kw_only=True)
class Pattern:
    """What all patterns share; all angles in degrees.

    Parameters
    ----------
    incidences_deg : sequence of float
        Polar angles of incidence.
    azimuths_deg : sequence of float
        Azimuths of incidence; several mean that the sample is turned, which is
        how anisotropy is seen.
    max_deg : float
        Largest polar angle of view.
    blind_deg : float
        Views closer than this to the light are left out: there the detector
        stands in its way.

    Raises
    ------
    MeasurementError
        If an angle is below the horizon or a step leads nowhere.
    """

    name: ClassVar[str] = ""

    incidences_deg: Sequence[float] = (0.0, 15.0, 30.0, 45.0, 60.0, 75.0)
    azimuths_deg: Sequence[float] = (0.0,)
    max_deg: float = 80.0
    blind_deg: float = 0.0

    def __post_init__(self) -> None:
        """Refuse what is no scan."""
        for name in ("incidences_deg", "azimuths_deg"):
            numbers = tuple(float(number) for number in getattr(self, name))
            object.__setattr__(self, name, numbers)
            if not numbers or not np.isfinite(numbers).all():
                raise self._error(name, numbers, "one or more angles in degrees")
        if min(self.incidences_deg) < 0 or max(self.incidences_deg) >= 90:
            raise self._error("incidences_deg", self.incidences_deg, "angles from 0 to below 90")
        if not 0 < self.max_deg < 90:
            raise self._error("max_deg", self.max_deg, "an angle above 0 and below 90")
        if not 0 <= self.blind_deg < 90:
            raise self._error("blind_deg", self.blind_deg, "an angle from 0 to below 90")
        for entry in fields(self):
            step = getattr(self, entry.name)
            if entry.name.endswith("step_deg") and not 0 < step <= 90:
                raise self._error(entry.name, step, "a step above 0, at most 90 degrees")
        if self.at_most > MAX_DIRECTIONS:
            raise self._error("a step", "too small", f"at most {MAX_DIRECTIONS:,} directions")

    def _error(self, name: str, found: object, expected: str) -> MeasurementError:
        return MeasurementError(f"{self.name}: {name} is {found}", expected=expected)

    @property
    def at_most(self) -> float:
        """Bound the number of directions without making them."""
        return len(self.incidences_deg) * len(self.azimuths_deg) * self._views_at_most()

    def _views(self) -> tuple[Array, Array]:
        """Give theta_o and phi_o - phi_i of one incidence, in degrees."""
        raise NotImplementedError

    def _views_at_most(self) -> float:
        """Bound the number of views without making them."""
        raise NotImplementedError

    def turned(self) -> Pattern:
        """Give the same scan with the sample turned in four steps of 45 degrees."""
        return replace(self, azimuths_deg=(0.0, 45.0, 90.0, 135.0))

    def angles(self) -> Angles:
        """List the directions.

        Returns
        -------
        theta_i, phi_i, theta_o, phi_o : ndarray, shape (N,)
            In radians, azimuths in [0, 2 pi), 0 at the pole; no direction twice.
        """
        view, turn = self._views()
        incidence = np.array(
            [(theta, phi) for phi in self.azimuths_deg for theta in self.incidences_deg]
        )
        grid = np.empty((4, len(incidence), len(view)))
        grid[0], grid[1] = incidence[:, :1], incidence[:, 1:]
        grid[2], grid[3] = view, incidence[:, 1:] + turn
        degrees = grid.reshape(4, -1)
        for theta, phi in ((0, 1), (2, 3)):
            degrees[phi] = np.where(degrees[theta] == 0, 0.0, np.mod(degrees[phi], 360.0))
        keys = np.rint(degrees * _PER_DEGREE)
        degrees = degrees[:, np.sort(np.unique(keys, axis=1, return_index=True)[1])]
        radians = np.deg2rad(degrees)
        if self.blind_deg:
            radians = radians[:, ~_close(radians, np.deg2rad(self.blind_deg))]
        theta_i, phi_i, theta_o, phi_o = radians
        return theta_i, phi_i, theta_o, phi_o

    def __str__(self) -> str:
        """Write the pattern as the text that `pattern` reads."""
        words = [self.name]
        for entry in fields(self):
            value = getattr(self, entry.name)
            numbers = value if isinstance(value, tuple) else (value,)
            text = ",".join(f"{number:.9g}" for number in numbers)
            words.append(f"{entry.name.removesuffix('_deg')}={text}")
        return " ".join(words)


@dataclass(frozen=True, kw_only=True)
class InPlane(Pattern):
    """A goniometer's scan: the detector runs through the plane of incidence.

    From ``-max_deg`` on the side of the light (phi_o = phi_i) over the normal to
    ``+max_deg`` on the side of the mirror direction (phi_o = phi_i + 180).

    Parameters
    ----------
    step_deg : float
        Between views.
    """

    name: ClassVar[str] = "in-plane"

    step_deg: float = field(default=2.0)

    def _views_at_most(self) -> float:
        return 2 * self.max_deg / self.step_deg + 1

    def _views(self) -> tuple[Array, Array]:
        count = int(self.max_deg / self.step_deg + _ROUNDING)
        signed = np.arange(-count, count + 1) * self.step_deg
        return np.abs(signed), np.where(signed > 0, 180.0, 0.0)


@dataclass(frozen=True, kw_only=True)
class Hemisphere(Pattern):
    """A grid over all directions of view, for every incidence.

    Parameters
    ----------
    theta_step_deg, phi_step_deg : float
        Between rings, and between views on a ring; the azimuths start in the
        plane of incidence on the side of the light.
    """

    name: ClassVar[str] = "hemisphere"

    incidences_deg: Sequence[float] = (10.0, 30.0, 50.0, 70.0)
    theta_step_deg: float = field(default=5.0)
    phi_step_deg: float = field(default=15.0)

    def _views_at_most(self) -> float:
        return (self.max_deg / self.theta_step_deg + 1) * (360 / self.phi_step_deg + 1)

    def _views(self) -> tuple[Array, Array]:
        rings = np.arange(1, int(self.max_deg / self.theta_step_deg + _ROUNDING) + 1)
        turns = np.arange(ceil(360 / self.phi_step_deg - _ROUNDING)) * self.phi_step_deg
        theta = np.repeat(rings * self.theta_step_deg, turns.size)
        return np.append(0.0, theta), np.append(0.0, np.tile(turns, rings.size))


PATTERNS: dict[str, type[Pattern]] = {p.name: p for p in (InPlane, Hemisphere)}
"""By the name that texts and commands use."""


def pattern(text: str) -> Pattern:
    """Read a pattern from text.

    Parameters
    ----------
    text : str
        ``in-plane`` or ``hemisphere``, then any of its parameters in degrees:
        ``in-plane incidences=15,45,70 step=2.5 max=75``.

    Raises
    ------
    MeasurementError
        No such pattern or parameter, or no number where one is needed.
    """
    name, *settings = text.split() or [""]
    if name not in PATTERNS:
        near = get_close_matches(name, PATTERNS, n=1)
        hint = f"; did you mean {near[0]!r}?" if near else ""
        raise MeasurementError(
            f"{name!r} is no scan pattern{hint}",
            text=text,
            expected=f"{', '.join(PATTERNS)}, a pattern with parameters, or four arrays of angles",
        )
    kind = PATTERNS[name]
    known = {entry.name.removesuffix("_deg"): entry for entry in fields(kind)}
    values: dict[str, float | tuple[float, ...]] = {}
    for word in settings:
        key, _, numbers = word.partition("=")
        if key not in known:
            raise MeasurementError(
                f"{name} has no parameter {key!r}",
                text=text,
                expected=" ".join(f"{other}=..." for other in known),
            )
        try:
            parsed = tuple(float(number) for number in numbers.split(","))
        except ValueError:
            raise MeasurementError(
                f"{key} is not a number: {numbers!r}", text=text, expected=f"{key}=DEGREES"
            ) from None
        several = isinstance(known[key].default, tuple)
        if not several and len(parsed) != 1:
            raise MeasurementError(f"{key} is one number", text=text, expected=f"{key}=DEGREES")
        values[known[key].name] = parsed if several else parsed[0]
    return kind(**values)  # type: ignore[arg-type]


def _close(radians: Array, limit: float) -> NDArray[np.bool_]:
    """Find views closer to the light than the limit (a hair less: a view on it is seen)."""
    theta_i, phi_i, theta_o, phi_o = radians
    # Haversines keep small angles exact, which the cosine of the angle does not.
    haversine = np.sin((theta_i - theta_o) / 2) ** 2
    haversine += np.sin(theta_i) * np.sin(theta_o) * np.sin((phi_i - phi_o) / 2) ** 2
    close: NDArray[np.bool_] = haversine < np.sin(limit / 2) ** 2 * (1 - 1e-9)
    return close
