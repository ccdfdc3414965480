"""What a picture of a fit shows: which directions, which channels, and the residuals' measure."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lobefit.fitting.bands import Bands, Groups, is_scattered, pool
from lobefit.fitting.instrument_result import readings
from lobefit.fitting.lobes import PLANE, out_of_plane, planes_of, signed
from lobefit.fitting.measurement import Measurement
from lobefit.fitting.result import FitResult

__all__ = ["Panel", "Panels", "Residuals", "choose_channels", "choose_panels", "thinned"]

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Directions = tuple[Array, Array, Array, Array]

MAX_PANELS = 8
MAX_CHANNELS = 5
MAX_POINTS = 8000
"""Points of a panel; more only darken the paper."""
LOG_FROM_DECADES = 1.5

# Data off the plane of incidence: how far a view may turn from it (degrees) and still be shown
# as if in it. The first is taken that leaves enough views.
TOLERANCES = (0.5, 1.5, 3.0, 5.0, 10.0)
ENOUGH_VIEWS = 8

# Scattered incidences: widths of a band of theta_i in degrees. The first is taken whose bands
# have so many views near the plane of incidence; incidence varies within them, so it takes more.
BAND_WIDTHS = (5.0, 10.0)
ENOUGH_IN_BAND = 30
# A lobe falls steeply about the mirror direction; so of a band only views are shown whose half
# vector leans out of the plane at most this share of what it leans within.
ASIDE_SHARE = 1 / 3


@dataclass(frozen=True, eq=False)
class Panel:
    """A fixed direction and what was measured with it.

    Attributes
    ----------
    theta, phi : float
        The fixed direction, usually the incidence, in degrees.
    rows : ndarray, shape (M,)
        Rows in the plane of incidence.
    angle : ndarray, shape (M,)
        Their signed angle in degrees, positive on the mirror direction's side.
    line : tuple of four ndarray, shape (L,)
        Directions in radians along which to draw the lobe.
    line_angle : ndarray, shape (L,)
        Their signed angle in degrees.
    hemisphere : ndarray, shape (H,)
        Rows in the plane and out of it.
    turn, tilt : ndarray, shape (H,)
        Their azimuth from the plane of incidence in radians, 0 on the mirror direction's
        side, and their polar angle in degrees.
    band : tuple of two float, optional
        Where incidences are pooled, from which theta_i to which in degrees; the line is drawn
        at `theta` between them.
    """

    theta: float
    phi: float
    rows: Index
    angle: Array
    line: Directions
    line_angle: Array
    hemisphere: Index
    turn: Array
    tilt: Array
    band: tuple[float, float] | None = None


@dataclass(frozen=True, eq=False)
class Panels:
    """The panels of a measurement.

    Attributes
    ----------
    chosen : list of Panel
        In ascending order of the fixed direction.
    total : int
        How many there would be.
    in_plane : bool
        Whether all views lie in the plane of incidence.
    by_view : bool
        Whether the direction of view is fixed and the incidence runs.
    tolerance : float
        Degrees that a view may turn from the plane and be shown as in it.
    width : float, optional
        Where incidences are scattered and therefore pooled: width of a band in degrees.
    """

    chosen: list[Panel]
    total: int
    in_plane: bool
    by_view: bool
    tolerance: float
    width: float | None = None


class Residuals:
    """What the model leaves over, in the measure that suits the data.

    In units of sigma where that was measured; as log10 of measured/fitted where values span
    decades; else relative to the model in per cent.
    """

    def __init__(self, measurement: Measurement, result: FitResult) -> None:
        self._m, self._result = measurement, result
        self.log = measurement.decades >= LOG_FROM_DECADES
        if measurement.sigma is not None:
            self.label, self.least = "residual / σ", 3.0
        elif self.log:
            self.label, self.least = r"$\log_{10}$(meas./fit)", 0.05
        else:
            self.label, self.least = "residual [%]", 1.0

    def fitted(self, directions: Directions) -> Array:
        """Evaluate the model as the instrument sees it, shape (C, N)."""
        return readings(self._result, *directions)

    def at(self, rows: Index) -> Array:
        """Give the residuals of some rows, shape (C, M); NaN where the measure has none."""
        m = self._m
        values = m.values[:, rows]
        fitted = self.fitted((m.theta_i[rows], m.phi_i[rows], m.theta_o[rows], m.phi_o[rows]))
        with np.errstate(divide="ignore", invalid="ignore"):
            if m.sigma is not None:
                left: Array = (values - fitted) / m.sigma[:, rows]
            elif self.log:
                left = np.log10(np.where((values > 0) & (fitted > 0), values / fitted, np.nan))
            else:
                left = 100.0 * (values / fitted - 1.0)
        left[~np.isfinite(left)] = np.nan
        return left

    def limit(self, residuals: Array) -> float:
        """Give the half range of an axis or colour scale that only stray values exceed."""
        present = np.abs(residuals[~np.isnan(residuals)])
        if present.size == 0:
            return self.least
        return max(1.2 * float(np.quantile(present, 0.98)), self.least)


def choose_channels(count: int) -> list[int]:
    """Pick the channels to show, evenly, the first and last among them."""
    shown = min(count, MAX_CHANNELS)
    return sorted({round(k) for k in np.linspace(0, count - 1, shown)})


def choose_panels(m: Measurement, *, isotropic: bool = False) -> Panels:
    """Pick the panels to show, evenly over the incidences (or views, or bands of theta_i).

    Parameters
    ----------
    m : Measurement
        What was measured.
    isotropic : bool
        Whether the model is; then incidences of any azimuth may be pooled into bands.
    """
    in_plane = bool((out_of_plane(m.theta_i, m.theta_o, m.phi_o - m.phi_i) < PLANE).all())
    groups = m.distinct_incidences()
    crowded = len(groups) > MAX_PANELS
    scattered = crowded and is_scattered(m, groups, isotropic=isotropic)
    swapped = replace(m, theta_i=m.theta_o, phi_i=m.phi_o, theta_o=m.theta_i, phi_o=m.phi_i)
    by_view, bands, scan = False, None, m
    if crowded and (in_plane or scattered):
        # Some goniometers move the lamp: then a view has a lobe and an incidence a few points.
        views = swapped.distinct_incidences()
        by_view = 3 * len(views) < len(groups)
        groups, scan = (views, swapped) if by_view else (groups, m)
    if scattered and not by_view:
        bands = _bands(m)
        groups, scan = bands.groups, bands.turned
    elif in_plane:
        groups = planes_of(scan, groups)
    if in_plane:
        tolerance = float(np.rad2deg(PLANE))
    else:
        tolerance = TOLERANCES[-1] if bands is not None else _tolerance(scan, groups)
    panels = []
    for (theta, phi), rows in groups.items():
        near = rows
        if bands is not None:
            near = _near_in_band(scan, rows)
        elif not in_plane:
            near = _near(scan, rows, phi, tolerance)
        panels.append((theta, phi, rows, near))
    # A single view makes no lobe; unless there is nothing else to show.
    lobes = [p for p in panels if len(p[3]) >= 3] or panels
    picked = np.linspace(0, len(lobes) - 1, min(len(lobes), MAX_PANELS)).round().astype(int)
    beside = not in_plane and bands is None
    chosen = [_panel(scan, *lobes[k], by_view=by_view, beside=beside) for k in picked]
    if bands is not None:
        edges = [bands.edges[lobes[k][:2]] for k in picked]
        chosen = [replace(p, band=own) for p, own in zip(chosen, edges, strict=True)]
    width = None if bands is None else bands.width
    return Panels(chosen, len(panels), in_plane, by_view, tolerance, width)


def thinned(rows: Index) -> Index:
    """Keep at most `MAX_POINTS`, evenly."""
    return rows[:: -(-len(rows) // MAX_POINTS) or 1]


def _away(turn: Array, theta: Array) -> Array:
    """Give the azimuth from the plane of incidence in degrees, 0 at the pole."""
    degrees = np.mod(np.rad2deg(turn) + 90.0, 180.0) - 90.0
    return np.where(theta < PLANE, 0.0, np.abs(degrees))


def _near(m: Measurement, rows: Index, phi: float, tolerance: float) -> Index:
    """Keep the rows whose view is near the plane of incidence."""
    return rows[_away(m.phi_o[rows] - phi, m.theta_o[rows]) <= tolerance + 1e-6]


def _near_in_band(m: Measurement, rows: Index) -> Index:
    """Keep the rows of a band whose view is near the plane, closer about the mirror direction."""
    theta_i, theta_o, turn = m.theta_i[rows], m.theta_o[rows], m.phi_o[rows] - m.phi_i[rows]
    across = np.abs(np.sin(theta_o) * np.sin(turn))
    along = np.abs(np.sin(theta_i) + np.sin(theta_o) * np.cos(turn))
    # Both over the sum of the cosines are slopes of the half vector.
    least = PLANE * (np.cos(theta_i) + np.cos(theta_o))
    close = across <= np.maximum(least, ASIDE_SHARE * along)
    near: Index = rows[close & (_away(turn, theta_o) <= TOLERANCES[-1])]
    return near


def _tolerance(m: Measurement, groups: Groups) -> float:
    for tolerance in TOLERANCES[:-1]:
        counts = [len(_near(m, rows, phi, tolerance)) for (_, phi), rows in groups.items()]
        if np.median(counts) >= ENOUGH_VIEWS:
            return tolerance
    return TOLERANCES[-1]


def _bands(m: Measurement) -> Bands:
    """Pool scattered incidences into the narrowest bands that have enough to show."""
    for width in BAND_WIDTHS[:-1]:
        bands = pool(m, width)
        counts = [len(_near_in_band(bands.turned, rows)) for rows in bands.groups.values()]
        if np.median(counts) >= ENOUGH_IN_BAND:
            return bands
    return pool(m, BAND_WIDTHS[-1])


def _panel(
    m: Measurement,
    theta: float,
    phi: float,
    rows: Index,
    near: Index,
    *,
    by_view: bool,
    beside: bool,
) -> Panel:
    hemisphere, near = thinned(rows), thinned(near)
    turn = m.phi_o[near] - phi
    angle = np.rad2deg(signed(m.theta_o[near], turn))
    # Where all views are beside the plane, the lobe is drawn beside it too.
    aside = _away(turn, m.theta_o[near]) if beside and near.size else np.zeros(1)
    mirror = float(np.rad2deg(theta))
    low, high = (float(angle.min()), float(angle.max())) if angle.size else (-85.0, 85.0)
    line_angle = _line_angles(max(low - 3, -89.5), min(high + 3, 89.5), mirror)
    tilt = np.abs(np.deg2rad(line_angle))
    azimuth = phi + np.where(line_angle > 0, np.pi, 0.0) + np.deg2rad(np.median(aside))
    fixed = (np.full(tilt.shape, theta), np.full(tilt.shape, phi))
    line = (tilt, azimuth, *fixed) if by_view else (*fixed, tilt, azimuth)
    return Panel(
        theta=mirror,
        phi=float(np.rad2deg(phi)),
        rows=near,
        angle=angle,
        line=line,
        line_angle=line_angle,
        hemisphere=hemisphere,
        turn=m.phi_o[hemisphere] - phi - np.pi,
        tilt=np.rad2deg(m.theta_o[hemisphere]),
    )


def _line_angles(low: float, high: float, mirror: float) -> Array:
    """Give angles dense enough for a lobe of a hundredth of a degree at the mirror direction."""
    close = np.geomspace(0.003, 6.0, 60)
    angles = np.concatenate([np.linspace(low, high, 361), mirror - close, mirror + close])
    return np.unique(np.clip(np.append(angles, mirror), low, high))
