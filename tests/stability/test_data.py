"""F1, F16 to F21: measurements that are not what a fit takes them for."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from lobefit.fitting import Instrument, Measurement, check, fit, read_measurement, simulate
from lobefit.fitting.lobes import make_grid, write_lobes
from lobefit.fitting.sample import sample
from lobefit.kernels import MeasurementError, evaluate
from lobefit.kernels.evaluate import Params
from tests.fitting.test_lobes import read_exr
from tests.stability.modes import measured
from tests.stability.naive import Array, angles, errors, ggx_of_scale_1, least_squares
from tests.truth import deviations

GLOSSY = {"k_d": 0.1, "k_s": 1.0, "F0": 0.5, "alpha": 0.1}
SCAN = "in-plane incidences=10,30,50,70 step=1"


def noisy(m: Measurement, f: Array, seed: int = 1) -> Measurement:
    """Give a measurement of values f with 2 % and 0.001 1/sr of noise."""
    noise = np.random.default_rng(seed).standard_normal(f.shape)
    return replace(m, values=f + noise * np.hypot(0.02 * f, 1e-3))


def leaning(m: Measurement, truth: Params) -> tuple[Array, Array]:
    """Give what is seen of a sample whose normal is half a degree off, and cos theta_o there."""
    tilt = np.radians(0.5)
    theta_i = m.theta_i + tilt
    theta_o = np.where(np.cos(m.phi_o - m.phi_i) < 0, m.theta_o, -m.theta_o) - tilt
    phi_o = np.where(theta_o >= 0, np.pi, 0.0)
    return evaluate("ggx", truth, theta_i, 0.0, np.abs(theta_o), phi_o), np.cos(theta_o)


def test_grazing() -> None:
    truth = {"k_d": 0.3, "k_s": 1.0, "F0": 0.5, "alpha": 0.3}
    clean = simulate("ggx", truth, "in-plane incidences=10,30,50,70 step=1 max=89", (0, 0))
    cosine = np.cos(clean.theta_o)
    floor = 0.01 * (clean.values * cosine).max()
    sigma = np.broadcast_to(floor / cosine, clean.values.shape)
    off: dict[str, list[float]] = {name: [] for name in ("plain", "fit", "within", "sigma")}
    for seed in range(12):
        noise = np.random.default_rng(seed).standard_normal(clean.values.shape)
        m = replace(clean, values=clean.values + sigma * noise)
        found, _ = least_squares(ggx_of_scale_1, m, [0.1, 0.3, 0.2])
        off["plain"].append(found[0])
        kept = m.within(np.radians(80.0))
        assert kept.dropped[0].rule == "theta above 80° (asked for)"
        assert kept.dropped[0].count == m.n_directions - kept.n_directions == 72
        for name, data in (("fit", m), ("within", kept), ("sigma", replace(m, sigma=sigma))):
            result = fit(data, "ggx:k_s=1").best
            off[name].append(float(result.params["k_d"]))  # type: ignore[arg-type]
            if name == "fit" and seed == 0:
                rough = check(m, result)["grazing angles"]
                assert rough.verdict == "suspicious"
                assert "Beyond 80° scans are rough to 31 %" in rough.sentence
            if name == "sigma":
                assert max(map(abs, deviations(result, truth).values())) < 4
    measured(
        "F1",
        rel=0.2,
        **{
            name: float(np.sqrt(np.mean((np.array(k_d) / 0.3 - 1) ** 2)))
            for name, k_d in off.items()
        },
    )


def test_shifted_peak() -> None:
    """The sample's normal half a degree off: the lobe is a degree off the mirror direction."""
    truth = {**GLOSSY, "alpha": 0.05}
    m = simulate("ggx", truth, SCAN)
    f, _ = leaning(m, truth)
    m = noisy(m, f)
    found, covariance = least_squares(
        ggx_of_scale_1,
        m,
        [0.1, 0.5, 0.1],
        sigma=np.hypot(0.02 * m.values[0], 1e-3),
        absolute_sigma=True,
    )
    measured("F16", rel=0.2, sigmas=float((0.5 - found[1]) / errors(covariance)[1]))
    report = fit(m, "ggx:k_s=1")
    assert report.best.diagnostics.misfit_limited
    assert "not to within its noise" in report.verdict
    peak = check(m, report.best)["peak position"]
    assert peak.verdict == "suspicious"
    assert "a sample tilted by 0.4" in peak.remedy
    wide = {**truth, "alpha": 0.1}
    f, _ = leaning(m, wide)
    peak = check(noisy(m, f), report.best)["peak position"]
    assert peak.verdict == "suspicious"
    assert "a sample tilted by 0.5" in peak.remedy

    veiled = noisy(m, evaluate("ggx", truth, *angles(m)) + 0.02)
    report = fit(veiled, "ggx:k_s=1")
    measured("F16", veil=float(report.best.params["k_d"]) / 0.1 - 1)  # type: ignore[arg-type]
    # Nothing tells a constant of f itself from a brighter diffuse term.
    assert not report.best.diagnostics.misfit_limited


def test_shifted_peak_and_veil_are_fitted_when_asked_for() -> None:
    truth = {**GLOSSY, "alpha": 0.05}
    m = simulate("ggx", truth, SCAN)
    f, cosine = leaning(m, truth)
    seen = f * cosine / np.cos(m.theta_o)  # divided by the nominal cosine
    veil = evaluate("ggx", truth, *angles(m)) + 0.02 / np.cos(m.theta_o)
    for readings, instrument, name, value in (
        (seen, Instrument(tilt=True), "tilt_x", -0.5),
        (veil, Instrument(veil=True), "veil", 0.02),
    ):
        best = fit(noisy(m, readings), "ggx:k_s=1", instrument=instrument).best
        assert best.instrument is not None
        estimates = {e.name: e for e in (*best.instrument.estimates, *best.estimates)}
        for key, true in ((name, value), ("F0", 0.5), ("k_d", 0.1), ("alpha", 0.05)):
            e = estimates[key]
            assert e.standard_error is not None
            assert e.value == pytest.approx(true, abs=4.0 * e.standard_error)
        assert not best.diagnostics.misfit_limited


def test_saturation() -> None:
    m = simulate("ggx", GLOSSY, SCAN)
    f = evaluate("ggx", GLOSSY, *angles(m))
    m = noisy(m, f)
    m = replace(m, values=np.minimum(m.values, 0.5 * f.max()))
    found, covariance = least_squares(ggx_of_scale_1, m, [0.1, 0.5, 0.1])
    measured("F17", wide=found[2] / 0.1 - 1, sigmas=(found[2] - 0.1) / errors(covariance)[2])
    report = fit(m, "ggx:k_s=1")
    assert report.best.diagnostics.misfit_limited
    assert "at the mirror direction: model" in report.best.diagnostics.worst[0]
    # The point fit takes what was clipped for values: its width is a little wrong still.
    assert report.best.params["alpha"] == pytest.approx(0.1, rel=0.05)
    top = float(m.values.max())
    posterior = sample(report.best, m, saturation=top, ensembles=2, steps=60, seed=1)
    alpha = posterior.summary()["alpha"]
    assert alpha.mean == pytest.approx(0.1, abs=3.5 * alpha.sd)
    assert alpha.sd < 0.0005
    plateau = check(m, report.best)["saturation"]
    assert plateau.verdict == "suspicious"
    assert plateau.figures["plateau"] == np.count_nonzero(m.values == m.values.max())


def test_retro_gap(tmp_path: Path) -> None:
    truth = {"k_d": 0.1, "k_s": 0.5, "alpha": 0.08}
    scan = "in-plane incidences=15,30,60 step=1"
    m = simulate("retro", truth, f"{scan} blind=5", (0.02, 1e-3), seed=1)
    peak = evaluate("retro", truth, np.radians(30), 0.0, np.radians(30), 0.0).item()
    row = np.isclose(m.theta_i, np.radians(30))
    theta = (np.where(np.cos(m.phi_o - m.phi_i) < 0, 1.0, -1.0) * m.theta_o)[row]
    order = np.argsort(theta)
    filled = np.interp(np.radians(-30), theta[order], m.values[0, row][order])
    measured("F18", low=1 - filled / peak)

    report = fit(m, "retro")
    assert report.best.diagnostics.samples == m.n_directions < 483
    at_gap = report.best.predict(np.radians(30), 0.0, np.radians(30), 0.0).item()
    assert at_gap == pytest.approx(peak, rel=0.02)
    # What was not measured is not made up.
    path = tmp_path / "lobes.exr"
    write_lobes(path, report.best, m)
    pixels, _ = read_exr(path)
    grid = make_grid(m)
    column = int(np.argmin(np.abs(grid.theta + 30)))
    assert np.isnan(pixels["measured.brdf"][1, column])
    assert np.isfinite(pixels["fitted.brdf"][1, column])
    # Without a lobe that looks back no candidate describes what there is.
    assert "No candidate describes this surface" in fit(m, ["lambert", "ggx:k_s=1"]).verdict
    assert "Nothing was measured within" in check(m, report.best)["retro gap"].sentence


def test_negative_values() -> None:
    truth = {"k_d": 0.003}
    m = simulate("lambert", truth, "in-plane step=1", (0.02, 0.002), seed=8)
    y = m.values[0]
    plain = {
        "dropped": y[y > 0].mean(),
        "clamped": np.maximum(y, 0).mean(),
        "logarithm": np.exp(np.log(y[y > 0]).mean()),
    }
    measured("F19", share=m.negative_share, **{k: np.pi * v / 0.003 for k, v in plain.items()})
    report = fit(m, "lambert")
    assert abs(deviations(report.best, truth)["k_d[brdf]"]) < 3
    assert report.best.diagnostics.samples == y.size
    logarithm = fit(m, "lambert", metric="log")
    assert "are not positive and have no logarithm: they were left out" in logarithm.verdict


def test_noise_of_two_parts() -> None:
    truth = {"k_d": 0.05, "k_s": 1.0, "F0": 0.5, "alpha": 0.1}
    plain, own = [], []
    for seed in range(30):
        scan = "in-plane incidences=10,30,50,70 step=2"
        m = simulate("ggx:k_s=1", truth, scan, (0.05, 1e-3), seed=seed)
        found, covariance = least_squares(ggx_of_scale_1, m, [0.1, 0.5, 0.1])
        plain.append((found - [0.05, 0.5, 0.1]) / errors(covariance))
        result = fit(m, "ggx:k_s=1").best
        own.append([*deviations(result, truth).values()])
        assert result.noise.relative[0] == pytest.approx(0.05, rel=0.2)
    rms = np.sqrt(np.mean(np.square(plain), axis=0))
    measured("F20", rel=0.25, F0=rms[1], alpha=rms[2])
    # 30 draws know a standard deviation to 13 %.
    np.testing.assert_allclose(np.sqrt(np.mean(np.square(own), axis=0)), 1.0, atol=0.4)


def test_wrong_quantity(tmp_path: Path) -> None:
    m = simulate("lambert", {"k_d": 0.8}, SCAN, (0.02, 1e-3), seed=1)
    measured("F21", k_d=float(np.pi * (np.pi * m.values).mean()))
    factor_pi = replace(m, values=np.pi * m.values)
    report = fit(factor_pi, "lambert")
    assert "which no passive surface has" in report.verdict
    found = check(factor_pi, report.best)["pi factor"]
    assert found.verdict == "suspicious"
    assert "# quantity: radiance factor" in found.remedy
    dark = replace(m, values=0.2 * factor_pi.values)
    assert check(dark, fit(dark, "lambert").best)["pi factor"].verdict == "cannot tell"

    cosine = replace(m, values=m.values * np.cos(m.theta_o))
    found = check(cosine, fit(cosine, "lambert").best)["cosine factor"]
    assert found.verdict == "suspicious"
    assert found.figures["cosine_exponent"] == pytest.approx(1.0, abs=0.03)

    path = tmp_path / "radians.csv"
    rows = [f"{t:.4f},0,{t / 2:.4f},3.1416,0.2" for t in np.linspace(0.1, 1.4, 20)]
    path.write_text("theta_i,phi_i,theta_o,phi_o,brdf\n" + "\n".join(rows))
    with pytest.raises(MeasurementError, match="look like radians but are read as degrees"):
        read_measurement(path)
