"""A measurement as the checks look at it: folded angles, distances, scans, its noise."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from lobefit.fitting.measurement import Measurement

__all__ = ["Scan", "View", "plural", "steps"]

Array = NDArray[np.float64]
Index = NDArray[np.intp]

# Half the width (rad) of what counts as the plane of incidence.
IN_PLANE = np.radians(2.5)
# Angles within this many degrees are the same position of an instrument.
SAME_DEG = 0.02


@dataclass(frozen=True, slots=True)
class Scan:
    """Rows of one in-plane scan: one direction stands still, the other runs.

    Attributes
    ----------
    fixed : float
        Polar angle of the direction that stands still.
    running : ndarray, shape (n,)
        Polar angle of the other, ascending; positive on the mirror side.
    rows : ndarray of int, shape (n,)
        Which rows of the measurement.
    source_runs : bool
        True where it is the incidence that runs.
    """

    fixed: float
    running: Array
    rows: Index
    source_runs: bool


class View:
    """Geometry of a measurement, computed once for all checks.

    Parameters
    ----------
    measurement : Measurement
        What was measured.
    """

    def __init__(self, measurement: Measurement) -> None:
        self.m = measurement

    @cached_property
    def turn(self) -> Array:
        """Give phi_o - phi_i in (-pi, pi], 0 where one of them is the normal."""
        m = self.m
        turn: Array = np.pi - np.mod(np.pi - (m.phi_o - m.phi_i), 2.0 * np.pi)
        # The last digit of two azimuths must not tell 180 degrees from -180.
        turn = np.where(turn < 1e-9 - np.pi, np.pi, turn)
        return np.where((m.theta_i < 1e-9) | (m.theta_o < 1e-9), 0.0, turn)

    def distance(self, *, mirrored: bool) -> Array:
        """Give the angle between wo and wi, or between wo and the mirror direction of wi."""
        m = self.m
        sign = -1.0 if mirrored else 1.0
        across = np.sin(m.theta_i) * np.sin(m.theta_o)
        # Through half angles, which keeps small distances exact.
        apart = np.sin(0.5 * (m.theta_o - m.theta_i)) ** 2
        half = np.sin(0.5 * self.turn) ** 2 if sign > 0 else np.cos(0.5 * self.turn) ** 2
        at_pole = (m.theta_i < 1e-9) | (m.theta_o < 1e-9)
        half = np.where(at_pole, 0.0, half)
        angle: Array = 2.0 * np.arcsin(np.sqrt(np.clip(apart + across * half, 0.0, 1.0)))
        return angle

    def log_ratio(self, first: Index, second: Index) -> Array:
        """Give ln(f[first]/f[second]); NaN where one of them is not positive."""
        ratio: Array = np.log(self.level[first] / self.level[second])
        return ratio

    def log_cosines(self, rows: Index) -> Array:
        """Give ln(cos_theta_o/cos_theta_i)."""
        ratio: Array = np.log(np.cos(self.m.theta_o[rows]) / np.cos(self.m.theta_i[rows]))
        return ratio

    @cached_property
    def to_mirror(self) -> Array:
        """Angle between wo and the mirror direction of wi, in radians."""
        return self.distance(mirrored=True)

    @cached_property
    def to_source(self) -> Array:
        """Angle between wo and wi, in radians."""
        return self.distance(mirrored=False)

    @cached_property
    def level(self) -> Array:
        """One value for each row: the mean of its channels, NaN where it is not positive.

        Bright channels count most in it, as they have least of the noise.
        """
        values = self.m.values
        there = np.isfinite(values)
        mean = np.where(there, values, 0.0).sum(axis=0) / np.maximum(there.sum(axis=0), 1)
        # A row that lacks a channel cannot be compared with one that has it.
        complete = there.sum(axis=0) == there.any(axis=1).sum()
        level: Array = np.where(complete & (mean > 0.0), mean, np.nan)
        return level

    @cached_property
    def incidences(self) -> list[Index]:
        """Rows of each incidence of the instrument, those with at least five."""
        keys = steps(self.m.theta_i) << 20 | steps(np.mod(self.m.phi_i, 2.0 * np.pi))
        return [rows for rows in _groups(keys) if rows.size >= 5]

    @cached_property
    def scans(self) -> list[Scan]:
        """In-plane scans of at least seven rows, of either direction."""
        return [*self._scans(source_runs=False), *self._scans(source_runs=True)]

    def _scans(self, *, source_runs: bool) -> Iterator[Scan]:
        m, turn = self.m, self.turn
        fixed, running = (m.theta_o, m.theta_i) if source_runs else (m.theta_i, m.theta_o)
        azimuth = m.phi_o if source_runs else m.phi_i
        near = np.abs(turn) < IN_PLANE
        plane = np.flatnonzero(near | (np.abs(turn) > np.pi - IN_PLANE) | (running < 1e-9))
        signed = np.where(near & (running > 1e-9), -running, running)
        keys = steps(fixed[plane]) << 20 | steps(np.mod(azimuth[plane], 2.0 * np.pi))
        for group in _groups(keys):
            rows = plane[group]
            rows = rows[np.argsort(signed[rows], kind="stable")]
            # A grid of azimuths can have several rows at one angle; the first will do.
            rows = rows[np.append(True, np.diff(signed[rows]) > 1e-6)]
            if rows.size >= 7 and fixed[rows[0]] > 1e-9:
                yield Scan(float(fixed[rows[0]]), signed[rows], rows, source_runs)

    @cached_property
    def roughness(self) -> tuple[Index, Array]:
        """Rows within scans, and how far (in logarithms) each lies off its two neighbours.

        Scaled to noise of one in each of the three.
        """
        logs, middle, rough = np.log(self.level), [], []
        for scan in self.scans:
            x, y = scan.running, logs[scan.rows]
            left, right = x[1:-1] - x[:-2], x[2:] - x[1:-1]
            weight = right / (left + right)
            off = y[1:-1] - weight * y[:-2] - (1.0 - weight) * y[2:]
            middle.append(scan.rows[1:-1])
            rough.append(off / np.sqrt(1.0 + weight**2 + (1.0 - weight) ** 2))
        if not rough:
            return np.empty(0, dtype=np.intp), np.empty(0)
        rows, found = np.concatenate(middle), np.concatenate(rough)
        good = np.isfinite(found)
        return rows[good], found[good]

    @cached_property
    def noise(self) -> float | None:
        """Relative noise, from how rough scans are; None where they are too few.

        By the median, since a smooth curve has large second differences in few places.
        """
        found = np.abs(self.roughness[1])
        return float(1.4826 * np.median(found)) if found.size >= 10 else None


def steps(angle: Array) -> NDArray[np.int64]:
    """Round angles in radians to positions of an instrument."""
    found: NDArray[np.int64] = np.rint(np.degrees(angle) / SAME_DEG).astype(np.int64)
    return found


def _groups(keys: NDArray[np.int64]) -> list[Index]:
    if not keys.size:
        return []
    order = np.argsort(keys, kind="stable")
    return np.split(order, np.flatnonzero(np.diff(keys[order])) + 1)


def plural(count: int, word: str) -> str:
    """Write a count with its noun.

    Examples
    --------
    >>> plural(1, "pair"), plural(3, "pair")
    ('1 pair', '3 pairs')
    """
    return f"{count} {word}{'' if count == 1 else 's'}"
