"""Autocorrelation time, R-hat and effective samples: known processes, and ArviZ where it is there."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
import pytest

from lobefit.fitting.chains import (
    autocorrelation_time,
    bulk_ess,
    r_hat,
    rank_normalised,
    tail_ess,
)
from tests.fitting.processes import autoregressive

Array = npt.NDArray[np.float64]


@pytest.mark.parametrize("rho", [0.0, 0.5, 0.9])
def test_times_of_known_processes(rho: float) -> None:
    x = autoregressive(rho, 64, 2000)
    expected = (1 + rho) / (1 - rho)
    # 64 chains of 2,000 steps: a few per cent at 105 autocorrelation times each.
    time = autocorrelation_time(x.T.reshape(2000, 4, 16))
    assert time == pytest.approx(expected, rel=0.08)
    assert x.size / bulk_ess(x) == pytest.approx(expected, rel=0.08)


def test_anticorrelated_steps_count_more_than_once() -> None:
    x = autoregressive(-0.5, 16, 2000)
    assert bulk_ess(x) > 1.5 * x.size


def test_a_short_chain_is_not_taken_for_a_quick_one() -> None:
    """Walkers that have hardly moved differ from one another: their ensemble's mean shows it."""
    x = autoregressive(0.999, 64, 100)
    time = autocorrelation_time(x.T.reshape(100, 1, 64))
    # Per walker the estimate could be no more than some 20 steps; the truth is 1999.
    assert time > 60


def test_what_does_not_move_has_no_time() -> None:
    stuck = np.ones((100, 2, 8))
    assert math.isnan(autocorrelation_time(stuck))
    assert math.isnan(r_hat(np.ones((4, 100))))
    assert math.isnan(bulk_ess(np.ones((4, 100))))


def test_r_hat_sees_a_shift_and_a_scale() -> None:
    x = autoregressive(0.0, 4, 2000)
    assert r_hat(x) < 1.003
    shifted = x.copy()
    shifted[0] += 0.5
    assert r_hat(shifted) > 1.01
    scaled = x.copy()
    scaled[0] *= 2.0
    assert r_hat(scaled) > 1.01
    trend = x + np.linspace(0.0, 1.0, 2000)
    assert r_hat(trend) > 1.01


def test_ranks_of_any_distribution_become_normal() -> None:
    rng = np.random.default_rng(2)
    z = rank_normalised(rng.standard_cauchy((4, 5000)))
    assert abs(z.mean()) < 1e-3
    assert z.std() == pytest.approx(1.0, abs=1e-3)
    # Equal values share their rank.
    assert rank_normalised(np.array([1.0, 1.0, 2.0, 3.0]))[0] == pytest.approx(
        rank_normalised(np.array([1.0, 1.0, 2.0, 3.0]))[1]
    )


@pytest.mark.parametrize("rho", [0.0, 0.6, 0.95])
@pytest.mark.parametrize("steps", [500, 777])
def test_arviz_says_the_same(rho: float, steps: int) -> None:
    stats = pytest.importorskip("arviz_stats.base", reason="arviz-stats is not installed")
    ess, hat = stats.array_stats.ess, stats.array_stats.rhat
    x = np.exp(autoregressive(rho, 8, steps))
    kind = {"chain_axis": 0, "draw_axis": 1}
    assert bulk_ess(x) == pytest.approx(float(ess(x, method="bulk", **kind)), rel=1e-3)
    # Its quantiles are of another definition.
    tail = float(ess(x, method="tail", prob=(0.05, 0.95), **kind))
    assert tail_ess(x) == pytest.approx(tail, rel=0.05)
    assert r_hat(x) == pytest.approx(float(hat(x, method="rank", **kind)), rel=1e-6)
