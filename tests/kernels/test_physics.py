"""What must hold for every registered model; a new model is held to it without an edit here."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import lobefit.kernels
from lobefit.kernels import Model, evaluate, models
from lobefit.kernels.geometry import Precision
from tests.kernels.strategies import (
    Directions,
    Params,
    awkward_directions,
    directions,
    legal_params,
    rotated,
)
from tests.kernels.transcriptions import Array, load

ORDINARY = directions(4096, seed=1)
AWKWARD = awkward_directions()

every_model = pytest.mark.parametrize("name", models())
# The same examples in every run, and no limit on one that pays for compiling a kernel.
examples = settings(max_examples=40, deadline=None, derandomize=True, database=None)


def values(
    name: str, params: Params, d: Directions, precision: Precision = "double"
) -> npt.NDArray[np.float64]:
    return evaluate(name, params, *d, precision=precision)


def reference(name: str, params: Params, d: Directions) -> Array:
    return load(name)(*d.exact(), **params)


@every_model
def test_reference_values_of_the_record(name: str) -> None:
    references = models()[name].lobe.references
    assert len(references) >= 3
    for row in references:
        angles = np.radians([row.theta_i, row.phi_i, row.theta_o, row.phi_o])
        # Values are given to 16 digits; the angles are rounded on their way to radians.
        f = evaluate(name, row.params, *angles, options=row.options)
        assert f.item() == pytest.approx(row.value, rel=1e-12)


def test_models_stays_a_function_when_they_are_loaded() -> None:
    """Importing lobefit.kernels.models.ggx must not put the package in the function's place."""
    assert models() is lobefit.kernels.models()


def test_every_model_has_a_transcription() -> None:
    assert models()
    for name in models():
        assert callable(load(name))


@every_model
@given(data=st.data())
@examples
def test_double_agrees_with_transcription(name: str, data: st.DataObject) -> None:
    params = data.draw(legal_params(models()[name]))
    expected = reference(name, params, ORDINARY)
    f = values(name, params, ORDINARY)
    assert f.shape == expected.shape
    # Vectors are rounded to 1e-16, slopes at 89 degrees to 3e-15; the narrowest lobe, 1e-4
    # wide, sees that as 3e-11 of its width. Below 1e-12 nothing is left to compare.
    np.testing.assert_allclose(f, expected, rtol=2e-10, atol=1e-12)


@every_model
def test_double_agrees_to_rounding_for_a_wide_lobe(name: str) -> None:
    params = off_default(name)
    expected = reference(name, params, ORDINARY)
    # The same rounding, seen by a lobe 0.15 wide.
    np.testing.assert_allclose(values(name, params, ORDINARY), expected, rtol=2e-13)


@every_model
@given(data=st.data())
@examples
def test_double_agrees_at_awkward_directions(name: str, data: st.DataObject) -> None:
    params = data.draw(legal_params(models()[name]))
    expected = reference(name, params, AWKWARD)
    # At 89.9999 degrees |H| may be 3e-6, so that its rounding of 1e-16 becomes 3e-11 of a
    # slope: the narrowest lobe sees 3e-7 of its width. Beside its edge a lobe is rounded as its
    # peak is: Phong's (r.o) is right to 1e-16 of 1, and 1/cos_theta_i there is 6e5.
    rounding = 1e-15 * float(expected.max())
    found = values(name, params, AWKWARD)
    np.testing.assert_allclose(found, expected, rtol=1e-6, atol=1e-12 + rounding)


@every_model
@pytest.mark.parametrize("d", [ORDINARY, AWKWARD], ids=["ordinary", "awkward"])
@given(data=st.data())
@examples
def test_single_agrees_with_double(name: str, d: Directions, data: st.DataObject) -> None:
    # Parameters are rounded first: what a number of 24 bits cannot say is no error of the sum.
    params = rounded(models()[name], data.draw(legal_params(models()[name])))
    double = values(name, params, d)
    single = values(name, params, d, precision="single")
    # Parameters and slopes carry 6e-8 each; in an exponent of 80, the largest above 1e-30 or
    # so, that is 1e-5. The narrow axis of an anisotropic lobe sees the rounding of slopes six
    # times as long as the wide axis, and that error again times 16 in the exponent.
    rtol = 2e-5 + 6e-6 * elongation(name, params)
    # A lobe that ends at a zero of its base (Lafortune's) keeps 1e-6 of its height there.
    steep = values(name, params, ORDINARY)[:, np.maximum(*ORDINARY[::2]) < math.radians(60)]
    np.testing.assert_allclose(single, double, rtol=rtol, atol=1e-30 + 1e-6 * float(steep.max()))


@every_model
@pytest.mark.parametrize("precision", ["double", "single"])
@given(data=st.data())
@examples
def test_finite_and_not_negative(name: str, precision: Precision, data: st.DataObject) -> None:
    params = data.draw(legal_params(models()[name]))
    f = values(name, params, AWKWARD, precision=precision)
    assert np.all(np.isfinite(f))
    assert np.all(f >= 0)


@pytest.mark.parametrize("name", [name for name in models() if models()[name].reciprocal])
@given(data=st.data())
@examples
def test_reciprocity(name: str, data: st.DataObject) -> None:
    params = data.draw(legal_params(models()[name]))
    f, swapped = values(name, params, ORDINARY), values(name, params, ORDINARY.swapped())
    # Exchanging i and o only changes the order of additions.
    np.testing.assert_allclose(swapped, f, rtol=1e-13, atol=1e-200)


@pytest.mark.parametrize(
    "name", [name for name, m in models().items() if not (m.reciprocal and m.isotropic)]
)
def test_declared_violations_are_real(name: str) -> None:
    """A model that says it is not reciprocal, or not isotropic, must show it."""
    params = off_default(name)
    f = values(name, params, ORDINARY)
    if not models()[name].reciprocal:
        assert not np.allclose(values(name, params, ORDINARY.swapped()), f, rtol=1e-3)
    if not models()[name].isotropic:
        assert not np.allclose(values(name, params, rotated(ORDINARY, 1.0)), f, rtol=1e-3)


@every_model
@given(data=st.data(), angle=st.floats(0, 2 * math.pi))
@examples
def test_turning_the_sample(name: str, data: st.DataObject, angle: float) -> None:
    """Isotropic: only phi_o - phi_i matters. Anisotropic: the axes turn with the sample."""
    params = data.draw(legal_params(models()[name]))
    f = values(name, params, ORDINARY)
    params = turned_axes(models()[name], params, lambda phi_x: phi_x + angle)
    turned = values(name, params, rotated(ORDINARY, angle))
    # The sum phi + angle is rounded to 1e-15, ten times what vectors carry
    # otherwise; the tolerance is that of the transcription, times ten.
    np.testing.assert_allclose(turned, f, rtol=2e-9, atol=1e-12)


@every_model
@given(data=st.data())
@examples
def test_half_a_turn_changes_nothing(name: str, data: st.DataObject) -> None:
    """An isotropic surface and one with two axes look the same after 180 degrees."""
    params = data.draw(legal_params(models()[name]))
    f = values(name, params, ORDINARY)
    half = values(name, params, rotated(ORDINARY, math.pi))
    np.testing.assert_allclose(half, f, rtol=2e-9, atol=1e-12)


@every_model
@given(data=st.data())
@examples
def test_mirror_image(name: str, data: st.DataObject) -> None:
    """Reflecting everything at the xz plane, the axis included, changes nothing."""
    params = data.draw(legal_params(models()[name]))
    f = values(name, params, ORDINARY)
    params = turned_axes(models()[name], params, lambda phi_x: -phi_x)
    theta_i, phi_i, theta_o, phi_o = ORDINARY
    image = values(name, params, Directions(theta_i, -phi_i, theta_o, -phi_o))
    np.testing.assert_allclose(image, f, rtol=2e-9, atol=1e-12)


@every_model
@pytest.mark.parametrize("precision", ["double", "single"])
@pytest.mark.parametrize("below", [90.0, 90.0001, 135.0, 180.0])
def test_zero_below_the_horizon(name: str, precision: Precision, below: float) -> None:
    params = off_default(name)
    turn = np.radians([0.0, 60.0, 180.0, 300.0])
    down, up = np.full(4, math.radians(below)), np.full(4, math.radians(40.0))
    for d in (Directions(down, turn, up, 0 * turn), Directions(up, 0 * turn, down, turn)):
        assert np.all(values(name, params, d, precision=precision) == 0.0)
    d = Directions(down, turn, down, turn + math.pi)
    assert np.all(values(name, params, d, precision=precision) == 0.0)
    assert np.all(values(name, params, Directions(up, turn, up, turn)) > 0.0)


def off_default(name: str) -> Params:
    """Defaults, but with a diffuse term, a lobe, and axes that differ by a factor of three."""
    model = models()[name]
    params: Params = {p.name: p.default for p in model.parameters}
    params |= {p.name: 0.5 for p in model.linear}
    if model.lobe.axes is not None:
        wide, narrow, phi_x = model.lobe.axes
        params |= {wide: 0.45, narrow: 0.15, phi_x: 0.4}
    elif not model.isotropic:  # what makes it so has its default where nothing is turned
        params |= {p.name: 0.4 for p in model.nonlinear if p.default in p.bounds}
    return params


def turned_axes(model: Model, params: Params, turn: Callable[[float], float]) -> Params:
    """Change the azimuth of the sample's axes; the parameters with a period are such azimuths."""
    turned = dict(params)
    for p in model.parameters:
        value = turned[p.name]
        if p.period:
            assert isinstance(value, float)
            turned[p.name] = turn(value) % p.period
    return turned


def rounded(model: Model, params: Params) -> Params:
    """Round to single precision, without leaving the bounds."""

    def single(value: float, low: float, high: float) -> float:
        near = np.float32(value)
        if float(near) > high:
            near = np.nextafter(near, np.float32(-np.inf))
        if float(near) < low:
            near = np.nextafter(near, np.float32(np.inf))
        return float(near)

    found: Params = {}
    for p in model.parameters:
        value = params[p.name]
        if isinstance(value, list):
            found[p.name] = [single(v, *p.bounds) for v in value]
        else:
            found[p.name] = single(value, *p.bounds)
    return found


def elongation(name: str, params: Params) -> float:
    """Ratio of the axes of an anisotropic lobe, else 1."""
    axes = models()[name].lobe.axes
    if axes is None:
        return 1.0
    wide, narrow = params[axes[0]], params[axes[1]]
    assert isinstance(wide, float)
    assert isinstance(narrow, float)
    return wide / narrow
