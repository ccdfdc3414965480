"""The picture of a batch: for each item the chosen model, how well it fits, and the time."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from lobefit.fitting.figure import ACCENT, DARK, DPI, GREY, LIGHT
from lobefit.fitting.pictures import new_figure, write_png

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["draw_batch", "write_batch_figure"]

Rows = Sequence[Mapping[str, Any]]

FITTED = "#0072B2"
# Inches of a row; with more rows than can be read, of all rows together.
ROW, MOST = 0.155, 300
# A name is cut in its middle beyond this.
LONGEST = 34


def write_batch_figure(path: Path, rows: Rows) -> None:
    """Draw items and write a PNG; the same rows give the same bytes."""
    write_png(path, draw_batch(rows), DPI)


def draw_batch(rows: Rows) -> Figure:
    """Draw a row for each item: names to the left, three panels beside each other.

    Parameters
    ----------
    rows : sequence of mapping
        As in the table (`lobefit.fitting.batch_table.ITEM_COLUMNS`), the first at the top. Beyond
        300 items rows get thinner and only failures are named, unless these are as many.

    Returns
    -------
    matplotlib.figure.Figure
        With its own Agg canvas.
    """
    chosen = Counter(row["model"] for row in rows if row.get("model"))
    # The most frequent first; equal ones by name.
    models = sorted(chosen, key=lambda name: (-chosen[name], name))
    names = 0.065 * max([len(_short(row["name"])) for row in rows], default=1) + 0.3
    longest = 0.06 * max([len(name) for name in models], default=1)
    height = ROW * min(max(len(rows), 4), MOST) + 1.0 + longest
    widths = [max(0.2 * len(models), 0.8), 2.6, 1.8]
    figure = new_figure(max(sum(widths) + names + 0.6, 6.4), height)
    figure.suptitle(_title(rows), fontsize=9, color=DARK, x=0.01, ha="left")
    left, middle, right = figure.subplots(1, 3, sharey=True, width_ratios=widths)
    _draw_models(left, rows, models, chosen)
    _draw_errors(middle, rows)
    _draw_times(right, rows)
    for ax in (left, middle, right):
        ax.set_ylim(len(rows) - 0.4, -0.6)
        ax.tick_params(labelsize=7, length=2, colors=GREY)
        ax.set_axisbelow(True)
        for side in ("top", "right", "left", "bottom"):
            ax.spines[side].set_visible(False)
    _name_rows(left, rows)
    for ax in (middle, right):
        ax.tick_params(axis="y", left=False, labelleft=False)
    return figure


def _title(rows: Rows) -> str:
    failed = sum(_has_failed(row) for row in rows)
    cancelled = sum(not row.get("model") and row.get("status") == "cancelled" for row in rows)
    fitted = len(rows) - failed - cancelled
    poor = sum(row.get("described") is False for row in rows)
    said = [f"{fitted} fitted" + (f" ({poor} of them described by no model)" if poor else "")]
    said += [f"{failed} failed"] if failed else []
    said += [f"{cancelled} cancelled"] if cancelled else []
    return f"{len(rows)} item{'s' * (len(rows) != 1)}: {', '.join(said)}"


def _short(text: str, most: int = LONGEST) -> str:
    half = (most - 1) // 2
    return text if len(text) <= most else f"{text[:half]}…{text[-half:]}"


def _has_failed(row: Mapping[str, Any]) -> bool:
    return bool(row.get("reason")) and row.get("status") != "cancelled"


def _named(rows: Rows) -> list[int]:
    """Say which rows there is room to write about: all, else failures, else none."""
    failed = [k for k, row in enumerate(rows) if _has_failed(row)]
    return next((at for at in ([*range(len(rows))], failed) if len(at) <= MOST), [])


def _name_rows(ax: Axes, rows: Rows) -> None:
    at = _named(rows)
    ax.set_yticks(at, [_short(rows[k]["name"]) for k in at], fontsize=7)
    for k, label in zip(at, ax.get_yticklabels(), strict=True):
        label.set_color(ACCENT if _has_failed(rows[k]) else DARK)


def _colour(row: Mapping[str, Any]) -> str:
    return FITTED if row.get("described") is not False else ACCENT


def _mark(ax: Axes, points: Sequence[tuple[float, int, str]], **style: Any) -> None:
    """Draw markers at x, y of a colour, those not described on top; a call for each is slow."""
    for colour in (FITTED, ACCENT):
        at = [(x, y) for x, y, own in points if own == colour]
        if at:
            ax.plot(*zip(*at, strict=True), ls="", color=colour, mew=0, **style)


def _draw_models(ax: Axes, rows: Rows, models: list[str], chosen: Counter[str]) -> None:
    place = {name: x for x, name in enumerate(models)}
    chosen_by = [(k, row) for k, row in enumerate(rows) if row.get("model")]
    _mark(ax, [(place[row["model"]], k, _colour(row)) for k, row in chosen_by], marker="s", ms=5)
    ax.set_xlim(-0.6, max(len(models), 1) - 0.4)
    labels = [f"{name} ({chosen[name]})" for name in models]
    ax.set_xticks(range(len(models)), labels, rotation=90, fontsize=7)
    ax.xaxis.tick_top()
    ax.grid(color=LIGHT, lw=0.6)


def _draw_errors(ax: Axes, rows: Rows) -> None:
    """Draw how far a typical reading is from the model, relatively."""
    ax.set_xscale("log")
    shown = [100.0 * row["typical_error"] for row in rows if row.get("typical_error")] or [1.0]
    # Whole decades, so that at least two ticks say what they are.
    low, high = np.floor(np.log10(min(shown))), np.floor(np.log10(max(shown))) + 1.0
    ax.set_xlim(10.0**low, 10.0**high)
    marked = []
    named = set(_named(rows))
    for k, row in enumerate(rows):
        error = row.get("typical_error")
        if row.get("reason"):
            if k not in named:
                continue
            failed = _has_failed(row)
            ax.text(
                0.01,
                k,
                f"{'failed: ' * failed}{_short(row['reason'], 58)}",
                fontsize=6,
                color=ACCENT if failed else GREY,
                va="center",
                transform=ax.get_yaxis_transform(),
                clip_on=False,
            )
        elif error is not None and error > 0.0:
            marked.append((100.0 * error, k, _colour(row)))
    _mark(ax, marked, marker="o", ms=4)
    ax.xaxis.set_minor_formatter("")
    ax.xaxis.set_major_formatter(lambda value, _: f"{value:g} %")
    ax.xaxis.tick_top()
    ax.xaxis.set_label_position("top")
    ax.set_xlabel("typical error of a reading (orange: not described)", fontsize=7, color=GREY)
    ax.grid(color=LIGHT, lw=0.6)


def _draw_times(ax: Axes, rows: Rows) -> None:
    from matplotlib.collections import PolyCollection

    seconds = [row.get("seconds") or 0.0 for row in rows]
    # Bars as one thing to draw, since a patch for each is slow.
    bars = [
        [(0.0, k - 0.3), (s, k - 0.3), (s, k + 0.3), (0.0, k + 0.3)] for k, s in enumerate(seconds)
    ]
    ax.add_collection(PolyCollection(bars, facecolor="#9ecae1", edgecolor="none"), autolim=False)
    ax.set_xlim(0.0, 1.05 * max(seconds) or 1.0)
    ax.xaxis.tick_top()
    ax.xaxis.set_label_position("top")
    ax.set_xlabel("time of the fit, s", fontsize=7, color=GREY)
    ax.grid(axis="x", color=LIGHT, lw=0.6)
