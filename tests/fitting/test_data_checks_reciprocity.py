"""Reciprocity of data: a cosine too many is found and sized, with pairs and without."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from lobefit.fitting import read_measurement, simulate
from lobefit.fitting.checks.reciprocity import check_cosine_factor, check_reciprocity, exchange
from lobefit.fitting.checks.surface import fitted_surface
from lobefit.fitting.checks.view import View
from tests.fitting.check_cases import GLOSSY, HEMISPHERE, IN_PLANE, ROUGH, glossy, rough, times
from tests.fitting.shared_data import DATA, needs_data


@pytest.mark.parametrize("surface", [glossy, rough])
@pytest.mark.parametrize("geometry", [IN_PLANE, HEMISPHERE])
@pytest.mark.parametrize(
    ("which", "power"),
    [("theta_o", 1.0), ("theta_i", -1.0), ("theta_i", 1.0), ("theta_o", -1.0)],
)
def test_a_cosine_too_many_is_flagged_by_its_size(
    surface: Any, geometry: str, which: str, power: float
) -> None:
    m = surface(geometry)
    pairs = exchange(View(times(m, np.cos(getattr(m, which)) ** power)), None)
    assert pairs is not None
    sign = power if which == "theta_o" else -power
    # 0.1: noise of 2 % in tens of pairs, and the error of interpolating on coarse grids.
    assert pairs.exponent == pytest.approx(sign, abs=0.1)
    for found in (check_reciprocity(pairs), check_cosine_factor(pairs)):
        assert found.verdict == "suspicious"
        assert ("cosine-weighted" in found.remedy) == (sign > 0)


@pytest.mark.parametrize("surface", [glossy, rough])
@pytest.mark.parametrize(
    "geometry",
    [IN_PLANE, HEMISPHERE, "in-plane", "in-plane incidences=11,23,37,52,68 step=1.7"],
)
def test_reciprocal_values_are_not_flagged(surface: Any, geometry: str) -> None:
    for seed in range(5):
        pairs = exchange(View(surface(geometry, seed)), None)
        assert pairs is not None
        assert abs(pairs.exponent) < 0.15
        assert check_reciprocity(pairs).verdict == "ok"
        assert check_cosine_factor(pairs).verdict == "ok"


PHONG_SCAN = "in-plane incidences=10,20,30,40,50,60,70 step=5"


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("n", [5.0, 10.0])
def test_a_lobe_that_is_not_reciprocal_over_a_floor_that_is(n: float, seed: int) -> None:
    truth = {"k_d": 0.1, "k_s": 0.1, "n": n}
    m = simulate("phong", truth, PHONG_SCAN, noise=(0.01, 1e-4), seed=seed)
    pairs = exchange(View(m), None)
    assert pairs is not None and abs(pairs.exponent) < 0.25
    found = check_reciprocity(pairs)
    assert found.verdict == "suspicious"
    assert "stand out from noise and alignment" in found.sentence
    assert "Phong" in found.remedy


@pytest.mark.parametrize("relative", [0.01, 0.05])
@pytest.mark.parametrize(
    ("model", "truth"),
    [
        ("ggx", GLOSSY),
        ("ggx", GLOSSY | {"alpha": 0.03}),
        ("beckmann", ROUGH),
        ("blinn_phong", {"k_d": 0.1, "k_s": 0.3, "n": 100.0}),
        ("oren_nayar", {"k_d": 0.3, "sigma": 0.5}),
    ],
)
def test_noise_alone_does_not_stand_out(model: str, truth: dict[str, Any], relative: float) -> None:
    for seed in range(3):
        m = simulate(model, truth, PHONG_SCAN, noise=(relative, 1e-4), seed=seed)
        found = check_reciprocity(exchange(View(m), None))
        assert found.verdict == "ok"
        assert int(found.figures["standing_out"] or 0) < 3


def test_pairs_are_measured_where_they_can_be_and_interpolated_where_not() -> None:
    """Incidences of 10 degrees with views of 2 visit 21 pairs on either side of the normal."""
    exact = exchange(View(rough()), None)
    assert exact is not None and exact.kind == "exact" and len(exact) == 42
    near = exchange(View(rough("in-plane incidences=11,23,37,52,68 step=1.7")), None)
    assert near is not None and near.kind == "interpolated" and len(near) > 20


@pytest.mark.parametrize("power", [-1.0, 0.0, 1.0])
def test_without_pairs_the_models_symmetric_part_is_asked(power: float) -> None:
    m = rough("in-plane incidences=25,45,65 step=12")
    view = View(times(m, np.cos(m.theta_o) ** power))
    assert exchange(view, None) is None
    assert check_reciprocity(None).verdict == check_cosine_factor(None).verdict == "cannot tell"
    pairs = exchange(view, fitted_surface(view))
    assert pairs is not None and pairs.kind == "model"
    # 0.4: the model was fitted to the wrong values, and half of the cosine shows in it.
    assert pairs.exponent == pytest.approx(power, abs=0.4)
    assert check_reciprocity(pairs).verdict == ("suspicious" if power else "ok")


def test_a_turned_anisotropic_sample_is_reciprocal_but_for_its_azimuths() -> None:
    truth = {"k_d": 0.05, "F0": 0.5, "alpha_x": 0.1, "alpha_y": 0.4}
    geometry = "in-plane incidences=20,40,60 azimuths=0,45,90,135 step=2"
    m = simulate("ggx_anisotropic", truth, geometry, noise=(0.02, 1e-4), seed=1)
    for factor, expected in ((1.0, "ok"), (np.cos(m.theta_o), "suspicious")):
        pairs = exchange(View(times(m, factor)), None)
        assert pairs is not None and pairs.kind == "exact"
        assert check_reciprocity(pairs).verdict == expected


@needs_data
@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("mtmrt_aluminium_sandblasted", "ok"),
        ("mtmrt_aluminium_sandblasted_nonreciprocal", "suspicious"),
    ],
)
def test_the_published_formula_of_a_goniometer_has_one_cosine_too_many(
    name: str, expected: str
) -> None:
    pairs = exchange(View(read_measurement(DATA / f"{name}.csv")), None)
    assert pairs is not None and pairs.kind == "exact" and len(pairs) == 36
    found = check_reciprocity(pairs)
    assert found.verdict == check_cosine_factor(pairs).verdict == expected
    if expected == "suspicious":
        assert pairs.exponent == pytest.approx(1.0, abs=0.05)
        assert pairs.median_ratio > 1.5
        assert "one cosine" in found.sentence
    else:
        assert pairs.exponent == pytest.approx(0.0, abs=0.05)
