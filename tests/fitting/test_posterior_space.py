"""Priors, transforms and their Jacobians, and the arguments of the likelihood."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from lobefit.fitting import simulate
from lobefit.fitting.likelihood import Density, model_values
from lobefit.fitting.priors import HalfNormal, LogNormal, LogUniform, Lomax, Normal, Prior, Uniform
from lobefit.fitting.space import Space
from lobefit.fitting.transforms import Lever, NoisePair, Transforms, Way
from lobefit.kernels import ModelError, candidate, evaluate, get_device, models
from lobefit.kernels.geometry import Directions

Array = npt.NDArray[np.float64]

WAYS = {
    "identity": Way(),
    "angle": Way(centre=0.3, period=math.pi),
    "log": Way(0.0, math.inf),
    "shifted log": Way(0.5, math.inf),
    "logit": Way(-2.0, 5.0),
    "logarithmic": Way(1e-4, 2.0, logarithmic=True),
}
PRIORS: list[Prior] = [
    Uniform(0.2, 1.5),
    LogUniform(1e-3, 2.0),
    Lomax(0.05),
    Lomax(1.0, low=0.5),
    LogNormal(10.0, 1.2),
    Normal(0.3, 0.2),
    HalfNormal(0.1),
]


def check_jacobian(transforms: Transforms, q: Array) -> None:
    """Compare with the determinant of differences."""
    steps = 1e-5 * np.eye(q.shape[1])
    columns = [
        (transforms.to_parameters(q + e) - transforms.to_parameters(q - e)) / 2e-5 for e in steps
    ]
    determinant = np.linalg.det(np.stack(columns, axis=2))
    found = transforms.log_jacobian(q, transforms.to_parameters(q))
    np.testing.assert_allclose(found, np.log(np.abs(determinant)), atol=1e-6)


@pytest.mark.parametrize("name", WAYS)
def test_jacobians_against_differences(name: str) -> None:
    transforms = Transforms([WAYS[name]])
    q = np.linspace(-1.2, 1.2, 41)[:, None] * (8.0 if "log" in name else 1.0)
    check_jacobian(transforms, q)


@pytest.mark.parametrize("name", WAYS)
def test_there_and_back(name: str) -> None:
    transforms = Transforms([WAYS[name]])
    q = np.linspace(-1.2, 1.2, 41)[:, None] * (10.0 if "log" in name else 1.0)
    np.testing.assert_allclose(
        transforms.to_coordinates(transforms.to_parameters(q)), q, rtol=1e-7, atol=1e-10
    )


def test_edges_and_far_points_stay_finite() -> None:
    transforms = Transforms(list(WAYS.values()))
    far = np.full((2, len(WAYS)), 500.0)
    far[1] *= -1.0
    theta = transforms.to_parameters(far)
    assert np.isfinite(theta).all()
    assert (theta[:, 4] >= -2.0).all() and (theta[:, 4] <= 5.0).all()
    assert not transforms.inside(far).any()  # the angle is out of its period
    edge = np.array([[0.0, 0.0, 0.0, 0.5, -2.0, 2.0]])
    assert np.isfinite(transforms.to_coordinates(edge)).all()


def test_a_scale_sampled_with_its_ratio() -> None:
    """The whole Jacobian by differences: its determinant, and there and back."""
    ways = [Way(0.0, math.inf), Way(0.0, 1.0), Way(1e-4, 2.0, logarithmic=True)]
    transforms = Transforms(ways, [Lever(0, 1, 0.9, 0.02)])
    rng = np.random.default_rng(1)
    q = rng.normal(0.0, 2.0, (40, 3))
    theta = transforms.to_parameters(q)
    np.testing.assert_allclose(np.exp(q[:, 0]), theta[:, 0] * (0.9 * theta[:, 1] + 0.02))
    np.testing.assert_allclose(transforms.to_coordinates(theta), q, atol=1e-9)
    check_jacobian(transforms, q)


def test_scales_of_noise_sampled_together() -> None:
    transforms = Transforms(
        [Way(), Way(0.0, math.inf), Way(0.0, math.inf)], (), [NoisePair(1, 2, 0.3)]
    )
    q = np.random.default_rng(1).normal(0.0, 3.0, (40, 3))
    theta = transforms.to_parameters(q)
    np.testing.assert_allclose(np.hypot(theta[:, 1], 0.3 * theta[:, 2]), np.exp(q[:, 1]))
    np.testing.assert_allclose(transforms.to_coordinates(theta), q, atol=1e-9)
    check_jacobian(transforms, q)


def test_the_data_choose_how_a_scale_is_sampled() -> None:
    """At small angles what is known is k_s F0; where s = 1, at grazing ones, k_s itself."""
    small = np.diag([1.0, 5.0, 1e-6])
    grazing = np.diag([1.0, 1e-6, 5.0])
    ggx = candidate("ggx")
    assert ggx.model.coefficients == (("k_d",), ("k_s", "F0"), ("k_s",))
    theta = np.array([[0.2, 0.1, 0.5, 0.04, 1e-3, 0.02]])
    for information, expected in ((small, 0.5 * 0.04), (grazing, 0.5)):
        space = Space(ggx, ("brdf",), information=information[None])
        q = space.transforms.to_coordinates(theta)
        assert np.exp(q[0, space.labels.index("k_s")]) == pytest.approx(expected, rel=1e-4)
        np.testing.assert_allclose(space.transforms.to_parameters(q), theta)


@pytest.mark.parametrize("prior", PRIORS, ids=repr)
def test_priors_are_densities_of_what_they_draw(prior: Prior) -> None:
    assert isinstance(prior, Prior)
    drawn = prior.draw(np.random.default_rng(1), 100_000)
    low, high = prior.support
    assert (drawn >= low).all() and (drawn <= high).all()
    first, last = (float(v) for v in np.quantile(drawn, [0.001, 0.9]))
    grid = np.linspace(first, last, 20_001)
    density = np.exp(prior.log_density(grid))
    share = float(np.sum(0.5 * (density[1:] + density[:-1]) * np.diff(grid)))
    # Four standard deviations of a share of 100,000 draws.
    assert share == pytest.approx(0.899, abs=4 * math.sqrt(0.09 / 100_000))


@pytest.mark.parametrize("model", ["ggx", "ggx+ggx", "ward", "lambert", "ggx:conductor"])
def test_the_prior_of_coordinates_integrates_to_one(model: str) -> None:
    """Density times Jacobian, a coordinate at a time, over all of q."""
    space = Space(candidate(model), ("a", "b"), noise="fit", student=True)
    middle = np.zeros(space.size)
    for k, c in enumerate(space.coordinates):
        period = c.parameter.period if c.parameter else None
        half = 0.5 * period if period else 40.0
        centre = 0.5 * sum(c.parameter.bounds) if period and c.parameter else 0.0
        middle[k] = centre
        q = np.tile(middle, (40_001, 1))
        q[:, k] = centre + np.linspace(-half, half, 40_001)
        theta = space.transforms.to_parameters(q)
        one = c.prior.log_density(theta[:, k])
        rest = Transforms([_way_of(space, k)])
        one = one + rest.log_jacobian(q[:, k : k + 1], theta[:, k : k + 1])
        density = np.exp(one)
        total = float(np.sum(0.5 * (density[1:] + density[:-1]) * np.diff(q[:, k])))
        assert total == pytest.approx(1.0, abs=2e-4), c.label


def _way_of(space: Space, k: int) -> Way:
    c = space.coordinates[k]
    if c.parameter is None:
        return Way(0.0, math.inf)
    if c.parameter.period:
        return Way(centre=0.5 * sum(c.parameter.bounds), period=c.parameter.period)
    return Way(*c.parameter.bounds, logarithmic=c.parameter.scale == "log")


@pytest.mark.parametrize("model", sorted(models()))
def test_arguments_are_those_of_evaluate(model: str) -> None:
    """Draws of the prior, as the likelihood gets them, give the values of `evaluate`."""
    space = Space(candidate(model), ("a", "b"))
    theta = space.draw(np.random.default_rng(3), 3)
    assert np.isfinite(space.log_density(theta)).all()
    angles = (np.array([0.2, 0.7]), np.zeros(2), np.array([0.5, 0.6]), np.array([3.0, 2.0]))
    where = Directions(get_device(), *angles)
    found = model_values(space, theta, where)
    where.release()
    for row, values in zip(theta, found, strict=True):
        expected = evaluate(candidate(model).model, space.params(row), *angles)
        np.testing.assert_allclose(values, np.broadcast_to(expected, values.shape), rtol=1e-9)


def test_labels_are_unique() -> None:
    """Two lobes of a kind are ordered, as are the widths of an anisotropic one."""
    for name, larger, smaller in (
        ("ggx+ggx", "alpha_2", "alpha_1"),
        ("ward", "alpha_x", "alpha_y"),
    ):
        space = Space(candidate(name), ("brdf",))
        theta = space.draw(np.random.default_rng(1), 200)
        a, b = (space.labels.index(n) for n in (larger, smaller))
        assert (theta[:, a] >= theta[:, b]).all()
        theta[:, [a, b]] = theta[:, [b, a]]
        assert np.isneginf(space.log_density(theta)).all()


def test_held_and_tied_parameters_are_not_sampled() -> None:
    assert "k_s" not in Space(candidate("ggx:k_s=1"), ("brdf",)).labels
    space = Space(candidate("ward:isotropic"), ("brdf",))
    params = space.params(space.draw(np.random.default_rng(1), 1)[0])
    assert params["alpha_y"] == params["alpha_x"]


def test_a_prior_can_be_replaced() -> None:
    own = LogNormal(0.2, 0.3)
    space = Space(
        candidate("ggx"), ("brdf",), priors={"alpha": own, "noise_relative": Uniform(0, 1)}
    )
    assert space.coordinates[space.labels.index("alpha")].prior is own

    class Steep:
        support = (0.0, 1.0)

        def log_density(self, theta: Array) -> Array:
            return np.asarray(np.log(2.0 * theta))

        def draw(self, rng: np.random.Generator, size: int) -> Array:
            return np.asarray(np.sqrt(rng.uniform(size=size)))

    space = Space(candidate("lambert"), ("brdf",), priors={"k_d": Steep()})
    q = np.linspace(-30, 30, 20_001)[:, None] * np.eye(space.size)[0]
    theta = space.transforms.to_parameters(q)
    assert theta[:, 0].min() >= 0.0 and theta[:, 0].max() <= 1.0
    with pytest.raises(ModelError, match="'alpah', which is not sampled; these are: alpha"):
        Space(candidate("ggx"), ("brdf",), priors={"alpah": own})
    with pytest.raises(ModelError, match="leaves nothing of its range"):
        Space(candidate("ggx"), ("brdf",), priors={"alpha": Uniform(3.0, 4.0)})


@pytest.mark.parametrize("precision", ["double", "single"])
def test_the_density_against_numpy(precision: Any) -> None:
    truth: dict[str, Any] = {"k_d": [0.2, 0.1], "k_s": 0.5, "F0": [0.3, 0.6], "alpha": 0.2}
    m = simulate("ggx", truth, "in-plane step=3", (0.02, 1e-3), seed=1)
    space = Space(candidate("ggx"), m.channels)
    density = Density(space, m, get_device(), power=0.5, precision=precision)
    rng = np.random.default_rng(1)
    theta = space.draw(rng, 50)
    q = space.transforms.to_coordinates(theta)
    found = density(q)
    f = model_values(space, theta, density.directions)
    a = space.arguments(theta)
    assert a.additive is not None and a.relative is not None
    v = a.additive[:, :, None] ** 2 + (a.relative[:, :, None] * f) ** 2
    terms = -0.5 * ((m.values - f) ** 2 / v + np.log(2 * np.pi * v))
    expected = 0.5 * terms.sum(axis=(1, 2)) + space.log_density(theta)
    expected += space.transforms.log_jacobian(q, theta)
    size = np.abs(terms).sum(axis=(1, 2))
    assert np.max(np.abs(found - expected) / size) < (1e-10 if precision == "double" else 1e-5)
    density.release()
