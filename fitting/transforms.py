"""Transforms between parameters on their physical scale and coordinates without edges.

A coordinate at a time, with the Jacobian d theta / d q that densities are multiplied with.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["Lever", "NoisePair", "Transforms", "Way"]

Array = NDArray[np.float64]

# Coordinates go no further than this: exp(700) is the end of double precision.
FARTHEST = 600.0


@dataclass(frozen=True, slots=True)
class Way:
    """How one parameter is sampled.

    Attributes
    ----------
    low, high : float
        Between which values it lies; either may be infinite.
    logarithmic : bool
        The coordinate is one of log(theta), for a range with two positive ends.
    centre, period : float
        An angle is sampled as it is within half a period of the centre; 0 for none.
    """

    low: float = -np.inf
    high: float = np.inf
    logarithmic: bool = False
    centre: float = 0.0
    period: float = 0.0

    @property
    def kind(self) -> str:
        """Give "identity", "log", "logit" or "log_logit"."""
        if self.period or not np.isfinite(self.low):
            if np.isfinite(self.high) and not self.period:
                raise ValueError("a range that is bounded above only has no transform")
            return "identity"
        if not np.isfinite(self.high):
            return "log"
        return "log_logit" if self.logarithmic else "logit"


@dataclass(frozen=True, slots=True)
class Lever:
    """A scale that is sampled by what it makes together with its ratio.

    With ``k_s F0`` and ``k_s`` as coefficients the data know ``along k_s F0 + beside k_s`` best.
    The logarithm of that is sampled instead of log(k_s), so that a ratio that the data leave open
    makes no bent ridge. At a given ratio it is a shift, which changes no Jacobian.

    Attributes
    ----------
    scale, ratio : int
        Columns; the scale's way must be "log" from 0.
    along, beside : float
        Weights, not negative, not both 0.
    """

    scale: int
    ratio: int
    along: float
    beside: float


@dataclass(frozen=True, slots=True)
class NoisePair:
    """Two scales of noise that are sampled by their sum at a level, and the additive one's share.

    With ``v = additive^2 + (relative level)^2`` these are log(v)/2 and the logit of
    ``additive^2 / v``. Where all readings are of one level only v is known, and the ridge, bent at
    a right angle in the logarithms of the scales, is straight.

    Attributes
    ----------
    additive, relative : int
        Columns; both ways must be "log" from 0.
    level : float
        In 1/sr.
    """

    additive: int
    relative: int
    level: float


class Transforms:
    """The transforms of all coordinates, vectorised over walkers.

    Parameters
    ----------
    ways : sequence of Way
        One for each coordinate.
    levers : sequence of Lever
        Scales that are sampled together with their ratios.
    pairs : sequence of NoisePair
        Scales of noise that are sampled together.
    """

    def __init__(
        self,
        ways: Sequence[Way],
        levers: Sequence[Lever] = (),
        pairs: Sequence[NoisePair] = (),
    ) -> None:
        self._additive = np.array([pair.additive for pair in pairs], dtype=np.intp)
        self._relative = np.array([pair.relative for pair in pairs], dtype=np.intp)
        self._level = np.array([pair.level for pair in pairs])
        self._scales = np.array([lever.scale for lever in levers], dtype=np.intp)
        self._ratios = np.array([lever.ratio for lever in levers], dtype=np.intp)
        self._along = np.array([lever.along for lever in levers])
        self._beside = np.array([lever.beside for lever in levers])
        kinds = np.array([way.kind for way in ways], dtype=object)
        kinds[self._additive] = kinds[self._relative] = "pair"
        self._log = np.flatnonzero(kinds == "log")
        self._logit = np.flatnonzero((kinds == "logit") | (kinds == "log_logit"))
        self._exp = np.flatnonzero(kinds == "log_logit")
        self._angles = np.flatnonzero([way.period > 0.0 for way in ways])
        self._floor = np.array([way.low for way in ways])[self._log]
        edges = np.array([(way.low, way.high) for way in ways]).reshape(-1, 2)
        self._low, self._high = edges[self._logit].T
        scaled = edges.copy()
        scaled[self._exp] = np.log(edges[self._exp])
        self._start = scaled[self._logit, 0]
        self._span = scaled[self._logit, 1] - self._start
        self._centre = np.array([way.centre for way in ways])[self._angles]
        self._half = 0.5 * np.array([way.period for way in ways])[self._angles]

    def inside(self, q: Array) -> NDArray[np.bool_]:
        """Tell, for each row of q (W, n), whether it is finite and its angles are in range."""
        good = np.abs(q).max(axis=1, initial=0.0) < FARTHEST
        if len(self._angles):
            turned = np.abs(q[:, self._angles] - self._centre)
            good &= (turned <= self._half).all(axis=1)
        return np.asarray(good)

    def to_parameters(self, q: Array) -> Array:
        """Give theta of q, both of shape (W, n)."""
        theta = q.copy()
        if len(self._log):
            theta[:, self._log] = self._floor + np.exp(q[:, self._log])
        if len(self._logit):
            theta[:, self._logit] = self._start + self._span * _expit(q[:, self._logit])
            if len(self._exp):
                theta[:, self._exp] = np.exp(theta[:, self._exp])
            # Rounding must not carry it past its bound.
            theta[:, self._logit] = np.clip(theta[:, self._logit], self._low, self._high)
        if len(self._scales):
            theta[:, self._scales] /= self._made(theta)
        if len(self._additive):
            both, share = np.exp(q[:, self._additive]), q[:, self._relative]
            theta[:, self._additive] = both * np.sqrt(_expit(share))
            theta[:, self._relative] = both * np.sqrt(_expit(-share)) / self._level
        return theta

    def _made(self, theta: Array) -> Array:
        """Give what a scale of 1 makes together with its ratio; above 0."""
        made: Array = self._along * theta[:, self._ratios] + self._beside
        return np.maximum(made, 1e-12)

    def to_coordinates(self, theta: Array) -> Array:
        """Give q of theta, both of shape (W, n); at an edge the nearest coordinate within."""
        q = np.array(theta, dtype=np.float64)
        tiny = 1e-12
        if len(self._additive):
            a = np.maximum(theta[:, self._additive], 1e-150)
            r = np.maximum(theta[:, self._relative] * self._level, 1e-150)
            q[:, self._additive] = np.log(np.hypot(a, r))
            q[:, self._relative] = 2.0 * (np.log(a) - np.log(r))
        if len(self._scales):
            q[:, self._scales] *= self._made(theta)
        if len(self._log):
            q[:, self._log] = np.log(np.maximum(q[:, self._log] - self._floor, 1e-150))
        if len(self._exp):
            q[:, self._exp] = np.log(q[:, self._exp])
        if len(self._logit):
            share = np.clip((q[:, self._logit] - self._start) / self._span, tiny, 1.0 - tiny)
            q[:, self._logit] = np.log(share) - np.log1p(-share)
        if len(self._angles):
            turned = np.remainder(q[:, self._angles] - self._centre + self._half, 2 * self._half)
            q[:, self._angles] = self._centre - self._half + turned
        return q

    def log_jacobian(self, q: Array, theta: Array) -> Array:
        """Give the sum over the coordinates of log |d theta / d q|, shape (W,)."""
        total = np.zeros(len(q))
        if len(self._log):
            total += q[:, self._log].sum(axis=1)
        if len(self._logit):
            a = np.abs(q[:, self._logit])
            total += (np.log(self._span) - a - 2.0 * np.log1p(np.exp(-a))).sum(axis=1)
            if len(self._exp):
                total += np.log(theta[:, self._exp]).sum(axis=1)
        if len(self._scales):
            total -= np.log(self._made(theta)).sum(axis=1)
        if len(self._additive):
            # d(log a, log r) / d(log v / 2, logit share) has the determinant 1/2.
            share = np.abs(q[:, self._relative])
            total += (2.0 * q[:, self._additive] - 0.5 * share - np.log1p(np.exp(-share))).sum(
                axis=1
            )
            total -= np.log(2.0 * self._level).sum()
        return total


def _expit(q: Array) -> Array:
    small = np.exp(-np.abs(q))
    share: Array = np.where(q < 0.0, small, 1.0) / (1.0 + small)
    return share
