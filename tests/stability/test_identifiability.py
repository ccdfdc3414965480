"""F4 to F7, F23: parameters that data do not determine."""

from __future__ import annotations

import re

import numpy as np
import pytest

from lobefit.fitting import FitResult, fit, simulate
from tests.kernels.transcriptions import load
from tests.stability.modes import measured
from tests.stability.naive import Array, angles, beckmann, errors, ggx, least_squares
from tests.truth import deviations

# Between the steps of the scan: the peak itself is never seen.
BETWEEN = "in-plane incidences=20.5,40.5,60.5 step=1"


def said(result: FitResult) -> str:
    assert result.identifiability is not None
    return ". ".join(result.identifiability.sentences)


def status(result: FitResult, name: str) -> str:
    (found,) = (e for e in result.estimates if e.name == name)
    assert (found.standard_error is None) == (found.status == "undetermined")
    return found.status


def limit(result: FitResult, name: str) -> tuple[str, float]:
    assert result.identifiability is not None
    found = [x for x in result.identifiability.limits if x.parameter == name]
    assert len(found) == 1
    return found[0].kind, found[0].value


def test_peak_between_the_steps() -> None:
    truth = {"k_d": 0.1, "k_s": 1.0, "F0": 0.5, "alpha": 1e-4}
    m = simulate("beckmann", truth, BETWEEN, (0.01, 1e-3), seed=1)
    x, sigma = angles(m), np.hypot(0.01 * 0.1 / np.pi, 1e-3)
    chi2 = [
        float((((beckmann(x, 0.1, 0.5, np.log(alpha)) - m.values[0]) / sigma) ** 2).sum())
        for alpha in (1e-4, 7e-4)
    ]
    found, covariance = least_squares(
        beckmann, m, [0.1, 0.5, np.log(0.001)], sigma=np.full(m.n_directions, sigma)
    )
    measured("F4", rel=0.2, alpha=np.exp(found[2]), error=errors(covariance)[2])
    assert chi2[1] - chi2[0] == pytest.approx(0.0, abs=0.1)
    result = fit(m, "beckmann:k_s=1").best
    kind, value = limit(result, "alpha")
    assert kind == "upper"
    assert 1e-4 < value < 0.002
    assert "narrower than the readings resolve" in said(result)
    assert status(result, "alpha") == status(result, "F0") == "undetermined"
    # With k_s free too, what fits may be no peak at all.
    full = fit(m, "beckmann").best
    assert {status(full, name) for name in ("k_s", "F0", "alpha")} == {"undetermined"}


def test_limits_from_few_readings_on_the_peak() -> None:
    """Three readings on the peak tell two parameters, and one residual their noise."""
    truth = {"k_d": 0.1, "k_s": 1.0, "F0": 0.5, "alpha": 1e-3}
    wrong = {"wrong": 0, "stated": 0}
    for seed in range(20):
        for name, sigma in (("wrong", False), ("stated", True)):
            scan = "in-plane incidences=20,40,60 step=1"
            m = simulate("beckmann", truth, scan, (0.01, 1e-3), seed=seed, sigma=sigma)
            result = fit(m, "beckmann:k_s=1").best
            wrong[name] += limit(result, "alpha")[1] < 1e-3
            assert status(result, "F0") == "undetermined"
    # At 95 %, 20 draws give 4 or more wrong ones in 2 % of all cases.
    assert max(wrong.values()) < 4
    measured("F4", rel=0.0, **wrong)


def test_saturated_exponent() -> None:
    truth = {"k_d": 0.1, "k_s": 0.5, "n": 5e5}
    m = simulate("blinn_phong", truth, "in-plane incidences=20,40,60 step=2", (0.01, 1e-3), seed=1)
    x, blinn_phong = angles(m), load("blinn_phong")

    def model(x: Array, k_d: float, k_s: float, n: float) -> Array:
        return np.asarray(blinn_phong(*x, k_d=k_d, k_s=k_s, n=n)[0], dtype=np.float64)

    sigma = np.hypot(0.01 * model(x, *truth.values()), 1e-3)
    chi2 = [
        (((model(x, 0.1, 0.5 * 500_002 / (n + 2), n) - m.values[0]) / sigma) ** 2).sum()
        for n in (2.5e5, 1e6)
    ]
    found = [least_squares(model, m, [0.1, 0.5, n], sigma=sigma)[0][2] for n in (2e5, 1e6)]
    measured("F5", rel=0.3, low=found[0], high=found[1])
    assert abs(chi2[1] - chi2[0]) < 1e-3
    result = fit(m, "blinn_phong").best
    kind, value = limit(result, "n")
    assert kind == "lower"
    assert 5e4 < value < 5e5
    assert "k_s and n cannot be told apart; k_s n = 2.5" in said(result)


def test_a_dip_in_the_flat_valley() -> None:
    truth = {"k_d": 0.1, "k_s": 0.5, "n": 5e5}
    off, dips = [], 0
    for seed in range(10):
        scan = "in-plane incidences=20,40,60 step=2"
        m = simulate("blinn_phong", truth, scan, (0.01, 1e-3), seed=seed)
        result = fit(m, "blinn_phong").best
        assert limit(result, "n")[1] < 5e5
        assert status(result, "k_s") == status(result, "n") == "undetermined"
        (found,) = re.findall(r"k_s n = (\S+) is known to (\S+) %", said(result))
        value, error = map(float, found)
        # In units of an error that is one of Student's t with two degrees of freedom.
        off.append((value / 250_001 - 1) / (0.01 * error))
        assert result.identifiability is not None
        dips += not result.identifiability.combinations
    assert dips >= 3
    assert max(map(abs, off)) < 5
    assert np.median(np.abs(off)) < 1.5


def test_strength_and_f0() -> None:
    truth = {"k_d": 0.05, "k_s": 1.0, "F0": 0.04, "alpha": 0.1}
    m = simulate("ggx", truth, "in-plane incidences=1,3,5 step=0.5 max=6", (0.02, 1e-4), seed=6)
    sigma = np.hypot(0.02 * ggx(angles(m), *truth.values()), 1e-4)
    strengths = []
    for k_s in (0.1, 1.0, 10.0):
        found, _ = least_squares(
            ggx, m, [0.05, k_s, min(0.04 / k_s, 0.4), 0.1], sigma=sigma, absolute_sigma=True
        )
        strengths.append(found[1])
        assert found[1] * found[2] == pytest.approx(0.04, rel=0.1)
    measured("F6", low=strengths[0], middle=strengths[1], high=strengths[2])
    result = fit(m, "ggx").best
    assert "k_s and F0 cannot be told apart; k_s F0 = 0.0" in said(result)
    assert result.identifiability is not None
    product = result.identifiability.combinations[0]
    assert product.parameters == ("k_s", "F0")
    assert product.value == pytest.approx(0.04, rel=3 * (product.product_error or 0.0))
    assert (product.product_error or 1.0) < 0.1
    assert "of incidence would shrink the error" in said(result)
    wide = simulate("ggx", truth, "in-plane incidences=5,30,60 step=1", (0.02, 1e-4), seed=6)
    assert said(fit(wide, "ggx").best) == ""


def test_diffuse_part_of_a_metal() -> None:
    truth = {"k_d": 1e-3, "k_s": 1.0, "F0": 0.9, "alpha": 0.2}
    negative, error, above = 0, [], 0
    for seed in range(10):
        scan = "in-plane incidences=10,30,50,70 step=5"
        m = simulate("ggx", truth, scan, (0.02, 1e-3), seed=seed)
        sigma = np.hypot(0.02 * ggx(angles(m), *truth.values()), 1e-3)
        found, covariance = least_squares(
            ggx, m, [*truth.values()], sigma=sigma, absolute_sigma=True
        )
        negative += found[0] < 0
        error.append(errors(covariance)[0] / 1e-3)
        result = fit(m, "ggx:k_s=1").best
        kind, value = limit(result, "k_d")
        assert kind == "upper"
        assert value < 0.005
        above += value > 1e-3
        assert "k_d < 0.00" in said(result)
    measured("F7", error=float(np.mean(error)), negative=negative)
    assert above >= 8


def test_parameter_at_its_bound() -> None:
    scan = "in-plane incidences=10,30,50,70 step=2"
    felt = simulate("oren_nayar", {"k_d": 0.2, "sigma": 0.5}, scan, (0.02, 1e-3), seed=1)
    ward = load("ward")

    def model(x: Array, k_d: float, k_s: float, alpha: float) -> Array:
        lobe = ward(*x, k_d=k_d, k_s=k_s, alpha_x=alpha, alpha_y=alpha, phi_x=0.0)
        return np.asarray(lobe[0], dtype=np.float64)

    found, covariance = least_squares(
        model,
        felt,
        [0.1, 0.1, 0.2],
        bounds=([0, 0, 0.01], [1, 1, 0.5]),
        sigma=0.02 * felt.values[0] + 1e-3,
    )
    measured("F23", alpha=found[2], error=errors(covariance)[2])
    report = fit(felt, ["ward:isotropic", "oren_nayar"])
    assert report.best.candidate == "oren_nayar"
    assert max(map(abs, deviations(report.best, {"k_d": 0.2, "sigma": 0.5}).values())) < 3.5
    railed = {e.name: e for e in report.results[1].estimates}
    assert railed["k_s"].status == "lower"
    assert railed["alpha_x"].status == "lower"
    assert railed["alpha_x"].standard_error is None
    assert "lower bound" in str(report.results[1])
