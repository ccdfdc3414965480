"""Charts of speed against accuracy: what is run, what is scored, what is said."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lobefit.fitting import SearchSettings, fit, simulate, tradeoff_arithmetic
from lobefit.fitting.measurement import Measurement
from lobefit.fitting.search import ALGORITHMS, USUAL
from lobefit.fitting.tradeoff import Chart, chart
from lobefit.fitting.tradeoff_arithmetic import arithmetic_panel
from lobefit.fitting.tradeoff_fits import FitChoice, variations
from lobefit.fitting.tradeoff_posterior import quantile_error
from lobefit.fitting.tradeoff_subject import every, held_out, simulated
from lobefit.fitting.tradeoff_texts import functions
from lobefit.fitting.tradeoff_timing import interleaved
from lobefit.kernels import (
    DeviceError,
    FitError,
    MeasurementError,
    candidate,
    evaluate,
    get_device,
)
from lobefit.kernels.arithmetic import Arithmetic, ArithmeticDevice, arithmetics

TRUTH = {"k_d": 0.1, "F0": 0.5, "alpha": 0.3}
SCAN = "in-plane incidences=0,10,20,30,40,50,60,70 step=10"


def clock_of(step: float) -> Callable[[], float]:
    now = [0.0]

    def clock() -> float:
        now[0] += step
        return now[0]

    return clock


@pytest.fixture(scope="module")
def small() -> Measurement:
    return simulate("ggx:k_s=1", TRUTH, SCAN, noise=(0.01, 1e-4), seed=3)


@pytest.fixture(scope="module")
def made() -> Chart:
    """Few models of few pieces: most of the time goes into compiling them."""
    scan = simulate("blinn_phong", {"k_d": 0.2, "k_s": 0.1, "n": 20.0}, SCAN, (0.01, 1e-4), seed=3)
    return chart(
        held_out(scan),
        models=["lambert", "blinn_phong"],
        tolerance=0.05,
        groups=["fit", "albedo"],
        repeats=2,
        clock=clock_of(0.25),
    )


def test_every_second_incidence_is_held_out(small: Measurement) -> None:
    subject = held_out(small)
    kept, out = (np.unique(np.degrees(m.theta_i).round()) for m in (subject.train, subject.test))
    assert kept.tolist() == [0, 20, 40, 60]
    assert out.tolist() == [10, 30, 50, 70]
    assert "4 held-out incidences of 8" in subject.note


def test_few_incidences_are_cut_in_ranges_and_it_is_said() -> None:
    m = simulate("lambert", {"k_d": 0.3}, "in-plane incidences=20,50 step=5")
    subject = held_out(m)
    assert "contiguous ranges of theta_o" in subject.note
    assert subject.train.n_directions + subject.test.n_directions == m.n_directions


def test_too_little_to_hold_back_is_an_error() -> None:
    m = simulate("lambert", {"k_d": 0.3}, "in-plane incidences=20 step=60")
    with pytest.raises(MeasurementError, match="too small to keep a part of it back"):
        held_out(m.select([0]))


def test_a_truth_without_noise_is_what_it_says() -> None:
    subject = simulated("ggx:k_s=1", TRUTH, geometry=SCAN, noise=(0.05, 0.0), seed=1)
    assert subject.error(subject.test.values) == 0.0
    assert subject.error(1.1 * subject.test.values) == pytest.approx(0.1, rel=0.05)
    assert "scored against the truth" in subject.note


def test_the_noise_of_readings_is_the_error_of_the_truth(small: Measurement) -> None:
    subject = held_out(small)
    found = subject.noise(fit(subject.train, ["ggx:k_s=1"]).best)
    truth = evaluate("ggx", {**TRUTH, "k_s": 1.0}, *subject.angles)
    # 36 readings: their scatter is known to 1/sqrt(72) = 12 %, and so is the noise that was found.
    assert found == pytest.approx(subject.error(truth), rel=0.4)
    exact = simulated("ggx:k_s=1", TRUTH, geometry=SCAN, noise=(0.05, 0.0), seed=1)
    misfit = fit(subject.train, ["lambert"]).best
    assert exact.noise(misfit) == 0.0
    assert subject.noise(misfit) is None


@pytest.mark.parametrize("step", [2, 4])
def test_fewer_angles_of_every_incidence_are_kept(small: Measurement, step: int) -> None:
    thinned = every(small, step)
    assert thinned is not None
    assert thinned.n_directions == pytest.approx(small.n_directions / step, rel=0.1)
    assert len(thinned.distinct_incidences()) == len(small.distinct_incidences())
    assert every(small, 100) is None


def test_a_chart_names_what_was_asked_for(made: Chart) -> None:
    assert made.answer.startswith("You asked for 5 %: blinn_phong")
    assert made.answer.endswith(").")
    assert [p.name for p in made.panels] == ["fit", "albedo"]
    assert all(p.finding.endswith(".") for p in made.panels)


def test_each_kind_of_choice_was_run(made: Chart) -> None:
    panel = made.panels[0]
    groups = {p.group for p in panel.points}
    assert groups == {"model", "metric", "data", "scan", "algorithm", "tolerance"}
    labels = [p.label for p in panel.points]
    assert len(set(labels)) == len(labels)
    # The stubbed clock makes one step within each run.
    assert {r for p in panel.points for r in p.seconds.runs} == {0.25}
    searched = [p for p in panel.points if p.label.startswith("blinn_phong")]
    for p in searched:
        if p.group == "algorithm":
            run = ALGORITHMS[p.settings["search"]["algorithm"]]
            assert f"NLopt {run} " in p.detail["algorithm"]
    nodes = {p.label: int(p.detail["algorithm"].split()[2]) for p in searched if p.group == "scan"}
    assert nodes["blinn_phong, scan x 0.25"] < nodes["blinn_phong, scan x 2"]
    rows = {p.settings["every"]: p.detail["directions"] for p in searched}
    assert rows[1] > 1.8 * rows[2] > 3.2 * rows[4]


def test_options_that_a_variant_does_not_hold_are_varied() -> None:
    base = FitChoice("ggx:k_s=1", "model", candidate("ggx:k_s=1"), "relative")
    options = [c.label for c in variations(base) if c.group == "option"]
    assert "ggx:k_s=1, masking=v_cavity" in options
    assert "ggx:k_s=1, fresnel=none" in options
    held = FitChoice("ggx:f82", "model", candidate("ggx:f82"), "relative")
    assert not [c for c in variations(held) if "fresnel" in c.label]


def test_more_nodes_are_nearer(made: Chart) -> None:
    errors = {p.label: p.error.median for p in made.panels[1].points}
    assert errors["order 8 x 256 azimuths (usual)"] < 1e-6 < errors["order 2 x 16 azimuths"]


def test_precision_and_functions_cost_what_they_should(monkeypatch: pytest.MonkeyPatch) -> None:
    device = get_device()
    usual = {p: device.width(p) for p in ("double", "single")}
    few = [
        Arithmetic("double", usual["double"]),
        Arithmetic("single", usual["single"]),
        Arithmetic("double", usual["double"], "polynomial"),
        Arithmetic("single", usual["single"], "native"),
    ]
    assert set(few) < set(arithmetics(device))
    monkeypatch.setattr(tradeoff_arithmetic, "arithmetics", lambda _device: few)
    panel = arithmetic_panel(["lambert", "blinn_phong"], device, repeats=2, clock=clock_of(0.1))
    assert panel.title == "How to evaluate blinn_phong"
    exact, single, polynomial, native = (p.error.median for p in panel.points)
    assert exact == 2.0**-53
    assert 1e-12 < polynomial < 1e-7
    assert 1e-8 < single < 1e-5
    assert 1e-8 < native < 1e-3
    said = functions(panel)  # the stubbed clock finds all equally fast
    assert said.startswith("A cheaper exp and log buys nothing worth having (speed against")


def test_a_chart_is_written_and_read_back(made: Chart, tmp_path: Path) -> None:
    written = made.save(tmp_path)
    assert written["chart"].read_bytes().startswith(b"\x89PNG")
    document = json.loads(written["json"].read_text(encoding="utf-8"))
    back = Chart.from_dict(document)
    assert back.to_dict() == document
    assert document["versions"]["nlopt"]
    assert document["panels"][0]["front"]
    point = document["panels"][0]["points"][0]
    assert point["settings"]["candidate"] == "lambert"
    assert point["seconds"]["runs"]


@pytest.mark.parametrize("broken", [{}, {"schema": "lobefit.chart/1"}, []])
def test_what_is_no_chart_is_refused(broken: dict[str, str]) -> None:
    with pytest.raises(FitError, match=r"no chart|damaged"):
        Chart.from_dict(broken)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"groups": ["colour"]}, "there is no group 'colour'"),
        ({"tolerance": 0.0}, "tolerance is a relative error"),
        ({"tolerance": float("nan")}, "tolerance is a relative error"),
        ({"repeats": 0}, "one run at least"),
    ],
)
def test_bad_settings_are_refused(
    small: Measurement, wrong: dict[str, float], message: str
) -> None:
    with pytest.raises(FitError, match=message):
        chart(held_out(small), models="lambert", **wrong)  # type: ignore[arg-type]


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_every_algorithm_runs_and_finds_the_same(algorithm: str, small: Measurement) -> None:
    usual = fit(small, "blinn_phong").best
    found = fit(small, "blinn_phong", search=SearchSettings(algorithm=algorithm)).best
    ran = SearchSettings(algorithm=algorithm).run(1)
    assert f"NLopt {ran} from" in found.stop.algorithm
    assert found.params["n"] == pytest.approx(usual.params["n"], rel=5e-3)


def test_the_usual_search_is_what_it_was() -> None:
    assert USUAL.tolerance / 20.0 == 1e-4
    assert (USUAL.run(1), USUAL.run(2)) == ("LN_NELDERMEAD", "LN_BOBYQA")


@pytest.mark.parametrize(
    "wrong",
    [
        {"algorithm": "Newton"},
        {"tolerance": 0.0},
        {"scan_density": -1.0},
        {"max_evaluations": 0},
        {"tolerance": float("nan")},
    ],
)
def test_a_search_that_cannot_be_is_refused(wrong: dict[str, str]) -> None:
    with pytest.raises(FitError, match="search"):
        SearchSettings(**wrong)  # type: ignore[arg-type]


@given(st.integers(1, 4), st.integers(1, 6))
@settings(max_examples=30, deadline=None)
def test_tasks_are_timed_turn_by_turn(count: int, repeats: int) -> None:
    order: list[int] = []
    tasks = [lambda k=k: order.append(k) for k in range(count)]
    times = interleaved(tasks, repeats, clock_of(0.001))
    assert [len(t) for t in times] == [repeats] * count
    assert order[:count] == list(range(count))
    if repeats > 1:
        assert order[count : 2 * count] == list(range(count))[::-1]


def test_slow_tasks_are_timed_once() -> None:
    assert interleaved([lambda: None], 5, clock_of(2.0)) == [(2.0,)]


def test_quantiles_are_off_by_what_they_were_moved() -> None:
    draws = np.random.default_rng(1).normal(size=(4000, 3))
    assert quantile_error(draws, draws) == 0.0
    assert quantile_error(draws + 0.5 * draws.std(axis=0), draws) == pytest.approx(0.5)


@pytest.mark.parametrize(
    "wrong",
    [
        Arithmetic("double", 8),
        Arithmetic("single", 3),
        Arithmetic("double", 4, "native"),
        Arithmetic("single", 8, "lookup"),
    ],
)
def test_an_arithmetic_that_cannot_be_is_refused(wrong: Arithmetic) -> None:
    with pytest.raises(DeviceError, match="no "):
        ArithmeticDevice(get_device(), wrong)
