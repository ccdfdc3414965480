"""Errors that mean nothing: beside an unresolved peak, from too few readings, of no lobe."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from lobefit.fitting.identifiability_evidence import Evidence
from lobefit.fitting.identifiability_limits import RULED_OUT, VAGUE
from lobefit.fitting.information import Information
from lobefit.fitting.noise import variance
from lobefit.fitting.profile import Profile, restore_weights
from lobefit.fitting.resolution import Peak
from lobefit.fitting.result import ParameterEstimate

__all__ = ["Lost", "lost_errors"]

# An error that knowing the width would divide by this much rests on the width.
RESTS = 1.5
# With fewer degrees of freedom of the noise no error is quoted: a fifth of the estimates
# would be off by more than two of them.
FEWEST = 2.0


@dataclass(frozen=True, slots=True)
class Lost:
    """Parameters whose first-order errors mean nothing.

    Attributes
    ----------
    errors : frozenset of (str, str or None)
        Names and channels, as in the estimates.
    without_limits : frozenset of (str, str or None)
        Those of them whose limits would mean nothing either.
    beside : tuple of str
        Names that an unresolved peak's width takes with it.
    few : tuple of str
        Names that follow readings whose noise is not known.
    readings : float
        How many, at most.
    """

    errors: frozenset[tuple[str, str | None]] = frozenset()
    without_limits: frozenset[tuple[str, str | None]] = frozenset()
    beside: tuple[str, ...] = ()
    few: tuple[str, ...] = ()
    readings: float = 0.0


def lost_errors(evidence: Evidence) -> Lost:
    """Find the parameters whose errors mean nothing.

    Parameters
    ----------
    evidence : Evidence
        Of a fit whose dataset is still on the device; its weights are changed.

    Returns
    -------
    Lost
    """
    peak = evidence.peak
    free = [e for e in evidence.result.estimates if not e.held]
    widths = {(e.name, e.channel) for e in free if peak and e.name in peak.narrowing}
    beside = {
        (e.name, e.channel): e.name
        for e in free
        if peak and e.name in peak.raising and _rests(e, evidence.every[evidence.row_of(e)], peak)
    }
    shapes = {*_shapes_of_nothing(evidence)} if evidence.scale > 0.0 else set()
    few, readings = {}, 0.0
    for e in free:
        key = (e.name, e.channel)
        if e.status != "free" or key in widths or key in beside or key in shapes:
            continue
        noise = evidence.freedom.of(e.name, None if e.channel is None else evidence.row_of(e))
        if noise.degrees < FEWEST:
            few[key] = e.name
            readings = max(readings, noise.readings)
    return Lost(
        errors=frozenset({*widths, *beside, *shapes, *few}),
        without_limits=frozenset({*beside, *shapes}),
        beside=tuple(dict.fromkeys(beside.values())),
        few=tuple(dict.fromkeys(few.values())),
        readings=readings,
    )


def _rests(e: ParameterEstimate, known: Information, peak: Peak) -> bool:
    """Tell whether the estimate of a height rests on that of a width."""
    if not peak.sampled or e.name not in known.names:
        return True
    left = [k for k, name in enumerate(known.names) if name not in peak.narrowing]
    matrix = known.matrix[np.ix_(left, left)]
    held = Information(
        tuple(known.names[k] for k in left),
        tuple(known.relative[k] for k in left),
        known.values[left],
        matrix,
    )
    error = float(known.errors[known.names.index(e.name)])
    return error > RESTS * float(held.errors[held.names.index(e.name)])


def _shapes_of_nothing(evidence: Evidence) -> Iterator[tuple[str, str | None]]:
    """Name shape and scale of lobes that may as well not be there."""
    fit, result = evidence.fit, evidence.result
    candidate, program = fit.problem.candidate, fit.problem.program
    products = candidate.model.coefficients
    solved = {p.name for p in candidate.solved}
    nonlinear = [p.name for p in candidate.model.nonlinear]
    searched = {p.name for p in candidate.searched}
    for name in dict.fromkeys(names[0] for names in products if names):
        bases = {k for k, names in enumerate(products) if name in names}
        inside = {nonlinear[j] for k, j in program.derivatives if k in bases}
        inside -= {nonlinear[j] for k, j in program.derivatives if k not in bases}
        if name not in solved or not inside & searched:
            continue
        scales = [e for e in result.estimates if e.name == name]
        if any(e.value and (e.standard_error or 0.0) < VAGUE * e.value for e in scales):
            continue
        restore_weights(fit)
        if all(_may_be_nothing(evidence, e) for e in scales):
            parts = {p for k in bases for p in products[k]}
            for e in result.estimates:
                if e.name in inside | parts and e.status == "free":
                    yield e.name, e.channel


def _may_be_nothing(evidence: Evidence, height: ParameterEstimate) -> bool:
    """Tell whether a fit without a lobe is not ruled out."""
    fit, scale = evidence.fit, evidence.scale
    profile = Profile(fit, height.name, evidence.row_of(height), scale)
    if profile.rise(0.0) >= RULED_OUT:
        return False
    changes = profile.changes(0.0)
    dataset = fit.problem.dataset
    if changes is None or not dataset.estimates_noise:
        return True
    # Noise in proportion to a peak would excuse that it is missed altogether: without the
    # lobe the noise is that of what is left.
    measured = np.where(dataset.used, dataset.measurement.values, 0.0)
    without = fit.values + changes
    weaker = variance(without, fit.additive, fit.relative)
    rise = (measured - without) ** 2 / weaker - ((measured - fit.values) / fit.sigma) ** 2
    rise += np.log(weaker / fit.sigma**2)
    return float(rise[dataset.used].sum()) / scale < RULED_OUT
