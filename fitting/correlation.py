"""How many values count as independent: residuals of a misfit are correlated along scans."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lobefit.fitting.measurement import Measurement

__all__ = ["Scans", "find_scans"]

Array = NDArray[np.float64]
Index = NDArray[np.intp]

# Angles closer than this (rad) belong to one scan line: 0.05 degrees.
SAME = 9e-4
# Rows that determine the correlation well enough; of more, whole lines are chosen.
ENOUGH = 16_384


class Scans:
    """Rows in the order in which one angle runs while the others stand still.

    Parameters
    ----------
    orders : list of (order, starts)
        For each kind of scan the rows in order, line by line, and a flag per
        row of that order that starts a new line.
    """

    def __init__(self, orders: list[tuple[Index, NDArray[np.bool_]]]) -> None:
        self._orders = orders

    def autocorrelation_time(self, z: Array) -> float:
        """Estimate the number of consecutive values that count as one.

        Parameters
        ----------
        z : ndarray, shape (C, N)
            Standardised residuals; NaN where not used.

        Returns
        -------
        float
            At least 1: 1 + 2 sum of the autocorrelations up to the first that
            noise alone could produce; the longest of the kinds of scans.
        """
        times = [_autocorrelation_time(z[:, order], starts) for order, starts in self._orders]
        return max(times, default=1.0)


def _autocorrelation_time(z: Array, starts: NDArray[np.bool_]) -> float:
    line = np.cumsum(starts)
    there = np.isfinite(z)
    z = np.where(there, z, 0.0)
    power = float((z**2).sum()) / max(int(there.sum()), 1)
    if not power > 0.0:
        return 1.0
    time, lag, step, before = 1.0, 1, 1, 1.0
    while lag < z.shape[1]:
        both = there[:, lag:] & there[:, :-lag] & (line[lag:] == line[:-lag])
        pairs = int(both.sum())
        if pairs < 8:
            break
        rho = float((z[:, lag:] * z[:, :-lag]).sum(where=both)) / (pairs * power)
        # Three standard deviations of what independent values would show.
        if rho < 3.0 / np.sqrt(pairs):
            break
        # The sum over lags, in growing steps: those between are interpolated.
        time += step * (rho + before) - (before - rho)
        before = rho
        step = 1 if lag < 16 else lag // 8
        lag += step
    return time


def _steps(angle: Array) -> NDArray[np.int64]:
    steps: NDArray[np.int64] = (angle * (1.0 / SAME) + 0.5).astype(np.int64)
    return steps


def _wrapped(phi: Array) -> Array:
    inside = phi.min() >= 0.0 and phi.max() < 2.0 * np.pi
    return phi if inside else np.mod(phi, 2.0 * np.pi)


def find_scans(measurement: Measurement) -> Scans:
    """Find the scan lines of a measurement: runs of theta_o, of phi_o, and of theta_i.

    Points scattered over the hemisphere form no lines; they are followed from neighbour to
    neighbour instead.
    """
    m = measurement
    half = round(np.pi / SAME)
    theta_i, theta_o = _steps(m.theta_i), _steps(m.theta_o)
    turned_o = _wrapped(m.phi_o)
    phi_i, phi_o = _steps(_wrapped(m.phi_i)), _steps(turned_o)
    axis_i, axis_o = (
        np.where(phi_i < half, phi_i, phi_i - half),
        np.where(phi_o < half, phi_o, phi_o - half),
    )
    # In the plane of incidence theta runs through the pole: a signed angle on one line.
    signed_i = np.where(phi_i >= half, -m.theta_i, m.theta_i)
    signed_o = np.where(phi_o >= half, -m.theta_o, m.theta_o)
    orders = []
    for running, first, second, third in (
        (signed_o, theta_i, phi_i, axis_o),
        (turned_o, theta_i, phi_i, theta_o),
        (signed_i, theta_o, phi_o, axis_i),
    ):
        # 13 bits hold a full turn in steps of SAME; one sort of one integer is the fastest.
        line = ((first << 13) | second) << 13 | third
        # Of many, a multiplicative hash (Knuth) picks lines, not rows.
        share = min(ENOUGH / len(line), 1.0)
        rows = np.flatnonzero((line * 2_654_435_761 & 0xFFFFFFFF) < share * 2**32)
        line = line[rows]
        fine = ((running[rows] + 2.0 * np.pi) * 2.0**20).astype(np.int64)
        order = np.argsort((line << 24) | fine)
        starts = np.ones(len(order), dtype=bool)
        starts[1:] = np.diff(line[order]) != 0
        if starts.mean() < 0.5:  # lines of two and more, else there is nothing to correlate
            orders.append((rows[order], starts))
    if not orders and len(m.theta_i) > 1:
        orders = [_by_nearness(m)]
    return Scans(orders)


def _by_nearness(m: Measurement) -> tuple[Index, NDArray[np.bool_]]:
    """Order scattered directions so that neighbours are near each other.

    Along a Morton curve through the cube of half angle, difference angle and incidence,
    on which isotropic models are smooth.
    """
    rows = np.arange(0, len(m.theta_i), -(-len(m.theta_i) // ENOUGH))
    theta_i, theta_o = m.theta_i[rows], m.theta_o[rows]
    across = np.sin(theta_i) * np.sin(theta_o) * np.cos(m.phi_o[rows] - m.phi_i[rows])
    cos_d2 = 0.5 * (1.0 + across + np.cos(theta_i) * np.cos(theta_o))
    cos_d = np.sqrt(np.clip(cos_d2, 1e-12, 1.0))
    cos_h = np.clip(0.5 * (np.cos(theta_i) + np.cos(theta_o)) / cos_d, -1.0, 1.0)
    code = np.zeros(len(rows), dtype=np.int64)
    for shift, angle in enumerate((np.arccos(cos_h), np.arccos(cos_d), theta_i)):
        step = np.clip(angle * (64.0 / (0.5 * np.pi)), 0, 63).astype(np.int64)
        for bit in range(6):
            code |= ((step >> bit) & 1) << (3 * bit + shift)
    order = np.argsort(code, kind="stable")
    starts = np.zeros(len(rows), dtype=bool)
    starts[0] = True
    return rows[order], starts
