"""Standard errors: against numerical derivatives, against repeated measurements, on bounds."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest

from lobefit.fitting import FitResult, Measurement, fit, simulate
from lobefit.fitting.result import ParameterEstimate
from lobefit.fitting.scale import canonical
from lobefit.kernels import candidate, candidates, evaluate
from tests.truth import deviations

Array = npt.NDArray[np.float64]
Truth = Mapping[str, float | list[float]]

NOISE = (0.02, 1e-3)
SCAN = "in-plane incidences=10,30,50,70 step=2"
# Every candidate of the default set, and one of each kind with parameters by channel.
CANDIDATES = [*(c.name for c in candidates("standard")), "ggx:conductor", "ggx:f82", "eon"]


def inside(name: str) -> Truth:
    """Give parameters of a candidate well inside every bound, so that nothing sits on one."""
    chosen = candidate(name)
    ratios = {names[1] for names in chosen.model.coefficients if len(names) == 2}
    truth: dict[str, float | list[float]] = {}
    for p in chosen.model.parameters:
        low, high = p.bounds
        if p.name in chosen.fixed or p.name in chosen.tied:
            continue
        if p.name in ratios:
            truth[p.name] = [0.3, 0.5]
        elif p.linear:
            truth[p.name] = [0.1, 0.2] if p.name == "k_d" else [0.6, 0.5]
        elif p.period:
            truth[p.name] = 0.7
        elif p.per_channel:
            truth[p.name] = [0.8 * p.default, 0.7 * p.default]
        elif p.default in (low, high):
            truth[p.name] = 0.6 * low + 0.4 * high
        else:
            truth[p.name] = p.default
    for wide, narrow, _ in chosen.model.axes:
        truth |= {wide: 0.3} if wide in truth else {}
        truth |= {narrow: 0.15} if narrow in truth else {}
    if chosen.model.ordered:
        first, second = chosen.model.ordered
        truth |= {first: 0.08, second: 0.35}
    return truth


def exact(name: str, truth: Truth) -> Measurement:
    """Give values without noise that state the uncertainty of a noisy measurement."""
    stated = simulate(name, truth, SCAN, NOISE, sigma=True)
    clean = simulate(name, truth, SCAN, (0.0, 0.0))
    return replace(stated, values=clean.values)


def estimate(result: FitResult, name: str) -> ParameterEstimate:
    (found,) = (e for e in result.estimates if e.name == name)
    return found


def free(result: FitResult) -> list[ParameterEstimate]:
    return [e for e in result.estimates if e.status not in ("fixed", "tied")]


def jacobian(result: FitResult, m: Measurement) -> Array:
    """Differentiate all values (C N) along every free estimate (F), by evaluating the model."""
    chosen = candidate(result.candidate)

    def values(e: ParameterEstimate, change: float) -> Array:
        params = {k: (list(v) if isinstance(v, list) else v) for k, v in result.params.items()}
        entry = params[e.name]
        if isinstance(entry, list):
            assert e.channel is not None
            entry[m.channels.index(e.channel)] += change
        else:
            params[e.name] = entry + change
        for follower, leader in chosen.tied.items():
            params[follower] = params[leader]
        f = evaluate(chosen.model, params, m.theta_i, m.phi_i, m.theta_o, m.phi_o)
        return np.broadcast_to(f, m.values.shape).ravel()

    columns = []
    for e in free(result):
        h = 1e-5 * max(abs(e.value), 1e-3)
        columns.append((values(e, h) - values(e, -h)) / (2 * h))
    return np.stack(columns, axis=1)


@pytest.mark.parametrize("name", CANDIDATES)
def test_covariance_is_the_inverse_of_the_curvature(name: str) -> None:
    """Where residuals vanish, half the Hessian of chi-square is J W J exactly."""
    m = exact(name, inside(name))
    result = fit(m, [name]).best
    assert m.sigma is not None
    J = jacobian(result, m) / m.sigma.ravel()[:, None]
    expected = np.linalg.inv(J.T @ J)
    errors = np.sqrt(np.diag(expected))
    # Central differences of the fit, 1e-4 of a parameter, leave 1e-8 of the third derivative;
    # the correlation of k_s and F0, 0.99, magnifies it.
    np.testing.assert_allclose(
        result.covariance / np.outer(errors, errors),
        expected / np.outer(errors, errors),
        atol=2e-5,
    )
    for e, error in zip(free(result), errors, strict=True):
        assert e.status == "free"
        assert e.standard_error == pytest.approx(error, rel=2e-5)


def test_covariance_of_a_noisy_fit_is_the_hessian_of_chi_square() -> None:
    m = simulate("ggx", inside("ggx"), SCAN, NOISE, seed=1, sigma=True)
    m = replace(
        m,
        values=m.values[:1],
        sigma=m.sigma[:1] if m.sigma is not None else None,
        channels=("one",),
    )
    result = fit(m, ["ggx"]).best
    names = [e.name for e in free(result)]
    at = np.array([e.value for e in free(result)])
    errors = np.array([e.standard_error for e in free(result)])
    assert m.sigma is not None
    sigma = m.sigma

    def chi_square(x: Array) -> float:
        params = dict(zip(names, x.tolist(), strict=True))
        f = evaluate("ggx", params, m.theta_i, m.phi_i, m.theta_o, m.phi_o)
        return float((((m.values - f) / sigma) ** 2).sum())

    assert chi_square(at) == pytest.approx(result.objective, rel=1e-9)
    h = np.diag(0.1 * errors)
    hessian = np.array(
        [
            [
                chi_square(at + h[i] + h[j])
                - chi_square(at + h[i] - h[j])
                - chi_square(at - h[i] + h[j])
                + chi_square(at - h[i] - h[j])
                for j in range(4)
            ]
            for i in range(4)
        ]
    ) / (4 * np.outer(np.diag(h), np.diag(h)))
    expected = np.sqrt(np.diag(np.linalg.inv(hessian / 2)))
    # Gauss-Newton leaves out residuals times second derivatives: 1/sqrt(320) = 6 % and less.
    np.testing.assert_allclose(errors, expected, rtol=0.06)


def test_errors_are_the_scatter_of_repeated_measurements() -> None:
    name, truth = "ggx:k_s=1", {"k_d": 0.15, "k_s": 1.0, "F0": 0.2, "alpha": 0.25}
    found = [fit(simulate(name, truth, SCAN, NOISE, seed), [name]).best for seed in range(500, 560)]
    z = np.array([list(deviations(result, truth).values()) for result in found])
    assert z.shape == (60, 3)
    # 60 draws: their mean scatters by 0.13, their standard deviation by 0.09; three of those.
    np.testing.assert_allclose(z.mean(axis=0), 0.0, atol=0.4)
    np.testing.assert_allclose(z.std(axis=0), 1.0, atol=0.28)


def test_estimated_noise_gives_the_errors_of_the_stated_one() -> None:
    truth = inside("ggx")
    stated = simulate("ggx", truth, SCAN, NOISE, seed=2, sigma=True)
    unstated = replace(stated, sigma=None)
    first, second = fit(stated, ["ggx"]).best, fit(unstated, ["ggx"]).best
    assert first.noise.given
    assert not second.noise.given
    for a, b in zip(free(first), free(second), strict=True):
        assert a.standard_error is not None
        # The two scales are found from 320 values of each channel: to 6 %, and 1 in 3 beyond.
        assert b.standard_error == pytest.approx(a.standard_error, rel=0.2)


def test_errors_follow_the_stated_sigma_whatever_the_residuals() -> None:
    m = simulate("ggx", inside("ggx"), SCAN, NOISE, seed=3, sigma=True)
    assert m.sigma is not None
    wider = replace(m, sigma=3 * m.sigma)
    for a, b in zip(free(fit(m, ["ggx"]).best), free(fit(wider, ["ggx"]).best), strict=True):
        assert a.standard_error is not None
        assert b.value == pytest.approx(a.value, rel=1e-5)
        assert b.standard_error == pytest.approx(3 * a.standard_error, rel=1e-4)


# On a bound


def test_on_the_lower_bound_the_error_is_that_of_a_free_estimate() -> None:
    """A diffuse term below zero ends at zero, and says how far from it one would have to be."""
    m = exact("ggx", {"k_d": 0.0, "k_s": 0.6, "F0": 0.5, "alpha": 0.2})
    m = replace(m, values=m.values - 1e-3)
    result = fit(m, ["ggx"]).best
    k_d = estimate(result, "k_d")
    assert (k_d.value, k_d.status) == (0.0, "lower")
    assert m.sigma is not None
    J = jacobian_at_zero(result, m) / m.sigma.ravel()[:, None]
    expected = math.sqrt(np.linalg.inv(J.T @ J)[0, 0])
    assert k_d.standard_error == pytest.approx(expected, rel=1e-3)
    assert [e.status for e in result.estimates[1:]] == ["free"] * 3


def jacobian_at_zero(result: FitResult, m: Measurement) -> Array:
    """As `jacobian`; the values are linear in k_d, so that its column needs no step below 0."""
    above = replace(result, params={**result.params, "k_d": 0.1})
    return jacobian(above, m)


def test_on_the_upper_bound() -> None:
    """More than the whole light at normal incidence: F0 stays at 1."""
    m = exact("ggx:k_s=1", {"k_d": 0.1, "F0": 1.0, "alpha": 0.3})
    m = replace(m, values=1.2 * m.values)
    F0 = estimate(fit(m, ["ggx:k_s=1"]).best, "F0")
    assert (F0.value, F0.status) == (1.0, "upper")
    assert F0.standard_error is not None
    assert 0.0 < F0.standard_error < 0.1


@pytest.mark.parametrize(
    ("name", "shape"),
    [("ggx", ["F0", "alpha"]), ("ward:isotropic", ["alpha_x"]), ("blinn_phong", ["n"])],
)
def test_without_a_lobe_its_shape_is_undetermined(name: str, shape: list[str]) -> None:
    """A matte surface whose noise leaves no room for a lobe: k_s = 0, of no shape."""
    m = simulate("lambert", {"k_d": 0.5}, SCAN, NOISE, seed=1, sigma=True)
    result = fit(m, [name]).best
    assert (estimate(result, "k_s").value, estimate(result, "k_s").status) == (0.0, "lower")
    for parameter in shape:
        nothing = estimate(result, parameter)
        assert (nothing.status, nothing.standard_error) == ("undetermined", None)
    k_d = estimate(result, "k_d")
    assert k_d.status == "free"
    assert abs(k_d.value - 0.5) < 3 * (k_d.standard_error or 0.0)
    assert np.isfinite(result.covariance).all()
    assert "undetermined" in str(result)


def test_a_held_parameter_has_no_error() -> None:
    result = fit(simulate("ggx:k_s=1", {"alpha": 0.2}, SCAN, NOISE, seed=4), ["ggx:k_s=1"]).best
    k_s = estimate(result, "k_s")
    assert (k_s.value, k_s.standard_error, k_s.status) == (1.0, None, "fixed")
    assert result.covariance.shape == (3, 3)


def test_a_lobe_narrower_than_the_steps_has_no_width() -> None:
    """F4, F5: of a mirror only its place is seen at 5 degree steps, never its width."""
    scan = "in-plane incidences=12.5,32.5,52.5 step=5"
    m = simulate("ggx:k_s=1", {"k_d": 0.3, "F0": 0.5, "alpha": 1e-4}, scan, NOISE, seed=5)
    alpha = estimate(fit(m, ["ggx:k_s=1"]).best, "alpha")
    assert alpha.status in ("lower", "undetermined")


FRESNEL = {"k_d": 0.05, "k_s": 1.0, "F0": 0.04, "alpha": 0.1}


def test_strength_and_f0_are_told_apart_by_grazing_angles() -> None:
    m = simulate("ggx", FRESNEL, "in-plane incidences=5,30,60,75 step=0.5", (0.02, 1e-4), seed=6)
    result = fit(m, ["ggx"]).best
    for name in ("k_s", "F0"):
        e = estimate(result, name)
        assert e.standard_error is not None
        assert e.standard_error < 0.05 * e.value
        assert abs(e.value - FRESNEL[name]) < 3 * e.standard_error


@pytest.mark.parametrize("seed", [6, 7])
def test_strength_and_f0_cannot_be_told_apart_near_the_normal(seed: int) -> None:
    """F6: within 5 degrees only k_s F0 is seen. An interval that is given holds the truth."""
    scan = "in-plane incidences=1,3,5 step=0.5 max=6"
    result = fit(simulate("ggx", FRESNEL, scan, (0.02, 1e-4), seed), ["ggx"]).best
    k_s, F0 = estimate(result, "k_s"), estimate(result, "F0")
    assert k_s.value * F0.value == pytest.approx(0.04, rel=0.1)  # 1.7 % standard error
    wrong = {
        e.name: f"{e.value:.3g} ± {e.standard_error:.2g}"
        for e in (k_s, F0)
        if e.standard_error and abs(e.value - FRESNEL[e.name]) > 5 * e.standard_error
    }
    assert wrong == {}


# Labels


@pytest.mark.parametrize("seed", range(3))
def test_canonical_labels_name_the_same_surface(seed: int) -> None:
    chosen = candidate("ward")
    names = [p.name for p in chosen.searched]
    rng = np.random.default_rng(seed)
    angles = rng.uniform(0, 1.4, 50), rng.uniform(0, 6, 50), rng.uniform(0, 1.4, 50), 0.0
    for _ in range(20):
        x = np.array([*rng.uniform(0.05, 0.8, 2), rng.uniform(-3, 6)])
        label = canonical(chosen, x)
        assert label[0] >= label[1]
        assert 0.0 <= label[2] < math.pi
        f, g = (
            evaluate("ward", dict(zip(names, v.tolist(), strict=True)), *angles) for v in (x, label)
        )
        np.testing.assert_allclose(g, f, rtol=1e-10)
        np.testing.assert_array_equal(canonical(chosen, label), label)


@pytest.mark.parametrize(
    ("truth", "expected"),
    [
        ((0.3, 0.1, 0.5), (0.3, 0.1, 0.5)),
        ((0.1, 0.3, 0.5), (0.3, 0.1, 0.5 + math.pi / 2)),
        ((0.1, 0.3, 2.0), (0.3, 0.1, 2.0 - math.pi / 2)),
        ((0.3, 0.1, 0.0), (0.3, 0.1, 0.0)),
        ((0.3, 0.1, 3.13), (0.3, 0.1, 3.13)),
        ((0.3, 0.1, -0.4), (0.3, 0.1, math.pi - 0.4)),
        ((0.21, 0.2, 1.0), (0.21, 0.2, 1.0)),
    ],
)
def test_the_wider_axis_is_x(
    truth: tuple[float, float, float], expected: tuple[float, float, float]
) -> None:
    names = ("alpha_x", "alpha_y", "phi_x")
    params = {"k_d": 0.1, "k_s": 0.5}
    m = simulate("ward", params | dict(zip(names, truth, strict=True)), noise=(0.01, 1e-3), seed=7)
    result = fit(m, ["ward"]).best
    found = deviations(result, params | dict(zip(names, expected, strict=True)))
    assert estimate(result, "alpha_x").value >= estimate(result, "alpha_y").value
    assert 0.0 <= estimate(result, "phi_x").value < math.pi
    # 3.5 standard errors: 35 numbers are looked at.
    assert {name: z for name, z in found.items() if not abs(z) < 3.5} == {}
    errors = {name: estimate(result, name).standard_error or 0.0 for name in names}
    # Both widths are known to the same share of themselves: errors keep to their labels.
    ratio = (errors["alpha_x"] / expected[0]) / (errors["alpha_y"] / expected[1])
    assert 0.3 < ratio < 3.0


def test_equal_axes_have_no_azimuth() -> None:
    m = exact("ward", {"k_d": 0.1, "k_s": 0.5, "alpha_x": 0.2, "alpha_y": 0.2, "phi_x": 0.0})
    result = fit(m, ["ward"]).best
    phi_x = estimate(result, "phi_x")
    assert (phi_x.status, phi_x.standard_error) == ("undetermined", None)
    for name in ("alpha_x", "alpha_y"):
        assert estimate(result, name).value == pytest.approx(0.2, rel=1e-3)
