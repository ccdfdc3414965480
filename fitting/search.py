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

from lobefit.kernels import FitError

__all__ = ["ALGORITHMS", "USUAL", "Found", "SearchSettings", "minimise"]

Array = NDArray[np.float64]

# By the names that users know; "auto" takes the first, and Nelder-Mead in one dimension.
ALGORITHMS = {
    "BOBYQA": "LN_BOBYQA",
    "Nelder-Mead": "LN_NELDERMEAD",
    "SBPLX": "LN_SBPLX",
    "COBYLA": "LN_COBYLA",
    "SLSQP": "LD_SLSQP",
    "CRS2": "GN_CRS2_LM",
    "DIRECT": "GN_DIRECT_L",
    "MLSL": "G_MLSL_LDS",
}
# Of the algorithms that draw random numbers: the same run twice is the same.
SEED = 1

REASONS = {
    nlopt.SUCCESS: "success",
    nlopt.STOPVAL_REACHED: "target value reached",
    nlopt.FTOL_REACHED: "the value stopped changing",
    nlopt.XTOL_REACHED: "the parameters stopped changing",
    nlopt.MAXEVAL_REACHED: "limit of evaluations",
    nlopt.MAXTIME_REACHED: "limit of time",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class SearchSettings:
    """How a fit looks for the valley that Gauss-Newton then polishes.

    Attributes
    ----------
    algorithm : str
        One of `ALGORITHMS`, or "auto". SLSQP takes gradients; CRS2, DIRECT and MLSL look
        everywhere within the bounds. BOBYQA needs two dimensions: in one it is Nelder-Mead.
    tolerance : float
        Absolute one of the search coordinates (a relative change on a logarithmic scale);
        that of the objective is a twentieth of it, relatively.
    scan_density : float
        Nodes of the start scan along each dimension, as a multiple of the usual.
    max_evaluations : int
        Of one descent.

    Raises
    ------
    FitError
        An unknown algorithm, or a number that is not positive.
    """

    algorithm: str = "auto"
    tolerance: float = 2e-3
    scan_density: float = 1.0
    max_evaluations: int = 300

    def __post_init__(self) -> None:
        """Refuse what no search could use."""
        if self.algorithm != "auto" and self.algorithm not in ALGORITHMS:
            known = ", ".join(("auto", *ALGORITHMS))
            raise FitError(f"the search algorithm is one of {known}; not {self.algorithm!r}")
        for name in ("tolerance", "scan_density", "max_evaluations"):
            number = getattr(self, name)
            if not 0.0 < number < np.inf:
                raise FitError(f"{name} of a search is a positive number, not {number!r}")

    def run(self, dimensions: int) -> str:
        """Give NLopt's name of the algorithm that runs in so many dimensions."""
        wanted = "BOBYQA" if self.algorithm == "auto" else self.algorithm
        if wanted == "BOBYQA" and dimensions == 1:
            wanted = "Nelder-Mead"
        return ALGORITHMS[wanted]

    @property
    def is_global(self) -> bool:
        """Whether the algorithm looks everywhere, whatever its start."""
        return self.algorithm in ("CRS2", "DIRECT", "MLSL")


USUAL = SearchSettings()
"""What fits do unless told otherwise."""


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
    settings: SearchSettings = USUAL,
    gradient: Callable[[Array], Array] | None = None,
) -> Found:
    """Minimise within bounds.

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
    settings : SearchSettings
        Which algorithm; its tolerance and limit are those above.
    gradient : callable, optional
        Of the objective, shape (n,), for algorithms that take it.

    Returns
    -------
    Found
    """
    start = np.clip(start, low, high)
    best_point, best_value = start.copy(), np.inf
    worst, count = 0.0, 0
    raised: Exception | None = None

    # BOBYQA interpolates quadratically but needs two dimensions.
    algorithm = settings.run(len(start))
    opt = nlopt.opt(getattr(nlopt, algorithm), len(start))
    if settings.is_global:
        nlopt.srand(SEED)
    if algorithm == "G_MLSL_LDS":
        local = nlopt.opt(getattr(nlopt, USUAL.run(len(start))), len(start))
        local.set_xtol_abs(xtol)
        local.set_ftol_rel(ftol_rel)
        opt.set_local_optimizer(local)

    # It must not refer to opt: a cycle through C++ would never be collected.
    def guarded(x: Array, slope: Array) -> float:
        nonlocal best_point, best_value, worst, count, raised
        count += 1
        try:
            value = float(objective(np.array(x)))
            if slope.size and gradient is not None:
                slope[:] = np.nan_to_num(gradient(np.array(x)))
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
