"""The guard around NLopt: whatever it or the objective does, the best point seen is kept."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import nlopt
import numpy as np
import numpy.typing as npt
import pytest

from lobefit.fitting.search import REASONS, Found, minimise

Array = npt.NDArray[np.float64]

LOW, HIGH = np.array([-2.0, -2.0]), np.array([2.0, 2.0])
START, STEP = np.array([1.5, -1.0]), np.array([0.5, 0.5])
GOAL = np.array([0.3, 0.7])


def bowl(x: Array) -> float:
    return 1.0 + float(((x - GOAL) ** 2).sum())


def run(objective: Callable[[Array], Any], **changes: Any) -> Found:
    keywords = {"start": START, "low": LOW, "high": HIGH, "step": STEP, **changes}
    return minimise(objective, **keywords)


def recorded(objective: Callable[[Array], Any]) -> tuple[Callable[[Array], Any], list[Array]]:
    seen: list[Array] = []

    def wrapped(x: Array) -> Any:
        seen.append(x.copy())
        return objective(x)

    return wrapped, seen


def test_a_smooth_minimum() -> None:
    objective, seen = recorded(bowl)
    found = run(objective)
    np.testing.assert_allclose(found.point, GOAL, atol=3e-3)  # the default tolerance is 1e-3
    assert found.value == bowl(found.point)
    assert found.evaluations == len(seen) < 100
    assert found.algorithm == "LN_BOBYQA"
    assert found.reason in ("the value stopped changing", "the parameters stopped changing")


def test_the_best_point_is_never_worse_than_any_seen() -> None:
    rng = np.random.default_rng(1)
    values: list[float] = []

    def noisy(x: Array) -> float:
        values.append(bowl(x) + rng.normal())
        return values[-1]

    found = run(noisy)
    assert found.value == min(values)


@pytest.mark.parametrize(("start", "goal"), [(0.9, 0.23), (-1.0, 0.999), (0.0, -3.0)])
def test_one_dimension(start: float, goal: float) -> None:
    """BOBYQA refuses it, so another algorithm searches; a minimum beyond the bound ends on it."""
    found = minimise(
        lambda x: (x[0] - goal) ** 2,
        np.array([start]),
        np.array([-1.0]),
        np.array([1.0]),
        np.array([0.3]),
    )
    assert found.point.shape == (1,)
    assert found.point[0] == pytest.approx(max(goal, -1.0), abs=3e-3)
    assert found.algorithm == "LN_NELDERMEAD"


@pytest.mark.parametrize("n", [2, 3, 4, 5])
def test_a_minimum_in_the_corner_ends(n: int) -> None:
    """F36: some algorithms never meet a tolerance there; the number of evaluations is bounded."""
    found = minimise(lambda x: float(x.sum()), np.ones(n), np.zeros(n), 2 * np.ones(n), np.ones(n))
    np.testing.assert_allclose(found.point, 0.0, atol=1e-3)
    assert found.evaluations <= 300


def test_the_limit_of_evaluations_is_said() -> None:
    found = run(bowl, max_evaluations=7)
    assert found.evaluations == 7
    assert found.reason == "limit of evaluations"
    assert found.value < bowl(START)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf], ids=str)
def test_nothing_finite_at_all(bad: float) -> None:
    """F32: NLopt answers "success" with NaN or garbage; here the start comes back, and words."""
    found = run(lambda _x: bad)
    np.testing.assert_array_equal(found.point, START)
    assert found.value == np.inf
    assert found.reason == "no finite value was found"


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf], ids=str)
@pytest.mark.parametrize("n", [1, 2, 3])
def test_half_of_the_box_is_not_finite(bad: float, n: int) -> None:
    """F32: BOBYQA alone stops at 0.296, half the way; the guard turns it back."""
    goal = np.full(n, 0.3)

    def halved(x: Array) -> float:
        return bad if x[0] < 0.1 else float(((x - goal) ** 2).sum())

    found = minimise(
        halved, np.full(n, 1.5), np.full(n, -2.0), np.full(n, 2.0), np.full(n, 0.5), xtol=1e-4
    )
    assert np.isfinite(found.value)
    np.testing.assert_allclose(found.point, goal, atol=0.03)
    assert found.value < 1e-3  # from 1.44 n at the start


def test_a_start_that_is_not_finite() -> None:
    found = run(lambda x: np.nan if np.array_equal(x, START) else bowl(x))
    np.testing.assert_allclose(found.point, GOAL, atol=0.05)


@pytest.mark.parametrize("outside", [[9.0, -9.0], [2.0 + 1e-9, 0.0], [-np.inf, np.inf]])
def test_a_start_outside_the_bounds(outside: list[float]) -> None:
    """F37: NLopt's answer to it is an error without a message."""
    objective, seen = recorded(bowl)
    found = run(objective, start=np.array(outside))
    np.testing.assert_array_equal(seen[0], np.clip(outside, LOW, HIGH))
    np.testing.assert_allclose(found.point, GOAL, atol=3e-3)


def test_no_point_outside_the_bounds_is_tried() -> None:
    objective, seen = recorded(lambda x: -float(np.abs(x).sum()))
    found = run(objective)
    assert (np.array(seen) >= LOW).all()
    assert (np.array(seen) <= HIGH).all()
    np.testing.assert_allclose(np.abs(found.point), 2.0, atol=1e-3)


def test_a_step_wider_than_the_box() -> None:
    found = run(bowl, step=np.array([50.0, 50.0]))
    np.testing.assert_allclose(found.point, GOAL, atol=3e-3)


@pytest.mark.parametrize(
    "value",
    [np.float32(2.5), np.array(2.5), np.array([2.5]), True, 3, "2.5"],
    ids=lambda v: type(v).__name__,
)
def test_any_number_is_a_value(value: Any) -> None:
    """F34: NLopt wants a Python float and nothing else."""
    if isinstance(value, np.ndarray) and value.ndim:
        value = value[0]
    assert run(lambda _x: value).value == float(value)


@pytest.mark.parametrize("answer", [None, "nonsense", [1.0, 2.0], 1j], ids=str)
def test_no_number_is_an_error_of_the_objective(answer: Any) -> None:
    with pytest.raises((TypeError, ValueError)):
        run(lambda _x: answer)


class Stop(BaseException):
    """Like KeyboardInterrupt, no Exception."""


@pytest.mark.parametrize("error", [ValueError("no"), KeyboardInterrupt(), Stop(), MemoryError()])
@pytest.mark.parametrize("after", [0, 5])
def test_an_exception_is_raised_as_it_is_and_at_once(error: BaseException, after: int) -> None:
    """F35: global algorithms make a SystemError of it, others go on for a while."""
    calls = 0

    def fails(x: Array) -> float:
        nonlocal calls
        calls += 1
        if calls > after:
            raise error
        return bowl(x)

    with pytest.raises(type(error)) as caught:
        run(fails)
    assert caught.value is error
    assert calls == after + 1


def test_an_objective_that_writes_into_its_argument() -> None:
    def vandal(x: Array) -> float:
        value = bowl(x)
        x[:] = np.nan
        return value

    found = run(vandal)
    np.testing.assert_allclose(found.point, GOAL, atol=3e-3)


class Failing:
    """In the place of `nlopt.opt`: tries a few points, then fails as NLopt does."""

    error: BaseException = nlopt.RoundoffLimited()

    def __init__(self, algorithm: int, n: int) -> None:
        self._n = n

    def __getattr__(self, name: str) -> Any:
        return lambda *_arguments: None

    def set_min_objective(self, objective: Callable[[Array, Array], float]) -> None:
        self._objective = objective

    def optimize(self, start: Array) -> Array:
        for k in range(3):
            self._objective(start + k * (GOAL - start) / 2, np.zeros(0))
        raise self.error


@pytest.mark.parametrize(
    ("error", "reason"),
    [
        (nlopt.RoundoffLimited(), "limited by rounding"),
        (RuntimeError("nlopt failure"), "NLopt: nlopt failure"),
        (nlopt.invalid_argument(""), "NLopt: invalid_argument"),
        (SystemError("returned a result with an exception set"), "NLopt: returned a result"),
        (nlopt.ForcedStop(), "NLopt: ForcedStop"),
    ],
    ids=lambda v: type(v).__name__ if isinstance(v, BaseException) else "",
)
def test_the_best_point_survives_what_nlopt_raises(
    monkeypatch: pytest.MonkeyPatch, error: BaseException, reason: str
) -> None:
    """F31: the exception loses the point (stevengj/nlopt#513); the objective has kept it."""
    monkeypatch.setattr(Failing, "error", error)
    monkeypatch.setattr(nlopt, "opt", Failing)
    found = run(bowl)
    np.testing.assert_allclose(found.point, GOAL, rtol=1e-15)
    assert found.value == pytest.approx(1.0)
    assert found.evaluations == 3
    assert found.reason.startswith(reason)


def test_rounding_ends_a_search_without_tolerances() -> None:
    """The real thing: with no tolerance to meet, BOBYQA ends at the rounding of the value."""
    found = run(bowl, xtol=0.0, ftol_rel=0.0, max_evaluations=5000)
    np.testing.assert_allclose(found.point, GOAL, atol=1e-6)
    assert found.reason


def test_every_good_result_has_words() -> None:
    """A new NLopt with another result code must not come out as "unknown"."""
    codes = {
        getattr(nlopt, name)
        for name in ("SUCCESS", "STOPVAL_REACHED", "FTOL_REACHED", "XTOL_REACHED")
    } | {nlopt.MAXEVAL_REACHED, nlopt.MAXTIME_REACHED}
    assert set(REASONS) == codes


def test_the_same_search_twice() -> None:
    first, second = run(bowl), run(bowl)
    assert first.point.tobytes() == second.point.tobytes()
    assert (first.value, first.evaluations) == (second.value, second.evaluations)
