"""Fused sums against the same sums in numpy, and their derivatives against the formulas."""

from __future__ import annotations

from dataclasses import dataclass
from typing import get_args

import numpy as np
import numpy.typing as npt
import pytest

from lobefit.fitting import fit, simulate
from lobefit.kernels import ModelError, get_device, get_model, models
from lobefit.kernels.evaluate import basis_values
from lobefit.kernels.geometry import Directions, Precision
from lobefit.kernels.parameters import coefficients_of, complete, nonlinear_of
from lobefit.kernels.program import ModelProgram, model_program
from lobefit.kernels.sums import (
    Metric,
    Observations,
    Sums,
    chi_square,
    normal_equations,
    transform,
)
from tests.kernels.strategies import Params, directions
from tests.kernels.transcriptions import load

Array = npt.NDArray[np.float64]

every_model = pytest.mark.parametrize("name", models())
every_precision = pytest.mark.parametrize("precision", get_args(Precision))
every_metric = pytest.mark.parametrize("metric", get_args(Metric))
channel_counts = pytest.mark.parametrize("channels", [1, 3])

# Rounding of a term, times the few operations it takes, times the 16 terms that are added in
# that precision before the sum goes on in double; relative to the sum of the terms' sizes.
TOLERANCE = {"double": 1e-13, "single": 1e-6}
SETS = 3


def off_default(name: str, k: int) -> Params:
    """Give parameters inside their bounds, different for each k."""
    params: Params = {}
    for j, p in enumerate(get_model(name).parameters):
        low, high = p.bounds
        if p.linear:
            params[p.name] = [0.2 + 0.1 * j + 0.05 * k, 0.3, 0.6][: 3 if p.per_channel else 1]
        elif p.period:
            params[p.name] = 0.3 + 0.2 * k
        elif p.scale == "log":
            params[p.name] = min(p.default * (1.0 + 0.1 * (j % 4) + 0.2 * k), 0.9 * high)
        else:  # from the default towards the bound that is farther away
            far = high if high - p.default > p.default - low else low
            params[p.name] = p.default + (0.1 + 0.05 * (j % 3) + 0.1 * k) * (far - p.default)
    return params


@dataclass
class Case:
    """A model, a measurement of it, and SETS sets of parameters."""

    program: ModelProgram
    directions: Directions
    values: Array
    weights: Array
    x: Array
    coefficients: Array

    def basis(self) -> Array:
        return basis_values(self.program, self.directions, self.x)


def make(name: str, channels: int, precision: Precision, count: int = 1003) -> Case:
    """Half of the measured values near the mirror, some missing, negative or unweighted."""
    model = get_model(name)
    program = model_program(model)
    d = Directions(get_device(), *directions(count, seed=5, theta_max=85.0), precision)
    sets = [complete(model, off_default(name, k)) for k in range(SETS)]
    x = np.concatenate([nonlinear_of(model, full) for full in sets])
    c = np.stack(
        [np.broadcast_to(coefficients_of(model, full), (3, program.n_basis)) for full in sets]
    )
    c = c[:, :channels]
    rng = np.random.default_rng(8)
    model_values = np.einsum("ck,kn->cn", c[0], basis_values(program, d, x)[0])
    values = model_values * rng.uniform(0.5, 1.5, model_values.shape)
    values[:, 3::50] *= -1.0
    values[0, 1::40] = np.nan
    weights = rng.uniform(0.1, 2.0, values.shape)
    weights[:, ::7] = 0.0
    return Case(program, d, values, weights, x, c)


def in_numpy(case: Case, metric: Metric) -> tuple[Sums, Sums]:
    """Give the sums, and the sums of the sizes of their terms."""
    basis = case.basis()  # (P, K, N)
    f = np.einsum("pck,pkn->pcn", case.coefficients, basis)
    cosine = case.directions.plane("cos_theta_i")
    least: dict[str, Array | float] = {"log": 0.0, "cosine_log": -1 / cosine}
    used = np.isfinite(case.values) & (case.values > least.get(metric, -np.inf))
    y = np.where(used, case.values, 1.0)
    w = np.where(used, case.weights, 0.0)
    size = np.ones_like(f)
    if metric == "log":
        t, measured, slope = np.log(f), np.log(y), 1 / f
        size = 1.0 + np.abs(t)  # the logarithm's own rounding, of its argument
    elif metric == "cube_root":
        t, measured, slope = np.cbrt(f), np.cbrt(y), np.cbrt(f) / (3 * f)
    elif metric == "cosine_log":
        t, measured, slope = np.log1p(f * cosine), np.log1p(y * cosine), 1 / (1 / cosine + f)
    else:
        t, measured, slope = f, y, np.ones_like(f)
    r = measured - t
    J = slope[:, :, None] * basis[:, None]  # (P, C, K, N)
    whole = np.abs(measured) + np.abs(t) + (size if metric == "log" else 0.0)

    def sums(residual: Array, columns: Array) -> Sums:
        return Sums(
            np.einsum("cn,pcn,pcn->pc", w, residual, residual),
            np.einsum("cn,pckn,pcn->pck", w, columns, residual),
            np.einsum("cn,pckn,pcln->pckl", w, columns, columns),
        )

    return sums(r, J), sums(whole, J)


def close(found: Array, expected: Array, scale: Array, tolerance: float) -> None:
    assert found.shape == expected.shape
    # Squares below 1e-38 are 0 in single precision; nothing sums to so little that matters.
    error = np.abs(found - expected) / np.where(scale > 1e-30, scale, 1.0)
    assert error.max() < tolerance, f"{error.max():.2e} of the terms' size"


@every_model
@channel_counts
@every_precision
@every_metric
def test_sums_agree_with_numpy(
    name: str, channels: int, precision: Precision, metric: Metric
) -> None:
    case = make(name, channels, precision)
    observations = Observations(case.directions, case.values, case.weights, metric)
    expected, scale = in_numpy(case, metric)
    tolerance = TOLERANCE[precision]
    found = normal_equations(case.program, observations, case.x, case.coefficients)
    close(found.chi_square, expected.chi_square, scale.chi_square, tolerance)
    close(found.rhs, expected.rhs, scale.rhs, tolerance)
    close(found.gram, expected.gram, scale.gram, tolerance)
    alone = chi_square(case.program, observations, case.x, case.coefficients)
    close(alone, expected.chi_square, scale.chi_square, tolerance)
    # The misfit is half of the values: what the tolerance allows are digits, not residuals.
    assert (expected.chi_square > 0.005 * scale.chi_square).all() or metric != "identity"


@every_model
@every_precision
@pytest.mark.parametrize("count", [1, 2, 7, 8, 9, 127, 128, 129, 1023, 1025])
def test_any_number_of_directions(name: str, precision: Precision, count: int) -> None:
    """The padding to whole vectors, blocks and chunks counts nothing."""
    case = make(name, 1, precision, count)
    case.values[:] = np.where(np.isfinite(case.values), case.values, 1.0)
    case.weights[:] = 1.0
    observations = Observations(case.directions, case.values, case.weights)
    expected, scale = in_numpy(case, "identity")
    found = normal_equations(case.program, observations, case.x, case.coefficients)
    close(found.chi_square, expected.chi_square, scale.chi_square, TOLERANCE[precision])
    close(found.gram, expected.gram, scale.gram, TOLERANCE[precision])


def test_residuals_of_nothing_are_the_values() -> None:
    case = make("ggx", 3, "double")
    observations = Observations(case.directions, case.values, case.weights)
    found = normal_equations(case.program, observations, case.x)
    w = np.where(observations.used, case.weights, 0.0)
    y = np.where(observations.used, case.values, 0.0)
    expected = np.broadcast_to((w * y**2).sum(axis=1), (SETS, 3))
    np.testing.assert_allclose(found.chi_square, expected, rtol=1e-13)
    rhs = np.einsum("cn,pkn,cn->pck", w, case.basis(), y)
    np.testing.assert_allclose(found.rhs, rhs, rtol=1e-11)


def test_what_is_not_visible_or_not_finite_counts_nothing() -> None:
    theta_o = np.array([0.3, np.pi / 2, 2.0, 0.3, 0.3])
    d = Directions(get_device(), 0.2, 0.0, theta_o, 0.5)
    values = np.array([[1.0, 5.0, 5.0, np.nan, -2.0]])
    program = model_program(get_model("lambert"))
    x, c = np.zeros((1, 0)), np.array([[[np.pi]]])  # the model is 1 everywhere
    expected = {
        "identity": ([True, False, False, False, True], 9.0),
        "cube_root": ([True, False, False, False, True], (np.cbrt(2.0) + 1.0) ** 2),
        "log": ([True, False, False, False, False], 0.0),
        # 1 - 2 cos(0.2) < 0
        "cosine_log": ([True, False, False, False, False], 0.0),
    }
    for metric in get_args(Metric):
        observations = Observations(d, values, np.full_like(values, np.nan), metric)
        observations.set_weights(np.where(np.isfinite(values), 1.0, np.nan))
        used, total = expected[metric]
        assert observations.used.tolist() == [used]
        found = chi_square(program, observations, x, c)
        assert found.item() == pytest.approx(total, rel=1e-14, abs=1e-28)


def test_a_model_of_zero_has_a_finite_logarithm() -> None:
    """The search may come to k = 0; the value there is large, and no NaN."""
    case = make("ggx", 1, "double")
    for metric in get_args(Metric):
        observations = Observations(case.directions, case.values, case.weights, metric)
        found = normal_equations(
            case.program, observations, case.x, np.zeros_like(case.coefficients)
        )
        for part in (found.chi_square, found.rhs, found.gram):
            assert np.isfinite(part).all()


def test_transforms() -> None:
    y = np.array([1e-9, 0.5, 8.0])
    assert transform(y, "identity") is y
    np.testing.assert_array_equal(transform(y, "log"), np.log(y))
    np.testing.assert_array_equal(transform(-y, "cube_root"), -np.cbrt(y))
    cosine = np.array([1.0, 0.5, 0.25])
    np.testing.assert_array_equal(
        transform(-y[:2], "cosine_log", cosine[:2]), np.log1p([-1e-9, -0.25])
    )
    with pytest.raises(ModelError, match="cosines"):
        transform(y, "cosine_log")


def test_negative_values_count_where_the_logarithm_has_a_value() -> None:
    theta_i = np.radians([0.0, 60.0, 60.0])
    d = Directions(get_device(), theta_i, 0.0, 0.3, 0.5)
    values = np.array([[-0.5, -1.9, -2.1]])
    observations = Observations(d, values, np.ones_like(values), "cosine_log")
    assert observations.used.tolist() == [[True, True, False]]
    program = model_program(get_model("lambert"))
    found = chi_square(program, observations, np.zeros((1, 0)), np.array([[[np.pi]]]))
    expected = np.log(0.5 / 2) ** 2 + np.log(0.05 / 1.5) ** 2
    assert found.item() == pytest.approx(expected, rel=1e-13)


def test_wrong_calls_are_refused() -> None:
    case = make("ggx", 1, "double")
    with pytest.raises(ModelError, match="'sqrt'"):
        Observations(case.directions, case.values, case.weights, "sqrt")  # type: ignore[arg-type]
    observations = Observations(case.directions, case.values, case.weights)
    with pytest.raises(ModelError, match=r"\(3, 2, 3\), not \(3, 1, 3\)"):
        chi_square(case.program, observations, case.x, np.zeros((3, 2, 3)))


# Derivatives

# Relative half widths of the differences, as the fit takes them, and what they leave over:
# its square times a third derivative (some hundreds, at 20 widths off the peak), and rounding
# divided by the step.
STEPS: dict[str, tuple[float, float]] = {"double": (1e-4, 2e-7), "single": (2e-3, 3e-4)}


@every_precision
def test_channels_with_parameters_of_their_own(precision: Precision) -> None:
    """Sums with one set of nonlinear parameters per channel are those of each channel alone."""
    case = make("ggx", 1, precision)
    own = np.stack([case.x[0] * (1.0 + 0.2 * c) for c in range(len(case.values))])
    c = case.coefficients[:1]
    observations = Observations(case.directions, case.values, case.weights)
    steps = 1e-3 * own
    together = normal_equations(case.program, observations, own[None], c, steps[None])
    squares = chi_square(case.program, observations, own[None], c)
    for channel, x in enumerate(own):
        alone = normal_equations(case.program, observations, x[None], c, steps[channel][None])
        np.testing.assert_array_equal(together.gram[0, channel], alone.gram[0, channel])
        np.testing.assert_array_equal(together.rhs[0, channel], alone.rhs[0, channel])
        assert together.chi_square[0, channel] == alone.chi_square[0, channel]
        rel = 1e-12 if precision == "double" else 1e-7  # another kernel, contracted otherwise
        assert squares[0, channel] == pytest.approx(alone.chi_square[0, channel], rel=rel)


@pytest.mark.parametrize("name", [name for name in models() if models()[name].nonlinear])
@every_precision
def test_derivatives_agree_with_the_formula(name: str, precision: Precision) -> None:
    """One channel per direction, with all its weight: each derivative is seen by itself."""
    model = get_model(name)
    program = model_program(model)
    count = 64
    angles = directions(count, seed=9, theta_max=80.0)
    d = Directions(get_device(), *angles, precision)
    observations = Observations(d, np.ones((count, count)), np.eye(count))
    params = {key: v[0] if isinstance(v, list) else v for key, v in off_default(name, 1).items()}
    full = complete(model, params)
    x = nonlinear_of(model, full)
    relative, tolerance = STEPS[precision]
    steps = relative * np.abs(x)
    c = np.broadcast_to(coefficients_of(model, full), (count, program.n_basis))[None]
    found = normal_equations(program, observations, x, c, steps)
    assert found.gram.shape == (1, count, *2 * (program.n_basis + len(program.derivatives),))
    # The first basis times the derivatives of all bases.
    first = basis_values(program, d, x)[0, 0][:, None]
    per_basis = found.gram[0, :, 0, program.n_basis :] / first
    transcription = load(name)
    exact = angles.exact()
    for j, p in enumerate(model.nonlinear):
        columns = [k for k, (_, x_index) in enumerate(program.derivatives) if x_index == j]
        bases = [program.derivatives[k][0] for k in columns]
        got = (c[0][:, bases] * per_basis[:, columns]).sum(axis=1)
        value, h = params[p.name], 1e-5 * x[0, j]
        ahead, behind = (
            transcription(*exact, **(params | {p.name: value + sign * h}))[0] for sign in (1, -1)
        )
        expected = ((ahead - behind) / (2 * h)).astype(np.float64)
        f = transcription(*exact, **params)[0].astype(np.float64)
        scale = np.abs(expected) + np.abs(f) / x[0, j]
        close(got, expected, scale, tolerance)


@every_precision
def test_derivatives_carry_the_slope_of_the_metric(precision: Precision) -> None:
    """The gradient of chi-square along a coefficient and a parameter, by moving them."""
    case = make("ggx", 1, precision)
    x, c = case.x[:1], case.coefficients[:1]
    for metric in get_args(Metric):
        observations = Observations(case.directions, case.values, case.weights, metric)
        sums = normal_equations(case.program, observations, x, c, 1e-3 * x)
        double = make("ggx", 1, "double")
        reference = Observations(double.directions, double.values, double.weights, metric)

        def moved(dc: Array, dx: Array, at: Observations = reference) -> float:
            return chi_square(case.program, at, x + dx, c + dc).item()

        n_basis = case.program.n_basis
        for k in range(n_basis):
            step = np.zeros_like(c)
            step[..., k] = 1e-5 * c[..., k]
            slope = (moved(step, 0 * x) - moved(-step, 0 * x)) / (2 * step.max())
            # -2 rhs is the gradient; single precision terms of either sign cancel in it.
            assert -2 * sums.rhs[0, 0, k] == pytest.approx(slope, rel=1e-4)
        of_alpha = sums.rhs[0, 0, n_basis:] @ [
            c[0, 0, basis] for basis, _ in case.program.derivatives
        ]
        h = 1e-5 * x
        slope = (moved(0 * c, h) - moved(0 * c, -h)) / (2 * h.item())
        assert -2 * of_alpha == pytest.approx(slope, rel=1e-4)


# Single precision with many samples


def on_device(angles: Array, precision: Precision = "double") -> Directions:
    theta_i, phi_i, theta_o, phi_o = angles
    return Directions(get_device(), theta_i, phi_i, theta_o, phi_o, precision)


@pytest.fixture(scope="module")
def many() -> tuple[Params, Array, Array]:
    """Truth, angles (4, N) and noisy values of 100,000 directions of an anisotropic surface."""
    truth: Params = {"k_d": 0.1, "k_s": 0.5, "alpha_x": 0.5, "alpha_y": 0.3, "phi_x": 0.4}
    rng = np.random.default_rng(3)
    count = 100_000
    theta = np.arccos(rng.uniform(0.25, 1.0, (2, count)))
    phi = rng.uniform(0, 2 * np.pi, (2, count))
    angles = np.stack([theta[0], phi[0], theta[1], phi[1]])
    return truth, angles, simulate("ward", truth, list(angles), (0.01, 0.0), seed=4).values


def test_chi_square_of_many_samples_in_single(many: tuple[Params, Array, Array]) -> None:
    """Float accumulators were off by 1e-3 here; with double ones only the terms round.

    A term's relative error is 1e-5 (6e-8 of the value over a residual of 1 %) and of either
    sign, so that 100,000 of them leave 3e-8.
    """
    truth, angles, values = many
    model = get_model("ward")
    program = model_program(model)
    full = complete(model, truth)
    x, c = nonlinear_of(model, full), coefficients_of(model, full)[None]
    f = np.einsum("ck,kn->cn", c[0], basis_values(program, on_device(angles), x)[0])
    found = {
        precision: chi_square(
            program,
            Observations(on_device(angles, precision), values, (0.01 * f) ** -2),
            x,
            c,
        ).item()
        for precision in get_args(Precision)
    }
    expected = float((((values - f) / (0.01 * f)) ** 2).sum())
    assert found["double"] == pytest.approx(expected, rel=1e-12)
    assert found["single"] == pytest.approx(expected, rel=1e-6)


def test_a_fit_to_many_samples_finds_the_axes(many: tuple[Params, Array, Array]) -> None:
    truth, angles, values = many
    measurement = simulate("ward", truth, list(angles), (0.01, 0.0), seed=4)
    np.testing.assert_array_equal(measurement.values, values)
    best = fit(measurement, "ward").best
    assert best.stop.precision == "single"
    for estimate in best.estimates:
        # First-order errors of 100,000 samples: 1e-4 and less of the values.
        assert estimate.standard_error is not None
        assert estimate.standard_error < 1e-3 * estimate.value
        assert abs(estimate.value - float(str(truth[estimate.name]))) < 3 * estimate.standard_error
