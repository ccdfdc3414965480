"""What the data cannot determine: combinations, one-sided limits, and what would help.

From the Fisher information at the optimum over relative changes of the parameters come the
parameters that cannot be told apart and the product of them that is known. What is vague by
itself, or lies on a bound, gets a limit of 95 % by profile likelihood instead of an error. Where
something is vague, hypothetical readings at further angles of incidence are added to the
information: the one that shrinks the worst error most is the advice.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import product as pairs

import numpy as np
from numpy.typing import NDArray

from lobefit.fitting.advice import advise
from lobefit.fitting.identifiability_evidence import Evidence, evidence
from lobefit.fitting.identifiability_limits import VAGUE, limits_of
from lobefit.fitting.identifiability_lost import Lost, lost_errors
from lobefit.fitting.identifiability_noise import NoiseFreedom
from lobefit.fitting.identifiability_result import Advice, Combination, Identifiability
from lobefit.fitting.identifiability_texts import sentences
from lobefit.fitting.information import Information
from lobefit.fitting.point import PointFit
from lobefit.fitting.resolution import unresolved_peak
from lobefit.fitting.result import FitResult

__all__ = ["identifiability", "with_identifiability"]

Array = NDArray[np.float64]

# Vague parameters whose estimates are correlated more than this change together.
TOGETHER = 0.9
# So far, in ln(parameter), first derivatives may be followed when a product is looked for.
FARTHEST = 5.0
# Below one standard deviation above the mean.
ONE_SIGMA = 0.841345
# Exponents of products that are worth a name, the plainest first.
EXPONENTS = sorted(
    (e for e in pairs((1, 2, 3, 4), (1, -1, 2, -2, 3, -3, 4, -4)) if np.gcd(*e) == 1),
    key=lambda e: (e[0] + abs(e[1]), -e[1]),
)


def with_identifiability(
    results: Sequence[FitResult], fits: Mapping[str, PointFit]
) -> list[FitResult]:
    """Complete the recommended result, the first one.

    Parameters
    ----------
    results : sequence of FitResult
        Ranked.
    fits : mapping of str to PointFit
        Their point fits by candidate, whose dataset is still on the device.

    Returns
    -------
    list of FitResult
    """
    best = results[0]
    full = next((r for r in results if r.candidate == best.model != best.candidate), None)
    held = None
    if full is not None and full.options == best.options:
        held = evidence(fits[full.candidate], full)
    fit = fits[best.candidate]
    found, lost = identifiability(evidence(fit, best, unresolved_peak(fit)), held)
    estimates = tuple(
        replace(e, standard_error=None, status="undetermined")
        if (e.name, e.channel) in lost.errors
        else e
        for e in best.estimates
    )
    return [replace(best, identifiability=found, estimates=estimates), *results[1:]]


def identifiability(known: Evidence, held: Evidence | None = None) -> tuple[Identifiability, Lost]:
    """Find out what the data of a fit do not determine, and whose errors mean nothing.

    Parameters
    ----------
    known : Evidence
        Of a fit whose dataset is still on the device; its weights are changed.
    held : Evidence, optional
        That of the full model, where this candidate holds parameters.

    Returns
    -------
    Identifiability
    Lost
    """
    result, candidate, peak = known.result, known.fit.problem.candidate, known.peak
    combinations = _combinations(known)
    worst, worst_error, where = _worst(known.every)
    lost = lost_errors(known)
    found = limits_of(known, combinations, lost.without_limits)
    advice = None
    # Across an unresolved peak it is finer steps that help, not another incidence.
    narrowing = {*peak.narrowing, *lost.beside} if peak else set()
    hopeless = any(worst in c.parameters and narrowing & {*c.parameters} for c in combinations)
    # About what may as well not be there, its present shape says nothing.
    hopeless |= worst in {name for name, _ in lost.errors}
    if worst not in narrowing and not hopeless:
        advice = _advice(known)
    one = worst in [p.name for p in candidate.shared] or len(result.channels) == 1
    assumed: tuple[Combination, ...] = ()
    if held is not None:
        fixed = {*candidate.fixed}
        assumed = tuple(c for c in _combinations(held) if fixed & {*c.parameters})
        # What some channels cannot tell, the others may.
        if 2 * len(assumed) < len(result.channels):
            assumed = ()
        if advice is None and assumed:
            advice = _advice(held)
    product = None
    if peak is not None and peak.sampled and lost.beside and not combinations:
        product = _height_times_width(known, peak.narrowing, lost.beside)
    said = Identifiability(
        worst=worst if one or not worst else f"{worst}[{result.channels[where]}]",
        worst_error=worst_error,
        combinations=combinations,
        limits=found,
        advice=advice,
        sentences=sentences(result, combinations, assumed, found, peak, advice, lost, product),
    )
    return said, lost


def _advice(known: Evidence) -> Advice | None:
    """Say what would help, where something is vague."""
    worst, error, where = _worst(known.every)
    return advise(known.fit, known.scale, worst, where) if error > VAGUE else None


def _worst(every: Sequence[Information]) -> tuple[str, float, int]:
    worst, error, where = "", 0.0, 0
    for channel, known in enumerate(every):
        for name, e in zip(known.names, known.errors, strict=True):
            if e > error:
                worst, error, where = name, float(e), channel
    return worst, error, where


def _combinations(evidence: Evidence) -> tuple[Combination, ...]:
    result = evidence.result
    shared = {p.name for p in evidence.fit.problem.candidate.shared}
    found: list[Combination] = []
    for channel, known in enumerate(evidence.every):
        covariance, errors = known.covariance, known.errors
        correlation = covariance / np.outer(errors, errors)
        left = [int(k) for k in np.argsort(-errors) if errors[k] > VAGUE]
        while left:
            group = [left.pop(0)]
            for k in group:  # grows while it is walked
                near = [j for j in left if abs(correlation[k, j]) > TOGETHER]
                group += near
                left = [j for j in left if j not in near]
            if len(group) == 1:
                continue
            members = sorted(group)
            names = tuple(known.names[k] for k in members)
            label = (
                None
                if {*names} <= shared or len(result.channels) == 1
                else result.channels[channel]
            )
            text, value, error = _product(known, members, evidence.freedom, channel)
            combination = Combination(
                parameters=_in_order(names, result),
                channel=label,
                error=float(errors[group[0]]),
                correlation=float(correlation[group[0], group[1]]),
                product=text,
                value=value,
                product_error=error,
            )
            if label is None and any(c.parameters == combination.parameters for c in found):
                continue
            found.append(combination)
    return tuple(found)


def _in_order(names: Sequence[str], result: FitResult) -> tuple[str, ...]:
    order = [e.name for e in result.estimates]
    return tuple(sorted(names, key=order.index))


def _product(
    known: Information, members: Sequence[int], freedom: NoiseFreedom, channel: int
) -> tuple[str, float | None, float | None]:
    """Find the plainest product of two parameters that is known about as well as any."""
    if len(members) != 2 or not all(known.relative[k] for k in members):
        return "", None, None
    # The scale of a lobe is named first.
    a, b = sorted(members, key=lambda k: not known.names[k].startswith("k_"))
    known = replace(known, matrix=known.matrix + np.eye(len(known.names)) / FARTHEST**2)
    errors = []
    for p, q in EXPONENTS:
        weights = np.zeros(len(known.names))
        weights[a], weights[b] = p, q
        errors.append(known.along(weights))
    per_unit = [
        e / max(abs(x) for x in powers) for e, powers in zip(errors, EXPONENTS, strict=True)
    ]
    k = next(i for i, e in enumerate(per_unit) if e <= 1.5 * min(per_unit))
    if errors[k] > 0.3 * VAGUE:
        return "", None, None
    (p, q), x, y = EXPONENTS[k], known.values[a], known.values[b]
    noise = freedom.along({known.names[a]: float(p), known.names[b]: float(q)}, channel)
    error = errors[k] * float(np.sqrt(noise.level(ONE_SIGMA)))
    first, second = (
        name if abs(power) == 1 else f"{name}^{abs(power)}"
        for name, power in ((known.names[a], p), (known.names[b], q))
    )
    return f"{first}{' ' if q > 0 else '/'}{second}", float(x**p * y**q), error


def _height_times_width(
    evidence: Evidence, widths: Iterable[str], heights: Sequence[str]
) -> tuple[str, float, float] | None:
    """Give what is known of a peak that is not resolved, of one channel: its product."""
    if len(evidence.every) > 1:
        return None
    (known,), freedom = evidence.every, evidence.freedom
    for names in pairs(heights, widths):
        if {*names} <= {*known.names}:
            text, value, error = _product(known, [known.names.index(n) for n in names], freedom, 0)
            if value is not None and error is not None and error < VAGUE:
                return text, value, error
    return None
