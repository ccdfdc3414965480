"""The fused log-likelihood against the same sum in numpy, over values of `evaluate`."""

from __future__ import annotations

import math
from typing import Any, get_args

import numpy as np
import numpy.typing as npt
import pytest

from lobefit.kernels import Device, ModelError, evaluate, get_device, get_model
from lobefit.kernels.geometry import Directions, Precision
from lobefit.kernels.likelihood import Likelihood
from lobefit.kernels.parameters import coefficients_of, complete, nonlinear_of
from lobefit.kernels.program import model_program
from tests.kernels.strategies import directions

Array = npt.NDArray[np.float64]

every_precision = pytest.mark.parametrize("precision", get_args(Precision))
# Relative to the sum of the terms' sizes.
TOLERANCE = {"double": 1e-10, "single": 1e-5}
# One lobe, a sum, an exact Fresnel term (its index differs by channel), a diffuse model.
CASES: dict[str, tuple[dict[str, str], dict[str, Any]]] = {
    "ggx": ({}, {"k_d": [0.2, 0.1, 0.3], "k_s": 0.5, "F0": [0.3, 0.5, 0.9], "alpha": 0.2}),
    "ggx+ggx": ({}, {"k_d": 0.1, "alpha_1": 0.1, "alpha_2": 0.4, "k_s_1": 0.3, "k_s_2": 0.4}),
    "cook_torrance": (
        {"fresnel": "conductor"},
        {"k_d": 0.05, "eta": [0.2, 1.1, 1.2], "k": [3.4, 2.6, 2.4], "alpha": 0.15},
    ),
    "oren_nayar": ({}, {}),
}
COUNT = 1003
SETS = 3


class Case:
    """SETS sets of parameters of a model, and readings of the first."""

    def __init__(self, name: str, precision: Precision) -> None:
        options, params = CASES[name]
        self.model = get_model(name, options)
        self.angles = directions(COUNT, seed=3, theta_max=80.0)
        full = complete(self.model, params)
        sets = []
        for k in range(SETS):
            moved = dict(full)
            for p in self.model.parameters:
                if not p.linear and p.scale == "log":
                    moved[p.name] = full[p.name] * (1.0 + 0.02 * k)
            sets.append(moved)
        self.f = np.stack([np.broadcast_to(self._evaluate(s), (3, COUNT)) for s in sets])
        x = [nonlinear_of(self.model, s) for s in sets]
        own = any(len(rows) > 1 for rows in x)
        self.x = np.stack([np.broadcast_to(r, (3, r.shape[1])) if own else r[0] for r in x])
        self.c = np.stack(
            [np.broadcast_to(coefficients_of(self.model, s), (3, self.n)) for s in sets]
        )
        rng = np.random.default_rng(1)
        self.additive = rng.uniform(1e-3, 3e-3, (SETS, 3))
        self.relative = rng.uniform(0.01, 0.05, (SETS, 3))
        noise = np.hypot(2e-3, 0.03 * self.f[0])
        self.y = self.f[0] + noise * rng.standard_normal(self.f[0].shape)
        self.y[0, ::17] = np.nan
        self.sigma = noise * rng.uniform(0.8, 1.2, noise.shape)
        self.there = np.isfinite(self.y)
        self.directions = Directions(get_device(), *self.angles, precision)

    @property
    def n(self) -> int:
        return len(self.model.coefficients)

    def _evaluate(self, full: dict[str, Array]) -> Array:
        params = {k: v.item() if v.size == 1 else v.tolist() for k, v in full.items()}
        return evaluate(self.model, params, *self.angles)

    def likelihood(self, *arguments: Any, **settings: Any) -> Likelihood:
        return Likelihood(
            model_program(self.model), self.directions, self.y, *arguments, **settings
        )

    def total(self, terms: Array) -> Array:
        return np.asarray(np.where(self.there, terms, 0.0).sum(axis=2))

    @property
    def sampled_variance(self) -> Array:
        return np.asarray(
            self.additive[:, :, None] ** 2 + (self.relative[:, :, None] * self.f) ** 2
        )


def close(found: Array, case: Case, terms: Array, precision: Precision) -> None:
    """Compare sums, in units of what is summed: the terms cancel one another in part."""
    size = case.total(np.abs(terms))
    assert np.max(np.abs(found - case.total(terms)) / size) < TOLERANCE[precision]


@every_precision
@pytest.mark.parametrize("name", CASES)
def test_gaussian_noise_of_two_parts(name: str, precision: Precision) -> None:
    case = Case(name, precision)
    v = case.sampled_variance
    r = case.y - case.f
    found = case.likelihood()(case.x, case.c, case.additive, case.relative)
    close(found, case, -0.5 * (r * r / v + np.log(2 * np.pi * v)), precision)


@every_precision
def test_given_sigmas_and_their_scale(precision: Precision) -> None:
    case = Case("ggx", precision)
    scale = np.array([[1.0, 2.0, 0.5], [1.3, 1.0, 1.0], [0.7, 1.0, 3.0]])
    v = (scale[:, :, None] * case.sigma) ** 2
    r = case.y - case.f
    likelihood = case.likelihood(case.sigma)
    found = likelihood(case.x, case.c, scale=scale)
    close(found, case, -0.5 * (r * r / v + np.log(2 * np.pi * v)), precision)
    plain = likelihood(case.x, case.c)
    np.testing.assert_array_equal(plain, likelihood(case.x, case.c, scale=np.ones((SETS, 3))))


@every_precision
@pytest.mark.parametrize("given", [False, True])
def test_student_t(precision: Precision, given: bool) -> None:
    case = Case("ggx", precision)
    nu = np.array([2.5, 6.0, 40.0])
    v = np.broadcast_to(case.sigma**2, case.f.shape) if given else case.sampled_variance
    r = case.y - case.f
    norm = np.array([math.lgamma((n + 1) / 2) - math.lgamma(n / 2) for n in nu])
    norm -= 0.5 * np.log(nu * np.pi)
    t = 1.0 + r * r / (nu[:, None, None] * v)
    expected = norm[:, None, None] - 0.5 * np.log(v) - 0.5 * (nu[:, None, None] + 1) * np.log(t)
    if given:
        found = case.likelihood(case.sigma, student=True)(case.x, case.c, nu=nu)
    else:
        found = case.likelihood(student=True)(case.x, case.c, case.additive, case.relative, nu=nu)
    close(found, case, expected, precision)


def log_normal_cdf(z: float) -> float:
    """Give ln of the normal distribution function; far below by Mills' ratio."""
    if z > -30.0:
        return math.log(0.5 * math.erfc(-z / math.sqrt(2.0)))
    return -0.5 * z * z - math.log(-z * math.sqrt(2 * math.pi)) + math.log1p(-1 / z**2 + 3 / z**4)


@every_precision
@pytest.mark.parametrize("given", [False, True])
def test_censored_values(precision: Precision, given: bool) -> None:
    case = Case("ggx", precision)
    sides = np.zeros(case.y.shape, dtype=int)
    order = np.argsort(np.nan_to_num(case.y), axis=1)
    for channel in range(3):
        sides[channel, order[channel, -40:]] = 1
        sides[channel, order[channel, :30]] = -1
    case.y[sides == 1] *= 0.97
    case.y[2, order[2, -1]] *= 3.0  # a level far above what the model expects
    v = np.broadcast_to(case.sigma**2, case.f.shape) if given else case.sampled_variance
    z = (case.y - case.f) / np.sqrt(v)
    beyond = np.vectorize(log_normal_cdf)(np.nan_to_num(-sides * z))
    expected = np.where(sides == 0, -0.5 * (z * z + np.log(2 * np.pi * v)), beyond)
    if given:
        found = case.likelihood(case.sigma, sides=sides)(case.x, case.c)
    else:
        likelihood = case.likelihood(sides=sides)
        found = likelihood(case.x, case.c, case.additive, case.relative)
    close(found, case, expected, precision)


def test_any_number_of_sets_gives_each_its_sum() -> None:
    case = Case("ggx", "double")
    likelihood = case.likelihood()
    alone = likelihood(case.x[1:2], case.c[1:2], case.additive[1:2], case.relative[1:2])
    for count in (1, 5, 8, 33):
        k = np.arange(count) % SETS
        found = likelihood(case.x[k], case.c[k], case.additive[k], case.relative[k])
        np.testing.assert_array_equal(found[k == 1], np.repeat(alone, (k == 1).sum(), axis=0))


def test_noise_of_nothing_is_finite_or_minus_infinite() -> None:
    case = Case("ggx", "single")
    nothing = np.zeros_like(case.additive)
    found = case.likelihood()(case.x, case.c, nothing, nothing)
    assert not np.isnan(found).any()
    assert (found < -1e6).all()


def test_what_is_missing_is_told() -> None:
    case = Case("ggx", "double")
    with pytest.raises(ModelError, match="needs the scales of the noise"):
        case.likelihood()(case.x, case.c)
    with pytest.raises(ModelError, match="needs its degrees of freedom"):
        case.likelihood(case.sigma, student=True)(case.x, case.c)
    with pytest.raises(ModelError, match="coefficients have shape"):
        case.likelihood(case.sigma)(case.x, case.c[:, :1])
    with pytest.raises(ModelError, match="do not go together"):
        case.likelihood(student=True, sides=np.zeros(case.y.shape, dtype=int))


@every_precision
def test_a_set_does_not_depend_on_its_neighbours(precision: Precision) -> None:
    # What a walker's log-probability is must not change with the batch it is computed in, or
    # chains would depend on how a run was split.
    case = Case("ggx", precision)
    likelihood = case.likelihood()
    together = likelihood(case.x, case.c, case.additive, case.relative)
    alone = [
        likelihood(*(rows[k : k + 1] for rows in (case.x, case.c, case.additive, case.relative)))
        for k in range(SETS)
    ]
    np.testing.assert_array_equal(together, np.concatenate(alone))


@every_precision
def test_variances_far_from_one_do_not_overflow_their_product(precision: Precision) -> None:
    # Hundreds of variances of one size: their product would be 1e+-3000.
    case = Case("oren_nayar", precision)
    likelihood = case.likelihood()
    relative = np.zeros((SETS, 3))
    for size in (1e-5, 1e5):
        additive = np.full((SETS, 3), size)
        found = likelihood(case.x, case.c, additive, relative)
        r = case.y - case.f
        close(found, case, -0.5 * ((r / size) ** 2 + np.log(2 * np.pi * size**2)), precision)


class AsOnAGpu(Device):
    """The same device, which says that it is no CPU: work is shared out as there."""

    @property
    def is_cpu(self) -> bool:
        return False


@pytest.mark.parametrize("name", ["ggx", "cook_torrance"])
def test_strided_sums_agree(name: str) -> None:
    case = Case(name, "double")
    here = case.likelihood()(case.x, case.c, case.additive, case.relative)
    device = get_device()
    other = AsOnAGpu(device.info, device.context.devices[0])
    case.directions = Directions(other, *case.angles, "double")
    there = case.likelihood()(case.x, case.c, case.additive, case.relative)
    # Another order of addition.
    np.testing.assert_allclose(there, here, rtol=1e-11)
