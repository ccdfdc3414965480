"""The picture of a fit: measured points against fitted lobes, and where they differ.

One panel per incidence (of a scan over incidences, per view), at most eight: the BRDF in the
plane of incidence over the signed angle, positive on the side of the mirror direction, which
a dotted line marks. Below it what the model leaves over: in the plane a strip over the same
angle, out of the plane a map of the hemisphere.
"""

from __future__ import annotations

import re
import textwrap
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from lobefit import __version__
from lobefit.fitting.lobes import PLANE, out_of_plane, signed
from lobefit.fitting.measurement import Measurement
from lobefit.fitting.report import FitReport
from lobefit.fitting.result import FitResult
from lobefit.fitting.tables import with_error

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["channel_colours", "draw_figure", "write_figure"]

Array = NDArray[np.float64]
Index = NDArray[np.intp]

MAX_PANELS = 8
MAX_CHANNELS = 5
MAX_POINTS = 4000  # of a panel; more only darken the paper
DPI = 150
LOG_FROM_DECADES = 1.5

DARK, GREY, LIGHT = "#1a1a1a", "#6b6b6b", "#dddddd"
# Okabe and Ito's palette, told apart with any colour vision; its vermilion, green and blue
# stand for red, green and blue.
RGB = {"r": "#D55E00", "g": "#009E73", "b": "#0072B2"}
OTHERS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00")
WAVELENGTH = re.compile(r"^\D*(\d+(?:\.\d+)?)\s*(?:nm|um|µm)?$")


@dataclass(frozen=True, eq=False)
class _Panel:
    """One fixed direction and the rows measured with it."""

    title: str
    mirror: float  # signed angle of the mirror direction, degrees
    rows: Index  # in the plane of incidence
    angle: Array  # their signed angle, degrees
    line: tuple[Array, Array, Array, Array]  # directions of the drawn lobe
    line_angle: Array
    all_rows: Index  # of the whole hemisphere
    turn: Array  # azimuth of `all_rows` from the mirror direction, radians


def write_figure(path: Path, report: FitReport) -> None:
    """Draw the best result and write it as PNG; the same report gives the same bytes."""
    figure = draw_figure(report)
    figure.savefig(path, format="png", dpi=DPI, metadata={"Software": f"lobefit {__version__}"})


def draw_figure(report: FitReport) -> Figure:
    """Draw the best result of a report.

    Parameters
    ----------
    report : FitReport
        With at least one result.

    Returns
    -------
    matplotlib.figure.Figure
        With its own Agg canvas; no global state of matplotlib is touched.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    m, best = report.measurement, report.best
    shown = _shown_channels(m.channels)
    colours = channel_colours(m.channels)
    in_plane, panels = _panels(m)
    view = _Residuals(m, best, log=m.decades >= LOG_FROM_DECADES)

    columns = min(len(panels), 4)
    blocks = -(-len(panels) // columns)
    lower = 1.1 if in_plane else 2.2
    size = (max(2.75 * columns + 2.6, 7.2), (2.6 + lower) * blocks + 1.25)
    figure = Figure(figsize=size, layout="constrained")
    FigureCanvasAgg(figure)
    grid = figure.add_gridspec(2 * blocks, columns, height_ratios=[2.6, lower] * blocks)
    first: Axes | None = None
    first_below: Axes | None = None
    mapped: Any = None
    for k, panel in enumerate(panels):
        block, column = divmod(k, columns)
        ax = figure.add_subplot(grid[2 * block, column], sharex=first, sharey=first)
        first = first or ax
        _draw_lobes(ax, panel, view, shown, colours)
        if in_plane:
            below = figure.add_subplot(
                grid[2 * block + 1, column], sharex=ax, sharey=first_below or None
            )
            first_below = first_below or below
            _draw_strip(below, panel, view, shown, colours)
            ax.tick_params(labelbottom=False)
        else:
            below = figure.add_subplot(grid[2 * block + 1, column], projection="polar")
            mapped = _draw_map(below, panel, view, shown)
        if column == 0:
            ax.set_ylabel("BRDF [1/sr]")
            if in_plane:
                below.set_ylabel(view.label)
        else:
            ax.tick_params(labelleft=False)
            if in_plane:
                below.tick_params(labelleft=False)
        (below if in_plane else ax).set_xlabel(f"signed {_running(m)} [°]")
    assert first is not None
    _scale_values(first, panels, view, shown)
    if in_plane:
        assert first_below is not None
        first_below.set_ylim(-view.limit, view.limit)
    elif mapped is not None:
        bar = figure.colorbar(mapped, ax=figure.axes, shrink=0.4, aspect=25, pad=0.02)
        bar.set_label(_map_label(view, shown, m.channels), color=GREY, fontsize=8)
        bar.ax.tick_params(labelsize=7, colors=GREY)
        bar.outline.set_visible(False)  # type: ignore[operator]
    _legend(figure, m, shown, colours, in_plane)
    _title(figure, report, in_plane, len(panels))
    return figure
