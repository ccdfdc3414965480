"""NLopt behind a guard: non-finite values never reach it, and the best point is never lost.

NLopt returns success codes with NaN or an unmoved start, raises on rounding and
forgets the point (stevengj/nlopt#513), and turns exceptions into SystemError.
So the objective records the best point itself, and what NLopt says is only words.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import nlopt
import numpy as np
from numpy.typing import NDArray

__all__ = ["Found", "minimise"]

Array = NDArray[np.float64]

REASONS = {
    nlopt.SUCCESS: "success",
    nlopt.STOPVAL_REACHED: "target value reached",
    nlopt.FTOL_REACHED: "the value stopped changing",
    nlopt.XTOL_REACHED: "the parameters stopped changing",
    nlopt.MAXEVAL_REACHED: "limit of evaluations",
    nlopt.MAXTIME_REACHED: "limit of time",
}


@dataclass(frozen=True, slots=True)
class Found:
    """The best point of a search.

    Attributes
    ----------
    point : ndarray, shape (n,)
    value : float
        Finite unless no finite value was ever seen.
    algorithm, reason : str
        What ran, and why it stopped, in words.
    evaluations : int
    """

    point: Array
    value: float
    algorithm: str
    reason: str
    evaluations: int


def minimise(
    objective: Callable[[Array], float],
    start: Array,
    low: Array,
    high: Array,
    step: Array,
    *,
    xtol: float = 2e-3,
    ftol_rel: float = 1e-4,
    max_evaluations: int = 300,
) -> Found:
    """Minimise within bounds, without derivatives.

    Parameters
    ----------
    objective : callable
        Takes an array of shape (n,), may return anything or raise; an exception
        ends the search and is raised again.
    start, low, high, step : ndarray, shape (n,)
        Start (clipped into the bounds), bounds, and initial step.
    xtol, ftol_rel : float
        Absolute tolerance of the parameters; relative one of the value. They only
        have to reach the valley: Gauss-Newton takes the last digits.
    max_evaluations : int
        Always finite: some algorithms never meet a tolerance in a corner.

    Returns
    -------
    Found
    """
    start = np.clip(start, low, high)
    best_point, best_value = start.copy(), np.inf
    worst, count = 0.0, 0
    raised: Exception | None = None

    # BOBYQA interpolates quadratically but needs two dimensions.
    algorithm = "LN_NELDERMEAD" if len(start) == 1 else "LN_BOBYQA"
    opt = nlopt.opt(getattr(nlopt, algorithm), len(start))

    # It must not refer to opt: a cycle through C++ would never be collected.
    def guarded(x: Array, _gradient: Array) -> float:
        nonlocal best_point, best_value, worst, count, raised
        count += 1
        try:
            value = float(objective(np.array(x)))
        except Exception as error:
            raised = error
            raise
        if not np.isfinite(value):
            # Large, finite, and growing outwards, so that the search turns back.
            away = float(np.abs((x - best_point) / step).sum())
            return (abs(worst) + 1.0) * 10.0 * (1.0 + away)
        worst = max(worst, value)
        if value < best_value:
            best_point, best_value = np.array(x), value
        return value

    opt.set_min_objective(guarded)
    opt.set_lower_bounds(low)
    opt.set_upper_bounds(high)
    opt.set_initial_step(np.minimum(step, 0.49 * (high - low)))
    opt.set_xtol_abs(xtol)
    if len(start) > 1:  # two points of a simplex may stand at equal height across the valley
        opt.set_ftol_rel(ftol_rel)
    opt.set_maxeval(max_evaluations)
    try:
        opt.optimize(start)
        reason = REASONS.get(opt.last_optimize_result(), "unknown")
    except nlopt.RoundoffLimited:
        reason = "limited by rounding"
    except Exception as error:  # noqa: BLE001 - NLopt transforms what the objective raises
        reason = f"NLopt: {str(error) or type(error).__name__}"
    if raised is not None:
        raise raised
    if not np.isfinite(best_value):
        reason = "no finite value was found"
    return Found(best_point, best_value, algorithm, reason, count)
