"""Whether posteriors are calibrated, and whether the measure of that would tell if not."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from benchmarks.calibration import (
    CASES,
    bins_for,
    calibrate,
    chi_square,
    judge,
    line,
    rank,
    summarise,
)
from benchmarks.long_runs import KeptRows
from lobefit.fitting.space import Space
from lobefit.kernels import candidate

Array = npt.NDArray[np.float64]
DRAWS = 63


def test_the_rank_is_the_number_of_draws_below() -> None:
    rng = np.random.default_rng(1)
    draws = np.array([3.0, 1.0, 2.0])
    assert [rank(x, draws, rng) for x in (0.5, 1.5, 2.5, 9.0)] == [0, 1, 2, 3]
    # On a bound draws and truth may be equal: then every place among them is as likely.
    tied = [rank(0.0, np.zeros(3), rng) for _ in range(4000)]
    np.testing.assert_allclose(np.bincount(tied, minlength=4) / 4000, 0.25, atol=0.03)


def test_chi_square_of_known_counts() -> None:
    assert chi_square(list(range(64)) * 4, DRAWS, 16) == 0.0
    # All 256 in one of 16 bins: (256 - 16)^2 / 16 + 15 * 16.
    assert chi_square([0] * 256, DRAWS, 16) == pytest.approx(3840.0)
    # Ranks from 4 k to 4 k + 3 share a bin; the last one is of the largest rank.
    assert chi_square([3, 60], DRAWS, 16) == chi_square([0, 63], DRAWS, 16) == pytest.approx(14.0)


def test_the_line_allows_for_the_number_of_tests() -> None:
    assert line(1, 16) == pytest.approx(30.6, abs=0.05)
    assert line(32, 16) == pytest.approx(41.1, abs=0.05)


def test_few_simulations_have_fewer_bins() -> None:
    assert [bins_for(n, 63) for n in (256, 80, 79, 40, 20, 10, 3)] == [16, 16, 8, 8, 4, 2, 1]
    assert bins_for(256, 99) == 4  # 16 and 8 do not divide 100


def conjugate(sampler: Callable[[float, float], tuple[float, float]]) -> dict[str, Any]:
    """Calibrate a sampler of a normal mean, whose posterior is known, in 1000 simulations."""
    rng = np.random.default_rng(5)
    rows = []
    for number in range(1000):
        truth = float(rng.standard_normal())
        data = truth + 0.7 * float(rng.standard_normal())
        mean, sd = sampler(data / (1.0 + 0.49), float(np.sqrt(0.49 / 1.49)))
        picked = mean + sd * rng.standard_normal(DRAWS)
        chain = mean + sd * rng.standard_normal(2000)
        ends = [np.quantile(chain, [0.5 - 0.5 * c, 0.5 + 0.5 * c]) for c in (0.5, 0.9)]
        rows.append(
            {
                "number": number,
                "labels": ["mean"],
                "ranks": [rank(truth, picked, rng)],
                "inside": [[bool(a <= truth <= b) for a, b in ends]],
                "bound": [],
                "converged": True,
                "effective": 2000.0,
                "misfit": False,
                "seconds": 0.0,
            }
        )
    return summarise(rows, DRAWS)


def verdict(summary: dict[str, Any], label: str, tests: int = 1) -> list[str]:
    limit = line(tests, summary["bins"])
    return judge(summary["parameters"][label], summary["simulations"], limit)


def test_an_exact_posterior_passes() -> None:
    assert verdict(conjugate(lambda mean, sd: (mean, sd)), "mean") == []


@pytest.mark.parametrize(
    ("sampler", "expected"),
    [
        (lambda mean, sd: (mean, 0.7 * sd), ["chi-square", "50% interval", "90% interval"]),
        (lambda mean, sd: (mean, 1.4 * sd), ["chi-square", "50% interval", "90% interval"]),
        (lambda mean, sd: (mean - 0.4 * sd, sd), ["chi-square"]),
    ],
    ids=["too narrow", "too wide", "too low"],
)
def test_wrong_posteriors_fail(
    sampler: Callable[[float, float], tuple[float, float]], expected: list[str]
) -> None:
    summary = conjugate(sampler)
    assert set(expected) <= set(verdict(summary, "mean"))


def test_a_posterior_too_low_has_high_ranks() -> None:
    assert conjugate(lambda mean, sd: (mean - 0.4 * sd, sd))["parameters"]["mean"]["z"] > 5.0


@pytest.mark.parametrize("name", CASES)
def test_truths_are_drawn_from_the_priors_of_the_sampler(name: str) -> None:
    case = CASES[name]
    space = Space(candidate(case.model), ("brdf",), noise=case.noise, priors=case.priors)
    drawn = space.draw(np.random.default_rng(2), 2000)
    assert np.isfinite(space.log_density(drawn)).all()
    for label, prior in case.priors.items():
        found = drawn[:, space.labels.index(label)]
        low, high = prior.support
        assert low <= found.min() < 1.1 * low
        assert 0.9 * high < found.max() <= high


def test_rows_that_are_there_are_not_made_again() -> None:
    rows = [{"case": "lambert", "number": k} for k in range(3)]
    assert calibrate(["lambert"], 2, done=rows, processes=1) == rows[:2]


def test_a_run_goes_on_from_the_rows_it_kept(tmp_path: Path) -> None:
    file, settings = tmp_path / "rows.jsonl", {"draws": 63}
    first = KeptRows(file, settings, resume=True)
    assert first.before == []
    first.add({"case": "a", "number": 0})
    first.add({"case": "b", "number": 0})
    with file.open("a") as torn:
        torn.write('{"draws": 63, "case": "a", "num')
    again = KeptRows(file, settings, resume=True)
    assert again.before == [{"case": "a", "number": 0}, {"case": "b", "number": 0}]
    again.add({"case": "a", "number": 1})  # on a line of its own, though the last one was torn
    assert len(KeptRows(file, settings, resume=True).before) == 3
    again.finish(row for row in again.before if row["case"] == "b")
    assert KeptRows(file, settings, resume=True).before == [{"case": "b", "number": 0}]
    assert KeptRows(file, {"draws": 7}, resume=True).before == []
    again.finish()
    assert not file.exists()


def calibrated(simulations: int, kind: str | None = None) -> dict[str, Any]:
    # 600 steps are enough for one parameter; a wrong sampler may never find its chain long enough.
    rows = calibrate(["lambert"], simulations, DRAWS, 2, kind, 600)
    return summarise(rows, DRAWS)


@pytest.mark.slow
def test_posteriors_are_calibrated() -> None:
    """40 simulations in 8 bins: a coarse test, of which the benchmark is the fine one."""
    summary = calibrated(40)
    assert not summary["failed"]
    assert not summary["not_converged"]
    assert verdict(summary, "k_d") == []


@pytest.mark.slow
def test_a_dropped_jacobian_is_found_out() -> None:
    """Log(k_d) without its Jacobian: far too much of the posterior lies near 0."""
    summary = calibrated(20, "jacobian")
    assert summary["bins"] == 4
    assert "chi-square" in verdict(summary, "k_d")
    assert summary["parameters"]["k_d"]["z"] > 3.0
