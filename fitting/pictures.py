"""What all pictures have in common: a canvas of their own, and PNG files that can be compared."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from lobefit import __version__

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["new_figure", "write_png"]


def new_figure(width: float, height: float, layout: str | None = "constrained") -> Figure:
    """Make an empty figure with its own Agg canvas; no global state of matplotlib is touched.

    Parameters
    ----------
    width, height : float
        Inches.
    layout : str or None
        As for `matplotlib.figure.Figure`.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), layout=layout)  # type: ignore[arg-type]
    FigureCanvasAgg(figure)
    return figure


def write_png(path: Path, figure: Figure, dpi: float) -> None:
    """Write a figure; the same figure gives the same bytes."""
    figure.savefig(path, format="png", dpi=dpi, metadata={"Software": f"lobefit {__version__}"})
