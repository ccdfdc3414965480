"""About the light's own direction: a detector standing in its way leaves a gap or casts a shadow."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from lobefit.fitting.checks.finding import DataCheck
from lobefit.fitting.checks.view import View, plural

__all__ = ["check_retro"]

OBLIQUE = np.radians(12.0)
# Distances (rad) from the light: what may be in the shadow, and the ring it is compared with.
SHADOW, RING = np.radians(4.0), (np.radians(6.0), np.radians(14.0))
# Values in the shadow fall below this share of the ring.
DARK = 0.6
# A gap is this many times the distance between neighbouring views, and at least so wide.
MISSING, LEAST = 2.5, np.radians(2.0)


def check_retro(view: View) -> DataCheck:
    """Look for a hole, or a dip, in the data about the direction of the light."""
    gaps, ratios, covered = [], [], 0
    for rows in view.incidences:
        theta_i = view.m.theta_i[rows[0]]
        if theta_i < OBLIQUE:
            continue
        # Views on both sides of the light, that is nearer to the normal and further from it.
        apart = view.to_source[rows]
        beyond = view.m.theta_o[rows] - theta_i
        side = (np.cos(view.turn[rows]) > np.cos(np.radians(30.0))) & (apart < np.radians(30.0))
        if not ((side & (beyond > 0)).any() and (side & (beyond < 0)).any()):
            continue
        covered += 1
        nearest = float(apart.min())
        if nearest > max(LEAST, MISSING * _spacing(view, rows[side])):
            gaps.append(nearest)
            continue
        logs = np.log(view.level[rows])
        inside = logs[(apart < SHADOW) & np.isfinite(logs)]
        ring = (apart > RING[0]) & (apart < RING[1]) & side & np.isfinite(logs)
        if inside.size and (ring & (beyond > 0)).any() and (ring & (beyond < 0)).any():
            around = 0.5 * (logs[ring & (beyond > 0)].mean() + logs[ring & (beyond < 0)].mean())
            ratios.append(float(np.exp(inside.min() - around)))
    dip = float(np.median(ratios)) if ratios else None
    answer = partial(
        DataCheck,
        name="retro gap",
        figures={
            "incidences": covered,
            "gap_deg": float(np.degrees(np.median(gaps))) if gaps else 0.0 if covered else None,
            "dip": dip,
        },
    )
    unseen = "retro-reflection cannot be judged, and a model's retro peak there is a guess"
    if not covered:
        return answer(
            verdict="cannot tell",
            sentence=f"No view surrounds the direction of the light: {unseen}.",
        )
    if dip is not None and dip < DARK and np.mean(np.array(ratios) < DARK) > 0.5:
        return answer(
            verdict="suspicious",
            sentence=f"Within 4° of the light the values fall to {100 * dip:.2g} % of those "
            "around: the detector seems to stand in the light.",
            remedy="leave out directions within some degrees of the light",
        )
    if len(gaps) > 0.5 * covered:
        return answer(
            verdict="cannot tell",
            sentence=f"Nothing was measured within {np.degrees(np.median(gaps)):.2g}° of the "
            f"light: {unseen}.",
            remedy="do not read retro-reflection out of these data",
        )
    return answer(
        verdict="ok",
        sentence=f"The direction of the light is covered at {plural(covered, 'incidence')}, "
        "without a dip.",
    )


def _spacing(view: View, rows: np.ndarray[Any, np.dtype[np.intp]]) -> float:
    """Give the typical distance of neighbouring views, in radians."""
    m, rows = view.m, rows[:300]
    theta, phi = m.theta_o[rows], m.phi_o[rows]
    w = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)])
    cosine = np.clip(w.T @ w, -1.0, 1.0)
    np.fill_diagonal(cosine, -1.0)
    return float(np.median(np.arccos(cosine.max(axis=1))))
