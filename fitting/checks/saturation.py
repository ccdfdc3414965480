"""Saturation: a detector at its limit gives one value for many directions."""

from __future__ import annotations

from functools import partial

import numpy as np
from numpy.typing import NDArray

from lobefit.fitting.checks.finding import DataCheck
from lobefit.fitting.checks.view import View, plural, steps

__all__ = ["check_saturation"]

# Values are written to six digits.
EQUAL = 1e-5
LEAST = 3
# Some lobes are equally high at all mirror directions (rad).
EXACT = 1e-3
# Ties below the top, where values were rounded, are this many times rarer.
RARER = 3.0
# A larger share of equal values is a constant, not a limit.
CONSTANT = 0.5


def check_saturation(view: View) -> DataCheck:
    """Look for a plateau of equal values at the top, of f or of f cos(theta_o).

    A radiance limit shows at each incidence by itself, since its irradiance differs.
    """
    m = view.m
    cosine = np.cos(m.theta_o)
    everything = np.arange(m.n_directions)
    worst: tuple[int, float, str, str] = (0, 0.0, "", "")
    total = 0
    for channel, values in zip(m.channels, m.values, strict=True):
        for what, rows in (("all directions", everything), *_by_incidence(view)):
            for factor in (1.0, cosine[rows]):
                count, top = _plateau(view, rows, values[rows], values[rows] * factor)
                total += count
                if count > worst[0]:
                    worst = (count, top, channel, what)
    answer = partial(
        DataCheck,
        name="saturation",
        figures={"plateau": worst[0], "value": worst[1] if worst[0] else None},
    )
    if not total:
        return answer(verdict="ok", sentence="No plateau of equal largest values.")
    count, top, channel, what = worst
    of = f" of {channel}" if m.n_channels > 1 else ""
    return answer(
        verdict="suspicious",
        sentence=f"{plural(count, 'direction')}{of} ({what}) share the largest value, {top:.4g} "
        "1/sr, as a detector at its limit gives.",
        remedy="the peak is higher than measured: leave these directions out, or repeat them with "
        "a shorter exposure",
    )


def _by_incidence(view: View) -> list[tuple[str, NDArray[np.intp]]]:
    return [
        (f"theta_i {np.degrees(view.m.theta_i[rows[0]]):.3g}°", rows)
        for rows in view.incidences
        if rows.size >= 4 * LEAST
    ][:200]


def _plateau(
    view: View, rows: NDArray[np.intp], values: NDArray[np.float64], scaled: NDArray[np.float64]
) -> tuple[int, float]:
    """Count distinct directions at the largest value; 0 unless they are a plateau."""
    top = float(np.nanmax(scaled, initial=0.0))
    if not top > 0.0:
        return 0, 0.0
    at = scaled >= top * (1.0 - EQUAL)
    if np.count_nonzero(at) < LEAST:
        return 0, 0.0
    if np.all(view.to_mirror[rows[at]] < EXACT):
        return 0, 0.0
    # An isotropic surface gives equal values left and right, and with both exchanged.
    m, chosen = view.m, rows[at]
    a, b, turn = (
        steps(m.theta_i[chosen]),
        steps(m.theta_o[chosen]),
        steps(np.abs(view.turn[chosen])),
    )
    count = np.unique(np.stack([np.minimum(a, b), np.maximum(a, b), turn]), axis=1).shape[1]
    if count < LEAST or count > CONSTANT * rows.size:
        return 0, 0.0
    below = np.sort(scaled[(scaled > 0.0) & ~at])
    if below.size < LEAST:
        return 0, 0.0
    starts = np.flatnonzero(np.append(True, np.diff(below) > EQUAL * below[1:]))
    ties = int(np.diff(np.append(starts, below.size))[-10:].max())
    if np.count_nonzero(at) < RARER * ties and ties > 1:
        return 0, 0.0
    return int(count), float(np.nanmax(values[at]))
