"""The mirror convention: the peak belongs at phi_o = phi_i + 180 degrees, not at phi_o = phi_i."""

from __future__ import annotations

from functools import partial

import numpy as np

from lobefit.fitting.checks.finding import DataCheck
from lobefit.fitting.checks.view import View, plural

__all__ = ["check_mirror"]

# Distance (rad) from the mirror direction, or from the light, that counts as there.
NEAR = np.radians(10.0)
# At smaller incidence both are one place.
OBLIQUE = np.radians(15.0)
# Incidences near grazing: no peak is where the mirror direction is.
GRAZING = np.radians(72.0)
# How many times brighter one of them must be.
BRIGHTER = 2.0
SHOWN = 1.5


def check_mirror(view: View) -> DataCheck:
    """Compare the brightness about the mirror direction with that about the light."""
    m, level = view.m, view.level
    sides = []
    for rows in view.incidences:
        if not OBLIQUE <= m.theta_i[rows[0]] <= GRAZING:
            continue
        values = level[rows]
        good = np.isfinite(values)
        mirror = values[good & (view.to_mirror[rows] < NEAR)]
        source = values[good & (view.to_source[rows] < NEAR)]
        elsewhere = values[
            good & (view.to_mirror[rows] >= 2 * NEAR) & (view.to_source[rows] >= 2 * NEAR)
        ]
        if mirror.size and source.size:
            sides.append((np.log(source.max() / mirror.max()), True))
        elif (source.size or mirror.size) and elsewhere.size >= 3:
            # One side only: is there a peak on it at the light's angle?
            peak = max(source.max(initial=0.0), mirror.max(initial=0.0))
            sign = 1.0 if source.size else -1.0
            sides.append((sign * max(np.log(peak / np.median(elsewhere)), 0.0), False))
    answer = partial(DataCheck, name="mirror convention")
    if not sides:
        return answer(
            verdict="cannot tell",
            figures={"incidences": 0},
            sentence="No incidence of 15° to 72° was seen near the mirror direction or the light.",
            remedy="make sure that the mirror direction is phi_o = phi_i + 180",
        )
    excess = np.array([side[0] for side in sides])
    both = all(side[1] for side in sides)
    ratio = float(np.exp(np.median(excess)))
    figures = {"incidences": len(sides), "source_over_mirror": ratio, "both_sides": both}
    where = "the mirror direction" if both else "the rest"
    if ratio > BRIGHTER and np.mean(excess > np.log(BRIGHTER)) > 0.6:
        return answer(
            verdict="suspicious",
            figures=figures,
            sentence=f"At {plural(len(sides), 'incidence')} values within 10° of the light are "
            f"{ratio:.3g} times those of {where}, as if the mirror direction were phi_o = phi_i.",
            remedy="add 180 degrees to phi_o, unless the sample is a retro-reflector",
        )
    if ratio < 1.0 / SHOWN:
        return answer(
            verdict="ok",
            figures=figures,
            sentence=f"The peak is on the mirror side: {1.0 / ratio:.3g} times as bright as "
            f"{'the side of the light' if both else 'elsewhere'}.",
        )
    return answer(
        verdict="cannot tell",
        figures=figures,
        sentence="No peak tells the mirror side from the side of the light "
        f"(brightness {ratio:.3g} : 1).",
        remedy="make sure that the mirror direction is phi_o = phi_i + 180",
    )
