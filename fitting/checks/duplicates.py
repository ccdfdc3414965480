"""Repeated directions: readings of one direction should agree to within the noise."""

from __future__ import annotations

import re
from functools import partial

import numpy as np

from lobefit.fitting.checks.finding import DataCheck
from lobefit.fitting.checks.view import View, plural, steps

__all__ = ["check_duplicates"]

# The reader's words for rows that it averaged.
_APART = re.compile(r"averaged into (\d+).*values differ by up to ([\d.e+-]+) %")
_MERGED = re.compile(r"averaged into (\d+)")
# Repeats that differ by more than this, and by more than this many times the noise.
CONTRADICTION = 0.3
NOISY = 6.0


def check_duplicates(view: View) -> DataCheck:
    """Compare rows of one direction, and what the reader said about those it averaged."""
    m = view.m
    worst, repeated = 0.0, 0
    for note in m.notes:
        if found := _MERGED.search(note):
            repeated += int(found[1])
        if found := _APART.search(note):
            worst = max(worst, float(found[2]) / 100.0)
    phi_i = np.where(m.theta_i < 1e-9, 0.0, np.mod(m.phi_i, 2.0 * np.pi))
    phi_o = np.where(m.theta_o < 1e-9, 0.0, np.mod(m.phi_o, 2.0 * np.pi))
    places = np.stack([steps(a) for a in (m.theta_i, phi_i, m.theta_o, phi_o)])
    order = np.lexsort(places)
    same = (np.diff(places[:, order], axis=1) == 0).all(axis=0)
    if same.any():
        first, second = order[:-1][same], order[1:][same]
        low = np.minimum(view.level[first], view.level[second])
        high = np.maximum(view.level[first], view.level[second])
        repeated += int(same.sum())
        worst = max(worst, float(np.nan_to_num(1.0 - low / high).max()))
    noise = view.noise
    answer = partial(
        DataCheck,
        name="repeated directions",
        figures={"repeated": repeated, "largest_difference": worst, "noise": noise},
    )
    if not repeated:
        return answer(
            verdict="cannot tell",
            sentence="No direction was measured twice, so nothing shows how repeatable it is.",
            remedy="repeat a few directions at the end of a run",
        )
    apart = f"differ by up to {100 * worst:.2g} %" if worst else "are equal"
    said = f"Readings of {plural(repeated, 'repeated direction')} {apart}"
    if worst > max(CONTRADICTION, NOISY * (noise or 0.0)):
        return answer(
            verdict="suspicious",
            sentence=f"{said}, more than noise: they contradict each other.",
            remedy="find out which reading is right (drift, another sample, two tables in one "
            "file) and remove the other",
        )
    return answer(verdict="ok", sentence=f"{said}.")
