"""Blocks of a measurement: what is left out at a time to see how a model predicts.

Values of one scan share their errors (alignment, lamp, the model's own misfit), so that leaving
out single values says nothing; an incidence left out as a whole must be predicted from the
others.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lobefit.fitting.measurement import Measurement

__all__ = ["Blocks", "find_blocks", "signed_theta_o"]

Array = NDArray[np.float64]
Index = NDArray[np.intp]

# Fewer incidences than this are too few to leave out one at a time.
ENOUGH = 8
# More blocks than this cost time and say no more.
MOST = 24
# Fewer rows than this are no piece of a scan.
SMALLEST = 3
# Incidences closer than this (rad) are one: 0.1 degrees, the jitter of a goniometer.
SAME = np.deg2rad(0.1)
# A group wider than this (rad) is no incidence but a hemisphere of scattered ones.
WIDEST = np.deg2rad(1.0)


@dataclass(frozen=True, eq=False)
class Blocks:
    """A partition of the rows.

    Attributes
    ----------
    labels : ndarray of int, shape (N,)
        Block of each row, from 0.
    kind : {"incidences", "bands of incidence", "ranges of theta_o"}
        What a block is.
    note : str
        How they were made, in words.
    """

    labels: Index
    kind: str
    note: str

    @property
    def count(self) -> int:
        """Number of blocks."""
        return int(self.labels.max()) + 1


def find_blocks(measurement: Measurement) -> Blocks:
    """Cut a measurement into blocks.

    One per theta_i; where there are fewer than eight, one per direction of incidence
    (theta_i, phi_i); where those are fewer than eight too, contiguous ranges of theta_o within
    each. More than 24, and incidences that scatter, are pooled into neighbouring ones.

    Parameters
    ----------
    measurement : Measurement
        What is cut.

    Returns
    -------
    Blocks
    """
    m = measurement
    theta = _groups(m.theta_i)
    if theta is None:
        count = max(min(MOST, m.n_directions // SMALLEST), 1)
        return Blocks(
            _pooled(_ranks(m.theta_i), count),
            "bands of incidence",
            f"the incidences scatter: {count} bands of theta_i with equal numbers of rows",
        )
    if found := _whole(theta, "angles of incidence"):
        return found
    # At the pole the azimuth is no direction of its own.
    azimuth = _groups(np.where(m.theta_i < WIDEST, 0.0, np.mod(m.phi_i + SAME, 2.0 * np.pi)))
    incidence = theta
    if azimuth is not None:
        both = theta * (int(azimuth.max()) + 1) + azimuth
        incidence = np.unique(both, return_inverse=True)[1].reshape(-1)
    if found := _whole(incidence, "directions of incidence"):
        return found
    count = int(incidence.max()) + 1
    labels = _ranges(m, incidence, -(-ENOUGH // count))
    plural = "s are" if count > 1 else " is"
    return Blocks(
        labels,
        "ranges of theta_o",
        f"{count} incidence{plural} too few to leave out one at a time: "
        f"{int(labels.max()) + 1} contiguous ranges of theta_o instead",
    )


def signed_theta_o(m: Measurement) -> Array:
    """Give theta_o, negative on the side of the light, shape (N,)."""
    forward = np.cos(m.phi_o - m.phi_i) < 0.0
    return np.where(forward, m.theta_o, -m.theta_o)


def _whole(incidence: Index, what: str) -> Blocks | None:
    """Leave out incidences as they are, or pooled where they are many; None where they are few."""
    count = int(incidence.max()) + 1
    if count > MOST:
        note = f"{count} {what} in {MOST} bands of neighbouring ones"
        return Blocks(_pooled(incidence, MOST), "bands of incidence", note)
    return Blocks(incidence, "incidences", f"{count} {what}") if count >= ENOUGH else None


def _groups(angle: Array) -> Index | None:
    """Label angles that stand apart from each other, ascending; None where they scatter."""
    order = np.argsort(angle, kind="stable")
    rising = angle[order]
    starts = np.concatenate([[False], np.diff(rising) > SAME])
    group = np.cumsum(starts)
    first = rising[np.searchsorted(group, np.arange(group[-1] + 1))]
    if np.any(rising - first[group] > WIDEST):
        return None
    labels = np.empty(len(angle), dtype=np.intp)
    labels[order] = group
    return labels


def _ranks(angle: Array) -> Index:
    ranks = np.empty(len(angle), dtype=np.intp)
    ranks[np.argsort(angle, kind="stable")] = np.arange(len(angle))
    return ranks


def _pooled(groups: Index, count: int) -> Index:
    """Pool neighbouring groups until about equal numbers of rows stand in each of `count`."""
    sizes = np.bincount(groups)
    middles = np.cumsum(sizes) - 0.5 * sizes
    pool = (middles * (count / sizes.sum())).astype(np.intp)
    labels: Index = np.unique(pool[groups], return_inverse=True)[1].reshape(-1)
    return labels


def _ranges(m: Measurement, incidence: Index, pieces: int) -> Index:
    """Cut each incidence into ranges of theta_o."""
    signed = signed_theta_o(m)
    labels = np.empty(len(signed), dtype=np.intp)
    made = 0
    for k in range(int(incidence.max()) + 1):
        rows = np.flatnonzero(incidence == k)
        rows = rows[np.argsort(signed[rows], kind="stable")]
        parts = np.array_split(rows, max(min(pieces, len(rows) // SMALLEST), 1))
        for part in parts:
            labels[part] = made
            made += 1
    return labels
