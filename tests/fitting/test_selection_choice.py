"""The choice among candidates: what richer ones must earn, and how it is said."""

from __future__ import annotations

import json

import numpy as np
import numpy.typing as npt
import pytest

from lobefit.fitting import FitReport, Measurement, fit, simulate
from lobefit.fitting.document import to_json
from lobefit.fitting.selection import BIC_MARGIN, leaders, relative_change, simplest
from lobefit.kernels import FitError

Array = npt.NDArray[np.float64]

SCAN = "in-plane incidences=0,10,20,30,40,50,60,70 step=4"
PLAIN = {"k_d": 0.2, "F0": 0.3, "alpha": 0.25}
FEW = ["lambert", "ggx:k_s=1", "ggx", "student_t:k_s=1"]


# The rules


def blocks(*totals: float, scatter: float = 0.0) -> list[Array]:
    """Scores of eight blocks, the differences to the first scattered by so much."""
    ripple = scatter * np.array([1, -1] * 4)
    return [np.full(8, total / 8) + (ripple if k else 0.0) for k, total in enumerate(totals)]


def test_the_best_prediction_wins() -> None:
    assert simplest(blocks(0, 10), [3, 4], [100, 90]) == 1
    assert simplest(blocks(0, -10), [3, 4], [100, 90]) == 0


def test_within_one_standard_error_the_simpler_stays() -> None:
    error = 1.5 * np.sqrt(8) * np.sqrt(8 / 7)
    assert simplest(blocks(0, 0.99 * error, scatter=1.5), [3, 4], [100, 90]) == 0
    assert simplest(blocks(0, 1.01 * error, scatter=1.5), [3, 4], [100, 90]) == 1


def test_against_its_bic_a_richer_one_needs_two() -> None:
    error = 1.5 * np.sqrt(8) * np.sqrt(8 / 7)
    assert simplest(blocks(0, 1.9 * error, scatter=1.5), [3, 4], [90, 92]) == 0
    assert simplest(blocks(0, 2.1 * error, scatter=1.5), [3, 4], [90, 92]) == 1


def test_at_equal_size_and_prediction_the_better_score() -> None:
    assert simplest(blocks(0, 0.1, scatter=1), [3, 3], [100, 90]) == 1


def test_who_is_compared() -> None:
    sizes, scores = [3, 4, 1, 7, 3, 5], [100.0, 97.0, 118.0, 110.0, 104.0, 200.0]
    # The first; the better richer one and the simpler one; the richer one of worse score
    # only looks on, the one of equal size and the distant one are out.
    ranked = [0, 1, 4, 3, 2, 5]
    assert leaders(ranked, scores, sizes, BIC_MARGIN, 20.0) == ([0, 1, 2], [3])
    assert leaders([0], [1.0], [3], BIC_MARGIN, 20.0) == ([0], [])
    many = leaders(list(range(9)), [0.0] * 9, list(range(1, 10)), BIC_MARGIN, 20.0)
    assert many == ([0, 1, 2, 3], [])


def test_the_change_of_the_radiance() -> None:
    b = np.full((2, 40), 0.5)
    cosines, labels, there = np.ones(40), np.repeat([0, 1], 20), np.ones((2, 40), bool)
    assert relative_change(b, b, cosines, labels, there) == 0.0
    assert relative_change(1.02 * b, b, cosines, labels, there) == pytest.approx(0.02)
    a = b.copy()
    a[:, 20:] *= 1.02  # half of the incidences: as much as there, not half of it
    assert relative_change(a, b, cosines, labels, there) == pytest.approx(0.02)
    a[0, 20:] = b[0, 20:]
    assert relative_change(a, b, cosines, labels, there) == pytest.approx(0.02 / np.sqrt(2))
    there[:, 20:] = False
    assert relative_change(a, b, cosines, labels, there) == 0.0


def test_what_is_dark_does_not_matter() -> None:
    b = np.ones((1, 11))
    b[0, 10] = 1e-6
    a = b.copy()
    a[0, 10] = 3e-6
    zeros, there = np.zeros(11, int), np.ones((1, 11), bool)
    assert relative_change(a, b, np.ones(11), zeros, there) < 1e-4


# The choice


@pytest.fixture(scope="module")
def plain() -> FitReport:
    return fit(simulate("ggx:k_s=1", PLAIN, SCAN, (0.02, 1e-3), seed=1), FEW)


@pytest.fixture(scope="module")
def nearly() -> Measurement:
    """A surface whose k_s is 0.95: seen by a precise instrument, and hardly by an eye."""
    return simulate("ggx", {**PLAIN, "k_s": 0.95}, SCAN, (0.005, 1e-4), seed=2)


def test_the_simpler_model_where_it_is_true(plain: FitReport) -> None:
    choice = plain.choice
    assert plain.best.candidate == "ggx:k_s=1"
    assert choice is not None
    assert choice.sentence in plain.verdict
    assert choice.sentence.startswith(
        "Why ggx:k_s=1 (3 parameters): the next simpler, lambert (1),"
    )
    assert "; the next richer, " in choice.sentence
    assert choice.note == "8 angles of incidence"
    rivals = {entry.candidate: entry for entry in choice.left_out}
    assert rivals["ggx:k_s=1"].lead == 0.0
    assert len(rivals) >= 2
    for entry in rivals.values():
        assert len(entry.blocks) == 8
        assert entry.score == pytest.approx(sum(entry.blocks))
        assert entry.lead == pytest.approx(rivals["ggx:k_s=1"].score - entry.score)
        error = np.sqrt(8 * np.var(entry.blocks, ddof=1))
        assert entry.standard_error == pytest.approx(error)
    assert choice.changes["ggx:k_s=1"] == 0.0
    assert choice.changes["ggx"] < 0.01 < choice.changes["lambert"]


def test_the_richer_model_where_it_is_true() -> None:
    m = simulate("ggx", {**PLAIN, "k_s": 0.5}, SCAN, (0.02, 1e-3), seed=1)
    report = fit(m, FEW)
    assert report.best.candidate == "ggx"
    assert report.choice is not None
    assert "the next simpler, " in report.choice.sentence


def test_one_parameter_is_no_plural() -> None:
    report = fit(simulate("lambert", {"k_d": 0.3}, SCAN, (0.02, 1e-3), seed=1), FEW)
    assert report.choice is not None
    assert report.choice.sentence.startswith(
        "Why lambert (1 parameter): nothing simpler was fitted"
    )


def test_a_richer_model_must_matter(nearly: Measurement) -> None:
    exact, tolerant = fit(nearly, FEW), fit(nearly, FEW, tolerance=0.02)
    assert exact.best.candidate == "ggx"
    assert tolerant.best.candidate == "ggx:k_s=1"
    assert tolerant.choice is not None
    assert tolerant.choice.by == "tolerance"
    change = tolerant.choice.changes["ggx"]
    assert 0 < change < 0.02
    said = (
        f"changes the predicted radiance by {100 * change:.2g} % at most, less than the tolerance"
    )
    assert said in tolerant.verdict
    assert "the next richer, ggx (4)," in tolerant.verdict
    strict = fit(nearly, FEW, tolerance=0.2 * change)
    assert strict.best.candidate == "ggx"
    assert [r.candidate for r in tolerant.results].count("ggx:k_s=1") == 1


def test_a_surface_that_no_candidate_describes() -> None:
    """Two lobes, fitted with one: what is left out is predicted badly, and it is said."""
    params = {"k_d": 0.1, "k_s_1": 0.3, "F0_1": 0.5, "alpha_1": 0.05}
    params |= {"k_s_2": 0.5, "F0_2": 0.3, "alpha_2": 0.5}
    m = simulate("ggx+ggx", params, SCAN, (0.005, 1e-4), seed=3)
    report = fit(m, ["lambert", "ggx:k_s=1", "ggx", "ggx+ggx"])
    assert report.best.candidate == "ggx+ggx"
    assert report.choice is not None
    assert report.choice.sentence.endswith("nothing richer was fitted.")
    less = fit(m, ["ggx:k_s=1", "ggx", "blinn_phong"])
    assert less.best.diagnostics.misfit_limited
    assert less.choice is not None
    assert less.choice.sentence in less.verdict


def test_without_a_likelihood_the_rms_decides() -> None:
    m = simulate("ggx:k_s=1", PLAIN, SCAN, (0.02, 1e-6), seed=1)
    report = fit(m, FEW, metric="log")
    assert report.best.candidate == "ggx:k_s=1"
    assert report.choice is not None
    assert "% in rms" in report.choice.sentence
    assert "BIC" not in report.choice.sentence
    chosen = next(e for e in report.choice.left_out if e.candidate == "ggx:k_s=1")
    # The noise is 2 % of the value; what is predicted scatters by as much and a little more.
    assert chosen.score == pytest.approx(0.02, rel=0.15)


def test_one_candidate_is_no_choice(nearly: Measurement) -> None:
    report = fit(nearly, "ggx")
    assert report.choice is not None
    assert report.choice.sentence == ""
    assert report.choice.left_out == ()


def test_the_document_has_the_choice(plain: FitReport) -> None:
    assert plain.choice is not None
    document = json.loads(to_json(plain.to_dict()))
    assert document["choice"]["sentence"] == plain.choice.sentence
    assert document["choice"]["note"] == "8 angles of incidence"
    assert len(document["choice"]["left_out"][0]["blocks"]) == 8
    assert document["settings"]["tolerance"] is None


@pytest.mark.parametrize("tolerance", [-0.01, float("nan"), float("inf")])
def test_a_tolerance_is_a_relative_error(nearly: Measurement, tolerance: float) -> None:
    with pytest.raises(FitError, match="tolerance is a relative error"):
        fit(nearly, FEW, tolerance=tolerance)
