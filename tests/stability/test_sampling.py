"""F24 to F30: what emcee does by itself, and how Lobefit samples."""

from __future__ import annotations

import warnings
from collections.abc import Callable

import emcee
import numpy as np
import pytest

from lobefit.fitting import fit, simulate
from lobefit.fitting.chain_file import ChainFile
from lobefit.fitting.laplace import laplace, starts
from lobefit.fitting.likelihood import Density
from lobefit.fitting.sample import sample
from lobefit.fitting.sampler import Outcome, autocorrelation_times, judge, run
from lobefit.fitting.space import Space
from lobefit.fitting.transforms import Transforms, Way
from lobefit.kernels import FitError, candidate, get_device
from tests.stability.modes import measured
from tests.stability.naive import Array

LogProbability = Callable[[Array], Array]


def gauss(q: Array) -> Array:
    return np.asarray(-0.5 * (q * q).sum(axis=1))


def two_modes(distance: float, share: float = 0.5) -> LogProbability:
    """Give a density with modes at plus and minus so many standard deviations."""

    def density(q: Array) -> Array:
        offset = distance * np.eye(q.shape[1])[0]
        high, low = gauss(q - offset), gauss(q + offset)
        return np.asarray(np.logaddexp(np.log(share) + high, np.log(1 - share) + low))

    return density


def plain(
    density: LogProbability, start: Array, steps: int, *, seed: int = 1
) -> emcee.EnsembleSampler:
    """Run emcee as its manual does, but for the vectorised density."""
    np.random.seed(seed)
    sampler = emcee.EnsembleSampler(*start.shape, density, vectorize=True)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        sampler.run_mcmc(start, steps)
    return sampler


def own(
    density: LogProbability, start: Array, *, ensembles: int = 4, most: int = 3000
) -> tuple[Outcome, Array]:
    """Sample as Lobefit does; gives the outcome and the chain (steps, ensembles, walkers, n)."""
    size = len(start)
    walkers = max(16, 2 * size + 2)
    approximation = laplace(density, start)
    chain = ChainFile(None, {}, ensembles * walkers, size, most)
    outcome = run(
        density,
        approximation,
        lambda random: starts(density, approximation, (ensembles, walkers), random),
        chain,
        shape=(ensembles, walkers),
        seed=1,
        labels=tuple(f"q{k}" for k in range(size)),
        max_steps=most,
    )
    return outcome, chain.chain[outcome.warm_up :].reshape(-1, ensembles, walkers, size)


def draws(size: int, walkers: int = 16, *, seed: int = 0) -> Array:
    return np.random.default_rng(seed).standard_normal((walkers, size))


def test_degenerate_start() -> None:
    line = np.outer(np.linspace(-1, 1, 16), [1.0, 2.0, 3.0])
    refused = 0
    for start in (np.tile(draws(3)[0], (16, 1)), line):
        try:
            plain(gauss, start, 1)
        except ValueError as error:
            refused += "large condition number" in str(error)
    ball = 5.0 + 1e-10 * draws(3)
    early = plain(gauss, ball, 30).get_chain()
    measured("F24", rel=0.3, refused=refused, left=float(np.abs(early[-1] - 5.0).max()))

    def ridge(q: Array) -> Array:
        """A ridge ten thousand times longer than wide, as that of k_s and F0."""
        return np.asarray(-0.5 * ((q[:, 0] + q[:, 1]) / 1e-4) ** 2 - 0.5 * q[:, 0] ** 2)

    approximation = laplace(ridge, np.array([0.2, -0.2]))
    points, values = starts(ridge, approximation, (4, 16), np.random.RandomState(1))
    assert np.isfinite(values).all()
    for ensemble in points:
        widths = np.linalg.svd(ensemble - ensemble.mean(axis=0))[1]
        assert 3e3 < widths[0] / widths[1] < 1e5  # as long as it is, and not flat


def test_start_outside_the_prior() -> None:
    def within(q: Array) -> Array:
        return np.where((q < 1).all(axis=1), gauss(q), -np.inf)

    sampler = plain(within, 3.0 + 0.1 * draws(3), 200)
    measured("F25", moved=float((sampler.acceptance_fraction > 0).sum()))
    with pytest.raises(FitError, match="not finite: nowhere to start from"):
        laplace(within, np.full(3, 3.0))
    # The mode lies near the edge; what is drawn beyond it is drawn again.
    approximation = laplace(within, np.full(3, 0.9))
    _, values = starts(within, approximation, (4, 16), np.random.RandomState(1))
    assert np.isfinite(values).all()


def test_density_that_is_not_finite(monkeypatch: pytest.MonkeyPatch) -> None:
    def infinite(q: Array) -> Array:
        return np.where(q[:, 0] > 2, np.inf, gauss(q))

    chain = plain(infinite, 0.3 * draws(3), 400).get_chain()
    measured("F26", rel=0.3, share=float((chain[-1, :, 0] > 2).mean()))
    with pytest.raises(ValueError, match="Probability function returned NaN"):
        plain(lambda q: np.where(q[:, 0] > 2, np.nan, gauss(q)), 0.3 * draws(3), 400)

    m = simulate("ggx", {"alpha": 0.2}, "in-plane incidences=20,60 step=10", seed=1)
    space = Space(candidate("ggx"), m.channels)
    density = Density(space, m, get_device())
    q = np.zeros((6, len(space.coordinates)))
    bad = np.array([np.nan, np.inf, -np.inf, 0.0, 0.0, 0.0])
    monkeypatch.setattr(Density, "log_likelihood", lambda _self, theta: bad[: len(theta)])
    q[5, 0] = np.nan  # a coordinate of no parameter
    found = density(q)
    np.testing.assert_array_equal(np.isfinite(found), [False, False, False, True, True, False])
    assert (found[~np.isfinite(found)] == -np.inf).all()
    assert density.not_finite == 3
    density.release()


def test_short_chain() -> None:
    long = plain(gauss, draws(3), 3000)
    short = plain(gauss, draws(3), 200)
    measured(
        "F27",
        rel=0.2,
        short=float(short.get_autocorr_time(tol=0).mean()),
        long=float(long.get_autocorr_time(tol=0).mean()),
    )
    with pytest.raises(emcee.autocorr.AutocorrError, match="shorter than 50 times"):
        short.get_autocorr_time()
    chain = short.get_chain()[:, None]
    said = " ".join(judge(chain, autocorrelation_times(chain[:160]), ("x", "y", "z")).reasons)
    assert "200 steps are fewer than 50 autocorrelation times" in said
    outcome, samples = own(gauss, np.zeros(3))
    assert outcome.judgement.reasons == ()
    assert len(samples) > 50 * outcome.judgement.tau.max()


def test_budget_that_is_too_small() -> None:
    m = simulate("lambert", {"k_d": 0.5}, "in-plane step=5", seed=1)
    result = fit(m, "lambert").best
    posterior = sample(result, m, max_steps=350, seed=1)
    assert not posterior.converged
    assert posterior.reason.startswith("the budget ended after 350 steps")
    assert "NOT CONVERGED" in str(posterior)
    assert len(posterior["k_d"])  # the chain is kept
    with pytest.raises(FitError, match="within the warm-up"):
        sample(result, m, max_steps=20)


def test_modes_apart() -> None:
    one = draws(3) + np.array([10.0, 0.0, 0.0])
    chain = plain(two_modes(10.0), one, 1000).get_chain(discard=200)
    wide = [
        plain(two_modes(10.0, 0.9), 10 * draws(3, 32, seed=k), 800, seed=k).get_chain(discard=300)
        for k in range(3)
    ]
    shares = [float((c[..., 0] > 0).mean()) for c in wide]
    measured("F28", rel=0.3, other=float((chain[..., 0] < 0).mean()), found=float(np.mean(shares)))
    # Four standard deviations apart they mix, in the right proportion.
    outcome, samples = own(two_modes(4.0, 0.9), np.array([4.0, 0, 0]))
    assert outcome.judgement.reasons == ()
    assert (samples[..., 0] > 0).mean() == pytest.approx(0.9, abs=0.03)
    # Ensembles in different modes disagree, and that is said.
    apart = np.random.default_rng(1).standard_normal((400, 4, 16, 3))
    apart[:, :2, :, 0] += 20.0
    said = " ".join(judge(apart, autocorrelation_times(apart[:320]), ("x", "y", "z")).reasons)
    assert "the 4 ensembles disagree: R-hat of x is" in said
    # Twenty apart the other one is found from the first, fifty apart by no ensemble.
    outcome, samples = own(two_modes(10.0), np.array([10.0, 0, 0]))
    assert outcome.judgement.reasons == ()
    assert (samples[..., 0] > 0).mean() == pytest.approx(0.5, abs=0.05)
    outcome, samples = own(two_modes(25.0), np.array([25.0, 0, 0]))
    assert outcome.judgement.reasons == ()
    assert (samples[..., 0] > 0).all()


def test_dimensions() -> None:
    acceptance, tau = {}, {}
    for size in (5, 20, 50):
        sampler = plain(gauss, draws(size, 2 * size + 2), 2000)
        acceptance[size] = float(sampler.acceptance_fraction.mean())
        # A few of the coordinates, which are all alike.
        few = sampler.get_chain()[..., :3]
        tau[size] = float(emcee.autocorr.integrated_time(few, tol=0).mean())
    measured("F29", rel=0.2, t5=tau[5], t20=tau[20], t50=tau[50], a50=acceptance[50])
    for size in (5, 20):
        outcome, _ = own(gauss, np.full(size, 0.3), ensembles=2)
        assert outcome.judgement.reasons == ()
        assert outcome.judgement.tau.max() < tau[size] / 5


def test_density_at_an_edge() -> None:
    scale = 0.01

    def edge(q: Array) -> Array:
        inside = q[:, 0] >= 0
        return np.where(inside, -q[:, 0] / scale - 0.5 * q[:, 1] ** 2, -np.inf)

    rng = np.random.default_rng(0)
    start = np.stack([rng.exponential(scale, 16), rng.standard_normal(16)], axis=1)
    sampler = plain(edge, start, 2500)

    transforms = Transforms([Way(low=0.0), Way()])

    def by_logarithm(q: Array, *, jacobian: bool = True) -> Array:
        theta = transforms.to_parameters(q)
        return edge(theta) + (transforms.log_jacobian(q, theta) if jacobian else 0.0)

    without = plain(
        lambda q: by_logarithm(q, jacobian=False), transforms.to_coordinates(start), 1000
    ).get_chain(discard=500)
    measured(
        "F30",
        rel=0.5,
        tau=float(sampler.get_autocorr_time(tol=0)[0]),
        median=float(np.median(np.exp(without[..., 0]))),
    )
    outcome, samples = own(by_logarithm, np.array([-4.0, 0.0]))
    assert outcome.judgement.reasons == ()
    assert outcome.judgement.tau.max() < 10
    x = np.exp(samples[..., 0])
    assert x.mean() == pytest.approx(scale, rel=0.05)
    assert np.median(x) == pytest.approx(scale * np.log(2), rel=0.05)
