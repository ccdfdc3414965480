"""The noise scales found from residuals, where no sigma is given."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest
from scipy.optimize import minimize
from scipy.stats import norm

from lobefit.fitting.noise import estimate_noise, gaussian_deviance, level, variance

Array = npt.NDArray[np.float64]
COUNT = 4000


def model_values(count: int = COUNT) -> Array:
    """Values over four decades, as a glossy surface has, shape (1, N)."""
    return np.geomspace(1e-3, 10.0, count)[None, :]


def noisy(additive: float, relative: float, seed: int, count: int = COUNT) -> tuple[Array, Array]:
    f = model_values(count)
    sigma = np.sqrt(additive**2 + (relative * f) ** 2)
    return f, sigma * np.random.default_rng(seed).standard_normal(f.shape)


def estimate(r: Array, f: Array, n_parameters: int = 0) -> tuple[float, float]:
    additive, relative = estimate_noise(r, f, np.ones(f.shape, dtype=bool), n_parameters)
    assert additive.shape == relative.shape == (1,)
    return float(additive[0]), float(relative[0])


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize(("additive", "relative"), [(1e-3, 0.02), (0.03, 0.01), (1e-2, 0.1)])
def test_both_scales_are_recovered(additive: float, relative: float, seed: int) -> None:
    f, r = noisy(additive, relative, seed)
    found = estimate(r, f)
    # Each scale rules over at least 1,000 of the values, whose standard deviation is known to
    # 1/sqrt(2000) = 2.2 %; the other scale's share of them makes it a little worse.
    assert found == pytest.approx((additive, relative), rel=0.1)


def test_scales_are_unbiased() -> None:
    found = np.array([estimate(*noisy(1e-3, 0.02, seed)[::-1]) for seed in range(100, 160)])
    # The mean of 60 estimates is ten times as good as one.
    np.testing.assert_allclose(found.mean(axis=0), [1e-3, 0.02], rtol=0.01)


@pytest.mark.parametrize("relative", [1e-4, 0.02, 0.3])
def test_relative_noise_alone(relative: float) -> None:
    f, r = noisy(0.0, relative, seed=1)
    additive, found = estimate(r, f)
    assert found == pytest.approx(relative, rel=0.05)  # 4000 values: 1.1 %
    assert 0.0 < additive < 0.1 * relative * f.min()  # less than the noise of the darkest value


@pytest.mark.parametrize("additive", [1e-5, 0.02, 3.0])
def test_additive_noise_alone(additive: float) -> None:
    f, r = noisy(additive, 0.0, seed=2)
    found, relative = estimate(r, f)
    assert found == pytest.approx(additive, rel=0.05)
    assert relative * f.max() < 0.5 * additive


def test_scaling_the_values_scales_the_additive_part() -> None:
    f, r = noisy(1e-3, 0.02, seed=3)
    additive, relative = estimate(r, f)
    for unit in (1e-8, 1e8):
        scaled = estimate(unit * r, unit * f)
        assert scaled == pytest.approx((unit * additive, relative), rel=1e-9)


def test_degrees_of_freedom() -> None:
    """Residuals of a fit are smaller than the noise by the share that the parameters took."""
    f, r = noisy(0.0, 0.02, seed=4, count=20)
    without, with_ten = estimate(r, f, 0), estimate(r, f, 10)
    assert with_ten[1] == pytest.approx(without[1] * np.sqrt(2.0), rel=1e-9)


def test_channels_have_their_own_noise() -> None:
    f, r = noisy(1e-3, 0.02, seed=5)
    _, louder = noisy(1e-2, 0.1, seed=6)
    additive, relative = estimate_noise(
        np.concatenate([r, louder]), np.concatenate([f, f]), np.ones((2, COUNT), dtype=bool), 0
    )
    np.testing.assert_allclose(additive, [1e-3, 1e-2], rtol=0.1)
    np.testing.assert_allclose(relative, [0.02, 0.1], rtol=0.1)


def test_what_is_not_used_does_not_count() -> None:
    f, r = noisy(1e-3, 0.02, seed=7)
    used = np.ones(f.shape, dtype=bool)
    used[:, ::3] = False
    spoilt = np.where(used, r, np.nan)
    additive, relative = estimate_noise(spoilt, f, used, 0)
    alone = estimate(r[:, used[0]], f[:, used[0]])
    assert (additive[0], relative[0]) == pytest.approx(alone, rel=1e-9)


def test_the_metric_may_ask_for_constant_noise() -> None:
    f, r = noisy(0.05, 0.0, seed=8)
    used = np.ones(f.shape, dtype=bool)
    additive, relative = estimate_noise(r, f, used, 0, relative=False)
    assert relative[0] == 0.0
    assert additive[0] == pytest.approx(np.sqrt(np.mean(r**2)), rel=1e-12)


def test_exact_data_have_a_tiny_noise_and_finite_weights() -> None:
    f = model_values()
    additive, relative = estimate_noise(np.zeros_like(f), f, np.ones(f.shape, dtype=bool), 3)
    v = variance(f, additive, relative)
    assert (v > 0).all()
    assert np.isfinite(1.0 / v).all()
    assert np.sqrt(v.max()) < 1e-9 * f.max()


def test_a_black_channel_has_finite_weights() -> None:
    zero = np.zeros((1, 50))
    for relative in (True, False):
        scales = estimate_noise(zero, zero, np.ones((1, 50), dtype=bool), 1, relative=relative)
        assert np.isfinite(1.0 / variance(zero, *scales)).all()
    nothing = estimate_noise(zero, zero, np.zeros((1, 50), dtype=bool), 1)
    assert np.isfinite(1.0 / variance(zero, *nothing)).all()


def test_fewer_values_than_parameters_do_not_divide_by_zero() -> None:
    f, r = noisy(1e-3, 0.02, seed=9, count=3)
    assert np.isfinite(estimate(r, f, n_parameters=5)).all()


def test_the_level_is_the_models_value_but_for_gross_misfit() -> None:
    f = np.array([[1.0, 1.0, 1.0, 1.0, 0.0]])
    y = np.array([[0.5, 1.5, 2.0, -9.0, np.nan]])
    np.testing.assert_array_equal(level(f, y, gross=False), f)
    np.testing.assert_array_equal(level(f, y, gross=True), [[1.0, 1.0, 1.0, 4.5, 0.0]])


def test_deviance_is_twice_the_negative_log_likelihood() -> None:
    f, r = noisy(1e-3, 0.02, seed=10)
    v = variance(f, np.array([1e-3]), np.array([0.02]))
    used = np.ones(f.shape, dtype=bool)
    used[:, ::2] = False
    expected = -2.0 * norm.logpdf(r[used], scale=np.sqrt(v[used])).sum()
    assert gaussian_deviance(r, v, used) == pytest.approx(expected, rel=1e-12)


def test_the_estimate_has_the_highest_likelihood() -> None:
    """Against a search that knows nothing of profiles and ratios."""
    f, r = noisy(1e-3, 0.02, seed=11)
    used = np.ones(f.shape, dtype=bool)

    def deviance(logs: Array) -> float:
        return gaussian_deviance(r, variance(f, np.exp(logs[:1]), np.exp(logs[1:])), used)

    best = minimize(deviance, np.log([5e-3, 5e-3]), method="Nelder-Mead", options={"fatol": 1e-6})
    found = np.log(estimate(r, f))
    # Its own standard deviation costs 1.
    assert deviance(found) < best.fun + 1.0
