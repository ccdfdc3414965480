"""F31 to F38: what NLopt does by itself, and what its guard makes of it."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import nlopt
import numpy as np
import pytest

from lobefit.fitting import fit, simulate
from lobefit.fitting.search import Found, minimise
from tests.stability.modes import measured
from tests.stability.naive import Array

LOW, HIGH = np.array([-2.0, -2.0]), np.array([2.0, 2.0])
START, STEP = np.array([1.5, -1.0]), np.array([0.5, 0.5])
GOAL = np.array([0.3, 0.7])
SCAN = "in-plane incidences=20,60 step=5"


def bowl(x: Array) -> float:
    return 1.0 + float(((x - GOAL) ** 2).sum())


def plain(
    algorithm: str,
    objective: Callable[[Array, Array], Any],
    *,
    start: Sequence[float] = (1.5, -1.0),
    xtol: float = 1e-6,
    maxeval: int = 2000,
) -> tuple[Array | BaseException, Any]:
    """Use NLopt as its manual does; gives the point or the exception, and the `opt`."""
    opt = nlopt.opt(getattr(nlopt, algorithm), len(start))
    opt.set_lower_bounds([-2.0] * len(start))
    opt.set_upper_bounds([2.0] * len(start))
    opt.set_min_objective(objective)
    opt.set_maxeval(maxeval)
    if xtol:
        opt.set_xtol_rel(xtol)
    try:
        return np.asarray(opt.optimize(list(start))), opt
    except Exception as error:  # noqa: BLE001 - whatever it is, it is looked at
        return error, opt


def guarded(objective: Callable[[Array], Any], **changes: Any) -> Found:
    settings: dict[str, Any] = {"start": START, "low": LOW, "high": HIGH, "step": STEP, **changes}
    return minimise(objective, **settings)


def test_rounding() -> None:
    def objective(x: Array, gradient: Array) -> float:
        if gradient.size:
            gradient[:] = 2 * (x - GOAL)
        return bowl(x)

    runs = [
        plain(a, objective, xtol=0, maxeval=0)[0] for a in ("LN_COBYLA", "LN_BOBYQA", "LD_SLSQP")
    ]
    measured("F31", lost=sum(isinstance(r, nlopt.RoundoffLimited) for r in runs))
    found = guarded(bowl, xtol=0.0, ftol_rel=0.0, max_evaluations=5000)
    np.testing.assert_allclose(found.point, GOAL, atol=1e-6)
    assert found.reason == "limited by rounding"


def test_nan() -> None:
    def objective(_x: Array, gradient: Array) -> float:
        gradient[:] = np.nan
        return float("nan")

    success = 0
    for algorithm in ("LN_COBYLA", "LN_BOBYQA", "LN_SBPLX", "LN_NELDERMEAD", "LD_SLSQP"):
        _, opt = plain(algorithm, objective)
        success += opt.last_optimize_result() > 0
    measured("F32", success=success)
    found = guarded(lambda _x: float("nan"))
    assert found.reason == "no finite value was found"
    np.testing.assert_array_equal(found.point, START)


def test_success_at_the_start() -> None:
    def objective(x: Array, gradient: Array) -> float:
        if gradient.size:
            gradient = 2 * (x - GOAL)  # a new array; NLopt never sees it
        return bowl(x)

    runs = [plain(algorithm, objective) for algorithm in ("LD_SLSQP", "LD_LBFGS", "LD_MMA")]
    # NLopt's own array is not set at all, so that what happens depends on what stands there.
    ends = [np.asarray(START) if isinstance(p, BaseException) else p for p, _ in runs]
    measured("F33", reached=sum(float(np.linalg.norm(end - GOAL)) < 0.1 for end in ends))
    found = guarded(bowl)
    assert found.algorithm == "LN_BOBYQA"
    assert found.evaluations > 5
    m = simulate("ggx", {"alpha": 0.2}, SCAN, seed=1)
    stop = fit(m, "ggx").best.stop
    assert "LN_NELDERMEAD" in stop.algorithm  # one searched parameter
    assert stop.converged


def answer(value: object, _x: Array, _gradient: Array) -> object:
    return value


def test_types() -> None:
    silent = 0
    for value in (np.float32(1), np.array(1.0), None, "1"):
        error, _ = plain("LN_BOBYQA", partial(answer, value))
        silent += isinstance(error, nlopt.invalid_argument) and not str(error)
        assert not isinstance(error, ValueError)
    measured("F34", silent=silent)
    assert guarded(lambda _x: np.float32(2.5)).value == 2.5
    with pytest.raises(TypeError, match="NoneType"):
        guarded(lambda _x: None)


def test_exceptions() -> None:
    def fails(*_arguments: Any) -> float:
        raise ValueError("no such surface")

    raised = [plain(a, fails)[0] for a in ("GN_DIRECT_L", "GN_CRS2_LM")]
    measured("F35", changed=sum(isinstance(error, SystemError) for error in raised))
    with pytest.raises(ValueError, match="no such surface"):
        guarded(fails)


def test_corner() -> None:
    opt = nlopt.opt(nlopt.LN_SBPLX, 3)
    opt.set_lower_bounds([0.0] * 3)
    opt.set_upper_bounds([2.0] * 3)
    opt.set_min_objective(lambda x, _g: float(x.sum()))
    opt.set_xtol_rel(1e-6)
    opt.set_maxeval(2000)
    opt.optimize([1.0] * 3)
    measured("F36", evaluations=opt.get_numevals())
    low, high = np.zeros(3), 2 * np.ones(3)
    found = minimise(lambda x: float(x.sum()), np.ones(3), low, high, np.ones(3))
    np.testing.assert_allclose(found.point, 0.0, atol=1e-3)
    assert found.evaluations < 100


def test_start_outside() -> None:
    error, opt = plain("LN_BOBYQA", lambda x, _g: bowl(x), start=(9.0, -9.0))
    assert isinstance(error, nlopt.invalid_argument)
    assert str(error) == ""
    measured("F37", evaluations=opt.get_numevals())
    found = guarded(bowl, start=np.array([9.0, -9.0]))
    np.testing.assert_allclose(found.point, GOAL, atol=3e-3)


def test_seeds_in_threads() -> None:
    def waves(x: Array, _gradient: Array) -> float:
        return bowl(x) + float(np.sin(9 * x[0]))

    def in_a_thread(*, own: bool) -> Array:
        points: list[Array] = []

        def work() -> None:
            if own:
                nlopt.srand(42)
            point, _ = plain("GN_CRS2_LM", waves, maxeval=300)
            assert not isinstance(point, BaseException)
            points.append(point)

        nlopt.srand(42)
        thread = threading.Thread(target=work)
        thread.start()
        thread.join()
        return points[0]

    same = [np.array_equal(in_a_thread(own=own), in_a_thread(own=own)) for own in (False, True)]
    measured("F38", apart=same[0], seeded=same[1])
    first, second = guarded(bowl), guarded(bowl)
    assert first.point.tobytes() == second.point.tobytes()
