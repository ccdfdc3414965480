"""Reciprocal pairs of a measurement: light and detector exchanged.

For an isotropic surface a pair is (theta_i, theta_o, phi) and (theta_o, theta_i, phi), with phi the
unsigned difference of the azimuths. Where the instrument visited no such pairs, one partner is
interpolated among its neighbours in half and difference angles (Rusinkiewicz 1998), in which
lobes are smooth: the exchange turns (theta_h, theta_d, phi_d) into (theta_h, theta_d, pi - phi_d).
On a surface that changes when it is turned the azimuths of both must match, but for a half turn.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from lobefit.fitting.checks.azimuths import differs_when_turned
from lobefit.fitting.checks.view import View, steps

__all__ = ["Pairs", "reciprocal_pairs"]

Array = NDArray[np.float64]

# Exact pairs that are enough not to interpolate, and interpolated ones not to reach further.
ENOUGH, ENOUGH_NEAR = 20, 100
# Standard deviations beyond which a single pair is not reciprocal.
STANDS_OUT = 4.0
# Values at larger polar angles are not compared: cosines amplify what is wrong with them.
MAX_THETA = np.radians(80.01)
# Smallest |ln(cos_o/cos_i)| at which a cosine would show.
LEAST = 0.02
# Levels at which the noise is looked up.
LEVELS = 2000
# How far (degrees of half or difference angle) the nearest neighbour may be, tried in turn.
REACHES = (0.8, 1.6, 3.2)
NEIGHBOURS = 8
QUERIES = 1500
# So many at a time are looked for together.
BLOCK = 32
ROWS = 20_000
# Misalignment (rad) that a pair on the flank of a peak must exceed to count.
ALIGNED = np.radians(0.5)
# Scan values on either side, by level, whose roughness gives the noise at a level.
AROUND = 15
# A local gradient that changes the value more than this over the reach is a peak's flank.
STEEP = 0.4


@dataclass(frozen=True)
class Pairs:
    """Ratios of reciprocal pairs.

    Attributes
    ----------
    ratio : ndarray, shape (n,)
        ln f(i, o) - ln f(o, i).
    cosines : ndarray, shape (n,)
        ln cos_theta_o - ln cos_theta_i of the same rows.
    kind : {"exact", "interpolated", "model"}
        Both measured; one of them interpolated; or the second from a fitted model.
    tolerance : ndarray, shape (n,), or None
        Standard deviations of the ratios of measured pairs from the noise at their level and
        from misalignment; NaN where no scan tells.
    """

    ratio: Array
    cosines: Array
    kind: Literal["exact", "interpolated", "model"]
    tolerance: Array | None = None

    def __len__(self) -> int:
        """Count the pairs."""
        return len(self.ratio)

    @cached_property
    def exponent(self) -> float:
        """Give p of a factor cos_theta_o^p, by least absolute deviations.

        0 for reciprocal values; 1 where f cos_theta_o, or f over cos_theta_i, stands for f.
        """
        slope = self.ratio / self.cosines
        order = np.argsort(slope)
        weight = np.cumsum(np.abs(self.cosines[order]))
        return float(slope[order][np.searchsorted(weight, 0.5 * weight[-1])])

    @cached_property
    def exponent_error(self) -> float:
        """Give a robust standard error of `exponent`."""
        rest = self.ratio - self.exponent * self.cosines
        scatter = 1.4826 * float(np.median(np.abs(rest)))
        return 1.25 * scatter / float(np.sqrt(np.sum(self.cosines**2)))

    @property
    def outward(self) -> Array:
        """Give the ratios of the pairs that stand out, > 0: larger at the larger view angle."""
        if self.tolerance is None:
            return np.empty(0)
        outward = -self.ratio * np.sign(self.cosines)
        found: Array = outward[np.abs(outward) > STANDS_OUT * self.tolerance]
        return found

    @property
    def median_ratio(self) -> float:
        """Give the median of the larger over the smaller value of a pair."""
        return float(np.exp(np.median(np.abs(self.ratio))))


def reciprocal_pairs(view: View) -> Pairs | None:
    """Find reciprocal pairs, or interpolate them.

    Parameters
    ----------
    view : View
        The measurement.

    Returns
    -------
    Pairs or None
        None where fewer than five can be had.
    """
    anisotropic = differs_when_turned(view)[0]
    exact = _exact(view, anisotropic)
    if exact is not None and len(exact) >= ENOUGH:
        return exact
    near = None if anisotropic else _interpolated(view)
    found = max((p for p in (exact, near) if p is not None), key=len, default=None)
    return found if found is not None and len(found) >= 5 else None


def _exact(view: View, anisotropic: bool) -> Pairs | None:
    m = view.m
    a, b = steps(m.theta_i), steps(m.theta_o)
    if anisotropic:
        # Axes, not directions: a grain has no head or tail.
        half, full = steps(np.array([np.pi, 2.0 * np.pi]))
        first, second = (steps(np.mod(phi, np.pi)) % half for phi in (m.phi_i, m.phi_o))
        signed = steps(view.turn)
        own = _key(a, b, first, signed % full)
        other = _key(b, a, second, -signed % full)
    else:
        turn = steps(np.abs(view.turn))
        own, other = _key(a, b, np.zeros_like(a), turn), _key(b, a, np.zeros_like(a), turn)
    order = np.argsort(own, kind="stable")
    found = np.minimum(np.searchsorted(own[order], other), len(order) - 1)
    inside = np.maximum(m.theta_i, m.theta_o) < MAX_THETA
    hit = np.flatnonzero((own[order[found]] == other) & (a < b) & inside)
    other_rows = order[found[hit]]
    variance = _variance(view)
    tolerance = np.sqrt(variance[hit] + variance[other_rows])
    return _pairs(view, hit, view.log_ratio(hit, other_rows), "exact", tolerance)


def _variance(view: View) -> Array:
    """Give the variance of each row's logarithm: noise at its level, and misalignment.

    On the flank of a peak half a degree changes a value by more than noise does.
    """
    logs = np.log(view.level)
    found = np.full(len(logs), np.nan)
    rows, rough = view.roughness
    if len(rows) < 2 * AROUND:
        return found
    order = np.argsort(logs[rows], kind="stable")
    rows, rough = rows[order], np.abs(rough[order])
    windows = np.lib.stride_tricks.sliding_window_view(
        np.pad(rough, AROUND, mode="reflect"), 2 * AROUND + 1
    )
    stride = -(-len(rows) // LEVELS)
    noise = 1.4826 * np.median(windows[::stride], axis=1)
    for scan in view.scans:
        y = logs[scan.rows]
        slope = np.nan_to_num(np.abs(np.diff(y) / np.diff(scan.running)))
        steepest = np.maximum(np.append(slope, 0.0), np.append(0.0, slope))
        here = np.interp(y, logs[rows[::stride]], noise) ** 2 + (ALIGNED * steepest) ** 2
        found[scan.rows] = np.fmax(found[scan.rows], here)
    return found


def _key(*angles: NDArray[np.int64]) -> NDArray[np.int64]:
    """Pack positions of 0.02 degrees, each below 2^15, into one integer."""
    key = np.zeros_like(angles[0])
    for angle in angles:
        key = (key << 15) | angle
    return key


def _pairs(
    view: View,
    rows: NDArray[np.intp],
    ratio: Array,
    kind: Literal["exact", "interpolated"],
    tolerance: Array | None = None,
) -> Pairs | None:
    cosines = view.log_cosines(rows)
    good = np.isfinite(ratio) & (np.abs(cosines) > LEAST)
    if not good.any():
        return None
    return Pairs(ratio[good], cosines[good], kind, None if tolerance is None else tolerance[good])


def _coordinates(view: View, rows: NDArray[np.intp]) -> Array:
    """Give degrees of (theta_h cos phi_d, theta_h sin phi_d, theta_d), shape (3, n)."""
    m = view.m
    theta_i, theta_o, turn = m.theta_i[rows], m.theta_o[rows], np.abs(view.turn[rows])
    wi = np.stack([np.sin(theta_i), np.zeros_like(theta_i), np.cos(theta_i)])
    wo = np.stack([np.sin(theta_o) * np.cos(turn), np.sin(theta_o) * np.sin(turn), np.cos(theta_o)])
    h = wi + wo
    h /= np.linalg.norm(h, axis=0)
    theta_h = np.arctan2(np.hypot(h[0], h[1]), h[2])
    theta_d = np.arctan2(
        0.5 * np.linalg.norm(wi - wo, axis=0), 0.5 * np.linalg.norm(wi + wo, axis=0)
    )
    # Components of the difference towards and across the half vector's azimuth.
    flat = np.maximum(np.hypot(h[0], h[1]), 1e-12)
    across = np.stack([-h[1] / flat, h[0] / flat])
    along = np.stack([h[2] * h[0] / flat, h[2] * h[1] / flat, -flat])
    phi_d = np.arctan2(np.abs(across[0] * wi[0] + across[1] * wi[1]), (along * wi).sum(axis=0))
    found: Array = np.degrees(np.stack([theta_h * np.cos(phi_d), theta_h * np.sin(phi_d), theta_d]))
    return found


def _interpolated(view: View) -> Pairs | None:
    m = view.m
    good = np.isfinite(view.level) & (np.maximum(m.theta_i, m.theta_o) < MAX_THETA)
    rows = np.flatnonzero(good)
    if rows.size < 2 * NEIGHBOURS:
        return None
    generator = np.random.Generator(np.random.PCG64(0))
    if rows.size > ROWS:
        rows = np.sort(generator.choice(rows, ROWS, replace=False))
    places = _coordinates(view, rows)
    asked = np.flatnonzero(np.abs(view.log_cosines(rows)) > LEAST)
    if asked.size > QUERIES:
        asked = np.sort(generator.choice(asked, QUERIES, replace=False))
    if not asked.size:
        return None
    targets = places[:, asked] * np.array([[-1.0], [1.0], [1.0]])
    nearest, value, change = _neighbours(places, np.log(view.level[rows]), targets)
    ratio = np.log(view.level[rows[asked]]) - value
    for reach in REACHES:
        usable = (nearest < reach) & (change < STEEP)
        if usable.sum() >= ENOUGH_NEAR or reach == REACHES[-1]:
            break
    return _pairs(view, rows[asked[usable]], ratio[usable], "interpolated")


def _neighbours(places: Array, logs: Array, targets: Array) -> tuple[Array, Array, Array]:
    """Interpolate by a plane through the nearest rows.

    Returns the distance of the nearest row, the value, and how much the plane changes it.
    """
    found = [
        _planes(places, logs, targets[:, first : first + BLOCK])
        for first in range(0, targets.shape[1], BLOCK)
    ]
    nearest, value, change = (np.concatenate(parts) for parts in zip(*found, strict=True))
    return nearest, value, change


def _planes(places: Array, logs: Array, targets: Array) -> tuple[Array, Array, Array]:
    """Do it for a block of targets at once."""
    # Squared distances less those of the targets from the origin, in one product of matrices.
    order = (places**2).sum(axis=0) - 2.0 * targets.T @ places
    chosen = np.argpartition(order, NEIGHBOURS, axis=1)[:, :NEIGHBOURS]
    near = (places[:, chosen] - targets[:, :, None]).transpose(1, 0, 2)
    square = (near**2).sum(axis=1)
    weight = 1.0 / np.sqrt(square + 0.1)
    matrix = np.concatenate([np.ones((len(near), 1, NEIGHBOURS)), near], axis=1)
    matrix *= weight[:, None, :]
    # Directions in which the neighbours do not extend have no slope: a small ridge.
    gram = matrix @ matrix.transpose(0, 2, 1)
    size = np.trace(gram[:, 1:, 1:], axis1=1, axis2=2)
    gram[:, 1:, 1:] += (0.02 * size + 1e-9)[:, None, None] * np.eye(3)
    plane = np.linalg.solve(gram, matrix @ (logs[chosen] * weight)[:, :, None])[:, :, 0]
    change = np.linalg.norm(plane[:, 1:], axis=1) * np.sqrt(square.max(axis=1))
    return np.sqrt(square.min(axis=1)), plane[:, 0], change
