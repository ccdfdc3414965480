"""One-sided limits of 95 % by profile likelihood, where an error would say nothing."""

from __future__ import annotations

from collections.abc import Container, Sequence
from typing import Literal

import numpy as np

from lobefit.fitting.identifiability_evidence import Evidence
from lobefit.fitting.identifiability_result import Combination, Limit
from lobefit.fitting.point import PointFit
from lobefit.fitting.profile import LEVEL, Profile, restore_weights
from lobefit.fitting.result import ParameterEstimate

__all__ = ["RULED_OUT", "VAGUE", "limits_of"]

# A relative standard error above this leaves a parameter vague.
VAGUE = 0.3
# A value that fits worse than the best by less than this many units of -2 ln L, three standard
# deviations, is not ruled out.
RULED_OUT = 9.0
# Limits found by profile likelihood; further ones, of many channels, from the curvature.
PROFILES = 6
# Further searches for a limit whose level depends on where it is.
AGAIN = 3


def limits_of(
    evidence: Evidence,
    combinations: Sequence[Combination],
    without: Container[tuple[str, str | None]],
) -> tuple[Limit, ...]:
    """Give limits of what lies on a bound, is vague by itself, or follows from the tails alone.

    Parameters
    ----------
    evidence : Evidence
        Of a fit whose dataset is still on the device; its weights are changed.
    combinations : sequence of Combination
        Parameters that cannot be told apart.
    without : container of (str, str or None)
        Names and channels that a limit would say nothing of.
    """
    fit, result = evidence.fit, evidence.result
    linear = {p.name for p in fit.problem.candidate.solved}
    # Of two scales that only have a product, limits would say little.
    spared = {
        (name, c.channel)
        for c in combinations
        if {*c.parameters} <= linear
        for name in c.parameters
    }
    narrowing = evidence.peak.narrowing if evidence.peak else {}
    wanted: list[tuple[float, ParameterEstimate, int]] = []
    for e in result.estimates:
        channel = evidence.row_of(e)
        known = evidence.every[channel]
        error = float(known.errors[known.names.index(e.name)]) if e.name in known.names else np.inf
        at = e.status in ("lower", "upper", "undetermined") or e.name in narrowing
        ratio_of_nothing = e.status == "undetermined" and e.standard_error is None and not e.value
        label = e.channel if len(result.channels) > 1 else None
        if e.held or (e.name, label) in spared or ratio_of_nothing:
            continue
        if (e.name, e.channel) in without:
            continue
        if at or error > VAGUE or _beside_a_bound(fit, e):
            wanted.append((error, e, channel))
    if not wanted or not evidence.scale > 0.0:
        return ()
    restore_weights(fit)
    found = []
    for count, (error, e, channel) in enumerate(wanted):
        if count < PROFILES:
            limit = _profiled(evidence, e, channel, error, narrowing.get(e.name, 0))
        else:
            limit = _first_order(e) if e.name in linear else None
        if limit is not None:
            found.append(limit)
    return tuple(found)


def _beside_a_bound(fit: PointFit, e: ParameterEstimate) -> bool:
    """Tell whether a bound is near a parameter that is not on a relative scale."""
    p = next(p for p in fit.problem.candidate.model.parameters if p.name == e.name)
    if p.linear or p.period or p.scale == "log" or e.standard_error is None:
        return False
    nearest = min(e.value - p.bounds[0], p.bounds[1] - e.value)
    return nearest * nearest < RULED_OUT * e.standard_error**2


def _profiled(
    evidence: Evidence, e: ParameterEstimate, channel: int, error: float, grows: int
) -> Limit | None:
    """Look along the likelihood on both sides; None where neither or both are open."""
    profile = Profile(evidence.fit, e.name, channel, evidence.scale)
    linear = e.name in {p.name for p in evidence.fit.problem.candidate.solved}
    below = grows > 0 or profile.rise(profile.low) < RULED_OUT
    above = grows < 0 or (np.isfinite(profile.high) and profile.rise(profile.high) < RULED_OUT)
    if below == above:
        return None
    if linear:
        size = e.standard_error or max(error * e.value if np.isfinite(error) else 0.0, 1e-6)
        guess = 1.6 * size
    else:
        guess = min(max(1.6 * error, 1e-3), 0.1 * (profile.high - profile.low))
    side = 1 if below else -1
    position, level = profile.limit(side, guess), LEVEL
    for _ in range(AGAIN):
        changes = None if position is None else profile.changes(position)
        if changes is None:
            break
        # The readings that rule a value out may be few, and their noise hardly known.
        needed = evidence.freedom.of_changes(changes).level(0.95)
        if needed < 1.1 * level:
            break
        level = needed
        position = profile.limit(side, guess, level)
    if position is None:
        return None
    return Limit(
        parameter=e.name,
        channel=e.channel,
        kind="upper" if below else "lower",
        value=profile.value(position),
        method="profile",
    )


def _first_order(e: ParameterEstimate) -> Limit | None:
    """Give the limit of a value on its bound, or with an error as large as itself."""
    if e.standard_error is None or e.status == "undetermined":
        return None
    kind: Literal["upper", "lower"] = "lower" if e.status == "upper" else "upper"
    value = e.value + (1.645 if kind == "upper" else -1.645) * e.standard_error
    return Limit(parameter=e.name, channel=e.channel, kind=kind, value=value, method="first order")
