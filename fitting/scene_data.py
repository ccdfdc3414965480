"""Measured data as a BRDF of any direction: interpolation in half-difference angles.

S. Rusinkiewicz, A new change of variables for efficient BRDF representation, 1998: half angle
theta_h, difference angle theta_d and its azimuth phi_d. Neighbours are found in coordinates that
do not see what an isotropic reciprocal BRDF does not see either::

    (2 sqrt(theta_h / 90 deg), theta_d / 90 deg, sin theta_h sin theta_d |cos phi_d|)

the last of which is ``|cos theta_i - cos theta_o| / 2``: it is 0 wherever phi_d has no meaning. The
square root is MERL's, which makes room about the mirror direction. Among the `NEIGHBOURS`
nearest readings a plane is fitted to asinh(f/s), weighted by distance (W. S. Cleveland, S. J.
Devlin, Locally weighted regression, JASA 83, 1988); asinh is a logarithm that bears values about
zero, s a hundredth of the channel's median. Readings of one place are averaged first. Planes are
fitted at the nodes of a lattice, and directions interpolated between them.

Its error is found by leaving each reading out: that holds the reading's own noise too.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lobefit.fitting.measurement import Measurement

__all__ = ["Interpolation", "LeftOut", "half_difference"]

Array = NDArray[np.float64]
Index = NDArray[np.intp]

NEIGHBOURS = 12
CELL = 0.008  # readings this close are averaged
STEP = 0.04  # of the lattice between whose nodes a look-up is trilinear
CORNERS = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)])
MOST_LEFT_OUT = 400
AT_ONCE = 4_000_000  # distances
# A direction is out of reach where its nearest reading is further than this many times the
# distance within which 95 % of the readings have another.
REACH = 2.0
BEYOND = np.deg2rad(2.5)  # nearer to the horizon than any reading, by this at most


def half_difference(theta_i: Array, theta_o: Array, turn: Array) -> Array:
    """Give the coordinates above, shape (N, 3), of directions (N,); turn is phi_o - phi_i."""
    cos_i, cos_o = np.cos(theta_i), np.cos(theta_o)
    # i.o, of unit vectors: cos(2 theta_d).
    between = cos_i * cos_o + np.sin(theta_i) * np.sin(theta_o) * np.cos(turn)
    length = np.sqrt(np.maximum(2.0 + 2.0 * between, 1e-30))
    theta_h = np.arccos(np.clip((cos_i + cos_o) / length, -1.0, 1.0))
    theta_d = 0.5 * np.arccos(np.clip(between, -1.0, 1.0))
    quarter = 0.5 * np.pi
    return np.stack(
        [2.0 * np.sqrt(theta_h / quarter), theta_d / quarter, 0.5 * np.abs(cos_i - cos_o)], axis=1
    )


@dataclass(frozen=True, eq=False)
class LeftOut:
    """Readings predicted from the others.

    Attributes
    ----------
    measured, predicted : ndarray, shape (C, M)
        BRDF in 1/sr.
    cos_theta_i : ndarray, shape (M,)
    """

    measured: Array
    predicted: Array
    cos_theta_i: Array

    @property
    def relative(self) -> float:
        """Median relative error."""
        size = np.maximum(np.abs(self.measured), 1e-300)
        return float(np.median(np.abs(self.predicted - self.measured) / size))


class Interpolation:
    """The BRDF of an isotropic sample between its readings.

    Parameters
    ----------
    measurement : Measurement
        Readings; a direction that lacks one in a channel is left out.

    Attributes
    ----------
    places : ndarray, shape (N, 3)
        Where readings are, averaged.
    reach : float
        Distance from the nearest reading up to which a direction is covered.
    lowest : float
        Largest polar angle, in radians, up to which it is.
    """

    def __init__(self, measurement: Measurement) -> None:
        m = measurement
        whole = np.isfinite(m.values).all(axis=0)
        where = half_difference(m.theta_i, m.theta_o, m.phi_o - m.phi_i)[whole]
        values = m.values[:, whole]
        cells, inverse = np.unique(np.rint(where / CELL), axis=0, return_inverse=True)
        count = np.bincount(inverse, minlength=len(cells))

        def means(rows: Array) -> Array:
            sums = [np.bincount(inverse, row, minlength=len(cells)) for row in rows]
            return np.stack(sums) / count

        self.places, self.values = means(where.T).T, means(values)
        self.cos_theta_i = means(np.cos(m.theta_i[whole])[None])[0]
        self.lowest = float(max(m.theta_i.max(), m.theta_o.max())) + BEYOND
        self.scale = 0.01 * np.median(np.abs(self.values), axis=1, keepdims=True) + 1e-300
        self._stretched = np.arcsinh(self.values / self.scale)
        self.reach = 0.0
        if len(self.places) > NEIGHBOURS + 1:
            some = self._some()
            near = self._nearest(self.places[some], 2)[1][:, 1]
            self.reach = REACH * float(np.percentile(near, 95))

    @property
    def usable(self) -> bool:
        """Whether there are enough readings to interpolate between."""
        return self.reach > 0.0

    def _some(self) -> Index:
        most = min(len(self.places), MOST_LEFT_OUT)
        return np.linspace(0, len(self.places) - 1, most).round().astype(np.intp)

    def _nearest(self, at: Array, count: int) -> tuple[Index, Array]:
        """Give the nearest readings of places and their distances, ascending, (M, count)."""
        own = (self.places**2).sum(axis=1)
        indices, distances = [], []
        step = max(1, AT_ONCE // len(self.places))
        for start in range(0, len(at), step):
            part = at[start : start + step]
            squared = own - 2.0 * part @ self.places.T + (part**2).sum(axis=1)[:, None]
            found = np.argpartition(squared, count - 1, axis=1)[:, :count]
            order = np.take_along_axis(squared, found, 1).argsort(axis=1)
            found = np.take_along_axis(found, order, 1)
            indices.append(found)
            distances.append(np.take_along_axis(squared, found, 1))
        return np.concatenate(indices), np.sqrt(np.maximum(np.concatenate(distances), 0.0))

    def _regress(self, at: Array, found: Index, distance: Array) -> Array:
        """Fit a plane to neighbours (M, k) of places; give asinh(f/s) there, (C, M)."""
        width = np.maximum(distance[:, -1:] * 1.001, 1e-9)
        root = np.sqrt((1.0 - (distance / width) ** 3) ** 3)  # of the tricube weights
        offset = (self.places[found] - at[:, None]) / width[:, :, None]
        design = np.concatenate([np.ones_like(distance)[:, :, None], offset], axis=2)
        design = design * root[:, :, None]
        values = np.moveaxis(self._stretched[:, found], 0, -1) * root[:, :, None]
        normal = np.einsum("mki,mkj->mij", design, design)
        # Neighbours in a plane or a line leave slopes open: those are 0 then.
        ridge = 1e-3 * np.diag([0.0, 1.0, 1.0, 1.0]) * normal[:, :1, :1]
        right = np.einsum("mki,mkc->mic", design, values)
        fitted = np.linalg.solve(normal + ridge, right)[:, 0].T
        # A plane may leave what its neighbours span; the BRDF does not by much.
        near = self._stretched[:, found]
        fitted = np.clip(fitted, near.min(axis=2), near.max(axis=2))
        return np.asarray(fitted)

    def __call__(
        self, theta_i: Array, theta_o: Array, turn: Array
    ) -> tuple[Array, NDArray[np.bool_]]:
        """Interpolate.

        Parameters
        ----------
        theta_i, theta_o, turn : ndarray, shape (N,)
            In radians; turn is phi_o - phi_i.

        Returns
        -------
        values : ndarray, shape (C, N)
            BRDF in 1/sr.
        covered : ndarray of bool, shape (N,)
            Where readings are near enough.
        """
        where = half_difference(theta_i, theta_o, turn) / STEP
        low = np.floor(where)
        part = where - low
        corners = low[:, None, :] + CORNERS
        keys = corners.astype(np.int64) @ np.array([1 << 20, 1 << 10, 1])
        known, inverse = np.unique(keys, return_inverse=True)
        inverse = inverse.reshape(keys.shape)
        at = np.stack([known >> 20, (known >> 10) & 1023, known & 1023], axis=1) * STEP
        found, distance = self._nearest(at, NEIGHBOURS)
        nodes = self._regress(at, found, distance)
        values = np.zeros((len(self.values), len(where)))
        for k, corner in enumerate(CORNERS):
            share = np.where(corner == 1, part, 1.0 - part).prod(axis=1)
            values += share * nodes[:, inverse[:, k]]
        nearest = (np.rint(part) @ np.array([4, 2, 1])).astype(np.intp)
        reached = (distance[:, 0] <= self.reach)[inverse]
        near = reached[np.arange(len(where)), nearest]
        covered = near & (np.maximum(theta_i, theta_o) <= self.lowest)
        return np.sinh(values) * self.scale, covered

    def left_out(self) -> LeftOut:
        """Predict readings, `MOST_LEFT_OUT` at most, each from all others."""
        some = self._some()
        found, distance = self._nearest(self.places[some], NEIGHBOURS + 1)
        # Each is the nearest of itself, places being distinct.
        fitted = self._regress(self.places[some], found[:, 1:], distance[:, 1:])
        predicted = np.asarray(np.sinh(fitted) * self.scale)
        return LeftOut(self.values[:, some], predicted, self.cos_theta_i[some])
