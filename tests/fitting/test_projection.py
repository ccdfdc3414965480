"""The small bounded least squares, and the coordinates that keep coefficients physical."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest
from scipy.optimize import lsq_linear, nnls

from lobefit.fitting.projection import coordinates, solve_bounded
from lobefit.kernels import Candidate, Model, ModelError, Parameter, candidate, candidates
from lobefit.kernels.parameters import coefficients_of, complete, linear_from_coefficients
from lobefit.kernels.registry import Term

Array = npt.NDArray[np.float64]
EVERY_CANDIDATE = [c.name for c in candidates("all")]


def systems(count: int, size: int, seed: int) -> tuple[Array, Array]:
    """Give matrices (S, 40, D) and right sides (S, 40), half of them pulling negative."""
    rng = np.random.default_rng(seed)
    return rng.normal(size=(count, 40, size)), rng.normal(size=(count, 40))


def solve(A: Array, b: Array, low: Array, high: Array) -> Array:
    gram = np.einsum("snd,sne->sde", A, A)
    return solve_bounded(gram, np.einsum("snd,sn->sd", A, b), low, high)


def objective(A: Array, b: Array, d: Array) -> Array:
    r = np.einsum("snd,sd->sn", A, d) - b
    return np.asarray(np.einsum("sn,sn->s", r, r))


@pytest.mark.parametrize("size", [1, 2, 3, 4, 5])
def test_not_negative_as_nnls(size: int) -> None:
    A, b = systems(60, size, seed=size)
    d = solve(A, b, np.zeros(size), np.full(size, np.inf))
    expected = np.stack([nnls(A[s], b[s])[0] for s in range(60)])
    # Normal equations square the condition number (below 30 here) times rounding.
    np.testing.assert_allclose(d, expected, atol=1e-11)
    assert (d == 0).any()
    assert (d > 0).any()


@pytest.mark.parametrize("size", [1, 2, 3, 4])
def test_bounds_as_lsq_linear(size: int) -> None:
    rng = np.random.default_rng(100 + size)
    A, b = systems(60, size, seed=10 + size)
    low = rng.uniform(-0.2, 0.0, size)
    high = low + rng.uniform(0.0, 0.4, size)
    high[0] = np.inf
    d = solve(A, b, low, high)
    expected = np.stack([lsq_linear(A[s], b[s], (low, high), "bvls").x for s in range(60)])
    np.testing.assert_allclose(d, expected, atol=1e-11)
    assert (d >= low).all()
    assert (d <= high).all()


def test_columns_of_very_different_size() -> None:
    """A narrow lobe's basis is 1e4 where the diffuse one is 0.3, with weights on top."""
    A, b = systems(60, 3, seed=20)
    scale = np.array([1e-8, 1.0, 1e8])
    d = solve(A * scale, b, np.zeros(3), np.full(3, np.inf)) * scale
    np.testing.assert_allclose(d, solve(A, b, np.zeros(3), np.full(3, np.inf)), atol=1e-11)


def test_equal_columns_still_reach_the_minimum() -> None:
    """Without grazing angles F0 and k_s cannot be told apart: any split is as good."""
    A, b = systems(60, 3, seed=21)
    A[:, :, 2] = A[:, :, 1]
    d = solve(A, b, np.zeros(3), np.full(3, np.inf))
    best = np.array([nnls(A[s], b[s])[1] ** 2 for s in range(60)])
    assert np.isfinite(d).all()
    assert (d >= 0).all()
    np.testing.assert_allclose(objective(A, b, d), best, rtol=1e-9)


def test_nearly_equal_columns() -> None:
    A, b = systems(60, 3, seed=22)
    A[:, :, 2] = A[:, :, 1] + 1e-9 * A[:, :, 2]
    d = solve(A, b, np.zeros(3), np.full(3, 50.0))
    best = np.array([2 * lsq_linear(A[s], b[s], (0, 50.0), "bvls").cost for s in range(60)])
    # Below the rounding of the Gram matrix the two columns are one.
    np.testing.assert_allclose(objective(A, b, d), best, rtol=1e-6)


def test_columns_that_vanish() -> None:
    """A lobe so narrow that no direction sees it has no strength rather than a wild one."""
    A, b = systems(20, 3, seed=23)
    A[:, :, 1] = 0.0
    d = solve(A, b, np.zeros(3), np.full(3, np.inf))
    assert (d[:, 1] == 0).all()
    expected = np.stack([nnls(A[s][:, [0, 2]], b[s])[0] for s in range(20)])
    np.testing.assert_allclose(d[:, [0, 2]], expected, atol=1e-11)
    nothing = solve_bounded(np.zeros((2, 3, 3)), np.zeros((2, 3)), np.zeros(3), np.ones(3))
    assert (nothing == 0).all()


def test_no_unknowns() -> None:
    assert solve_bounded(np.zeros((5, 0, 0)), np.zeros((5, 0)), *np.zeros((2, 0))).shape == (5, 0)


# Coordinates


def legal(c: Candidate, seed: int, channels: int = 50) -> dict[str, list[float]]:
    """Draw linear parameters, bounds among them; held ones as they are held."""
    rng = np.random.default_rng(seed)
    params: dict[str, list[float]] = {}
    for p in c.model.linear:
        low, high = p.bounds
        values = rng.uniform(low, min(high, 5.0), channels)
        values[::7] = low
        values[3::7] = min(high, 5.0)
        params[p.name] = [c.fixed[p.name]] * channels if p.name in c.fixed else values.tolist()
    return params


@pytest.mark.parametrize("name", EVERY_CANDIDATE)
def test_every_legal_coefficient_has_coordinates(name: str) -> None:
    c = candidate(name)
    k = coordinates(c)
    coefficients = coefficients_of(c.model, complete(c.model, legal(c, seed=1)))
    d = k.coordinates(coefficients)
    assert d.shape == (len(coefficients), len(c.solved))
    assert (d >= k.low).all()
    assert (d <= k.high).all()
    # Products and their sums of numbers up to 5.
    np.testing.assert_allclose(k.coefficients(d), coefficients, atol=1e-14)


@pytest.mark.parametrize("name", EVERY_CANDIDATE)
def test_every_coordinate_is_a_legal_surface(name: str) -> None:
    """The physical limits hold by construction, at the bounds and far inside."""
    c = candidate(name)
    k = coordinates(c)
    rng = np.random.default_rng(2)
    d = rng.exponential(size=(200, len(k.low))) * 10.0 ** rng.uniform(-6, 6, (200, len(k.low)))
    d = np.where(rng.uniform(size=d.shape) < 0.2, 0.0, d)
    d = np.clip(d, k.low, k.high)
    found = linear_from_coefficients(c.model, k.coefficients(d))
    assert set(found) == {p.name for p in c.model.linear}
    for p in c.model.linear:
        values = found[p.name]
        assert (values >= p.bounds[0]).all()
        assert (values <= p.bounds[1] * (1 + 1e-15)).all()
        if p.name in c.fixed:
            assert (values == c.fixed[p.name]).all()


def gold() -> Candidate:
    """A Schlick lobe whose F0 may reach 1.1, as the red of gold does in sRGB."""
    ggx = candidate("ggx").model

    def wider(p: Parameter) -> Parameter:
        return replace(p, bounds=(0.0, 1.1)) if p.name == "F0" else p

    diffuse, specular = ggx.terms
    lobe = replace(specular.lobe, parameters=tuple(wider(p) for p in specular.lobe.parameters))
    return Candidate("gold", Model("gold", (diffuse, Term(lobe)), (lobe,), ""))


def test_f0_may_pass_1_where_the_record_allows_it() -> None:
    k = coordinates(gold())
    c = np.array([[0.2, 0.5 * 1.1, 0.5], [0.2, 0.5 * 1.02, 0.5], [0.0, 0.0, 0.5]])
    np.testing.assert_allclose(k.coefficients(k.coordinates(c)), c, atol=1e-15)
    too_much = np.array([[0.2, 0.5 * 1.3, 0.5]])
    ratio = k.coefficients(k.coordinates(too_much))[0]
    assert ratio[1] / ratio[2] == pytest.approx(1.1, rel=1e-12)


@pytest.mark.parametrize(
    ("fixed", "n"), [({}, 3), ({"k_s": 1.0}, 2), ({"F0": 0.04}, 2), ({"k_s": 0.5, "F0": 0.04}, 1)]
)
def test_what_is_held_is_held(fixed: dict[str, float], n: int) -> None:
    ggx = candidate("ggx")
    k = coordinates(Candidate("held", ggx.model, fixed))
    assert k.T.shape == (3, n)
    d = np.linspace(0.1, 0.9, 5 * n).reshape(5, n)
    found = linear_from_coefficients(ggx.model, k.coefficients(d))
    for name, value in fixed.items():
        np.testing.assert_allclose(found[name], value, rtol=1e-14)


def test_a_ratio_from_above_zero_is_refused() -> None:
    ggx = candidate("ggx").model
    parameters = tuple(
        replace(p, bounds=(0.02, 1.0)) if p.name == "F0" else p
        for p in ggx.terms[1].lobe.parameters
    )
    lobe = replace(
        ggx.terms[1].lobe, parameters=parameters, variants=(), references=ggx.lobe.references
    )
    with pytest.raises(ModelError, match="has a ratio whose lower bound is not 0"):
        lobe.check()
