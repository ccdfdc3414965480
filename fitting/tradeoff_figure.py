"""The picture of a chart: time against error, the Pareto front lettered, the rest numbered."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lobefit.fitting.pictures import new_figure, write_png
from lobefit.fitting.tradeoff import Chart
from lobefit.fitting.tradeoff_points import Panel, Point, contenders, front, within
from lobefit.fitting.tradeoff_texts import duration, share

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["draw_chart", "write_chart"]

DPI = 150
DARK, GREY, LIGHT = "#1a1a1a", "#666666", "#e2e2e2"
ACCENT = "#D55E00"
# Okabe and Ito's palette, told apart with any colour vision, and a shape for each.
COLOURS = ("#0072B2", "#E69F00", "#009E73", "#CC79A7", "#56B4E9", "#8C6D00", "#7A4FB5", "#444444")
SHAPES = ("o", "s", "D", "^", "v", "P", "X", "h")
# More points than this fill a panel.
FEW = 30
# Errors above twice the value itself say only that the fit went astray.
ASTRAY = 2.0
LETTERS = "ABCDEFGHIJKLMNOPQRSTUVWXYZ"


def write_chart(path: Path, chart: Chart) -> None:
    """Draw a chart and write it as PNG; the same chart gives the same bytes."""
    write_png(path, draw_chart(chart), DPI)


def draw_chart(chart: Chart) -> Figure:
    """Draw a chart.

    Parameters
    ----------
    chart : Chart

    Returns
    -------
    matplotlib.figure.Figure
        One wide panel for the fits, the others below it in a row, each with the names of its
        front beside or below it.
    """
    first, *others = chart.panels
    height = 6.6 + (6.1 if others else 0.0)
    figure = new_figure(13.0, height, layout=None)

    def inches(left: float, bottom: float, width: float, tall: float) -> Any:
        return figure.add_axes((left / 13.0, bottom / height, width / 13.0, tall / height))

    figure.text(
        0.3 / 13, 1 - 0.32 / height, chart.name, fontsize=14, weight="bold", color=DARK, va="center"
    )
    head = [(chart.answer, 10.5, DARK), (first.finding, 9.5, DARK)]
    head.append((f"{chart.device}; {first.notes[0]}", 8, GREY))
    for k, (text, size, colour) in enumerate(head):
        line = textwrap.shorten(text, int(1750 / size), placeholder=" ...")
        y = 1 - (0.62 + 0.25 * k) / height
        figure.text(0.3 / 13, y, line, fontsize=size, color=colour, va="center")
    below = height - 6.6
    axes = inches(0.75, below + 0.65, 7.6, 4.35)
    _draw(axes, first, chart.tolerance)
    _key(figure, first, (8.75, below + 5.05, 4.1), height, 24, chart.tolerance)
    width = (13.0 - 0.3) / max(len(others), 1)
    for k, panel in enumerate(others):
        left = 0.3 + k * width
        axes = inches(left + 0.55, 2.75, min(width - 0.85, 6.5), 2.85)
        _draw(axes, panel, None)
        _key(figure, panel, (left + 0.2, 2.2, min(width, 6.5) - 0.2), height, 12, None)
    return figure


def _groups(panel: Panel) -> dict[str, int]:
    return {name: k for k, name in enumerate(dict.fromkeys(p.group for p in panel.points))}


def _draw(axes: Axes, panel: Panel, tolerance: float | None) -> None:
    members, level = front(panel.points), contenders(panel.points)
    groups = _groups(panel)
    for k, point in enumerate(panel.points):
        _mark(axes, point, groups[point.group], panel, bold=k in members, ring=k in level)
    chain = [panel.points[k] for k in members]
    x, y = (
        [p.seconds.median for p in chain],
        [_height(p.error.median, panel) for p in chain],
    )
    axes.plot(x, y, color=DARK, linewidth=1.3, drawstyle="steps-post", zorder=4, alpha=0.8)
    axes.set_xscale("log")
    axes.set_yscale("log")
    _limits(axes, panel)
    _ticks(axes)
    for letter, point in zip(LETTERS, chain, strict=False):
        axes.annotate(
            letter,
            (point.seconds.median, _height(point.error.median, panel)),
            xytext=(-5, -5),
            textcoords="offset points",
            ha="right",
            va="top",
            fontsize=10,
            weight="bold",
            color=DARK,
            zorder=6,
        )
    _number(axes, panel, members)
    if tolerance is not None:
        asked = (100.0 if panel.percent else 1.0) * tolerance
        axes.axhline(asked, color=ACCENT, linewidth=1.0, linestyle="--", zorder=1)
        chosen = within(panel.points, tolerance)
        if chosen is not None:
            at = (chosen.seconds.median, _height(chosen.error.median, panel))
            axes.plot(*at, "o", markersize=15, markerfacecolor="none", color=ACCENT, zorder=6)
        axes.annotate(
            f"{100 * tolerance:g} % asked for",
            (1.0, asked),
            xycoords=("axes fraction", "data"),
            xytext=(-4, -3),
            textcoords="offset points",
            ha="right",
            va="top",
            fontsize=7.5,
            color=ACCENT,
        )
    astray = sum(p.error.median > ASTRAY for p in panel.points) if panel.percent else 0
    if astray:
        axes.annotate(
            f"upper edge: {astray} beyond {100 * ASTRAY:g} %",
            (0.01, 0.985),
            xycoords="axes fraction",
            va="top",
            fontsize=7,
            color=GREY,
        )
    size = 10.5 if tolerance is not None else 9.5
    axes.set_title(panel.title, fontsize=size, color=DARK, loc="left", weight="bold")
    axes.set_xlabel(panel.seconds_label, fontsize=8.5)
    axes.set_ylabel(panel.error_label, fontsize=8.5)
    _legend(axes, panel, groups)


def _height(error: float, panel: Panel) -> float:
    """Give the height of an error in the picture: what is astray stands at the upper edge."""
    return 100.0 * min(error, ASTRAY) if panel.percent else error


def _number(axes: Axes, panel: Panel, members: list[int]) -> None:
    """Write the numbers of the points off the front, where there is room for the number."""
    scale = axes.transData.transform
    at = [scale((p.seconds.median, _height(p.error.median, panel))) for p in panel.points]
    pixel = axes.figure.dpi / 72.0
    taken: list[tuple[float, float]] = [(x, y) for x, y in at]
    for k in range(len(panel.points)):
        if k in members:
            continue
        for dx, dy in ((6, 5), (6, -5), (-6, 5), (-6, -5), (0, 9), (0, -9), (0, 15), (0, -15)):
            x, y = at[k][0] + dx * pixel, at[k][1] + dy * pixel
            if all(abs(x - u) > 6.0 * pixel or abs(y - v) > 5.0 * pixel for u, v in taken):
                break
        else:
            continue  # its place is in chart.json
        taken.append((x, y))
        axes.annotate(
            str(k + 1),
            (panel.points[k].seconds.median, _height(panel.points[k].error.median, panel)),
            xytext=(dx, dy),
            textcoords="offset points",
            ha="center",
            va="center",
            fontsize=5.5,
            color=GREY,
            zorder=3,
        )


def _mark(axes: Axes, point: Point, group: int, panel: Panel, *, bold: bool, ring: bool) -> None:
    x, y = point.seconds.median, _height(point.error.median, panel)
    colour = COLOURS[group % len(COLOURS)]
    bars: dict[str, Any] = {"color": colour, "linewidth": 0.8, "alpha": 0.6, "zorder": 2}
    axes.plot([point.seconds.low, point.seconds.high], [y, y], **bars)
    ends = [_height(e, panel) for e in (point.error.low, point.error.high)]
    axes.plot([x, x], ends, **bars)
    axes.plot(
        x,
        y,
        linestyle="none",
        marker=SHAPES[group % len(SHAPES)],
        markersize=7.0 if bold else 4.5,
        markerfacecolor=colour if bold or not ring else "white",
        markeredgecolor=DARK if bold else colour,
        markeredgewidth=0.9 if bold or ring else 0.0,
        alpha=1.0 if bold or ring else 0.75,
        zorder=5 if bold else 3,
    )


def _limits(axes: Axes, panel: Panel) -> None:
    """Leave room for letters below and to the left of the front."""
    x = [v for p in panel.points for v in (p.seconds.low, p.seconds.high)]
    y = [_height(v, panel) for p in panel.points for v in (p.error.low, p.error.high)]
    for low, high, limit in ((min(x), max(x), axes.set_xlim), (min(y), max(y), axes.set_ylim)):
        room = (high / low) ** 0.05
        limit(low / max(room**1.8, 1.15), high * max(room, 1.1))


def _ticks(axes: Axes) -> None:
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    def plain(value: float, _position: int) -> str:
        return f"{value:g}" if 1e-4 < value < 1e4 else f"{value:.0e}".replace("e-0", "e-")

    for axis, (low, high) in ((axes.xaxis, axes.get_xlim()), (axes.yaxis, axes.get_ylim())):
        axis.set_major_formatter(FuncFormatter(plain))
        axis.set_minor_formatter(FuncFormatter(plain) if high < 80.0 * low else NullFormatter())
        axis.set_minor_locator(LogLocator(subs=(2, 3, 5), numticks=50))
    axes.spines[["top", "right"]].set_visible(False)
    axes.spines[["left", "bottom"]].set(color=GREY, linewidth=0.7)
    axes.grid(color=LIGHT, linewidth=0.5)
    axes.set_axisbelow(True)
    axes.tick_params(labelsize=8, color=GREY, width=0.7, which="both")
    axes.tick_params(labelsize=6.5, which="minor")


def _legend(axes: Axes, panel: Panel, groups: dict[str, int]) -> None:
    from matplotlib.lines import Line2D

    handles = [
        Line2D(
            [],
            [],
            linestyle="none",
            marker=SHAPES[k % len(SHAPES)],
            color=COLOURS[k % len(COLOURS)],
            markersize=5,
            label=name,
        )
        for name, k in groups.items()
    ]
    handles.append(Line2D([], [], color=DARK, linewidth=1.3, label="Pareto front"))
    if len(contenders(panel.points)) > len(front(panel.points)):
        style: dict[str, Any] = {"linestyle": "none", "marker": "o", "markersize": 5}
        handles.append(
            Line2D([], [], color=GREY, markerfacecolor="white", label="level with it", **style)
        )
    if len(panel.points) > FEW:  # below the axes, where it hides nothing
        place: dict[str, Any] = {"loc": "upper center", "bbox_to_anchor": (0.5, -0.1)}
        place |= {"ncol": len(handles), "columnspacing": 1.2, "handletextpad": 0.4}
    else:  # what is slow and far off is of least interest: the front is never there
        place = {"loc": "upper right", "frameon": True}
    axes.legend(handles=handles, fontsize=7, framealpha=0.6, edgecolor="none", **place)


def _key(
    figure: Figure,
    panel: Panel,
    place: tuple[float, float, float],
    height: float,
    lines: int,
    tolerance: float | None,
) -> None:
    """Name the front's points, then, where there is room, the finding or the numbered ones."""
    left, top, width = place
    columns = int(width * 14.5)
    rows: list[tuple[str, str, Any]] = []
    chain = [panel.points[k] for k in front(panel.points)]
    chosen = None if tolerance is None else within(panel.points, tolerance)
    for letter, p in zip(LETTERS, chain, strict=False):
        colour = ACCENT if p is chosen else DARK
        rows.append((letter, f"{p.label}: {_figures(p, panel.percent)}", colour))
    if tolerance is None:
        said = [("", text, GREY) for text in textwrap.wrap(panel.finding, columns)]
        rows = [*rows[: max(lines - len(said), 4)], *said]
    else:
        rows += [("", "", GREY), *_numbered(panel, chain, lines - len(rows) - 1)]
    for k, (mark, text, colour) in enumerate(rows[:lines]):
        y = (top - 0.175 * k) / height
        style: dict[str, Any] = {"fontsize": 7.5, "va": "center", "color": colour}
        figure.text(left / 13.0, y, mark, weight="bold", **style)
        cut = textwrap.shorten(text, columns, placeholder=" ...")
        figure.text((left + (0.2 if mark else 0.0)) / 13.0, y, cut, **style)


def _numbered(panel: Panel, chain: Sequence[Point], room: int) -> list[tuple[str, str, Any]]:
    """Name the other models, by the numbers that they have in the picture."""
    rest = [(k + 1, p) for k, p in enumerate(panel.points) if p.usual and p not in chain]
    rest.sort(key=lambda entry: (entry[1].error.median, entry[1].seconds.median))
    rows = [("", "other models, by error:", GREY)]
    for number, p in rest[: max(room - 2, 0)]:
        rows.append(("", f"{number:>3}  {p.label}: {_figures(p, panel.percent)}", GREY))
    shown = len(rows) - 1 + len(chain)
    if len(panel.points) > shown:
        more = len(panel.points) - shown
        rows.append(("", f"... and {more} more choices, by number in chart.json", GREY))
    return rows


def _figures(p: Point, percent: bool) -> str:
    return f"{duration(p.seconds.median)}, {share(p.error.median, percent)}"
