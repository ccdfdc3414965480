"""A measurement on the device: all rows, and the thinned ones that a search needs."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from lobefit.fitting.correlation import Scans, find_scans
from lobefit.fitting.diagnostics import regions
from lobefit.fitting.instrument import Instrument, views
from lobefit.fitting.measurement import Measurement
from lobefit.fitting.search import USUAL, SearchSettings
from lobefit.kernels import Device
from lobefit.kernels.geometry import Directions, Precision
from lobefit.kernels.sums import Metric, Observations, transform
from lobefit.kernels.views import Views

__all__ = ["METRICS", "Dataset"]

Array = NDArray[np.float64]

# metric of a fit -> transform of the residuals
METRICS: dict[str, Metric] = {
    "chi2": "identity",
    "relative": "identity",
    "log": "log",
    "cube_root": "cube_root",
    "cosine_log": "cosine_log",
}
# Up to here double precision costs less than compiling a second set of kernels.
DOUBLE_UP_TO = 20_000
# Directions that the start scan and NLopt look at; the polish uses all of them.
SCAN_ROWS = 2048
SEARCH_ROWS = 8192


class Dataset:
    """One measurement, ready for every candidate.

    Parameters
    ----------
    measurement : Measurement
        What was measured.
    metric : {"chi2", "relative", "log", "cube_root", "cosine_log"}
        How residuals are weighed.
    device : Device
        Where the sums are computed.
    instrument : Instrument, optional
        What stands between surface and readings.
    student : bool
        Whether fits take Student's t instead of a Gaussian.
    how : SearchSettings
        How fits look for the valley.

    Attributes
    ----------
    tilt : (float, float)
        Of the sample, in radians; see `turn`.
    precision : {"single", "double"}
        Of the terms; sums are accumulated in double either way.
    full, search, scan : Observations
        All rows; at most SEARCH_ROWS; at most SCAN_ROWS (always residuals of
        the plain values, for which coefficients are linear).
    present, used : ndarray of bool, shape (C, N)
        Values that are there; those that count ("log" has no use for others than
        positive ones, "cosine_log" for those at or below -1/cos_theta_i).
    """

    def __init__(
        self,
        measurement: Measurement,
        metric: str,
        device: Device,
        instrument: Instrument | None = None,
        *,
        student: bool = False,
        how: SearchSettings = USUAL,
    ) -> None:
        self.measurement, self.how = measurement, how
        m = measurement
        self.instrument, self.student = instrument, student
        self.tilt = (0.0, 0.0)
        self.metric = metric
        self.device = device
        self.precision: Precision = "double" if m.n_directions <= DOUBLE_UP_TO else "single"
        self.uses_sigma = metric == "chi2" and m.sigma is not None
        # Otherwise the noise is estimated from the residuals, or the metric has none.
        self.estimates_noise = self.has_likelihood and not self.uses_sigma
        start = self._start_weights()
        uploaded: dict[int, Directions] = {}
        self._observed: list[tuple[Observations, NDArray[np.intp] | slice]] = []

        def observe(
            chosen: NDArray[np.intp] | None, residual_metric: Metric, weights: Array
        ) -> Observations:
            size = m.n_directions if chosen is None else len(chosen)
            # A slice, not an index, where it is all of them: no copies of a million rows.
            rows = slice(None) if chosen is None or size == m.n_directions else chosen
            if size not in uploaded:
                uploaded[size] = self._directions(rows)
            made = Observations(
                uploaded[size], m.values[:, rows], weights[:, rows], residual_metric
            )
            self._observed.append((made, rows))
            return made

        own = METRICS[metric]
        ones = start if own == "identity" else np.ones_like(start)
        self.full = observe(None, own, ones)
        half_angle = -self.full.directions.plane("log2_cos_h")
        self.search_rows = thinned(half_angle, SEARCH_ROWS)
        self.scan_rows = self.search_rows[thinned(half_angle[self.search_rows], SCAN_ROWS)]
        same = len(self.search_rows) == m.n_directions
        self.search = self.full if same else observe(self.search_rows, own, ones)
        self.scan = observe(self.scan_rows, "identity", start)
        self.used = self.full.used
        self.present = np.isfinite(m.values) & self.full.directions.visible
        self._started = True
        self._logarithmic: Observations | None = None

    def _directions(self, rows: NDArray[np.intp] | slice) -> Directions:
        """Upload rows as the instrument sees them."""
        m = self.measurement
        angles = (m.theta_i[rows], m.phi_i[rows], m.theta_o[rows], m.phi_o[rows])
        if self.instrument is None or not self.instrument.bends:
            return Directions(self.device, *angles, precision=self.precision)
        seen = views(angles, self.instrument, self.tilt)
        return Views(self.device, angles, seen, self.precision)

    def turn(self, tilt: tuple[float, float]) -> None:
        """Tilt the sample by two angles in radians; see `lobefit.fitting.instrument.tilted`."""
        if tilt == self.tilt:
            return
        self.tilt = tilt
        turned: dict[int, Directions] = {}
        before = {id(o.directions): o.directions for o, _ in self._observed}
        for observations, rows in self._observed:
            key = id(observations.directions)
            if key not in turned:
                turned[key] = self._directions(rows)
            observations.directions = turned[key]
        if self._logarithmic is not None:
            self._logarithmic.directions = self.search.directions
        for old in before.values():
            old.release()

    @property
    def has_likelihood(self) -> bool:
        """Whether the metric weighs plain residuals by their noise; the others have no BIC."""
        return METRICS[self.metric] == "identity"

    @property
    def extra_parameters(self) -> int:
        """Numbers that a fit finds beside a candidate's parameters."""
        return 2 if self.instrument is not None and self.instrument.tilt else 0

    @cached_property
    def distinct_directions(self) -> int:
        """Directions that differ by more than 0.01 degrees, counted up to SCAN_ROWS rows."""
        m, rows = self.measurement, self.scan_rows
        angles = np.stack([a[rows] for a in (m.theta_i, m.phi_i, m.theta_o, m.phi_o)])
        steps = np.round(np.degrees(angles) * 100.0).astype(np.int64)
        return int(np.unique(steps, axis=1).shape[1])

    @cached_property
    def scans(self) -> Scans:
        """Scan lines of the measurement."""
        return find_scans(self.measurement)

    @cached_property
    def regions(self) -> NDArray[np.intp]:
        """Region of angles of each row, for the question where a model fails."""
        return regions(self.measurement, self.full.directions)

    @property
    def logarithmic(self) -> Observations:
        """The thinned rows with residuals of the logarithm, for gross misfits."""
        if self._logarithmic is None:
            values = self.measurement.values[:, self.search_rows]
            ones = np.ones_like(values)
            self._logarithmic = Observations(self.search.directions, values, ones, "log")
        return self._logarithmic

    def _start_weights(self) -> Array:
        m = self.measurement
        if self.uses_sigma and m.sigma is not None:
            with np.errstate(divide="ignore", invalid="ignore"):
                known: Array = np.where(np.isfinite(m.values), 1.0 / (m.sigma * m.sigma), 0.0)
            return known
        if self.metric == "cosine_log":
            # For the start only: residuals are small where the transform's slope is.
            n_i = np.maximum(np.cos(m.theta_i), 0.0)
            return np.nan_to_num((n_i / (1.0 + np.maximum(m.values, 0.0) * n_i)) ** 2)
        size = np.abs(m.values)
        level = np.nanmedian(size, axis=1, keepdims=True)
        floor = np.maximum(0.05 * level, 1e-6 * np.nanmax(size, axis=1, keepdims=True))
        floor = np.where(floor > 0.0, floor, 1.0)  # a black channel
        if self.metric == "chi2":
            constant: Array = np.ones_like(size) / floor**2
            return constant
        # For the start only: relative weights of the measured value with a floor.
        weights: Array = np.nan_to_num(1.0 / (size**2 + floor**2))
        return weights

    def residuals(self, fitted: Array) -> Array:
        """Give measured minus fitted, shape (C, N), both transformed by the metric."""
        metric, measured = METRICS[self.metric], self.measurement.values
        if metric == "identity":
            return measured - fitted
        safe = np.where(self.used, measured, 1.0)
        n_i = np.maximum(np.cos(self.measurement.theta_i), 0.0)
        return transform(safe, metric, n_i) - transform(np.maximum(fitted, 1e-300), metric, n_i)

    def set_weights(self, weights: Array) -> None:
        """Replace the weights of all rows, shape (C, N)."""
        self._started = False
        self.full.set_weights(weights)
        if self.search is not self.full:
            self.search.set_weights(weights[:, self.search_rows])

    def reset_weights(self) -> None:
        """Put the weights back that every candidate starts with."""
        if self._started:
            return
        identity = self.has_likelihood
        self.set_weights(self._start_weights() if identity else np.ones(self.used.shape))
        self._started = True

    def release(self) -> None:
        """Free the device's memory."""
        if self._logarithmic is not None:
            self._logarithmic.release()
        for observations in {id(o): o for o in (self.full, self.search, self.scan)}.values():
            observations.release()
        for directions in {
            id(o.directions): o.directions for o in (self.full, self.search, self.scan)
        }.values():
            directions.release()


def thinned(half_angle: Array, rows: int) -> NDArray[np.intp]:
    """Choose at most so many rows: the sharpest half angles, and evenly from the rest.

    Selecting by geometry only keeps a fit to them unbiased.

    Parameters
    ----------
    half_angle : ndarray, shape (N,)
        Anything that grows with it.
    rows : int
        How many to keep, about.
    """
    size = len(half_angle)
    if size <= rows:
        return np.arange(size)
    sharpest = np.argpartition(half_angle, rows // 8)[: rows // 8]
    # One row of each stretch, at a place that no regular scan repeats.
    k = np.arange(rows - rows // 8)
    spread = ((k + np.mod(k * 0.6180339887498949, 1.0)) * (size / len(k))).astype(np.intp)
    return np.union1d(sharpest, spread)
