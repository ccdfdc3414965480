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
# Rows that determine the correlation well enough.
ENOUGH = 65_536


class Scans:
    """Rows in the order in which one angle runs while the others stand still.

    Parameters
    ----------
    orders : list of (order, starts)
        For each kind of scan the permutation of the rows and a flag per
        permuted row that starts a new scan line.
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
            noise alone could produce, multiplied over the kinds of scans.
        """
        time = 1.0
        for order, starts in self._orders:
            rows = _stretches(len(order))
            time *= _autocorrelation_time(np.nan_to_num(z[:, order[rows]]), starts[rows])
        return time


def _stretches(size: int) -> NDArray[np.intp] | slice:
    """Choose rows for the estimate: all, or evenly spread stretches of a large measurement."""
    if size <= ENOUGH:
        return slice(None)
    length = ENOUGH // 16
    first = np.linspace(0, size - length, 16).astype(np.intp)
    rows: NDArray[np.intp] = (first[:, None] + np.arange(length)).ravel()
    return rows


def _autocorrelation_time(z: Array, starts: NDArray[np.bool_]) -> float:
    line = np.cumsum(starts)
    power = float(np.mean(z**2))
    if not power > 0.0:
        return 1.0
    time, lag = 1.0, 1
    while lag < z.shape[1]:
        same = line[lag:] == line[:-lag]
        pairs = int(same.sum()) * len(z)
        if pairs < 8:
            break
        rho = float((z[:, lag:] * z[:, :-lag])[:, same].sum()) / (pairs * power)
        # Three standard deviations of what independent values would show.
        if rho < 3.0 / np.sqrt(pairs):
            break
        time += 2.0 * rho
        lag += 1 if lag < 16 else lag // 8
    return time


def find_scans(measurement: Measurement) -> Scans:
    """Find the scan lines of a measurement: runs of theta_o, and runs of phi_o.

    Points scattered over the hemisphere form no lines and count as independent.
    """
    m = measurement
    theta_i, phi_i, theta_o, phi_o = (
        np.round(np.mod(a, 2.0 * np.pi) / SAME).astype(np.int64)
        for a in (m.theta_i, m.phi_i, m.theta_o, m.phi_o)
    )
    # In the plane of incidence theta_o runs through the pole: a signed angle on one line.
    half = round(np.pi / SAME)
    signed = np.where(phi_o >= half, -m.theta_o, m.theta_o)
    orders = []
    for running, across in ((signed, np.mod(phi_o, half)), (np.mod(m.phi_o, 2.0 * np.pi), theta_o)):
        # 13 bits hold a full turn in steps of SAME; one sort of one integer is the fastest.
        line = ((theta_i << 13) | phi_i) << 13 | across
        fine = np.round((running + np.pi) * 2.0**20).astype(np.int64)
        order = np.argsort((line << 24) | fine)
        starts = np.ones(len(order), dtype=bool)
        starts[1:] = np.diff(line[order]) != 0
        if starts.mean() < 0.5:  # lines of two and more, else there is nothing to correlate
            orders.append((order, starts))
    return Scans(orders)
