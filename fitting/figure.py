"""The picture of a fit: measured points against fitted lobes, and where they differ.

One panel per incidence (where the lamp moves, per view; where incidences are scattered, per band
of theta_i, with the lobes drawn at its middle), at most eight: the BRDF in the plane of incidence over the signed angle, positive on the side of the mirror direction, which a
dotted line marks. Below it what the model leaves over: in the plane a strip over the same
angle, out of the plane a map of the hemisphere with the mirror direction to the right.
"""

from __future__ import annotations

import re
import textwrap
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from lobefit.fitting.bands import is_isotropic
from lobefit.fitting.panels import Panel, Panels, Residuals, choose_channels, choose_panels
from lobefit.fitting.pictures import new_figure, write_png
from lobefit.fitting.report import FitReport
from lobefit.fitting.result import FitResult
from lobefit.fitting.tables import HELD, flags, with_error
from lobefit.kernels import get_model

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure

__all__ = ["channel_colours", "draw_figure", "write_figure"]

Array = NDArray[np.float64]

DPI = 150
DARK, GREY, LIGHT = "#1a1a1a", "#666666", "#e2e2e2"
ACCENT = "#D55E00"
# Okabe and Ito's palette, told apart with any colour vision; its vermilion, green and blue
# stand for red, green and blue.
RGB = {"r": "#D55E00", "red": "#D55E00", "g": "#009E73", "green": "#009E73"}
RGB |= {"b": "#0072B2", "blue": "#0072B2"}
OTHERS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
WAVELENGTH = re.compile(r"^\D*(\d+(?:[.,]\d+)?)\s*(?:nm|um|µm)?$")


def write_figure(path: Path, report: FitReport) -> None:
    """Draw the best result and write it as PNG; the same report gives the same bytes."""
    write_png(path, draw_figure(report), DPI)


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
    panels = choose_panels(report.measurement, isotropic=is_isotropic(report.best))
    count = len(panels.chosen)
    blocks = 1 if count <= 4 else 2
    columns = -(-count // blocks)
    lower = 1.0 if panels.in_plane else 1.9
    width = max(2.7 * columns + 1.7, 6.4)
    head = _headline(report, panels, width)
    foot = 0.5 if panels.in_plane else 0.8
    heights = [0.3 + 0.2 * len(head), (2.3 + lower) * blocks + foot]
    figure = new_figure(width, sum(heights))
    parts = figure.add_gridspec(2, 1, height_ratios=heights)
    top, body = figure.add_subfigure(parts[0]), figure.add_subfigure(parts[1])
    for k, (text, style) in enumerate(head):
        top.text(0.012, 1 - (0.28 + 0.2 * k) / heights[0], text, va="center", **style)
    _draw_body(body, report, panels, columns, blocks, lower)
    return figure


def channel_colours(channels: tuple[str, ...]) -> list[str]:
    """Give a colour for each channel.

    Red, green and blue for channels of those names, a perceptual map from dark to light for
    wavelengths, dark for a single channel, else a palette for any colour vision.
    """
    if len(channels) == 1:
        return [DARK]
    if all(name.casefold() in RGB for name in channels):
        return [RGB[name.casefold()] for name in channels]
    found = [WAVELENGTH.match(name) for name in channels]
    if all(found) or len(channels) > len(OTHERS):
        from matplotlib import colormaps
        from matplotlib.colors import to_hex

        waves = np.array([float(f[1].replace(",", ".")) if f else k for k, f in enumerate(found)])
        if not all(found) or np.ptp(waves) == 0:
            waves = np.arange(len(channels), dtype=float)
        # The light end of the map is hard to see on white.
        share = 0.85 * (waves - waves.min()) / np.ptp(waves)
        return [to_hex(colour) for colour in colormaps["plasma"](share)]
    return list(OTHERS[: len(channels)])


def _draw_body(
    body: SubFigure, report: FitReport, panels: Panels, columns: int, blocks: int, lower: float
) -> None:
    from matplotlib.ticker import MaxNLocator

    m, best = report.measurement, report.best
    residuals = Residuals(m, best)
    shown = choose_channels(m.n_channels)
    colours = channel_colours(m.channels)
    left = [residuals.at(p.rows if panels.in_plane else p.hemisphere)[shown] for p in panels.chosen]
    limit = residuals.limit(np.concatenate([part.ravel() for part in left]))
    one_sided = all(p.angle.min(initial=90.0) > -5.0 for p in panels.chosen)
    lobes = [residuals.fitted(p.line)[shown] for p in panels.chosen]
    span = _value_span(panels, m.values[shown], lobes, residuals.log)
    several = len({round(p.phi, 3) for p in panels.chosen}) > 1
    symbol = "o" if panels.by_view else "i"
    running = r"$\theta_i$" if panels.by_view else r"$\theta_o$"

    grid = body.add_gridspec(2 * blocks, columns, height_ratios=[2.3, lower] * blocks)
    mapped: Any = None
    for k, panel in enumerate(panels.chosen):
        block, column = divmod(k, columns)
        ax = body.add_subplot(grid[2 * block, column])
        _clean(ax)
        title = rf"$\theta_{symbol}$ = {_angle_text(panel)}"
        if several:
            title += rf", $\varphi_{symbol}$ = {_degrees(panel.phi)}"
        ax.set_title(title, fontsize=9, color=DARK)
        _draw_lobes(ax, panel, m.values[shown], lobes[k], [colours[c] for c in shown])
        if m.sigma is not None:
            _draw_bars(ax, panel, m.values[shown], m.sigma[shown], [colours[c] for c in shown])
        if residuals.log:
            ax.set_yscale("log")
        ax.set_ylim(span)
        ax.set_xlim(-4 if one_sided else -92, 92)
        ax.set_xticks([0, 30, 60, 90] if one_sided else [-60, -30, 0, 30, 60])
        if panels.in_plane:
            below = body.add_subplot(grid[2 * block + 1, column], sharex=ax)
            _clean(below)
            _draw_strip(below, panel, left[k], limit, [colours[c] for c in shown])
            ax.tick_params(labelbottom=False)
            if column == 0:
                below.set_ylabel(residuals.label, fontsize=8)
            else:
                below.tick_params(labelleft=False)
        else:
            below = body.add_subplot(grid[2 * block + 1, column], projection="polar")
            mapped = _draw_map(below, panel, left[k], limit)
        if not panels.in_plane or k + columns >= len(panels.chosen):
            (below if panels.in_plane else ax).set_xlabel(f"signed {running} [°]", fontsize=8)
        if column == 0:
            ax.set_ylabel("BRDF [1/sr]", fontsize=8)
        else:
            ax.tick_params(labelleft=False)
    body.align_ylabels()
    if mapped is not None:
        bar = body.colorbar(
            mapped, ax=body.axes, location="bottom", shrink=0.45, aspect=40, extend="both"
        )
        bar.locator = MaxNLocator(5, symmetric=True)
        mean = "" if len(shown) == 1 else ", mean of the channels shown"
        bar.set_label(residuals.label + mean, fontsize=8)
        bar.outline.set_visible(False)
        bar.ax.tick_params(labelsize=7)
    names = [m.channels[c] for c in shown]
    _legend(body, names, [colours[c] for c in shown], maps=not panels.in_plane)


def _draw_lobes(ax: Axes, panel: Panel, values: Array, lobes: Array, colours: list[str]) -> None:
    ax.axvline(panel.theta, color=GREY, linewidth=0.8, linestyle=":", zorder=1)
    for channel, lobe, colour in zip(values, lobes, colours, strict=True):
        single = len(colours) == 1
        ax.plot(
            panel.angle,
            channel[panel.rows],
            linestyle="none",
            marker="o",
            markersize=3.6,
            markerfacecolor=colour,
            markeredgecolor="none",
            alpha=0.45,
            zorder=2,
        )
        ax.plot(panel.line_angle, lobe, color=ACCENT if single else colour, linewidth=1.1, zorder=3)


def _draw_bars(ax: Axes, panel: Panel, values: Array, sigma: Array, colours: list[str]) -> None:
    for channel, error, colour in zip(values, sigma, colours, strict=True):
        ax.errorbar(
            panel.angle,
            channel[panel.rows],
            error[panel.rows],
            fmt="none",
            ecolor=colour,
            elinewidth=0.6,
            alpha=0.45,
            zorder=1,
        )


def _draw_strip(ax: Axes, panel: Panel, left: Array, limit: float, colours: list[str]) -> None:
    ax.axhline(0.0, color=ACCENT if len(colours) == 1 else GREY, linewidth=0.9, zorder=1)
    ax.axvline(panel.theta, color=GREY, linewidth=0.8, linestyle=":", zorder=1)
    for residual, colour in zip(left, colours, strict=True):
        outside = np.abs(residual) > limit
        style: dict[str, Any] = {"linestyle": "none", "markeredgecolor": "none", "zorder": 2}
        inside = np.where(outside, np.nan, residual)
        ax.plot(panel.angle, inside, ".", color=colour, markersize=3.5, alpha=0.6, **style)
        for sign, marker in ((1, "^"), (-1, "v")):
            beyond = outside & (np.sign(residual) == sign)
            edge = np.full(int(beyond.sum()), 0.93 * sign * limit)
            ax.plot(panel.angle[beyond], edge, marker, color=colour, markersize=3.5, **style)
    ax.set_ylim(-limit, limit)


def _draw_map(ax: Any, panel: Panel, left: Array, limit: float) -> Any:
    present = ~np.isnan(left).all(axis=0)
    mean = np.nanmean(left[:, present], axis=0)
    ax.set_axisbelow(True)
    ax.grid(color=LIGHT, linewidth=0.5)
    mapped = ax.scatter(
        panel.turn[present],
        panel.tilt[present],
        c=mean,
        s=float(np.clip(9000.0 / max(len(mean), 1), 1.0, 14.0)),
        cmap="RdBu_r",
        vmin=-limit,
        vmax=limit,
        linewidths=0,
        zorder=2,
    )
    ax.plot(0.0, panel.theta, "o", markersize=6, markerfacecolor="none", color=DARK, zorder=3)
    ax.set_ylim(0, 90)
    ax.set_yticks([30, 60, 90], ["", "", ""])
    ax.set_xticks(np.deg2rad([0, 90, 180, 270]), ["", "", "", ""])
    halo: dict[str, Any] = {"facecolor": "white", "edgecolor": "none", "alpha": 0.7, "pad": 0.5}
    for ring in (30, 60):
        ax.text(np.pi / 2, ring, f"{ring}°", fontsize=6, color=GREY, ha="center", bbox=halo)
    ax.spines["polar"].set(color=GREY, linewidth=0.6)
    return mapped


def _clean(ax: Axes) -> None:
    ax.spines[["top", "right"]].set_visible(False)
    ax.spines[["left", "bottom"]].set(color=GREY, linewidth=0.7)
    ax.grid(color=LIGHT, linewidth=0.5)
    ax.set_axisbelow(True)
    ax.tick_params(labelsize=8, color=GREY, width=0.7)


def _value_span(
    panels: Panels, values: Array, lobes: list[Array], log: bool
) -> tuple[float, float]:
    """Give the limits of the BRDF axis: all points but stray low ones, and the lobes' tops."""
    rows = np.concatenate([p.rows for p in panels.chosen])
    measured = values[:, rows]
    measured = measured[~np.isnan(measured)]
    tops = []
    for p, lobe in zip(panels.chosen, lobes, strict=True):
        first, last = (p.angle.min(), p.angle.max()) if p.angle.size else (-90.0, 90.0)
        tops.append(lobe[:, (p.line_angle >= first) & (p.line_angle <= last)].max(initial=0.0))
    top = max(float(measured.max(initial=0.0)), *map(float, tops)) or 1.0
    if not log:
        low = float(np.quantile(measured, 0.002)) if measured.size else 0.0
        return min(1.1 * low, 0.0), 1.05 * top
    positive = measured[measured > 0]
    low = float(np.quantile(positive, 0.005)) if positive.size else top / 1e3
    return low / 2.0, 2.0 * top


def _legend(body: SubFigure, channels: list[str], colours: list[str], *, maps: bool) -> None:
    from matplotlib.lines import Line2D

    single = len(channels) == 1
    dot: dict[str, Any] = {"linestyle": "none", "marker": "o", "markersize": 4}
    entries = [
        Line2D([], [], color=DARK if single else GREY, label="measured", **dot),
        Line2D([], [], color=ACCENT if single else GREY, linewidth=1.5, label="fitted"),
        Line2D([], [], color=GREY, linewidth=0.8, linestyle=":", label="mirror direction"),
    ]
    if maps:
        ring: dict[str, Any] = {"linestyle": "none", "marker": "o", "markersize": 5}
        entries.append(
            Line2D(
                [], [], color=DARK, markerfacecolor="none", label="mirror direction (maps)", **ring
            )
        )
    if not single:
        entries += [
            Line2D([], [], color=colour, linewidth=3, label=name)
            for name, colour in zip(channels, colours, strict=True)
        ]
    body.legend(handles=entries, loc="outside right upper", frameon=False, fontsize=8)


def _headline(report: FitReport, panels: Panels, width: float) -> list[tuple[str, dict[str, Any]]]:
    """Give the lines above the picture with their style."""
    m, best = report.measurement, report.best
    name = m.metadata.get("material") or m.source or "measurement"
    plain: dict[str, Any] = {"fontsize": 8.5, "color": DARK}
    quiet: dict[str, Any] = {"fontsize": 7.5, "color": GREY}
    columns = int(width * 15)
    head = [(_shorten(name, int(width * 9)), {"fontsize": 12, "color": DARK, "weight": "bold"})]
    title = f"{best.candidate}: {get_model(best.model).title}"
    if not report.described:
        title = f"No candidate describes this surface; the nearest is {title}"
    head.append((_shorten(title, columns), plain))
    wrapped = textwrap.wrap("   ".join(_parameter_texts(best)), columns, break_on_hyphens=False)
    head += [(line, plain) for line in wrapped[:3]]
    said = [f"rmse {best.rmse:.3g} 1/sr"]
    if best.diagnostics.log10_rms is not None:
        said.append(f"rms of log10 {best.diagnostics.log10_rms:.3f}")
    said.append(f"albedo up to {max(best.plausibility.albedo_max):.3f}")
    said += flags(best)
    head.append((_shorten("; ".join(said), int(columns * 1.1)), quiet))
    if panels.width is not None:
        pooled = f"scattered incidences pooled in bands of {panels.width:g}°, turned to one azimuth"
        head.append((f"{pooled}; fitted lobes at the bands' middles", quiet))
    notes = _notes(report, panels)
    if notes:
        head.append((_shorten("; ".join(notes), int(columns * 1.1)), quiet))
    return head


def _notes(report: FitReport, panels: Panels) -> list[str]:
    """Say what the picture leaves out."""
    m, notes = report.measurement, []
    kind = "views" if panels.by_view else "incidences"
    if panels.width is not None:
        kind = "bands"
    if len(panels.chosen) < panels.total:
        notes.append(f"{len(panels.chosen)} of {panels.total} {kind} shown")
    shown = choose_channels(m.n_channels)
    if len(shown) < m.n_channels:
        notes.append(f"{len(shown)} of {m.n_channels} channels shown")
    if not panels.in_plane:
        closer = "" if panels.width is None else ", less near the mirror direction"
        notes.append(f"lobes: views within {panels.tolerance:g}° of the plane of incidence{closer}")
    if Residuals(m, report.best).log and m.positive_share < 1:
        notes.append(f"{100 * (1 - m.positive_share):.2g} % of the values are not positive")
    return notes


def _parameter_texts(result: FitResult) -> list[str]:
    """Write each parameter in a few words; of many channels the range."""
    texts = []
    for name in dict.fromkeys(e.name for e in result.estimates):
        own = [e for e in result.estimates if e.name == name]
        unit = "" if own[0].unit == "1" else f" {own[0].unit}"
        if len(own) == 1:
            value = with_error(own[0].value, own[0].standard_error) + HELD.get(own[0].status, "")
        elif len({e.value for e in own}) == 1:
            value = f"{own[0].value:.4g}"
        elif len(own) <= 3:
            value = ", ".join(
                "–" if e.status == "undetermined" else with_error(e.value, e.standard_error)
                for e in own
            )
        else:
            numbers = [e.value for e in own]
            value = f"{min(numbers):.3g} to {max(numbers):.3g}"
        texts.append(f"{name} = {value}{unit}".replace(" ", "\u00a0"))
    return texts


def _angle_text(panel: Panel) -> str:
    if panel.band is None:
        return _degrees(panel.theta)
    return "–".join(f"{edge:g}" for edge in panel.band) + "°"


def _degrees(angle: float) -> str:
    return f"{angle:.4g}°"


def _shorten(text: str, width: int) -> str:
    return text if len(text) <= width else text[: width - 1].rstrip() + "…"
