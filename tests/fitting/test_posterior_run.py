"""Sampling densities that are known: what goes right, and the ways in which it goes wrong."""

from __future__ import annotations

import itertools
import signal
import subprocess
import sys
import textwrap
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

from lobefit.fitting.chain_file import ChainFile
from lobefit.fitting.laplace import Laplace, laplace, starts
from lobefit.fitting.moves import Proposal
from lobefit.fitting.sampler import Outcome, SamplingProgress, autocorrelation_times, judge, run
from lobefit.kernels import FitError

Array = npt.NDArray[np.float64]
Density = Callable[[Array], Array]

SHAPE = (4, 32)
SETTINGS = {"measurement": "none"}


def normal(covariance: Array) -> Density:
    precision = np.linalg.inv(covariance)
    return lambda q: -0.5 * np.einsum("wi,ij,wj->w", q, precision, q)


def correlated(n: int, rho: float = 0.99) -> Array:
    """Give a covariance whose axes have sizes from 1e-3 to 1 and that is nearly degenerate."""
    size = np.geomspace(1e-3, 1.0, n)
    return np.outer(size, size) * (rho + (1.0 - rho) * np.eye(n))


def sampled(
    density: Density,
    approximation: Laplace,
    chain: ChainFile,
    *,
    seed: int = 1,
    max_steps: int = 4000,
    max_seconds: float | None = None,
    progress: Callable[[SamplingProgress], None] | None = None,
) -> Outcome:
    n = len(approximation.mode)
    return run(
        density,
        approximation,
        lambda random: starts(density, approximation, SHAPE, random),
        chain,
        shape=SHAPE,
        seed=seed,
        labels=tuple(f"q{k}" for k in range(n)),
        max_steps=max_steps,
        max_seconds=max_seconds,
        progress=progress,
    )


def chain_of(n: int, path: Path | None = None, steps: int = 4000, **changed: str) -> ChainFile:
    return ChainFile(path, {**SETTINGS, **changed}, SHAPE[0] * SHAPE[1], n, steps)


# The Laplace approximation


@pytest.mark.parametrize("n", [1, 3, 8])
def test_mode_and_covariance_of_a_normal(n: int) -> None:
    covariance = correlated(n)
    mode = np.linspace(1.0, 2.0, n)
    plain = normal(covariance)
    found = laplace(lambda q: plain(q - mode), mode + 0.02)
    assert found.converged
    np.testing.assert_allclose(found.mode, mode, atol=0.05 * np.sqrt(np.diag(covariance)).max())
    np.testing.assert_allclose(found.covariance, covariance, rtol=0.05)


def test_a_flat_direction_is_as_wide_as_a_prior_at_most() -> None:
    found = laplace(lambda q: -0.5 * 1e6 * q[:, 0] ** 2 + 0.0 * q[:, 1], np.zeros(2))
    assert np.sqrt(found.covariance[0, 0]) == pytest.approx(1e-3, rel=0.05)
    assert 3.0 < np.sqrt(found.covariance[1, 1]) <= 4.001


def test_a_start_that_cannot_be_is_told() -> None:
    with pytest.raises(FitError, match="not finite: nowhere to start from"):
        laplace(lambda q: np.full(len(q), -np.inf), np.zeros(2))


# Starts: F24 (degenerate walkers), F25 (dead walkers)


def test_walkers_start_finite_and_of_full_rank() -> None:
    def half(q: Array) -> Array:  # nothing at all on one side of the mode
        return np.where(q[:, 0] > -0.01, -0.5 * (q * q).sum(axis=1), -np.inf)

    approximation = laplace(half, np.full(3, 0.5))
    points, value = starts(half, approximation, SHAPE, np.random.RandomState(1))
    assert np.isfinite(value).all()
    for ensemble in points:
        offsets = ensemble - ensemble.mean(axis=0)
        assert np.linalg.cond(offsets / offsets.std(axis=0)) < 1e3


def test_degenerate_walkers_are_refused() -> None:
    flat = Laplace(np.zeros(2), np.array([[1.0, 0.0], [1.0, 0.0]]), 0.0, True)
    with pytest.raises(FitError, match="do not span"):
        starts(normal(np.eye(2)), flat, SHAPE, np.random.RandomState(1))


def test_nowhere_to_go_is_told() -> None:
    approximation = Laplace(np.zeros(2), np.eye(2), 0.0, True)
    with pytest.raises(FitError, match="no walkers with a finite"):
        starts(lambda q: np.full(len(q), -np.inf), approximation, SHAPE, np.random.RandomState(1))


# Proposals


def test_proposals_have_the_density_that_they_say() -> None:
    rng = np.random.RandomState(3)
    seen = np.stack([np.log(rng.chisquare(1, 40_000)), rng.standard_normal(40_000)], axis=1)
    seen[:, 1] += 0.5 * seen[:, 0]
    proposal = Proposal.of(seen.reshape(100, 4, 100, 2))
    drawn, said = proposal.draw(rng, 200_000)
    np.testing.assert_allclose(said, proposal.log_density(drawn), rtol=1e-6, atol=1e-6)
    # It integrates to the same everywhere: the share drawn over the share said is constant.
    cells, edges = [], [np.quantile(drawn[:, k], [0.02, 0.3, 0.6, 0.9]) for k in (0, 1)]
    for a, b in zip(edges[0], edges[0][1:], strict=False):
        for c, d in zip(edges[1], edges[1][1:], strict=False):
            inside = (drawn[:, 0] > a) & (drawn[:, 0] < b) & (drawn[:, 1] > c) & (drawn[:, 1] < d)
            x, y = np.meshgrid(np.linspace(a, b, 201), np.linspace(c, d, 201))
            points = np.stack([x.ravel(), y.ravel()], axis=1)
            mass = np.exp(proposal.log_density(points)).mean() * (b - a) * (d - c)
            cells.append(inside.mean() / mass)
    # 200,000 draws in nine cells: a per cent each, the grid another.
    np.testing.assert_allclose(cells, np.mean(cells), rtol=0.05)


# Known targets


def test_a_normal_is_sampled_right() -> None:
    covariance = correlated(6)
    density = normal(covariance)
    chain = chain_of(6)
    outcome = sampled(density, laplace(density, np.zeros(6)), chain)
    assert outcome.judgement.reasons == ()
    flat = chain.chain[outcome.warm_up : chain.iteration].reshape(-1, 6)
    size = np.sqrt(np.diag(covariance))
    # At least 128 * 50 independent draws.
    assert np.abs(flat.mean(axis=0) / size).max() < 5 / np.sqrt(6400)
    np.testing.assert_allclose(flat.std(axis=0), size, rtol=0.06)


def test_a_prior_that_hugs_its_boundary() -> None:
    """F30: exp(-theta / 0.01) at 0 in q = log(theta), with its Jacobian: a one-sided tail."""

    def density(q: Array) -> Array:
        return np.asarray((q - np.exp(np.minimum(q, 50.0)) / 0.01).sum(axis=1))

    chain = chain_of(1)
    outcome = sampled(density, laplace(density, np.full(1, -4.0)), chain)
    theta = np.exp(chain.chain[outcome.warm_up : chain.iteration])
    assert outcome.judgement.reasons == ()
    assert theta.mean() == pytest.approx(0.01, rel=0.05)
    assert theta.std() == pytest.approx(0.01, rel=0.1)
    # The same as plain stretch moves takes some 90 steps.
    assert outcome.judgement.tau[0] < 20


def test_modes_that_different_ensembles_found_are_weighed_right() -> None:
    """F28: narrow modes of weights 0.9 and 0.1, 20 sigma apart; the starts say 3 to 1."""
    n = 2

    def density(q: Array) -> Array:
        a = -0.5 * ((q - 10.0) ** 2).sum(axis=1) + np.log(0.9)
        b = -0.5 * ((q + 10.0) ** 2).sum(axis=1) + np.log(0.1)
        return np.asarray(np.logaddexp(a, b))

    def start(random: np.random.RandomState) -> tuple[Array, Array]:
        points = random.standard_normal((*SHAPE, n))
        points += np.array([10.0, 10.0, -10.0, 10.0])[:, None, None]
        return points, density(points.reshape(-1, n)).reshape(SHAPE)

    chain = chain_of(n)
    outcome = run(
        density,
        Laplace(np.full(n, 10.0), np.eye(n), 0.0, True),
        start,
        chain,
        shape=SHAPE,
        seed=1,
        labels=("a", "b"),
        max_steps=4000,
    )
    assert outcome.judgement.reasons == ()
    share = np.mean(chain.chain[outcome.warm_up : chain.iteration, :, 0] > 0.0)
    assert share == pytest.approx(0.9, abs=0.03)


def test_ensembles_that_disagree_are_reported() -> None:
    x = np.random.default_rng(1).standard_normal((600, 4, 32, 2))
    assert judge(x, autocorrelation_times(x[:500]), ("a", "b")).reasons == ()
    x[:, 2, :, 1] += 0.6  # one ensemble stays somewhere else
    said = judge(x, autocorrelation_times(x[:500]), ("a", "b")).reasons
    assert len(said) == 1
    assert said[0].startswith("the 4 ensembles disagree: R-hat of b is 1.")


def test_a_chain_too_short_says_so() -> None:
    """F27: fewer than 50 autocorrelation times are not enough."""
    density = normal(correlated(6))
    chain = chain_of(6)
    outcome = sampled(density, laplace(density, np.zeros(6)), chain, max_steps=400)
    assert any("fewer than 50 autocorrelation times" in r for r in outcome.judgement.reasons)
    assert "too few steps to tell whether" in outcome.judgement.reasons[1]
    still = np.full((200, 4, 32, 1), 2.0)
    assert (
        judge(still, autocorrelation_times(still[:100]), ("x",)).reasons[0]
        == "the walkers do not move in x"
    )
    with pytest.raises(FitError, match="within the warm-up of 352"):
        sampled(density, laplace(density, np.zeros(6)), chain_of(6), max_steps=300)


def test_the_clock_ends_a_run_and_it_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    density = normal(correlated(3))
    clock = itertools.count(0.0, 0.01)
    monkeypatch.setattr("lobefit.fitting.sampler.time.perf_counter", lambda: next(clock))
    chain = chain_of(3)
    outcome = sampled(density, laplace(density, np.zeros(3)), chain, max_seconds=3.0)
    assert outcome.by_clock
    assert 256 < chain.iteration < 320
    assert outcome.judgement.reasons


def test_progress_tells_where_it_stands() -> None:
    density = normal(correlated(3))
    said: list[SamplingProgress] = []

    def slow(q: Array) -> Array:
        time.sleep(0.0015)
        return density(q)

    sampled(slow, laplace(density, np.zeros(3)), chain_of(3), progress=said.append)
    assert [s.steps for s in said] == sorted(s.steps for s in said)
    assert 0.0 < said[-1].acceptance < 1.0
    assert said[-1].tau > 1.0
    assert said[-1].ess > 0.0
    assert said[-1].seconds_left >= 0.0


# Repeating and going on


def test_same_seed_same_chain() -> None:
    density = normal(correlated(3))
    approximation = laplace(density, np.zeros(3))
    chains = []
    for seed in (1, 1, 2):
        chain = chain_of(3)
        sampled(density, approximation, chain, seed=seed)
        chains.append(chain.get_chain())
    np.testing.assert_array_equal(chains[0], chains[1])
    assert not np.array_equal(chains[0][:50], chains[2][:50])


@pytest.mark.parametrize("after", [30, 150, 300])
def test_an_interrupted_run_goes_on_as_if_it_had_not_been(tmp_path: Path, after: int) -> None:
    density = normal(correlated(3))
    approximation = laplace(density, np.zeros(3))
    whole = chain_of(3)
    expected = sampled(density, approximation, whole)

    calls = 0

    def interrupted(q: Array) -> Array:
        nonlocal calls
        calls += 1
        if calls > 2 * after:
            raise KeyboardInterrupt
        return density(q)

    path = tmp_path / "chain.h5"
    with pytest.raises(KeyboardInterrupt):
        sampled(interrupted, approximation, chain_of(3, path))
    resumed = chain_of(3, path)
    # The first call is that of the start; nothing made is lost but the step in the making.
    assert after - 2 <= resumed.iteration <= after
    outcome = sampled(density, approximation, resumed)
    np.testing.assert_array_equal(resumed.get_chain(), whole.get_chain())
    np.testing.assert_array_equal(resumed.accepted, whole.accepted)
    np.testing.assert_array_equal(outcome.judgement.tau, expected.judgement.tau)
    # And once more from the finished file: nothing is left to do.
    again = chain_of(3, path)
    sampled(lambda q: pytest.fail("no step is left to make"), approximation, again)
    np.testing.assert_array_equal(again.get_chain(), whole.get_chain())


KILLED = """
import sys
from pathlib import Path
sys.path.insert(0, {root!r})
from tests.fitting.test_posterior_run import *
density = normal(correlated(3))
chain = chain_of(3, Path({path!r}), steps=10**5)
print(chain.iteration, flush=True)
n = 3
approximation = laplace(density, np.zeros(3))
run(density, approximation, lambda r: starts(density, approximation, SHAPE, r), chain,
    shape=SHAPE, seed=1, labels=("a", "b", "c"), max_steps=10**5, until=10**5)
"""


def test_a_killed_process_leaves_a_good_file(tmp_path: Path) -> None:
    """SIGKILL at any time: the file can be read, and has all but the steps of a second."""
    path = tmp_path / "chain.h5"
    script = textwrap.dedent(KILLED).format(root=str(Path(__file__).parents[2]), path=str(path))
    steps = [0]
    for delay in (0.013, 0.0, 0.029):
        process = subprocess.Popen(
            [sys.executable, "-c", script], stdout=subprocess.PIPE, text=True
        )
        assert process.stdout is not None
        assert int(process.stdout.readline()) == steps[-1]
        seen = path.stat().st_mtime_ns
        end = time.monotonic() + 60.0
        while path.stat().st_mtime_ns == seen and time.monotonic() < end:
            time.sleep(0.005)
        time.sleep(delay)
        process.send_signal(signal.SIGKILL)
        process.wait()
        process.stdout.close()
        steps.append(chain_of(3, path, steps=10**5).iteration)
    assert steps == sorted(steps)
    assert steps[-1] > 0
    density, chain = normal(correlated(3)), chain_of(3)
    sampled(density, laplace(density, np.zeros(3)), chain, max_steps=4000)
    made = min(steps[-1], chain.iteration)
    there = chain_of(3, path, steps=10**5)
    np.testing.assert_array_equal(there.chain[:made], chain.chain[:made])


def test_a_torn_end_of_the_file_is_no_harm(tmp_path: Path) -> None:
    import h5py

    path = tmp_path / "chain.h5"
    density = normal(correlated(3))
    sampled(density, laplace(density, np.zeros(3)), chain_of(3, path), max_steps=700)
    good = chain_of(3, path)
    with h5py.File(path, "r+") as file:
        newest = int(np.argmax(file["state"][:, 0]))
        file["state"][newest, 100:] = 7.0
        older = int(file["state"][1 - newest, 0])
    assert chain_of(3, path).iteration == older < good.iteration or older == 0


def test_files_of_other_runs_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "chain.h5"
    density = normal(correlated(3))
    sampled(density, laplace(density, np.zeros(3)), chain_of(3, path), max_steps=700)
    with pytest.raises(FitError, match="belongs to another run: its measurement is 'none', not"):
        chain_of(3, path, measurement="another")
    fresh = ChainFile(path, {"measurement": "another"}, 128, 3, 100, resume=False)
    assert fresh.iteration == 0
    other = tmp_path / "other.h5"
    other.write_text("no HDF5")
    with pytest.raises(FitError, match="cannot be read"):
        chain_of(3, other)
    with pytest.raises(FitError, match="cannot be written"):
        chain_of(3, tmp_path / "other.h5" / "chain.h5")
