"""Grazing directions: noise divided by small cosines, instrument floors, extrapolated values."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from lobefit.fitting.checks.finding import DataCheck
from lobefit.fitting.checks.view import View, plural

__all__ = ["check_grazing"]

GRAZING = np.radians(80.0)
FLAT = 1e-6
# Equal steps in a row at the end of a scan, and the share of equal steps that is rare elsewhere.
RUN, RARE = 2, 0.1
# Scans beyond 80 degrees are this many times rougher than below 70.
ROUGHER = 4.0
NOISY = 0.1


def check_grazing(view: View) -> DataCheck:
    """Compare values beyond 80 degrees with the rest of their scans."""
    m = view.m
    theta = np.maximum(m.theta_i, m.theta_o)
    beyond = theta > GRAZING + 1e-9
    count = int(np.count_nonzero(beyond))
    rows, rough = view.roughness
    graze, plain = np.abs(rough[beyond[rows]]), np.abs(rough[theta[rows] < np.radians(70.0)])
    noise, usual = (1.4826 * float(np.median(x)) if x.size >= 10 else None for x in (graze, plain))
    flat = _flat(view)
    figures: dict[str, Any] = {
        "largest_theta_i_deg": float(np.degrees(m.theta_i.max())),
        "largest_theta_o_deg": float(np.degrees(m.theta_o.max())),
        "rows_beyond_80_deg": count,
        "roughness_beyond_80_deg": noise,
        "roughness_below_70_deg": usual,
        "flat_rows": flat,
    }
    answer = partial(DataCheck, name="grazing angles", figures=figures)
    limits = (
        f"theta_i {figures['largest_theta_i_deg']:.3g}°, theta_o "
        f"{figures['largest_theta_o_deg']:.3g}°"
    )
    if not count:
        return answer(
            verdict="ok",
            sentence=f"Nothing beyond 80°: a model's values above {limits} are extrapolated.",
        )
    remedy = "leave them out (--max-theta 80)"
    if flat >= 3:
        return answer(
            verdict="suspicious",
            sentence=f"{plural(flat, 'value')} at the ends of scans beyond 80° are equal: an "
            "instrument's floor or a constant continuation, not a measurement.",
            remedy=remedy,
        )
    if noise is not None and usual is not None and noise > max(NOISY, ROUGHER * usual):
        return answer(
            verdict="suspicious",
            sentence=f"Beyond 80° scans are rough to {100 * noise:.2g} %, elsewhere to "
            f"{100 * usual:.2g} %.",
            remedy=remedy,
        )
    return answer(
        verdict="ok",
        sentence=f"{plural(count, 'row')} beyond 80° (up to {limits}) {'is' if count == 1 else 'are'} "
        "as smooth as the rest.",
    )


def _flat(view: View) -> int:
    """Count equal values in a row at grazing ends of scans.

    None are counted where neighbours are often equal elsewhere too, as in rounded or binned data.
    """
    flat, steps, equal_steps = 0, 0, 0
    for scan in view.scans:
        values = view.level[scan.rows]
        equal = np.abs(np.diff(values)) <= FLAT * np.abs(values[1:])
        inside = np.maximum(np.abs(scan.running[1:]), np.abs(scan.running[:-1])) <= GRAZING
        steps += int(np.count_nonzero(inside))
        equal_steps += int(np.count_nonzero(equal & inside))
        for x, same in ((scan.running, equal), (-scan.running[::-1], equal[::-1])):
            run = same.size if same.all() else int(np.argmin(same[::-1]))
            beyond = int(np.count_nonzero(x[1:] > GRAZING))
            if beyond and RUN <= run < 0.5 * same.size:
                flat += min(run + 1, beyond)
    return flat if equal_steps <= RARE * steps else 0
