"""Tilt, veil, gain and aperture: found where they are fitted, harmful where they are ignored."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from lobefit.fitting import FitResult, Measurement, fit, sample, simulate, write_measurement
from lobefit.fitting.instrument import Instrument, tilted, views
from lobefit.fitting.instrument_result import readings as readings_of
from lobefit.fitting.panels import Residuals
from lobefit.fitting.result import ParameterEstimate
from lobefit.kernels import FitError, candidate, models
from lobefit.kernels.veil import VEIL, with_veil
from lobefit.service.cli import app
from tests.fitting.instruments import readings
from tests.fitting.reports import strict

MODEL = "ggx:k_s=1"
TRUTH = {"k_d": 0.1, "F0": 0.5, "alpha": 0.1}
AROUND = "hemisphere incidences=15,35,55 theta_step=10 phi_step=20"
IN_PLANE = "in-plane incidences=10,30,50,65 step=4"
TILT, VEILED, WIDE = (0.5, -0.3), 0.01, 4.0
EVERYTHING = Instrument(tilt=True, veil=True, gain=0.02, aperture_deg=WIDE)


def pull(e: ParameterEstimate, truth: float) -> float:
    """By how many standard errors an estimate is off."""
    assert e.standard_error is not None
    return (e.value - truth) / e.standard_error


def pulls(result: FitResult) -> dict[str, float]:
    """Of the surface's parameters that are free."""
    return {e.name: pull(e, TRUTH[e.name]) for e in result.estimates if e.status == "free"}


@pytest.fixture(scope="module")
def measured() -> Measurement:
    return readings(TRUTH, AROUND, tilt_deg=TILT, veil=VEILED, gain=1.01, aperture_deg=WIDE, seed=1)


@pytest.fixture(scope="module")
def found(measured: Measurement) -> FitResult:
    return fit(measured, MODEL, instrument=EVERYTHING).best


def test_everything_at_once_is_found(found: FitResult) -> None:
    assert found.instrument is not None
    for name, truth in zip(("tilt_x", "tilt_y", "veil"), (*TILT, VEILED), strict=True):
        e = found.instrument[name]
        # The veil is read through the gain, whose error is one standard deviation of 2 %.
        assert abs(pull(e, truth)) < 3.0, e
    assert found.instrument["tilt_x"].standard_error == pytest.approx(0.005, rel=0.5)
    assert found.instrument["tilt_x"].unit == "deg"
    assert max(map(abs, pulls(found).values())) < 3.0
    assert {*pulls(found)} == {*TRUTH}
    assert found.diagnostics.reduced_chi_square == pytest.approx(1.0, abs=0.2)
    assert not found.diagnostics.misfit_limited
    assert found.n_parameters == 3 + 1 + 2
    assert found.covariance.shape == (3, 3)
    # The veil is no part of the surface.
    assert VEIL not in found.params
    assert found.plausibility.albedo_max[0] < 0.75


def test_residuals_are_those_of_the_readings(measured: Measurement, found: FitResult) -> None:
    assert measured.sigma is not None
    directions = (measured.theta_i, measured.phi_i, measured.theta_o, measured.phi_o)
    for fitted in (readings_of(found, *directions), Residuals(measured, found).fitted(directions)):
        z = (measured.values - fitted) / measured.sigma
        assert np.sqrt(np.mean(z**2)) == pytest.approx(1.0, abs=0.1)
    surface = (measured.values - found.predict(*directions)) / measured.sigma
    assert np.sqrt(np.mean(surface**2)) > 5.0


def test_ignored_it_biases_and_the_fit_says_so(measured: Measurement, found: FitResult) -> None:
    ideal = fit(measured, MODEL).best
    assert ideal.diagnostics.misfit_limited
    off = pulls(ideal)
    # A veil of 0.01 1/sr is mistaken for a diffuse albedo half as high again.
    assert off["k_d"] > 100.0
    # In what the lobe looks like the three partly cancel here.
    assert abs(off["F0"]) > 3.0
    assert ideal.instrument is None


def test_in_one_plane_only_one_tilt_shows() -> None:
    m = readings(TRUTH, IN_PLANE, tilt_deg=(0.5, 0.0), seed=2)
    ideal = fit(m, MODEL).best
    assert ideal.diagnostics.misfit_limited
    for metric in ("chi2", "relative"):
        best = fit(m, MODEL, metric=metric, instrument=Instrument(tilt=True)).best
        assert best.instrument is not None
        assert abs(pull(best.instrument["tilt_x"], 0.5)) < 3.0
        assert best.instrument["tilt_y"].status == "undetermined"
        assert best.instrument["tilt_y"].standard_error is None
        assert "tilt_y cannot be told from these readings" in best.instrument.sentences[0]
        assert max(map(abs, pulls(best).values())) < 3.0


def test_a_narrow_lobe_smeared_by_an_aperture() -> None:
    truth = {**TRUTH, "alpha": 0.04}
    m = readings(truth, IN_PLANE.replace("4", "1"), aperture_deg=WIDE, seed=3)
    known = fit(m, MODEL, instrument=Instrument(aperture_deg=WIDE)).best
    ignored = fit(m, MODEL).best
    alphas = [next(e for e in r.estimates if e.name == "alpha") for r in (known, ignored)]
    assert abs(pull(alphas[0], 0.04)) < 3.0
    assert alphas[1].value > 1.03 * 0.04
    assert ignored.diagnostics.misfit_limited
    assert not known.diagnostics.misfit_limited


def test_a_gain_widens_what_scales_with_it() -> None:
    m = readings({**TRUTH, "k_s": 0.8}, IN_PLANE)
    plain, wide = fit(m, "ggx").best, fit(m, "ggx", instrument=Instrument(gain=0.02)).best
    assert plain.params == wide.params
    before, after = ({e.name: e for e in r.estimates} for r in (plain, wide))
    for name in ("k_d", "k_s"):
        own, widened = before[name].standard_error, after[name].standard_error
        assert own is not None
        assert widened == pytest.approx(math.hypot(own, 0.02 * before[name].value), rel=1e-6)
    for name in ("F0", "alpha"):
        own = before[name].standard_error
        assert after[name].standard_error == pytest.approx(own, rel=1e-6)
    # One factor for all of a channel's coefficients.
    common = 0.02**2 * before["k_d"].value * before["k_s"].value
    assert wide.covariance[0, 1] == pytest.approx(plain.covariance[0, 1] + common, rel=1e-6)
    assert wide.instrument is not None
    assert "2 % of each channel's calibration" in wide.instrument.sentences[0]


def test_where_the_scale_is_fixed_a_gain_is_the_error_of_the_rest() -> None:
    m = readings(TRUTH, IN_PLANE)
    wide = fit(m, MODEL, instrument=Instrument(gain=0.02)).best
    relative = {e.name: (e.standard_error or 0.0) / e.value for e in wide.estimates}
    assert relative["F0"] == pytest.approx(0.02, rel=0.1)
    assert relative["alpha"] < 0.002


def test_nothing_switched_on_changes_nothing() -> None:
    m = readings(TRUTH, IN_PLANE)
    plain, off = fit(m, MODEL).best, fit(m, MODEL, instrument=Instrument()).best
    assert plain.params == off.params
    assert plain.estimates == off.estimates
    assert plain.bic == off.bic


def test_a_tilted_sample_sees_its_normal_upright() -> None:
    tilt = (0.02, -0.01)
    lean = math.hypot(*tilt)
    normal = np.array([[*(math.sin(lean) / lean * np.array(tilt)), math.cos(lean)]])
    assert tilted(normal, tilt) == pytest.approx(np.array([[0.0, 0.0, 1.0]]), abs=1e-15)
    many = np.random.default_rng(0).standard_normal((50, 3))
    turned = tilted(many, tilt)
    assert turned @ turned.T == pytest.approx(many @ many.T, abs=1e-13)
    assert tilted(many, (0.0, 0.0)) is many


@pytest.mark.parametrize("reading", ["flux", "radiance"])
def test_an_aperture_has_the_solid_angle_of_a_cap(reading: str) -> None:
    rows = tuple(np.array(a) for a in ([0.3, 0.3], [0.1, 0.1], [0.0, 1.0], [0.0, 2.0]))
    seen = views(rows, Instrument(aperture_deg=10.0, reading=reading), (0.0, 0.0))  # type: ignore[arg-type]
    total = sum(weight for _, weight in seen)
    # The mean of a cosine over a cap is (1 + cos(radius)) / 2 times that of its middle.
    mean = 0.5 * (1.0 + math.cos(math.radians(5.0))) if reading == "flux" else 1.0
    assert total == pytest.approx(np.full(2, mean), rel=1e-12)


def test_what_is_below_the_horizon_is_not_seen() -> None:
    rows = tuple(np.array([a]) for a in (0.3, 0.0, math.radians(89.5), 0.0))
    seen = views(rows, Instrument(aperture_deg=4.0), (0.0, 0.0))  # type: ignore[arg-type]
    assert 0 < sum(weight[0] == 0.0 for _, weight in seen) < len(seen)


def test_a_veil_is_no_model() -> None:
    veiled = with_veil(candidate(MODEL), "cos_theta_o")
    assert [p.name for p in veiled.solved] == ["k_d", "F0", VEIL]
    assert veiled.name == MODEL
    assert not any(VEIL in name for name in models())


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"gain": 0.0}, "relative uncertainty"),
        ({"gain": 2.0}, "relative uncertainty"),
        ({"aperture_deg": 0.0}, "full angle"),
        ({"aperture_deg": 90.0}, "full angle"),
        ({"reading": "brdf"}, "'flux' or 'radiance'"),
        ({"reading": "radiance"}, "changes nothing by itself"),
        ({"reading": "radiance", "gain": 0.1}, "give a tilt, a veil or an aperture"),
    ],
)
def test_instruments_that_do_not_exist(wrong: dict[str, float], said: str) -> None:
    with pytest.raises(FitError, match=said):
        Instrument(**wrong)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("instrument", "metric", "said"),
    [
        (Instrument(tilt=True, gain=0.1), "log", "a tilt and a gain go with the metric chi2"),
        (Instrument(aperture_deg=1.0), "cosine_log", "another metric than cosine_log"),
    ],
)
def test_metrics_that_do_not_go_with_it(instrument: Instrument, metric: str, said: str) -> None:
    m = simulate("lambert", {"k_d": 0.3}, IN_PLANE)
    with pytest.raises(FitError, match=said):
        fit(m, "lambert", metric=metric, instrument=instrument)


def test_sampling_refuses_what_it_does_not_account_for(
    measured: Measurement, found: FitResult
) -> None:
    with pytest.raises(FitError, match="sampling accounts for no tilt, veil, gain or aperture"):
        sample(found, measured)


def test_the_command_line_tells_what_was_found(measured: Measurement, tmp_path: Path) -> None:
    file = tmp_path / "tilted.csv"
    write_measurement(measured, file)
    command = ["fit", str(file), "--models", f"ggx,{MODEL}", "--tilt", "--veil"]
    command += ["--aperture", str(WIDE), "--gain", "0.02"]
    said = CliRunner().invoke(app, command)
    assert said.exit_code == 0, said.output
    assert "instrument\n" in said.output
    assert "tilt_x" in said.output
    assert "errors include 2 % of each channel's calibration" in said.output
    document = strict(CliRunner().invoke(app, [*command, "--json"]).stdout)
    best = document["results"][0]
    assert best["candidate"] == MODEL
    settings = best["instrument"]["settings"]
    assert settings == document["settings"]["instrument"]
    assert settings["aperture_deg"] == WIDE
    tilt = next(e for e in best["instrument"]["estimates"] if e["name"] == "tilt_x")
    assert tilt["value"] == pytest.approx(TILT[0], abs=3.0 * tilt["standard_error"])
    for flags, complaint in (
        (["--aperture", "100"], "aperture_deg is a full angle"),
        (["--tilt", "--posterior"], "--posterior accounts for no --tilt"),
        (["--radiance"], "a reading of radiance changes nothing by itself"),
    ):
        wrong = CliRunner().invoke(app, ["fit", str(file), *flags])
        assert wrong.exit_code == 2
        assert complaint in wrong.output


@pytest.mark.slow
def test_the_errors_cover() -> None:
    """Pulls of 60 simulations: of a normal distribution their rms is 1 ± 0.09."""
    collected: dict[str, list[float]] = {}
    random = np.random.default_rng(5)
    for seed in range(60):
        tilt = (float(random.normal(0.0, 0.3)), float(random.normal(0.0, 0.3)))
        m = readings(
            TRUTH,
            AROUND,
            tilt_deg=tilt,
            veil=VEILED,
            gain=1.0 + 0.02 * float(random.standard_normal()),
            seed=100 + seed,
            noise=(0.03, 1e-3),
        )
        best = fit(m, MODEL, instrument=Instrument(tilt=True, veil=True, gain=0.02)).best
        assert best.instrument is not None
        for name, truth in (("tilt_x", tilt[0]), ("tilt_y", tilt[1]), ("veil", VEILED)):
            collected.setdefault(name, []).append(pull(best.instrument[name], truth))
        for name, value in pulls(best).items():
            collected.setdefault(name, []).append(value)
    for name, values in collected.items():
        # Three standard errors of the rms, and of the mean.
        assert np.sqrt(np.mean(np.square(values))) == pytest.approx(1.0, abs=0.28), name
        assert abs(np.mean(values)) < 3.0 / math.sqrt(60), name
