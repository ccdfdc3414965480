"""How far a fit is from the truth, in its own standard errors."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from lobefit.fitting.result import FitResult, ParameterEstimate
from lobefit.kernels import get_model

__all__ = ["deviations", "label"]

Truth = Mapping[str, float | Sequence[float]]


def label(estimate: ParameterEstimate) -> str:
    """Name a number of a fit: ``alpha``, ``F0[R]``."""
    return f"{estimate.name}[{estimate.channel}]" if estimate.channel else estimate.name


def deviations(result: FitResult, truth: Truth) -> dict[str, float]:
    """Give (value - truth)/standard error for every parameter that was fitted.

    Parameters
    ----------
    result : FitResult
        With its channels in the order of the truth's lists.
    truth : mapping of str to float or sequence of float
        Parameters by name, all of the model's.

    Returns
    -------
    dict of str to float
        By `label`. NaN where the fit gives no standard error, which is then no
        answer. Held parameters must be exactly right, and are left out.
    """
    period = {p.name: p.period for p in get_model(result.model, result.options).parameters}
    found: dict[str, float] = {}
    for estimate in result.estimates:
        given = truth[estimate.name]
        if isinstance(given, Sequence):
            index = result.channels.index(estimate.channel) if estimate.channel else 0
            given = given[index]
        difference = estimate.value - given
        turn = period[estimate.name]
        if turn:
            difference = math.remainder(difference, turn)
        if estimate.status in ("fixed", "tied"):
            assert difference == 0, label(estimate)
            continue
        error = estimate.standard_error
        found[label(estimate)] = difference / error if error else math.nan
    return found
