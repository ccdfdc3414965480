"""Pictures of a posterior: pairs of parameters, the chain over its steps, and bands over the data."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from lobefit.fitting.bands import is_isotropic
from lobefit.fitting.figure import channel_colours
from lobefit.fitting.panels import choose_channels, choose_panels
from lobefit.fitting.pictures import new_figure, write_png

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from lobefit.fitting.posterior import Posterior

__all__ = ["draw_bands", "draw_corner", "draw_trace", "write"]

Array = NDArray[np.float64]

DPI = 130
DARK, GREY, LIGHT, ACCENT = "#1a1a1a", "#666666", "#e2e2e2", "#D55E00"
ENSEMBLES = ("#0072B2", "#E69F00", "#009E73", "#CC79A7", "#56B4E9", "#D55E00")
MOST_PAIRS = 8
MOST_TRACES = 12
BINS = 40
# Shares of the posterior inside the contours.
INSIDE = (0.5, 0.9)
DRAWS = 400
# Points of a trace; more only darken the paper.
MOST_STEPS = 1500


def write(path: Path, figure: Figure) -> None:
    """Write a picture as PNG; the same posterior gives the same bytes."""
    write_png(path, figure, DPI)


def _chosen(posterior: Posterior, most: int) -> list[int]:
    """Pick columns: those of all channels and of the first ones, the noise behind the model's."""
    model = [k for k, c in enumerate(posterior.space.coordinates) if c.parameter]
    noise = [k for k in range(posterior.space.size) if k not in model]
    order = sorted(model, key=lambda k: posterior.space.coordinates[k].channel or 0)
    order += sorted(noise, key=lambda k: posterior.space.coordinates[k].channel or 0)
    return sorted(order[:most])


def _fitted(posterior: Posterior, column: int) -> float | None:
    """Give the point fit's value of a model's parameter."""
    c = posterior.space.coordinates[column]
    if c.parameter is None or c.parameter.period:
        return None
    return c.value_in(posterior.result.params)


def _title(posterior: Posterior, left_out: int) -> str:
    state = "" if posterior.converged else " - NOT CONVERGED"
    more = f" ({left_out} more numbers were sampled)" if left_out else ""
    return f"Posterior of {posterior.result.candidate}{state}{more}"


def _plain(ax: Axes) -> None:
    ax.spines[["top", "right"]].set_visible(False)
    ax.spines[["left", "bottom"]].set(color=GREY, linewidth=0.7)
    ax.tick_params(labelsize=8, color=GREY, width=0.7)


def draw_corner(posterior: Posterior) -> Figure:
    """Draw each parameter's histogram and each pair's 50 % and 90 % regions.

    Orange lines mark the point fit, dotted lines the 5, 50 and 95 % quantiles.
    """
    columns = _chosen(posterior, MOST_PAIRS)
    n = len(columns)
    flat = posterior.theta.reshape(-1, posterior.space.size)[:, columns]
    ranges = [_range(flat[:, k]) for k in range(n)]
    size = max(1.6 * n + 0.9, 4.2)
    figure = new_figure(size, size)
    figure.suptitle(_title(posterior, posterior.space.size - n), fontsize=11, color=DARK)
    axes = figure.subplots(n, n, squeeze=False)
    labels = [posterior.labels[k] for k in columns]
    points = [_fitted(posterior, k) for k in columns]
    for i in range(n):
        for j in range(n):
            ax = axes[i, j]
            if j > i:
                ax.set_axis_off()
                continue
            _plain(ax)
            _ticks(ax, x=True, y=j < i)
            ax.set_xlim(ranges[j])
            if i == j:
                ax.hist(flat[:, i], bins=BINS, range=ranges[i], color="#9bb8d3")
                for q in np.quantile(flat[:, i], [0.05, 0.5, 0.95]):
                    ax.axvline(q, color=DARK, linewidth=0.8, linestyle=":")
                ax.set_yticks([])
                ax.spines["left"].set_visible(False)
                ax.set_title(_interval(flat[:, i]), fontsize=8, color=DARK)
            else:
                ax.set_ylim(ranges[i])
                _regions(ax, flat[:, j], flat[:, i], ranges[j], ranges[i])
                if points[i] is not None:
                    ax.axhline(points[i], color=ACCENT, linewidth=0.8)
            if points[j] is not None:
                ax.axvline(points[j], color=ACCENT, linewidth=0.8)
            if i == n - 1:
                ax.set_xlabel(labels[j], fontsize=9)
            else:
                ax.tick_params(labelbottom=False)
            if j == 0 and i > 0:
                ax.set_ylabel(labels[i], fontsize=9)
            elif j > 0:
                ax.tick_params(labelleft=False)
    figure.align_labels()
    return figure


def _ticks(ax: Axes, *, x: bool, y: bool) -> None:
    from matplotlib.ticker import MaxNLocator

    if x:
        ax.xaxis.set_major_locator(MaxNLocator(3, prune="both"))
        ax.tick_params(axis="x", labelrotation=40)
    if y:
        ax.yaxis.set_major_locator(MaxNLocator(3, prune="both"))


def _range(x: Array) -> tuple[float, float]:
    low, high = (float(v) for v in np.quantile(x, [0.001, 0.999]))
    margin = 0.05 * (high - low) or 1e-9 * max(abs(low), 1e-9)
    return low - margin, high + margin


def _interval(x: Array) -> str:
    low, middle, high = np.quantile(x, [0.05, 0.5, 0.95])
    digits = 1 - int(f"{max(high - low, 1e-300):.0e}".partition("e")[2])
    if not 0 <= digits <= 6:
        return f"{middle:.3g} ({low:.3g}, {high:.3g})"
    return f"{middle:.{digits}f} ({low:.{digits}f}, {high:.{digits}f})"


def _regions(
    ax: Axes, x: Array, y: Array, x_range: tuple[float, float], y_range: tuple[float, float]
) -> None:
    """Shade the smallest regions that hold the stated shares."""
    counts, x_edges, y_edges = np.histogram2d(x, y, bins=BINS, range=[x_range, y_range])
    smooth = np.array([1.0, 2.0, 1.0]) / 4.0
    for axis in (0, 1):
        counts = np.apply_along_axis(np.convolve, axis, counts, smooth, mode="same")
    ordered = np.sort(counts.ravel())[::-1]
    share = np.cumsum(ordered) / max(ordered.sum(), 1.0)
    levels = sorted({float(ordered[np.searchsorted(share, s)]) for s in INSIDE})
    if len(levels) < len(INSIDE) or levels[-1] >= counts.max():
        ax.plot(x[::97], y[::97], ",", color=GREY)
        return
    centres = [0.5 * (e[1:] + e[:-1]) for e in (x_edges, y_edges)]
    ax.contourf(
        *centres, counts.T, levels=[*levels, float(counts.max())], colors=["#c9d9e8", "#5d8ab5"]
    )


def draw_trace(posterior: Posterior) -> Figure:
    """Draw each parameter over the steps and its density, a colour for each ensemble."""
    columns = _chosen(posterior, MOST_TRACES)
    n = len(columns)
    steps, ensembles, walkers, _ = posterior.chain.shape
    stride = max(1, steps // MOST_STEPS)
    figure = new_figure(9.0, max(1.15 * n + 0.9, 3.0))
    figure.suptitle(_title(posterior, posterior.space.size - n), fontsize=11, color=DARK)
    axes = figure.subplots(n, 2, squeeze=False, width_ratios=[4, 1])
    at = np.arange(steps)[::stride]
    for row, k in enumerate(columns):
        trace, side = axes[row]
        limits = _range(posterior.theta[..., k].ravel())
        for e in range(ensembles):
            colour = ENSEMBLES[e % len(ENSEMBLES)]
            x = posterior.theta[::stride, e, :, k]
            for w in range(0, walkers, max(1, walkers // 4)):
                trace.plot(at, x[:, w], color=colour, linewidth=0.4, alpha=0.55)
            density, edges = np.histogram(x, bins=BINS, range=limits, density=True)
            side.stairs(density, edges, orientation="horizontal", color=colour, linewidth=1.0)
        for ax in (trace, side):
            _plain(ax)
            ax.set_ylim(limits)
            _ticks(ax, x=False, y=True)
        side.tick_params(labelleft=False)
        side.set_xticks([])
        trace.set_ylabel(posterior.labels[k], fontsize=9)
        label = posterior.labels[k]
        note = f"τ {posterior.tau[label]:.1f}, R-hat {posterior.summary()[label].r_hat:.4f}"
        side.set_title(note, fontsize=7.5, color=GREY)
        if row < n - 1:
            trace.tick_params(labelbottom=False)
    axes[-1, 0].set_xlabel(
        f"step after the warm-up of {posterior.warm_up} "
        f"(4 walkers of each of {ensembles} ensembles)",
        fontsize=9,
    )
    figure.align_ylabels(axes[:, 0])
    return figure


def draw_bands(posterior: Posterior) -> Figure:
    """Draw what was measured, and where 90 % of the model and of new readings would lie."""
    m = posterior.measurement
    panels = choose_panels(m, isotropic=is_isotropic(posterior.result))
    count = len(panels.chosen)
    columns = min(count, 4)
    rows = -(-count // columns)
    figure = new_figure(max(2.9 * columns + 0.6, 5.0), 2.7 * rows + 1.3)
    axes = np.atleast_1d(np.array(figure.subplots(rows, columns, squeeze=False))).ravel()
    shown = choose_channels(m.n_channels)
    colours = channel_colours(m.channels)
    log = m.decades >= 1.5
    # The line of every panel behind one another: one evaluation a draw.
    line = tuple(np.concatenate([p.line[a] for p in panels.chosen]) for a in range(4))
    values = posterior.predict(*line, draws=DRAWS)
    noisy = _readings(posterior, values)
    ends = np.cumsum([len(p.line_angle) for p in panels.chosen])
    symbol, running = ("o", "i") if panels.by_view else ("i", "o")
    top, bottom = [], []
    for panel, ax, end in zip(panels.chosen, axes, ends, strict=False):
        part = slice(end - len(panel.line_angle), end)
        _plain(ax)
        ax.grid(color=LIGHT, linewidth=0.5)
        ax.set_title(rf"$\theta_{symbol}$ = {panel.theta:.4g}°", fontsize=9, color=DARK)
        ax.axvline(panel.theta, color=GREY, linewidth=0.8, linestyle=":")
        reach = (panel.angle.min(initial=0.0), panel.angle.max(initial=0.0))
        seen = (panel.line_angle >= reach[0]) & (panel.line_angle <= reach[1])
        for c in shown:
            colour = colours[c]
            for band, alpha in ((noisy, 0.18), (values, 0.5)):
                if band is None:
                    continue
                low, high = np.quantile(band[:, c, part], [0.05, 0.95], axis=0)
                ax.fill_between(panel.line_angle, low, high, color=colour, alpha=alpha, linewidth=0)
                if seen.any():
                    top.append(float(high[seen].max()))
                    bottom.append(float(np.median(low[seen])))
            ax.plot(
                panel.angle, m.values[c, panel.rows], ".", color=colour, markersize=3.0, alpha=0.7
            )
        if log:
            ax.set_yscale("log")
        ax.set_xlabel(rf"signed $\theta_{running}$ [°]", fontsize=8)
    measured = m.values[shown][:, np.concatenate([p.rows for p in panels.chosen])]
    _limits(axes[:count], measured, max(top, default=1.0), log=log)
    for ax in axes[count:]:
        ax.set_axis_off()
    for ax in axes[:count:columns]:
        ax.set_ylabel("BRDF [1/sr]", fontsize=8)
    _legend(figure, [(m.channels[c], colours[c]) for c in shown], noise=noisy is not None)
    figure.suptitle(_title(posterior, 0), fontsize=11, color=DARK)
    return figure


def _readings(posterior: Posterior, values: Array) -> Array | None:
    """Give readings with noise at model values, where the noise was sampled."""
    if posterior.space.noise != "fit":
        return None
    sigma = posterior.noise_of(posterior.draws(len(values)), values)
    rng = np.random.default_rng(posterior.seed)
    z = rng.standard_normal(values.shape)
    if posterior.space.student:
        nu = posterior.draws(len(values))[:, posterior.labels.index("nu")]
        z /= np.sqrt(rng.chisquare(nu[:, None, None], z.shape) / nu[:, None, None])
    noisy: Array = values + sigma * z
    return noisy


def _limits(axes: Any, measured: Array, top: float, *, log: bool) -> None:
    present = measured[np.isfinite(measured)]
    top = max(top, float(present.max(initial=0.0)))
    if log:
        positive = present[present > 0.0]
        low = float(np.quantile(positive, 0.005)) / 2.0 if positive.size else top / 1e4
        limits = (low, 2.0 * top)
    else:
        limits = (min(0.0, 1.1 * float(np.quantile(present, 0.002))), 1.05 * top)
    for ax in axes:
        ax.set_ylim(limits)


def _legend(figure: Figure, channels: list[tuple[str, str]], *, noise: bool) -> None:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    entries: list[Any] = [
        Line2D([], [], color=GREY, marker=".", linestyle="none", label="measured"),
        Patch(color=GREY, alpha=0.5, label="model, 90 %"),
    ]
    if noise:
        entries.append(Patch(color=GREY, alpha=0.18, label="new readings, 90 %"))
    if len(channels) > 1:
        entries += [Line2D([], [], color=c, linewidth=3, label=name) for name, c in channels]
    figure.legend(
        handles=entries, loc="outside lower center", frameon=False, fontsize=8, ncols=len(entries)
    )
