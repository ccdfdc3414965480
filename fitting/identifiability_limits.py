"""One-sided limits of 95 % by profile likelihood, where an error would say nothing."""

from __future__ import annotations

from collections.abc import Container, Sequence
from typing import Literal

import numpy as np

from lobefit.fitting.identifiability_noise import NoiseFreedom
from lobefit.fitting.information import Information
from lobefit.fitting.point import PointFit
from lobefit.fitting.profile import LEVEL, Profile, restore_weights
from lobefit.fitting.resolution import Peak
from lobefit.fitting.result import Combination, FitResult, Limit, ParameterEstimate

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
    fit: PointFit,
    result: FitResult,
    every: Sequence[Information],
    combinations: Sequence[Combination],
    scale: float,
    peak: Peak | None,
    freedom: NoiseFreedom,
    without: Container[tuple[str, str | None]],
) -> tuple[Limit, ...]:
    """Give limits of what lies on a bound, is vague by itself, or follows from the tails alone.

    Parameters
    ----------
    fit : PointFit
        Its dataset is still on the device; its weights are changed.
    result : FitResult
        The same, judged.
    every : sequence of Information
        Of each channel.
    combinations : sequence of Combination
        Parameters that cannot be told apart.
    scale : float
        Variance in units of the objective.
    peak : Peak or None
        A peak that the readings do not resolve.
    freedom : NoiseFreedom
        How well the noise is known.
    without : container of (str, str or None)
        Names and channels that a limit would say nothing of.
    """
    linear = {p.name for p in fit.problem.candidate.solved}
    # Of two scales that only have a product, limits would say little.
    spared = {
        (name, c.channel)
        for c in combinations
        if {*c.parameters} <= linear
        for name in c.parameters
    }
    narrowing = peak.narrowing if peak else {}
    wanted: list[tuple[float, ParameterEstimate, int]] = []
    for e in result.estimates:
        channel = result.channels.index(e.channel) if e.channel in result.channels else 0
        known = every[channel]
        error = float(known.errors[known.names.index(e.name)]) if e.name in known.names else np.inf
        at = e.status in ("lower", "upper", "undetermined") or e.name in narrowing
        ratio_of_nothing = e.status == "undetermined" and e.standard_error is None and not e.value
        label = e.channel if len(result.channels) > 1 else None
        if e.status in ("fixed", "tied") or (e.name, label) in spared or ratio_of_nothing:
            continue
        if (e.name, e.channel) in without:
            continue
        if at or error > VAGUE or _beside_a_bound(fit, e):
            wanted.append((error, e, channel))
    if not wanted or not scale > 0.0:
        return ()
    restore_weights(fit)
    found = []
    for count, (error, e, channel) in enumerate(wanted):
        if count < PROFILES:
            limit = _profiled(fit, e, channel, error, scale, narrowing.get(e.name, 0), freedom)
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
    fit: PointFit,
    e: ParameterEstimate,
    channel: int,
    error: float,
    scale: float,
    grows: int,
    freedom: NoiseFreedom,
) -> Limit | None:
    """Look along the likelihood on both sides; None where neither or both are open."""
    profile = Profile(fit, e.name, channel, scale)
    linear = e.name in {p.name for p in fit.problem.candidate.solved}
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
        needed = freedom.of_changes(changes).level(0.95)
        if needed < 1.1 * level:
            break
        level = needed
        position = profile.limit(side, guess, level)
    if position is None:
        return None
    kind: Literal["upper", "lower"] = "upper" if below else "lower"
    return Limit(
        parameter=e.name,
        channel=e.channel,
        kind=kind,
        value=profile.value(position),
        method="profile",
    )


def _first_order(e: ParameterEstimate) -> Limit | None:
    """Give the limit of a value on its bound, or with an error as large as itself."""
    if e.standard_error is None or e.status == "undetermined":
        return None
    if e.status == "upper":
        value = e.value - 1.645 * e.standard_error
        return Limit(
            parameter=e.name, channel=e.channel, kind="lower", value=value, method="first order"
        )
    value = e.value + 1.645 * e.standard_error
    return Limit(
        parameter=e.name, channel=e.channel, kind="upper", value=value, method="first order"
    )
