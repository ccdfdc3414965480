"""The Pareto front of measured points: what it keeps, what it drops, and when two runs agree."""

from __future__ import annotations

from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lobefit.fitting.tradeoff import Chart
from lobefit.fitting.tradeoff_compare import compare
from lobefit.fitting.tradeoff_points import (
    SAME,
    Panel,
    Point,
    Spread,
    beats,
    contenders,
    front,
    within,
)
from lobefit.fitting.tradeoff_texts import answer, duration, finding
from lobefit.kernels import FitError

positive = st.floats(1e-6, 1e3)
runs = st.lists(positive, min_size=1, max_size=5)


def point(label: str, seconds: list[float], error: list[float], **more: object) -> Point:
    return Point(
        label=label,
        group="model",
        seconds=Spread(tuple(seconds)),
        error=Spread(tuple(error)),
        **more,  # type: ignore[arg-type]
    )


def points_of(drawn: list[tuple[list[float], list[float]]]) -> list[Point]:
    return [point(f"p{k}", seconds, error) for k, (seconds, error) in enumerate(drawn)]


clouds = st.lists(st.tuples(runs, runs), min_size=1, max_size=12).map(points_of)


def panel(points: list[Point]) -> Panel:
    return Panel(
        name="fit",
        title="",
        seconds_label="",
        error_label="",
        percent=True,
        points=tuple(points),
    )


def chart_of(points: list[Point], name: str = "a.csv") -> Chart:
    return Chart(
        name=name,
        tolerance=0.02,
        answer="",
        panels=(panel(points),),
        settings={"subject": {}},
        device="",
        versions={},
        seconds=0.0,
    )


@given(clouds)
@settings(max_examples=150, deadline=None)
def test_a_front_falls_and_whatever_is_off_it_has_a_reason(points: list[Point]) -> None:
    members, level = front(points), contenders(points)
    assert members
    assert set(members) <= set(level)
    for a, b in pairwise(members):
        assert points[a].seconds.median <= points[b].seconds.median
        assert points[b].error.median * (1 + SAME) < points[a].error.median
    for k, p in enumerate(points):
        if k not in level:
            # What beats it is a contender, or is beaten by one in turn.
            assert any(beats(q, p) for q in points)
        elif k not in members:
            better = [points[j] for j in members if points[j].seconds.median <= p.seconds.median]
            assert any(q.error.median <= p.error.median * (1 + SAME) for q in better)


@given(clouds)
@settings(max_examples=100, deadline=None)
def test_nothing_beats_itself_and_no_two_beat_each_other(points: list[Point]) -> None:
    for p in points:
        assert not beats(p, p)
        assert not any(beats(p, q) and beats(q, p) for q in points)


@given(clouds)
@settings(max_examples=100, deadline=None)
def test_a_chart_agrees_with_itself_whatever_the_clock_runs_at(points: list[Point]) -> None:
    slower = [point(p.label, [3 * s for s in p.seconds.runs], list(p.error.runs)) for p in points]
    (agreement,) = compare(chart_of(points), chart_of(slower))
    assert agreement.disputed == ()
    assert agreement.shared == agreement.first == agreement.second


def test_a_difference_within_the_spread_is_none() -> None:
    steady = point("steady", [1.0, 1.1, 1.2], [0.02])
    wide = point("wide", [0.9, 1.15, 1.4], [0.02])
    worse = point("worse", [1.0, 1.1, 1.2], [0.04])
    slow = point("slow", [3.0, 3.1, 3.2], [0.02])
    points = [steady, wide, worse, slow]
    assert [points[k].label for k in contenders(points)] == ["steady", "wide"]
    assert [points[k].label for k in front(points)] == ["steady"]


def test_errors_within_a_hundredth_are_the_same() -> None:
    points = [point("quick", [1.0], [0.0201]), point("slow", [5.0], [0.02])]
    assert front(points) == [0]


def test_a_front_that_is_elsewhere_is_disputed() -> None:
    first = [point("a", [1.0, 1.1], [0.02]), point("b", [2.0, 2.1], [0.02])]
    second = [point("a", [2.0, 2.1], [0.02]), point("b", [1.0, 1.1], [0.02])]
    (agreement,) = compare(chart_of(first), chart_of(second))
    assert agreement.disputed == (
        "a is beaten by b in the other run",
        "b is beaten by a in the other run",
    )
    assert "DISAGREE" in str(agreement)
    (one_only,) = compare(chart_of(first), chart_of(first[1:]))
    assert "a was not measured in the other run" in one_only.disputed


def test_charts_of_two_surfaces_are_not_compared() -> None:
    points = [point("a", [1.0], [0.02])]
    with pytest.raises(FitError, match=r"a\.csv and b\.csv, not of one surface"):
        compare(chart_of(points), chart_of(points, "b.csv"))


def test_the_answer_is_the_fastest_within_the_tolerance() -> None:
    points = [
        point("quick", [0.01], [0.3]),
        point("right", [0.04], [0.018]),
        point("best", [0.4], [0.010]),
    ]
    assert within(points, 0.02) is points[1]
    assert answer(panel(points), 0.02) == "You asked for 2 %: right, 40 ms (error 1.8 %)."
    said = answer(panel(points), 0.001)
    assert (
        said == "You asked for 0.1 %: nothing comes so near; the nearest is best with 1 %, 400 ms."
    )
    near = answer(panel([point("near", [1.0], [0.020004])]), 0.02)
    assert "near with 2.0004 %" in near  # not "2 %", which was asked for


def test_an_error_that_is_mostly_noise_is_called_so() -> None:
    only = panel([point("near", [1.0], [0.0204])])
    assert answer(only, 0.02, 0.02).endswith("The noise of the held-out readings alone is 2 %.")
    for little in (None, 0.0, 0.009):
        assert "noise" not in answer(only, 0.02, little)
    assert "noise" not in answer(only, 0.03, 0.02)


def test_a_finding_compares_with_the_usual() -> None:
    usual = point("ggx", [0.06], [0.0230], usual=True)
    quarter = point("ggx, every 4th angle", [0.01], [0.0234])
    rough = point("lambert", [0.005], [0.5], usual=True)
    said = finding(panel([usual, quarter, rough]))
    assert said == (
        "ggx, every 4th angle is 6 times faster than ggx (10 ms instead of 60 ms) and worse "
        "(error 2.34 % instead of 2.3 %)."
    )
    as_good = point("ggx, every 2nd angle", [0.011], [0.0230])
    assert finding(panel([usual, quarter, rough, as_good])).startswith(
        "ggx, every 2nd angle is 5.5 times faster than ggx (11 ms instead of 60 ms) and as good"
    )
    said = finding(panel([usual, rough]))
    assert said.startswith("Keep ggx (60 ms, error 2.3 %): the best of what is faster, lambert")
    assert finding(panel([usual])) == "Nothing measured is faster than ggx (60 ms)."


@pytest.mark.parametrize(
    ("seconds", "text"),
    [(12.34, "12.3 s"), (0.04, "40 ms"), (3.21e-5, "32.1 µs"), (4e-9, "4 ns"), (0.9999, "1 s")],
)
def test_times_are_written_with_their_unit(seconds: float, text: str) -> None:
    assert duration(seconds) == text
