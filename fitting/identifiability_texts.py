"""What the data cannot determine, in words."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from lobefit.fitting.identifiability_lost import Lost
from lobefit.fitting.identifiability_result import Advice, Combination, Limit
from lobefit.fitting.resolution import Peak
from lobefit.fitting.result import FitResult

__all__ = ["limit_value", "sentences"]

# Improvements below this are none.
WORTH = 1.3
# Channels that are listed; of more, the range is given.
FEW = 3


def sentences(
    result: FitResult,
    combinations: Sequence[Combination],
    assumed: Sequence[Combination],
    limits: Sequence[Limit],
    peak: Peak | None,
    advice: Advice | None,
    lost: Lost,
    product: tuple[str, float, float] | None,
) -> tuple[str, ...]:
    """Say what cannot be determined, and what would help.

    Parameters
    ----------
    result : FitResult
        The fit.
    combinations : sequence of Combination
        Of its parameters.
    assumed : sequence of Combination
        Of those that it would have if it held none.
    limits : sequence of Limit
    peak : Peak or None
        A peak that the readings do not resolve.
    advice : Advice or None
    lost : Lost
        Errors that mean nothing.
    product : (str, float, float) or None
        What is known of an unresolved peak: name, value and relative error.

    Returns
    -------
    tuple of str
        One for each thing to know, without a full stop.
    """
    said = _apart(combinations)
    for text in _apart(assumed):
        free = {name for c in assumed for name in c.parameters}
        held = [e for e in result.estimates if e.status == "fixed" and e.name in free]
        names = dict.fromkeys(f"{e.name} is held at {e.value:g}" for e in held)
        said.append(
            f"{' and '.join(names)}, which these data cannot test: if free ({result.model}), {text}"
        )
    said += _limit_texts(result, limits)
    if peak is not None:
        near = ", ".join(f"{round(math.degrees(x), 6):.2g}" for x in peak.nearest)
        width = math.degrees(peak.width)
        said.append(
            f"the peak, {width:.2g} deg wide at half its height, is narrower than the readings "
            f"resolve (the nearest lie {near} deg from the mirror direction): "
            f"{' and '.join(peak.narrowing)} would follow from the shape of the lobe's tails alone"
            + (f", and {_listed(lost.beside)} with it" if lost.beside else "")
            + (
                "; {} = {:.4g} is known to {}".format(*product[:2], _percent(product[2]))
                if product
                else ""
            )
        )
    if lost.few:
        count = max(round(lost.readings), 1)
        few = "one reading" if count == 1 else f"{count} readings"
        errors = "error" if len(lost.few) == 1 else "errors"
        said.append(
            f"the {errors} of {_listed(lost.few)} cannot be trusted: about {few} tell, and not "
            "their own noise; state the readings' uncertainty, or measure more of them on the peak"
        )
    if advice is not None:
        together = {n for c in (*combinations, *assumed) for n in c.parameters}
        said += _advice_texts(advice, together)
    return tuple(said)


def _apart(combinations: Iterable[Combination]) -> list[str]:
    grouped: dict[tuple[str, ...], list[Combination]] = {}
    for c in combinations:
        grouped.setdefault(c.parameters, []).append(c)
    said = []
    for names, group in grouped.items():
        products = {c.product for c in group}
        product = products.pop() if len(products) == 1 else ""
        worst = max(c.error for c in group)
        channels = [c.channel for c in group if c.channel is not None]
        where = ""
        if channels:
            where = (
                f" in {_listed(channels)}"
                if len(channels) <= FEW
                else f" in {len(channels)} channels"
            )
        hopeless = any(c.hopeless for c in group)
        how = "cannot be told apart" if hopeless else "can hardly be told apart"
        text = f"{_listed(names)} {how}{where}"
        if not hopeless:
            text += f" (their errors reach {_percent(worst)})"
        errors = [c.product_error for c in group if c.product_error is not None]
        if product and errors:
            one = group[0].value if len(group) == 1 else None
            shown = product if one is None else f"{product} = {one:.4g}"
            text += f"; {shown} is known to {_percent(max(errors))}"
        said.append(text)
    return said


def _advice_texts(advice: Advice, together: set[str]) -> list[str]:
    of = advice.parameter + (f"[{advice.channel}]" if advice.channel else "")
    if advice.factor < WORTH:
        # What is vague by itself drowns in noise at every angle; its limit says so.
        useless = f"no further angle of incidence would help to determine {of}"
        return [useless] if advice.parameter in together else []
    text = (
        f"readings at {advice.theta_i_deg:g} deg of incidence would shrink the error of {of} "
        f"{_times(advice.factor)}"
    )
    if advice.enough is not None and advice.enough[0] != advice.theta_i_deg:
        text += f"; {advice.enough[0]:g} deg would bring it to {_percent(advice.enough[1])}"
    return [text]


def _limit_texts(result: FitResult, limits: Iterable[Limit]) -> list[str]:
    values = {(e.name, e.channel): e.value for e in result.estimates}
    grouped: dict[tuple[str, str], list[Limit]] = {}
    for x in limits:
        grouped.setdefault((x.parameter, x.kind), []).append(x)
    said = []
    for (name, kind), group in grouped.items():
        sign = "<" if kind == "upper" else ">"
        if len(group) <= FEW:
            each = [
                f"{name}{f'[{x.channel}]' if x.channel and len(result.channels) > 1 else ''} "
                f"{sign} {limit_value(x.value, values[x.parameter, x.channel])}"
                for x in group
            ]
            shown = ", ".join(each)
        else:
            least, most = min(x.value for x in group), max(x.value for x in group)
            shown = f"{name} {sign} {least:.2g} to {most:.2g} in {len(group)} channels"
        said.append(f"{shown} (95 %)")
    return said


def limit_value(limit: float, value: float) -> str:
    """Write a limit to two digits, or to as many as tell it from the value."""
    digits = 2
    while digits < 6 and f"{limit:.{digits}g}" == f"{value:.{digits}g}":
        digits += 1
    return f"{limit:.{digits}g}"


def _listed(names: Sequence[str]) -> str:
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"


def _percent(share: float) -> str:
    return f"{100.0 * share:.2g} %" if share < 0.995 else f"{100.0 * share:.0f} %"


def _times(factor: float) -> str:
    if factor > 1e3:
        return "more than 1000 times"
    return f"{factor:.2g} times" if factor < 9.95 else f"{factor:.0f} times"
