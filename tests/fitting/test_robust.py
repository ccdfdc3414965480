"""Student's t in the point fit: one wild reading decides neither the model nor its parameters."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy import stats
from typer.testing import CliRunner

from lobefit.fitting import FitReport, Measurement, fit, sample, simulate, write_measurement
from lobefit.fitting.robust import student_deviance, student_spread, student_weights
from lobefit.kernels import FitError
from lobefit.service.cli import app
from tests.fitting.reports import strict

SCAN = "in-plane incidences=10,30,50,65 step=4"
TRUTH = {"k_d": 0.1, "F0": 0.05, "alpha": 0.1}
MODELS = ["lambert", "ggx:k_s=1", "ggx", "ward:isotropic"]
NOISE = (0.02, 1e-3)


def clean(seed: int, *, sigma: bool) -> Measurement:
    return simulate("ggx:k_s=1", TRUTH, SCAN, NOISE, seed, sigma=sigma)


def spoiled(m: Measurement, row: int) -> Measurement:
    """Make one reading a hundred times too large."""
    values = m.values.copy()
    values[0, row] *= 100.0
    return replace(m, values=values)


def off(report: FitReport) -> float:
    """By how many standard errors the worst parameter of the best model is off."""
    free = [e for e in report.best.estimates if e.status == "free"]
    return max(abs(e.value - TRUTH[e.name]) / (e.standard_error or 0.0) for e in free)


@pytest.mark.parametrize("sigma", [False, True], ids=["noise unknown", "sigma given"])
def test_one_wild_reading_does_not_choose_the_model(sigma: bool) -> None:
    m = spoiled(clean(0, sigma=sigma), 80)
    assert fit(m, MODELS).best.candidate != "ggx:k_s=1"
    report = fit(m, MODELS, student=True)
    assert report.best.candidate == "ggx:k_s=1"
    assert off(report) < 3.0
    assert report.best.noise.nu is not None
    assert report.best.noise.nu <= 4.0
    assert report.best.diagnostics.outliers.count == 1
    assert "lies far outside the scatter" in report.verdict
    assert not report.best.diagnostics.misfit_limited
    assert report.settings["student"] is True
    # What the errors grow by is far less than what the reading would have done to them.
    gaussian = fit(clean(0, sigma=sigma), "ggx:k_s=1").best
    for e, own in zip(report.best.estimates, gaussian.estimates, strict=True):
        if own.standard_error is not None:
            assert e.standard_error == pytest.approx(1.2 * own.standard_error, rel=0.35)


def test_without_outliers_it_is_least_squares() -> None:
    m = clean(2, sigma=False)
    plain, robust = fit(m, "ggx:k_s=1").best, fit(m, "ggx:k_s=1", student=True).best
    assert robust.noise.nu is not None
    assert robust.noise.nu >= 20.0
    assert plain.noise.nu is None
    for a, b in zip(plain.estimates, robust.estimates, strict=True):
        if a.standard_error is not None:
            assert b.value == pytest.approx(a.value, abs=0.2 * a.standard_error)
            assert b.standard_error == pytest.approx(a.standard_error, rel=0.1)
    assert robust.noise.relative[0] == pytest.approx(plain.noise.relative[0], rel=0.05)


def test_heavy_tails_are_recognised() -> None:
    m = simulate("lambert", {"k_d": 0.3}, "in-plane incidences=10,30,50,65 step=1", (0.0, 0.0))
    tails = np.random.default_rng(3).standard_t(3.0, m.values.shape)
    m = replace(m, values=m.values * (1.0 + 0.02 * tails))
    best = fit(m, "lambert", student=True).best
    assert best.noise.nu in (2.0, 3.0, 4.0)
    # Its sigma is the scale of the t, not the larger standard deviation.
    level = np.hypot(best.noise.relative[0] * 0.3 / np.pi, best.noise.additive[0])
    assert level == pytest.approx(0.02 * 0.3 / np.pi, rel=0.15)


def test_the_density_is_students() -> None:
    r = np.linspace(-9.0, 9.0, 31)[None]
    scale = np.linspace(0.5, 2.0, 31)[None]
    used = np.arange(31)[None] % 3 > 0
    expected = -2.0 * stats.t.logpdf(r[used], 3.0, scale=scale[used]).sum()
    assert student_deviance(r, scale**2, used, 3.0) == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("nu", [3.0, 10.0])
def test_the_spread_is_the_information_of_students_t(nu: float) -> None:
    """Of t-distributed residuals the information is (nu + 1)/(nu + 3) of a Gaussian's."""
    z = stats.t.ppf((np.arange(200_000) + 0.5) / 200_000, nu)
    assert float(np.mean(student_weights(z * z, nu))) == pytest.approx(1.0, abs=1e-4)
    assert student_spread(z, nu, z.size) == pytest.approx((nu + 3.0) / (nu + 1.0), rel=1e-3)


def test_it_needs_a_likelihood() -> None:
    with pytest.raises(
        FitError, match="Student's t goes with the metric chi2 or relative only, not log"
    ):
        fit(clean(0, sigma=False), "lambert", metric="log", student=True)


def test_a_posterior_has_the_tails_of_its_fit() -> None:
    m = spoiled(simulate("lambert", {"k_d": 0.3}, SCAN, NOISE, 1), 80)
    best = fit(m, "lambert", student=True).best
    posterior = sample(best, m, ensembles=2, walkers=16, steps=100, max_steps=600)
    assert "nu" in posterior.labels
    k_d = posterior.summary()["k_d"]
    assert abs(k_d.mean - 0.3) < 4.0 * k_d.sd
    assert k_d.sd == pytest.approx(best.estimates[0].standard_error, rel=0.4)


def test_the_command_line_says_so(tmp_path: Path) -> None:
    file = tmp_path / "spoiled.csv"
    write_measurement(spoiled(clean(0, sigma=False), 80), file)
    command = ["fit", str(file), "--models", "ggx:k_s=1", "--student"]
    said = CliRunner().invoke(app, command)
    assert said.exit_code == 0, said.output
    assert "Student's t with" in said.output
    document = strict(CliRunner().invoke(app, [*command, "--json"]).stdout)
    assert document["results"][0]["noise"]["nu"] <= 4.0


@pytest.mark.slow
@pytest.mark.parametrize("sigma", [False, True], ids=["noise unknown", "sigma given"])
def test_the_errors_cover_with_bad_readings(sigma: bool) -> None:
    """One reading in fifty is wrong by up to a factor 10; 60 sets: the rms of pulls is 1 ± 0.09."""
    collected: dict[str, list[float]] = {}
    for seed in range(60):
        m = clean(seed, sigma=sigma)
        random = np.random.default_rng(1000 + seed)
        values = m.values.copy()
        bad = random.random(values.shape) < 0.02
        values[bad] *= np.exp(random.uniform(-2.3, 2.3, int(bad.sum())))
        best = fit(replace(m, values=values), "ggx:k_s=1", student=True).best
        for e in best.estimates:
            if e.status == "free":
                assert e.standard_error is not None
                pulled = (e.value - TRUTH[e.name]) / e.standard_error
                collected.setdefault(e.name, []).append(pulled)
    for name, values_of in collected.items():
        assert np.sqrt(np.mean(np.square(values_of))) == pytest.approx(1.0, abs=0.28), name
        assert abs(np.mean(values_of)) < 3.0 / np.sqrt(60), name
