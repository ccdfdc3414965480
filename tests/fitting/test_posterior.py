"""Posteriors of simulated measurements, end to end."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from lobefit.fitting import Measurement, Posterior, fit, sample, simulate
from lobefit.fitting.likelihood import Censoring, Density
from lobefit.fitting.priors import Uniform
from lobefit.fitting.space import Space
from lobefit.kernels import FitError, candidate, get_device

Array = npt.NDArray[np.float64]

GLOSSY = {"k_d": 0.2, "k_s": 0.6, "F0": 0.3, "alpha": 0.15}
SCAN = "in-plane incidences=10,30,50,70 step=2"


def measured(seed: int = 1, **settings: Any) -> Measurement:
    return simulate("ggx", GLOSSY, SCAN, (0.02, 1e-3), seed=seed, **settings)


@pytest.fixture(scope="module")
def glossy() -> Measurement:
    return measured()


@pytest.fixture(scope="module")
def posterior(glossy: Measurement) -> Posterior:
    return sample(fit(glossy, "ggx").best, glossy, seed=1)


def test_it_converges_and_says_why(posterior: Posterior) -> None:
    assert posterior.converged
    assert "autocorrelation times, R-hat of the ensembles is at most 1.00" in posterior.reason
    assert posterior.repeatable
    assert posterior.not_finite == 0
    assert 0.2 < posterior.acceptance < 0.8
    assert len(posterior.chain) > 50 * max(posterior.tau.values())


def test_mean_and_sd_are_those_of_the_point_fit(posterior: Posterior) -> None:
    """Many readings, weak priors: the posterior is nearly the Laplace approximation."""
    for e in posterior.result.estimates:
        s = posterior.summary()[e.name]
        assert e.standard_error is not None
        # Noise is sampled too, and F0 is bent a little: a fifth of a standard deviation.
        assert abs(s.mean - e.value) < 0.2 * e.standard_error, e.name
        assert s.sd == pytest.approx(e.standard_error, rel=0.15), e.name


def test_the_truth_lies_where_it_should(posterior: Posterior) -> None:
    truth = {**GLOSSY, "noise_relative": 0.02, "noise_additive": 1e-3}
    for name, value in truth.items():
        s = posterior.summary()[name]
        assert abs(s.mean - value) < 3.5 * s.sd, name
        assert s.q5 < s.q50 < s.q95
        assert s.r_hat < 1.01
        assert min(s.ess_bulk, s.ess_tail) > 1000


def test_same_seed_same_chain(glossy: Measurement) -> None:
    result = fit(glossy, "ggx").best
    chains = [sample(result, glossy, seed=s, steps=40).chain for s in (5, 5, 6)]
    np.testing.assert_array_equal(chains[0], chains[1])
    assert not np.array_equal(chains[0], chains[2])


def test_draws_are_spread_over_chain_and_walkers(posterior: Posterior) -> None:
    draws = posterior.draws(63)
    assert draws.shape == (63, len(posterior.labels))
    assert len(np.unique(draws[:, 0])) > 55
    k = posterior.labels.index("alpha")
    assert abs(draws[:, k].mean() - posterior["alpha"].mean()) < 0.6 * posterior["alpha"].std()
    with pytest.raises(KeyError, match="was not sampled; these were: alpha"):
        posterior["beta"]


def test_netcdf_in_the_layout_of_arviz(posterior: Posterior, tmp_path: Path) -> None:
    import h5netcdf

    idata = posterior.idata
    assert idata.groups() == ["posterior", "sample_stats", "observed_data", "constant_data"]
    walkers = posterior.chain.shape[1] * posterior.chain.shape[2]
    draws = len(idata.posterior["draw"])
    assert idata.posterior["alpha"].shape == (walkers, draws)
    assert idata.posterior["F0"].shape == (walkers, draws, 1)
    assert "lp" in idata.sample_stats
    with pytest.raises(AttributeError, match="no group 'prior'"):
        _ = idata.prior
    path = idata.to_netcdf(tmp_path / "posterior.nc")
    with h5netcdf.File(path) as file:
        group = file["posterior"]
        assert group["F0"].dimensions == ("chain", "draw", "channel")
        np.testing.assert_array_equal(group["alpha"][...], idata.posterior["alpha"])
        assert group.attrs["inference_library"] == "emcee"
        assert group.attrs["converged"] == 1
        assert list(group["channel"][...]) == [b"brdf"] or list(group["channel"][...]) == ["brdf"]
        assert file["observed_data"]["brdf"].shape == posterior.measurement.values.shape


def test_arviz_reads_it(posterior: Posterior, tmp_path: Path) -> None:
    arviz = pytest.importorskip("arviz", reason="arviz is not installed")
    read = arviz.from_netcdf(posterior.idata.to_netcdf(tmp_path / "posterior.nc"))
    np.testing.assert_array_equal(read.posterior["alpha"], posterior.idata.posterior["alpha"])


def test_everything_is_saved(posterior: Posterior, tmp_path: Path) -> None:
    written = posterior.save(tmp_path / "out")
    assert {p.name for p in written.values()} == {
        *("corner.png", "trace.png", "predictive.png", "posterior.nc", "posterior.json")
    }
    assert all(p.stat().st_size > 1000 for p in written.values())
    text = str(posterior)
    assert "ess_bulk" in text and "converged: " in text


def test_bands_hold_the_readings(posterior: Posterior) -> None:
    m = posterior.measurement
    f = posterior.predict(m.theta_i, m.phi_i, m.theta_o, m.phi_o, draws=100)
    assert f.shape == (100, *m.values.shape)
    sigma = posterior.noise_of(posterior.draws(100), f)
    z = (m.values - f) / sigma
    # 328 readings, 90 %: three binomial standard deviations.
    assert np.mean(np.abs(z) < 1.645) == pytest.approx(0.9, abs=3 * math.sqrt(0.09 / m.values.size))


def test_single_precision_says_the_same(glossy: Measurement) -> None:
    """Differences of the log-probability are what counts: between draws, under 0.01."""
    result = fit(glossy, "ggx").best
    p = sample(result, glossy, seed=1, steps=40)
    q = p.chain[-1].reshape(-1, p.space.size)
    found = []
    for precision in ("double", "single"):
        density = Density(p.space, glossy, get_device(), precision=precision)
        found.append(density(q))
        density.release()
    difference = found[1] - found[0]
    assert np.ptp(difference) < 0.01


# Noise


def test_given_sigmas(glossy: Measurement) -> None:
    m = measured(sigma=True)
    p = sample(fit(m, "ggx").best, m, seed=1, steps=60)
    assert p.space.noise == "given"
    assert p.labels == ("alpha", "k_d", "k_s", "F0")
    wrong = replace(m, sigma=0.4 * np.asarray(m.sigma))
    q = sample(fit(wrong, "ggx").best, wrong, seed=1, steps=60)
    assert q.labels[-1] == "sigma_scale"
    assert q.summary()["sigma_scale"].mean == pytest.approx(2.5, rel=0.1)
    assert "times the stated sigma" in q.notes[0]
    # The interval is that of the true noise, not of the stated one.
    assert q.summary()["k_s"].sd == pytest.approx(p.summary()["k_s"].sd, rel=0.2)


def test_held_noise_has_fewer_numbers(glossy: Measurement) -> None:
    p = sample(fit(glossy, "ggx").best, glossy, seed=1, steps=60, noise="fixed")
    assert p.labels == ("alpha", "k_d", "k_s", "F0")
    assert "held at what the point fit found" in p.notes[0]


def test_students_t_is_not_pulled_by_outliers(glossy: Measurement) -> None:
    values = glossy.values.copy()
    values[0, ::40] *= 1.6
    m = replace(glossy, values=values)
    result = fit(m, "ggx").best
    plain = sample(result, m, seed=1, steps=60)
    robust = sample(result, m, seed=1, steps=60, student=True)
    assert robust.summary()["k_d"].sd < 0.5 * plain.summary()["k_d"].sd
    assert robust.summary()["nu"].q50 < 5.0
    assert abs(robust.summary()["k_d"].mean - 0.2) < 4.0 * robust.summary()["k_d"].sd


def test_saturated_readings_bias_nothing_when_they_are_told() -> None:
    m = measured()
    level = 0.5 * float(m.values.max())
    clipped = replace(m, values=np.minimum(m.values, level))
    assert 5 < (m.values > level).sum() < 60
    result = fit(clipped, "ggx").best
    told = sample(result, clipped, seed=1, steps=60, saturation=level)
    s = told.summary()["alpha"]
    assert abs(s.mean - 0.15) < 4.0 * s.sd
    # Saturated readings are no misfit: the likelihood counts in full.
    assert told.power == 1.0
    naive = sample(result, clipped, seed=1, steps=60, correlation="ignore").summary()["alpha"]
    assert abs(naive.mean - 0.15) > 4.0 * naive.sd
    values, sides = Censoring(level, 0.0).apply(np.array([[-1.0, 0.1, 2 * level]]))
    assert sides is not None and sides.tolist() == [[-1, 0, 1]]
    assert values.tolist() == [[0.0, 0.1, level]]


def test_misfit_makes_the_intervals_wider() -> None:
    """A model that is wrong: residuals are correlated, and count less."""
    m = simulate("ggx", GLOSSY, SCAN, (0.002, 1e-5), seed=1)
    result = fit(m, "beckmann").best
    assert result.diagnostics.misfit_limited
    p = sample(result, m, seed=1, steps=60)
    assert p.power < 0.5
    assert "the log-likelihood is divided" in " ".join(p.notes)
    naive = sample(result, m, seed=1, steps=60, correlation="ignore")
    assert naive.power == 1.0
    assert p.summary()["k_d"].sd > 1.3 * naive.summary()["k_d"].sd


def test_a_gross_misfit_is_not_explained_by_a_brighter_model() -> None:
    """Noise in proportion to the model rewards a model that is too bright."""
    truth = {"k_d": 0.0, "F0": 0.9, "alpha": 0.1, "gamma": 1.55}
    m = simulate("student_t:k_s=1", truth, "in-plane incidences=10,40,65 step=1", seed=3)
    result = fit(m, "blinn_phong").best
    point = next(e for e in result.estimates if e.name == "k_s")
    assert point.standard_error is not None
    p = sample(result, m, seed=1, steps=60)
    assert "are misfit, not noise" in " ".join(p.notes)
    assert "sigma_scale" in p.labels
    assert abs(p.summary()["k_s"].q50 - point.value) < 2.0 * point.standard_error
    naive = sample(result, m, seed=1, steps=60, noise="fit")
    assert naive.summary()["k_s"].q50 - point.value > 2.5 * point.standard_error


# Hard posteriors


def test_k_s_and_F0_at_small_angles() -> None:
    """F6: only their product is known; the ridge is followed, the prior ends it."""
    truth = {"k_d": 0.1, "k_s": 1.0, "F0": 0.04, "alpha": 0.1}
    m = simulate("ggx", truth, "in-plane incidences=0,2,5 max=10 step=0.5", (0.02, 1e-4), seed=1)
    p = sample(fit(m, "ggx").best, m, seed=1)
    product = p["k_s"] * p["F0"]
    assert p["k_s"].std() / p["k_s"].mean() > 0.3
    assert product.std() / product.mean() < 0.05
    assert abs(product.mean() - 0.04) < 4 * product.std()


def test_a_parameter_that_is_nothing() -> None:
    """F7: k_d = 0 beside a metal's lobe; the posterior leans on 0 and ends at an upper limit."""
    m = simulate("ggx:k_s=1", {"k_d": 0.0, "F0": 0.9, "alpha": 0.2}, SCAN, (0.02, 1e-3), seed=1)
    p = sample(fit(m, "ggx:k_s=1").best, m, seed=1)
    s = p.summary()["k_d"]
    assert p.converged, p.reason
    assert 0.0 < s.q95 < 0.002


def test_an_angle_is_sampled_about_the_fit() -> None:
    truth = {"k_d": 0.1, "k_s": 0.3, "alpha_x": 0.3, "alpha_y": 0.12, "phi_x": 0.02}
    m = simulate("ward", truth, "in-plane incidences=20,45 step=4 azimuths=0,30,60,90,120", seed=1)
    p = sample(fit(m, "ward").best, m, seed=1, steps=100)
    phi = p.idata.posterior["phi_x"]
    assert phi.min() >= 0.0 and phi.max() <= math.pi
    s = p.summary()["phi_x"]
    assert s.sd < 0.05
    assert abs(math.remainder(s.mean - 0.02, math.pi)) < 4 * s.sd


def test_priors_of_ones_own(glossy: Measurement) -> None:
    result = fit(glossy, "ggx").best
    free = sample(result, glossy, seed=1, steps=60)
    edge = free.summary()["F0"].q50
    cut = sample(result, glossy, seed=1, steps=60, priors={"F0": Uniform(0.0, edge)})
    assert cut["F0"].max() <= edge
    assert cut.summary()["F0"].mean < edge - 0.3 * free.summary()["F0"].sd


# What it refuses, and what it survives


def test_not_converged_is_told_and_kept(glossy: Measurement) -> None:
    p = sample(fit(glossy, "ggx").best, glossy, seed=1, max_steps=400)
    assert not p.converged
    assert p.reason.startswith("the budget ended after 400 steps; 48 steps are fewer than 50")
    assert len(p.chain) == 48
    assert "NOT CONVERGED" in str(p)


def test_log_probabilities_that_are_not_numbers_count_as_nothing(
    glossy: Measurement, monkeypatch: pytest.MonkeyPatch
) -> None:
    """F26: NaN and inf become -inf, and are counted."""
    space = Space(candidate("ggx"), glossy.channels)
    density = Density(space, glossy, get_device())
    plain = density.log_likelihood
    theta = space.draw(np.random.default_rng(1), 6)
    q = space.transforms.to_coordinates(theta)

    def broken(t: Array) -> Array:
        found = plain(t)
        found[:2] = np.nan, np.inf
        return found

    monkeypatch.setattr(density, "log_likelihood", broken)
    found = density(q)
    assert np.isneginf(found[:2]).all() and np.isfinite(found[2:]).all()
    assert density.not_finite == 2
    q[3] = np.nan
    assert np.isneginf(density(q)[3])
    density.release()


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"ensembles": 1}, "one ensemble cannot show that it is stuck"),
        ({"walkers": 2}, "2 walkers are too few"),
        ({"walkers": 8}, "8 walkers do not span 6 numbers"),
        ({"max_steps": 0}, "max_steps is 0"),
        ({"seed": -1}, "the seed is -1"),
        ({"noise": "loud"}, "noise is auto, fit, scaled, given or fixed"),
        ({"noise": "given"}, "needs a measurement with sigma"),
        ({"correlation": "some"}, "correlation is 'auto' or 'ignore'"),
        ({"max_steps": 100}, "within the warm-up"),
    ],
)
def test_what_cannot_be_done(
    glossy: Measurement, posterior: Posterior, settings: dict[str, Any], message: str
) -> None:
    with pytest.raises(FitError, match=message):
        sample(posterior.result, glossy, **settings)


def test_too_many_numbers_are_refused() -> None:
    names = [f"{w}nm" for w in range(400, 560, 10)]
    m = simulate("ggx", GLOSSY, "in-plane step=5", channels=names)
    with pytest.raises(FitError, match="81 numbers are more than walkers explore"):
        sample(fit(m, "ggx").best, m)


def test_a_file_goes_on_and_guards_itself(glossy: Measurement, tmp_path: Path) -> None:
    result = fit(glossy, "ggx").best
    file = tmp_path / "chain.h5"
    first = sample(result, glossy, seed=1, max_steps=400, file=file)
    assert not first.converged
    whole = sample(result, glossy, seed=1)
    resumed = sample(result, glossy, seed=1, file=file)
    assert resumed.converged
    np.testing.assert_array_equal(resumed.chain, whole.chain)
    assert resumed.evaluations < whole.evaluations
    with pytest.raises(FitError, match="its seed is '1', not '2'"):
        sample(result, glossy, seed=2, file=file)
    other = measured(seed=2)
    with pytest.raises(FitError, match="its measurement is"):
        sample(fit(other, "ggx").best, other, seed=1, file=file)
