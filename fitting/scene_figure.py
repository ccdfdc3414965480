"""The answer to a scene in pictures: reference, chosen, next cheaper, and where they differ."""

from __future__ import annotations

import textwrap
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from lobefit.fitting.pictures import new_figure, write_png
from lobefit.fitting.scene import Decision, Shown
from lobefit.fitting.scene_answer import Combination
from lobefit.fitting.scene_colour import MEASURES, encoded
from lobefit.fitting.scene_file import Tolerance
from lobefit.fitting.scene_texts import next_one, seconds_text

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure

__all__ = ["draw_decision", "tone_mapped", "write_decision"]

Array = NDArray[np.float64]

DPI = 130
MARKS = {"flat": "s", "gouraud": "^", "phong": "o"}
NAMES = {"flat": "flat", "gouraud": "Gouraud", "phong": "Phong"}
ACCENT, GREY, LIGHT, DARK = "#D55E00", "#666666", "#dddddd", "#1a1a1a"


def tone_mapped(decision: Decision, radiance: Any) -> Array:
    """Give what a screen gets of radiance (C, H, W), shape (H, W, 3).

    R, G and B become sRGB; other channels a grey of their mean, the reference's largest white.
    """
    if decision.request.tolerance.measure == "delta_e":
        return encoded(radiance, decision.factor)
    mean = np.asarray(radiance, dtype=np.float64).mean(axis=0)
    white = max(float(decision.reference.picture.mean(axis=0).max()), 1e-300)
    return np.repeat(np.clip(mean / white, 0.0, 1.0)[..., None], 3, axis=-1)


def write_decision(path: Path, decision: Decision) -> None:
    """Draw the answer and write it as PNG."""
    write_png(path, draw_decision(decision), DPI)


def draw_decision(decision: Decision) -> Figure:
    """Draw the pictures side by side over the maps of their errors.

    Parameters
    ----------
    decision : Decision
        From `lobefit.fitting.scene.decide`.

    Returns
    -------
    matplotlib.figure.Figure
        With its own Agg canvas; no global state of matplotlib is touched.
    """
    camera = decision.request.camera
    shown = [
        (title, c, s)
        for title, c, s in (
            ("chosen", decision.answer.chosen, decision.chosen),
            (
                next_one(decision.answer),
                decision.answer.cheaper,
                decision.cheaper,
            ),
        )
        if c is not None and s is not None
    ]
    head = textwrap.wrap(decision.sentence, 48 * (1 + len(shown)) + 16)
    top = 0.2 + 0.19 * len(head)
    panel = min(max(3.6 * camera.height / camera.width, 2.2), 5.0)
    width = 3.9 * (1 + len(shown)) + 0.6
    figure = new_figure(width, top + 2 * panel + 0.9)
    parts = figure.add_gridspec(2, 1, height_ratios=[top, 2 * panel + 0.9])
    words, body = figure.add_subfigure(parts[0]), figure.add_subfigure(parts[1])
    for k, line in enumerate(head):
        words.text(0.01, 1 - (0.18 + 0.19 * k) / top, line, va="center", fontsize=9.5, color=DARK)
    _draw_body(body, decision, shown)
    return figure


def _draw_body(
    body: SubFigure, decision: Decision, shown: list[tuple[str, Combination, Shown]]
) -> None:
    measure = MEASURES[decision.request.tolerance.measure]
    axes = body.subplots(2, 1 + len(shown), squeeze=False)
    reference = decision.reference
    what = "measured data" if reference.kind == "data" else reference.model
    _picture(axes[0, 0], tone_mapped(decision, reference.picture), f"reference: {what}")
    _costs(axes[1, 0], decision)
    limit = decision.answer.tolerance.p99
    # Not the largest: a pixel of the outline may be off by any amount.
    highest = max(limit, 1e-6, *(c.errors.p99 for _, c, _ in shown))
    for k, (title, c, s) in enumerate(shown, start=1):
        picture = tone_mapped(decision, s.rendering.beauty)
        level = f" at level {c.level}" if len(decision.request.levels) > 1 else ""
        _picture(axes[0, k], picture, f"{title}: {c.model.name}, {NAMES[c.shading]}{level}")
        _picture(
            axes[1, k],
            s.differences,
            f"mean {c.errors.mean:.3g}, 99 % {c.errors.p99:.3g}, {seconds_text(c.cost.fastest)}",
            vmin=0.0,
            vmax=highest,
            cmap="magma",
        )
    if shown:
        bar = body.colorbar(axes[1, -1].images[0], ax=list(axes[1, 1:]), extend="max", pad=0.02)
        bar.set_label(f"{measure} of each pixel", fontsize=8)
        bar.ax.tick_params(labelsize=8)
        if limit < 0.95 * highest:
            bar.ax.axhline(limit, color="white", linewidth=1.0)


def _picture(ax: Axes, image: Array, title: str, **style: Any) -> None:
    ax.imshow(image, interpolation="nearest", **style)
    ax.set_title(textwrap.fill(title, 46), fontsize=9)
    ax.set_xticks([])
    ax.set_yticks([])


def _height(c: Combination, tolerance: Tolerance) -> float:
    return max(c.excess(tolerance), 1e-4)


def _costs(ax: Axes, decision: Decision) -> None:
    """Draw the error of every combination over its cost."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    tolerance = decision.answer.tolerance
    for shading, mark in MARKS.items():
        some = [c for c in decision.combinations if c.shading == shading]
        if not some:
            continue
        x = np.array([1e3 * c.cost.fastest for c in some])
        y = [_height(c, tolerance) for c in some]
        slow = 1e3 * np.array([c.cost.quartiles[1] for c in some]) - x
        ax.errorbar(x, y, xerr=[0.0 * x, slow], fmt="none", ecolor=LIGHT, elinewidth=1.0, zorder=1)
        ax.scatter(x, y, 18, marker=mark, color=GREY, label=NAMES[shading], zorder=2)
    found = decision.answer
    names = ("chosen", next_one(found))
    for c, name, face in zip((found.chosen, found.cheaper), names, (ACCENT, "none"), strict=True):
        if c is not None:
            at, mark = (1e3 * c.cost.fastest, _height(c, tolerance)), MARKS[c.shading]
            ax.scatter(*at, 60, marker=mark, facecolor=face, edgecolor=ACCENT, label=name, zorder=3)
    ax.axhline(1.0, color=ACCENT, linewidth=0.9, linestyle="--")
    ax.set_xscale("log")
    ax.set_yscale("log")
    ax.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    ax.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    ax.xaxis.set_minor_formatter(NullFormatter())
    ax.set_xlabel("ms a frame: fastest round, line to the upper quartile", fontsize=8)
    ax.set_ylabel("error / tolerance", fontsize=8)
    ax.tick_params(labelsize=8, which="both")
    ax.grid(color=LIGHT, linewidth=0.5)
    ax.legend(fontsize=7, loc="best", framealpha=0.85)
    ax.set_title(f"all {len(decision.combinations)} combinations", fontsize=9)
