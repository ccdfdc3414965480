"""The lobes as an OpenEXR picture: measured, fitted and residual on a regular grid of angles.

Every pixel is a cell of a grid of directions. A picture has one of two layouts, told by the
attribute ``lobefit:layout``:

``in-plane``
    All views lie in the plane of incidence. A row is an incidence, a column a signed theta_o:
    positive on the side of the mirror direction, negative on the side of the light. For
    incidence along the normal every plane through it is a row.
``tiles``
    Each incidence is a tile, the tiles stand below each other. Inside a tile a row is an
    azimuth ``phi_o - phi_i`` (180 degrees holds the mirror direction), a column a theta_o.

Scattered incidences, more than a picture has room for and hardly a reading each, are pooled: in
tiles those within 5 degrees of theta_i, in the plane within 1, in cells of that width. Incidences
are then the bands' middles, and readings stand at their own theta_o and ``phi_o - phi_i``; the
attribute ``lobefit:band_deg`` gives the bands' width.

Channels are named ``LAYER.CHANNEL``, in 32-bit floating point, 1/sr:

``measured``
    Mean of the readings in the cell; NaN where there is none.
``fitted``
    The model at the centre of the cell, everywhere.
``residual``
    Mean over the cell's readings of measured minus model, each at its own angles; so where
    readings are off the centres it is not the difference of the other two.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lobefit.fitting.bands import is_isotropic, is_scattered, pool
from lobefit.fitting.exr import exr_header, exr_name, write_exr
from lobefit.fitting.instrument_result import readings
from lobefit.fitting.measurement import Measurement
from lobefit.fitting.result import FitResult

__all__ = [
    "LAYERS",
    "SCHEMA",
    "Grid",
    "make_grid",
    "out_of_plane",
    "planes_of",
    "signed",
    "write_lobes",
]

Array = NDArray[np.float64]
Index = NDArray[np.intp]

SCHEMA = "lobefit.lobes/1"
LAYERS = ("measured", "fitted", "residual")

MAX_INCIDENCES = 128
"""More are thinned evenly: a picture is for looking at."""
MAX_NUMBERS = 6_000_000
"""Floats in a picture, 24 MB before compression; tiles get coarser until they fit."""

# Width of bands of theta_i and of cells, in degrees, where incidences are scattered: some
# thousand readings then fill a good part of the picture.
PLANE_BAND, TILE_BAND = 1.0, 5.0

# Views this far from the plane of incidence still lie in it, and directions this close to the
# normal have no azimuth to speak of.
PLANE = np.deg2rad(0.5)


@dataclass(frozen=True, eq=False)
class Grid:
    """Where the cells are and which row of the measurement falls into which.

    Attributes
    ----------
    layout : str
        "in-plane" or "tiles".
    incidences : list of (theta_i, phi_i)
        In radians, one per row or tile.
    phi : ndarray
        Azimuths ``phi_o - phi_i`` of a tile's rows in degrees; ``[180]`` in the plane.
    theta : ndarray
        theta_o of the columns in degrees; signed in the plane.
    rows : ndarray, shape (M,)
        Rows of the measurement that are shown.
    cell : ndarray, shape (M,)
        The pixel of each, counted row by row.
    n_incidences : int
        Incidences (or bands) of the measurement, shown or not.
    width : float, optional
        Where incidences are pooled, of their bands in degrees.
    """

    layout: str
    incidences: list[tuple[float, float]]
    phi: Array
    theta: Array
    rows: Index
    cell: Index
    n_incidences: int
    width: float | None = None

    @property
    def shape(self) -> tuple[int, int]:
        """Height and width in pixels."""
        return len(self.incidences) * len(self.phi), len(self.theta)

    def centres(self) -> tuple[Array, Array, Array, Array]:
        """Give the directions of all cells in radians, row by row."""
        theta_i, phi_i = np.array(self.incidences).T
        axes = np.broadcast_arrays(
            theta_i[:, None, None],
            phi_i[:, None, None],
            np.abs(np.deg2rad(self.theta)),
            phi_i[:, None, None]
            + np.deg2rad(self.phi)[:, None]
            + np.where(self.theta < 0, np.pi, 0.0),
        )
        return tuple(a.ravel() for a in axes)  # type: ignore[return-value]


def signed(theta: Array, turn: Array) -> Array:
    """Give theta the sign of its side: positive for azimuths beyond 90 degrees of `turn` = 0."""
    return np.where(np.cos(turn) > 0, -theta, theta)


def out_of_plane(theta_i: Array, theta_o: Array, turn: Array) -> Array:
    """Give the angle of a view from the plane of incidence, in radians; 0 for theta_i = 0."""
    away = np.arcsin(np.abs(np.sin(theta_o) * np.sin(turn)))
    return np.where(theta_i < PLANE, 0.0, away)


def make_grid(measurement: Measurement, *, isotropic: bool = False) -> Grid:
    """Choose the layout and the steps that keep the measured directions apart.

    Parameters
    ----------
    measurement : Measurement
        Steps are those of its angles: 0.25 to 2.5 degrees in the plane of incidence, 1 to
        5 degrees in tiles, coarser where the picture would have more than `MAX_NUMBERS`.
    isotropic : bool
        Whether the model is; then scattered incidences of any azimuth are pooled.
    """
    m, width = measurement, 0.0
    groups = m.distinct_incidences()
    in_plane = bool((out_of_plane(m.theta_i, m.theta_o, m.phi_o - m.phi_i) < PLANE).all())
    if len(groups) > MAX_INCIDENCES and is_scattered(m, groups, isotropic=isotropic):
        bands = pool(m, PLANE_BAND if in_plane else TILE_BAND)
        m, groups, width = bands.turned, bands.groups, bands.width
    elif in_plane:
        groups = planes_of(m, groups)
    keys = list(groups)
    if len(keys) > MAX_INCIDENCES:
        keys = [keys[k] for k in np.linspace(0, len(keys) - 1, MAX_INCIDENCES).round().astype(int)]
    rows = np.concatenate([groups[key] for key in keys])
    incidence = np.repeat(np.arange(len(keys)), [len(groups[key]) for key in keys])
    turn = m.phi_o[rows] - np.array([phi for _, phi in keys])[incidence]
    theta_o = np.rad2deg(m.theta_o[rows])
    if in_plane:
        side = signed(theta_o, turn)
        theta = _axis(side, (width or 0.25, width or 2.5), (-90.0, 90.0), whole=width > 0)
        row, column, phi = incidence, _nearest(theta, side), np.array([180.0])
    else:
        turned = np.mod(np.rad2deg(turn), 360.0)
        coarsest = (width or 1.0, 5.0)
        while True:
            theta = _axis(theta_o, coarsest, (0.0, 90.0), whole=width > 0)
            phi = _axis(turned, coarsest, (0.0, 360.0), whole=width > 0)
            if len(keys) * len(phi) * len(theta) * 3 * m.n_channels <= MAX_NUMBERS:
                break
            coarsest = (coarsest[0] * 1.5, max(coarsest[1], coarsest[0] * 1.5))
        row = incidence * len(phi) + _nearest(phi, turned, period=360.0)
        column = _nearest(theta, theta_o)
    return Grid(
        layout="in-plane" if in_plane else "tiles",
        incidences=keys,
        phi=phi,
        theta=theta,
        rows=rows,
        cell=row * len(theta) + column,
        n_incidences=len(groups),
        width=width or None,
    )


def write_lobes(path: Path, result: FitResult, measurement: Measurement) -> None:
    """Write the lobes of a result beside what was measured.

    Parameters
    ----------
    path : Path
        An ``.exr`` file; replaced if it exists.
    result : FitResult
        The model to draw.
    measurement : Measurement
        What it was fitted to.

    Raises
    ------
    LobefitError
        The file cannot be written, or does not hold what was written.
    """
    grid = make_grid(measurement, isotropic=is_isotropic(result))
    planes = {
        f"{layer}.{exr_name(channel)}": values[c]
        for layer, values in _layers(grid, result, measurement).items()
        for c, channel in enumerate(measurement.channels)
    }
    write_exr(path, planes, _attributes(grid, result, measurement))


def _layers(grid: Grid, result: FitResult, m: Measurement) -> dict[str, Array]:
    """Fill the cells; each layer has shape (C, height, width)."""
    values = m.values[:, grid.rows]
    angles = (m.theta_i, m.phi_i, m.theta_o, m.phi_o)
    residual = values - readings(result, *(a[grid.rows] for a in angles))
    shape = (m.n_channels, *grid.shape)
    return {
        "measured": _cell_means(grid, values).reshape(shape),
        "fitted": result.predict(*grid.centres()).reshape(shape),
        "residual": _cell_means(grid, residual).reshape(shape),
    }


def _cell_means(grid: Grid, values: Array) -> Array:
    """Average each channel's readings by cell, shape (C, cells); NaN without a reading."""
    height, width = grid.shape
    means = np.full((len(values), height * width), np.nan)
    for mean, channel in zip(means, values, strict=True):
        present = ~np.isnan(channel)
        cell = grid.cell[present]
        total = np.bincount(cell, channel[present], minlength=mean.size)
        count = np.bincount(cell, minlength=mean.size)
        np.divide(total, count, out=mean, where=count > 0)
    return means


def planes_of(
    m: Measurement, groups: dict[tuple[float, float], Index]
) -> dict[tuple[float, float], Index]:
    """Split incidence along the normal into the planes through it that were scanned."""
    split: dict[tuple[float, float], Index] = {}
    for (theta_i, phi_i), rows in groups.items():
        if theta_i >= PLANE:
            split[theta_i, phi_i] = rows
            continue
        # An azimuth of view and its opposite are one plane; the pole itself joins the first.
        degrees = np.round(np.mod(np.rad2deg(m.phi_o[rows]), 180.0), 3) % 180.0
        oblique = m.theta_o[rows] >= PLANE
        planes = np.unique(degrees[oblique]) if oblique.any() else np.array([0.0])
        plane = np.where(oblique, degrees, planes[0])
        for azimuth in planes.tolist():
            key = (theta_i, float(np.deg2rad(azimuth)))
            mine = rows[plane == azimuth]
            split[key] = np.concatenate([split[key], mine]) if key in split else mine
    return dict(sorted(split.items()))


def _axis(
    angles: Array, steps: tuple[float, float], span: tuple[float, float], *, whole: bool
) -> Array:
    """Lay regular cell centres inside a span, in the step and phase of the angles (degrees).

    Or, if `whole`, in such a phase that polar angles are covered to the horizon and azimuths
    have the plane of incidence in the middle of a cell.
    """
    low, high = span
    found = np.unique(np.round(angles, 3))
    gaps = np.diff(found)
    step = float(np.quantile(gaps, 0.1)) if gaps.size else steps[1]
    step = min(max(step, steps[0]), steps[1])
    if high == 360.0:  # a whole number of cells closes the circle
        step = high / round(high / step)
    off_centre = [
        float(np.abs(np.mod((found - start) / step + 0.5, 1.0) - 0.5).mean())
        for start in (0.0, step / 2)
    ]
    if whole:
        start = 0.0 if high == 360.0 else step / 2
    else:
        start = 0.0 if off_centre[0] <= off_centre[1] else step / 2
    first, last = np.ceil((low - start) / step), np.floor((high - start) / step)
    centres = np.arange(first, last + 1) * step + start
    # No direction lies on the horizon, and 360 degrees are 0.
    keep = centres < high - 1e-9
    if low < 0:
        keep &= centres > low + 1e-9
    axis: Array = centres[keep]
    return axis


def _nearest(axis: Array, angles: Array, period: float | None = None) -> Index:
    step = axis[1] - axis[0] if len(axis) > 1 else 1.0
    index: Index = np.rint((angles - axis[0]) / step).astype(np.intp)
    if period:
        index %= len(axis)
    return np.clip(index, 0, len(axis) - 1)


def _attributes(grid: Grid, result: FitResult, m: Measurement) -> dict[str, str]:
    """Describe the axes and the model."""
    rows = "incidence" if grid.layout == "in-plane" else "incidence, then phi_o - phi_i"
    columns = "signed theta_o" if grid.layout == "in-plane" else "theta_o"
    incidences = np.rad2deg(np.array(grid.incidences)).round(9).tolist()
    band = {} if grid.width is None else {"band_deg": f"{grid.width:g}"}
    about = {
        "layout": grid.layout,
        "axes": f"rows from the top: {rows}; columns from the left: {columns}; degrees",
        "theta_o_deg": json.dumps(grid.theta.round(9).tolist()),
        "phi_deg": json.dumps(grid.phi.round(9).tolist()),
        "incidences_deg": json.dumps(incidences),
        "incidences_shown": f"{len(grid.incidences)} of {grid.n_incidences}",
        **band,
        "unit": "1/sr",
        "channels": json.dumps(m.channels),
        "candidate": result.candidate,
        "params": json.dumps(result.params),
        "options": json.dumps(dict(result.options)),
    }
    return exr_header(SCHEMA, __doc__, about)
