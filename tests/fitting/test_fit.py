"""The main job, end to end: what `fit` finds, how it ranks, and what it does when it cannot."""

from __future__ import annotations

import sys
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from lobefit.fitting import FitReport, Measurement, fit, simulate
from lobefit.fitting.dataset import Dataset
from lobefit.fitting.measurement import DIRECTION_COLUMNS
from lobefit.kernels import (
    DeviceError,
    FitError,
    MeasurementError,
    ModelError,
    candidate,
    candidates,
    directional_albedo,
)
from tests.fitting.test_uncertainty import CANDIDATES, inside
from tests.truth import deviations

Array = npt.NDArray[np.float64]

GLOSSY = {"k_d": 0.2, "k_s": 0.6, "F0": 0.3, "alpha": 0.15}
SCAN = "in-plane incidences=10,30,50,70 step=2"
# Enough to rank, and quick.
FEW = ["lambert", "ggx", "ward:isotropic", "blinn_phong"]


@pytest.fixture(scope="module")
def glossy() -> Measurement:
    return simulate("ggx", GLOSSY, SCAN, (0.02, 1e-3), seed=1)


@pytest.fixture(scope="module")
def report(glossy: Measurement) -> FitReport:
    return fit(glossy)


def angles(m: Measurement) -> list[Array]:
    return [getattr(m, name) for name in DIRECTION_COLUMNS]


# What it finds


def test_the_generating_model_is_first(report: FitReport) -> None:
    assert report.best.candidate == "ggx"
    assert report.best is report.results[0] is report["ggx"]
    assert report.described
    assert report.verdict.startswith("ggx describes this surface")
    assert {r.candidate for r in report.results} == {
        c.name for c in candidates("standard") if c.isotropic
    }
    assert report.failed == ()
    off = {k: z for k, z in deviations(report.best, GLOSSY).items() if not abs(z) < 3}
    assert off == {}


def test_a_result_predicts_what_it_was_fitted_to(report: FitReport, glossy: Measurement) -> None:
    for result in report.results:
        f = result.predict(*angles(glossy))
        assert f.shape == glossy.values.shape
        rmse = np.sqrt(np.mean((f - glossy.values) ** 2))
        assert result.rmse == pytest.approx(rmse, rel=1e-9)
        log = np.log10(f / glossy.values)[glossy.values > 0]
        assert result.diagnostics.log10_rms == pytest.approx(np.sqrt(np.mean(log**2)), rel=1e-9)


def test_a_result_says_how_it_was_found(report: FitReport) -> None:
    stop = report.best.stop
    assert "scan" in stop.algorithm
    assert "LN_NELDERMEAD" in stop.algorithm
    assert "Gauss-Newton" in stop.algorithm
    assert "gradient vanished" in stop.reason
    assert stop.converged
    assert stop.evaluations > 64  # the scan alone
    assert 0 < stop.seconds <= report.seconds
    assert stop.device
    assert stop.precision == "double"
    assert report.settings["models"] == "standard"
    assert report.settings["metric"] == report.metric == "relative"


def test_albedos_are_those_of_the_kernels(report: FitReport) -> None:
    for result in report.results:
        said = result.plausibility
        exact = directional_albedo(result.model, result.params, [said.albedo_max_theta_i[0]])
        # The coarse quadrature is good to three digits.
        assert said.albedo_max[0] == pytest.approx(exact.item(), abs=2e-3)
        assert said.conserves_energy
        assert said.reciprocal


@pytest.mark.parametrize("name", CANDIDATES)
def test_exact_data_give_the_parameters_back(name: str) -> None:
    m = simulate(name, inside(name), SCAN, noise=(0.0, 0.0))
    result = fit(m, [name]).best
    chosen = candidate(name)
    for parameter, expected in inside(name).items():
        # Weights of exact data are as steep as doubles allow; 1e-6 is what is asked for.
        np.testing.assert_allclose(result.params[parameter], expected, rtol=1e-6, err_msg=parameter)
    for follower, leader in chosen.tied.items():
        assert result.params[follower] == result.params[leader]
    assert result.rmse < 1e-6


def test_the_same_fit_twice(glossy: Measurement, report: FitReport) -> None:
    again = fit(glossy)
    assert [r.candidate for r in again.results] == [r.candidate for r in report.results]
    for a, b in zip(again.results, report.results, strict=True):
        assert a.params == b.params
        assert a.bic == b.bic
        assert a.covariance.tobytes() == b.covariance.tobytes()
        assert a.stop.evaluations == b.stop.evaluations
    assert again.verdict == report.verdict
    assert again.table() == report.table()


def test_the_order_of_the_rows_does_not_matter(glossy: Measurement, report: FitReport) -> None:
    shuffled = glossy.select(np.random.default_rng(2).permutation(glossy.n_directions))
    again = fit(shuffled, ["ggx"]).best
    for name, value in report.best.params.items():
        # Sums in another order end in another last digit; the search stops within 1e-2 errors.
        assert again.params[name] == pytest.approx(value, rel=1e-4)


@pytest.mark.parametrize("unit", [1e-6, 1e6])
def test_the_unit_of_the_values_does_not_matter(glossy: Measurement, unit: float) -> None:
    first = fit(glossy, FEW)
    second = fit(replace(glossy, values=unit * glossy.values), FEW)
    assert [r.candidate for r in second.results] == [r.candidate for r in first.results]
    samples = glossy.n_directions
    for a, b in zip(first.results, second.results, strict=True):
        for name, value in a.params.items():
            scale = unit if name in ("k_d", "k_s") else 1.0
            error = next(e.standard_error for e in a.estimates if e.name == name) or 0.0
            # Both stop within a hundredth of a standard error.
            assert isinstance(value, float)
            assert b.params[name] == pytest.approx(
                value * scale, abs=0.02 * error * scale, rel=1e-6
            )
        assert b.diagnostics.log10_rms == pytest.approx(a.diagnostics.log10_rms, rel=1e-3)
        assert b.diagnostics.misfit_limited == a.diagnostics.misfit_limited
        assert a.bic is not None
        assert b.bic is not None
        # The density of a value changes with its unit, and nothing else of BIC.
        effective = min(r.diagnostics.effective_samples for r in [first.results[0]])
        shift = 2 * effective * np.log(unit)
        assert b.bic - a.bic == pytest.approx(shift, rel=1e-3, abs=0.1 * samples**0.5)


# Candidates


def test_anisotropic_models_need_azimuthal_evidence(glossy: Measurement) -> None:
    assert not glossy.has_azimuthal_evidence
    assert "ward" not in [r.candidate for r in fit(glossy, "standard").results]
    named = fit(glossy, ["ward"])
    assert named.best.candidate == "ward"
    turned = simulate("ggx", GLOSSY, "in-plane incidences=30,60 step=5 azimuths=0,45,90", seed=1)
    assert turned.has_azimuthal_evidence
    assert "ward" in [r.candidate for r in fit(turned, "standard").results]


def test_models_are_named_in_any_way(glossy: Measurement) -> None:
    for models in ("lambert,ggx:k_s=1", ["lambert", "ggx:k_s=1"], ("ggx:k_s=1", "lambert")):
        found = fit(glossy, models)
        assert {r.candidate for r in found.results} == {"lambert", "ggx:k_s=1"}
        assert found.settings["models"] == (models if isinstance(models, str) else list(models))


def test_options_reach_the_models_that_have_them() -> None:
    options = {"masking": "smith_separable"}
    m = simulate("ggx", {**GLOSSY, "alpha": 0.5}, SCAN, (0.0, 0.0), options=options)
    found = fit(m, ["lambert", "ggx"], options=options)
    assert found.best.options == {**options, "fresnel": "schlick"}
    assert found.best.params["alpha"] == pytest.approx(0.5, rel=1e-6)
    np.testing.assert_allclose(found.best.predict(*angles(m)), m.values, rtol=1e-6)
    other = fit(m, ["ggx"]).best
    assert other.params["alpha"] != pytest.approx(0.5, rel=1e-6)


def test_an_option_that_no_candidate_has(glossy: Measurement) -> None:
    with pytest.raises(ModelError, match="masking"):
        fit(glossy, ["lambert", "ggx"], options={"maskng": "smith_separable"})


@pytest.mark.parametrize("models", ["ggxx", ["ggx", "phongg"], "ggx:k_s=2", "", []])
def test_unknown_models(glossy: Measurement, models: Any) -> None:
    with pytest.raises(ModelError):
        fit(glossy, models)


def test_unknown_metric_and_device(glossy: Measurement) -> None:
    with pytest.raises(
        FitError, match=r"auto, chi2, relative, log, cube_root, cosine_log; not 'rms'"
    ):
        fit(glossy, "lambert", metric="rms")
    with pytest.raises(DeviceError, match="no such device"):
        fit(glossy, "lambert", device="no such device")


# Data that are hard


def test_too_few_directions() -> None:
    m = simulate("ggx", GLOSSY, "in-plane incidences=30 step=30 max=60", (0.02, 1e-3))
    assert m.n_directions == 5
    few = m.select(slice(0, 4))
    with pytest.raises(
        MeasurementError,
        match=r"4 distinct directions and 4 values are too few for ggx with 4 parameters",
    ):
        fit(few, ["ggx"])
    found = fit(few, ["ggx", "lambert"])  # what can be fitted is
    assert found.best.candidate == "lambert"
    assert [f.candidate for f in found.failed] == ["ggx"]
    assert "too few for ggx" in found.failed[0].reason


def test_a_failing_candidate_does_not_lose_the_others(
    glossy: Measurement, monkeypatch: pytest.MonkeyPatch
) -> None:
    # By this way, since `lobefit.fitting.fit` is the function of that name.
    module = sys.modules["lobefit.fitting.fit"]
    real = vars(module)["fit_point"]

    def fails(chosen: Any, *arguments: Any) -> Any:
        if chosen.name == "ggx":
            raise FitError("ggx: no finite value was found")
        return real(chosen, *arguments)

    monkeypatch.setattr(module, "fit_point", fails)
    for models in (["lambert", "ggx", "blinn_phong"], ["lambert", "blinn_phong", "ggx"]):
        found = fit(glossy, models)
        assert {r.candidate for r in found.results} == {"lambert", "blinn_phong"}
        assert [(f.candidate, f.reason) for f in found.failed] == [
            ("ggx", "ggx: no finite value was found")
        ]
    with pytest.raises(FitError, match="no finite value was found"):
        fit(glossy, ["ggx"])


def test_missing_cells_in_one_channel() -> None:
    truth: dict[str, float | list[float]] = {**GLOSSY, "k_d": [0.1, 0.2, 0.3]}
    m = simulate("ggx", truth, SCAN, (0.02, 1e-3), seed=5)
    values = m.values.copy()
    values[1, np.random.default_rng(6).uniform(size=m.n_directions) < 0.4] = np.nan
    holes = replace(m, values=values)
    found = fit(holes, ["ggx", "lambert"])
    assert found.best.candidate == "ggx"
    assert found.best.diagnostics.samples == np.isfinite(values).sum()
    off = {k: z for k, z in deviations(found.best, truth).items() if not abs(z) < 3.5}
    assert off == {}
    whole = {(e.name, e.channel): e.standard_error for e in fit(m, ["ggx"]).best.estimates}
    for e in found.best.estimates:
        before = whole[e.name, e.channel]
        assert e.standard_error is not None
        assert before is not None
        # Losing 40 % of a channel costs it a quarter of its precision.
        if e.channel == "G" and e.name == "k_d":
            assert e.standard_error > 1.1 * before


def test_a_diffuse_fit_is_the_weighted_mean() -> None:
    m = simulate("lambert", {"k_d": [0.3, 0.6]}, SCAN, (0.02, 1e-3), seed=7, sigma=True)
    values = m.values.copy()
    values[0, ::3] = np.nan
    result = fit(replace(m, values=values), "lambert").best
    assert m.sigma is not None
    w = np.where(np.isnan(values), 0.0, m.sigma**-2.0)
    mean = np.pi * np.nansum(w * values, axis=1) / w.sum(axis=1)
    np.testing.assert_allclose(result.params["k_d"], mean, rtol=1e-12)
    errors = [e.standard_error or 0.0 for e in result.estimates]
    np.testing.assert_allclose(errors, np.pi / np.sqrt(w.sum(axis=1)), rtol=1e-9)


def test_negative_values_do_not_bias_a_dark_surface() -> None:
    """F19: half of the values are noise below zero; leaving them out would double k_d."""
    truth = {"k_d": 0.003}
    m = simulate("lambert", truth, "in-plane step=0.5", (0.02, 0.002), seed=8)
    assert m.negative_share > 0.25
    found = fit(m, ["lambert", "blinn_phong", "ggx"])
    assert found.best.candidate == "lambert"
    assert abs(deviations(found.best, truth)["k_d[brdf]"]) < 3
    d = found.best.diagnostics
    assert d.log10_excluded == np.count_nonzero(m.values <= 0)
    assert d.log10_count + d.log10_excluded == d.samples == m.n_directions


def test_noise_twice_the_signal_is_noise_and_no_misfit() -> None:
    truth = {"k_d": 0.003}
    dark = [simulate("lambert", truth, "in-plane step=2", (0.02, 0.002), k) for k in range(20)]
    z = [deviations(fit(m, "lambert").best, truth)["k_d[brdf]"] for m in dark]
    assert max(map(abs, z)) < 3.5  # one in 100 for twenty draws


def test_a_wrong_quantity_shows_in_the_albedo() -> None:
    """F21: reflectance factors, pi times the BRDF, taken for a BRDF."""
    m = simulate("lambert", {"k_d": 0.8}, SCAN, (0.02, 1e-3), seed=11)
    found = fit(replace(m, values=np.pi * m.values), "lambert")
    assert not found.best.plausibility.conserves_energy
    assert found.best.params["k_d"] == pytest.approx(0.8 * np.pi, rel=0.01)  # no silent bound
    assert "factor pi" in found.verdict


def test_a_sigma_that_is_too_small_is_said() -> None:
    m = simulate("ggx", GLOSSY, SCAN, (0.02, 1e-3), seed=12, sigma=True)
    assert m.sigma is not None
    small = fit(replace(m, sigma=m.sigma / 3), ["ggx"]).best
    assert small.diagnostics.reduced_chi_square == pytest.approx(9.0, rel=0.25)
    assert small.diagnostics.misfit_limited
    assert "stated sigma" in small.diagnostics.misfit_reason
    assert not fit(m, ["ggx"]).best.diagnostics.misfit_limited


# Progress and interruption


def test_progress_counts_the_candidates(glossy: Measurement) -> None:
    told: list[tuple[int, int, str]] = []
    fit(glossy, ["lambert", "ggx"], progress=lambda *step: told.append(step))
    assert told == [(0, 2, "lambert"), (1, 2, "ggx"), (2, 2, "done")]


@pytest.mark.parametrize("error", [KeyboardInterrupt, RuntimeError])
def test_an_interrupted_fit_frees_the_device(
    glossy: Measurement, monkeypatch: pytest.MonkeyPatch, error: type[BaseException]
) -> None:
    released: list[Dataset] = []
    real = Dataset.release

    def release(self: Dataset) -> None:
        released.append(self)
        real(self)

    def stop(done: int, _total: int, _label: str) -> None:
        if done == 1:
            raise error("stop")

    monkeypatch.setattr(Dataset, "release", release)
    with pytest.raises(error, match="stop"):
        fit(glossy, ["lambert", "ggx", "blinn_phong"], progress=stop)
    assert len(released) == 1
    assert fit(glossy, ["ggx"]).best.candidate == "ggx"
    assert len(released) == 2


def test_an_interrupt_within_the_search_comes_through(
    glossy: Measurement, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Ctrl-C while NLopt runs: not swallowed, not turned into an error of NLopt."""
    problem = sys.modules["lobefit.fitting.problem"].Problem
    real, calls = problem.project, 0

    def project(*arguments: Any) -> Any:
        nonlocal calls
        calls += 1
        if calls == 5:
            raise KeyboardInterrupt
        return real(*arguments)

    monkeypatch.setattr(problem, "project", project)
    with pytest.raises(KeyboardInterrupt):
        fit(glossy, ["ggx"])
    assert calls == 5
    assert fit(glossy, ["ggx"]).best.candidate == "ggx"
