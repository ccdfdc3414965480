"""Negative values: noise about zero after the dark level, or too much of it subtracted."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from lobefit.fitting.checks.finding import DataCheck
from lobefit.fitting.checks.view import View

__all__ = ["check_negative"]

# Less than this share is not worth a word.
FEW = 0.01
# Noise about zero makes as many positive values of the same size; half as many is no noise.
SYMMETRIC = 0.5
# From this share on most of a channel says nothing.
MANY = 0.3
# Negative values this many times their scatter along a scan are an offset.
SMOOTH = 3.0


def check_negative(view: View) -> DataCheck:
    """Count negative values, and positive ones of the same size."""
    m = view.m
    present = np.maximum((~np.isnan(m.values)).sum(axis=1), 1)
    shares = (m.values < 0.0).sum(axis=1) / present
    worst = int(np.argmax(shares))
    share, channel = float(shares[worst]), m.channels[worst]
    figures: dict[str, Any] = {
        "share": m.negative_share,
        "worst_share": share,
        "channel": channel if m.n_channels > 1 else None,
    }
    answer = partial(DataCheck, name="negative values", figures=figures)
    if share == 0.0:
        return answer(verdict="ok", sentence="No value is negative.")
    values = m.values[worst]
    size = -values[values < 0.0]
    limit = float(np.quantile(size, 0.9))
    alike = int(np.count_nonzero((values > 0.0) & (values <= limit)))
    figures["positive_of_that_size"] = alike / size.size
    figures["median_size"] = float(np.median(size))
    of = f" of {channel}" if m.n_channels > 1 else ""
    said = f"{100.0 * share:.2g} % of the values{of} are negative"
    smooth = _smoothness(view, worst)
    figures["size_over_scatter"] = smooth
    if share > FEW and smooth is not None and smooth > SMOOTH:
        return answer(
            verdict="suspicious",
            sentence=f"{said}, and scatter less than their size ({smooth:.2g} times): they are "
            "no noise.",
            remedy="too much dark level was subtracted (correct it), or the colour is one that RGB "
            "cannot hold (use the spectral values)",
        )
    if share > FEW and alike < SYMMETRIC * size.size:
        return answer(
            verdict="suspicious",
            sentence=f"{said}, and only {alike} positive ones of their size balance {size.size}.",
            remedy="too much dark level was subtracted, or negative numbers mark missing values: "
            "correct it, or write nan",
        )
    if share > MANY:
        return answer(
            verdict="suspicious",
            sentence=f"{said}: much of it is noise about zero.",
            remedy="average longer, or leave dark directions out; use a metric other than log",
        )
    return answer(verdict="ok", sentence=f"{said}, as many as noise about zero makes; they stay.")


def _smoothness(view: View, channel: int) -> float | None:
    """Give the median of negative values over their scatter; None where scans have too few."""
    sizes, scatters = [], []
    for scan in view.scans:
        values = view.m.values[channel, scan.rows]
        off = values[1:-1] - 0.5 * (values[:-2] + values[2:])
        there = (values[1:-1] < 0.0) & np.isfinite(off)
        sizes.append(-values[1:-1][there])
        scatters.append(np.abs(off[there]) / 1.5**0.5)
    if sum(map(len, sizes)) < 10:
        return None
    scatter = 1.4826 * float(np.median(np.concatenate(scatters)))
    size = float(np.median(np.concatenate(sizes)))
    return size / max(scatter, 1e-6 * size)
