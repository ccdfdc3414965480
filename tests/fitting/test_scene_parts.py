"""Parts of a scene's decision: interpolated data, colour differences, what is enough."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from lobefit.fitting import simulate
from lobefit.fitting.export.fitted import Fitted
from lobefit.fitting.scene_answer import Combination, answer_for
from lobefit.fitting.scene_candidates import Fits, ShadingModel
from lobefit.fitting.scene_colour import Errors, Yardstick, encoded, exposure_factor
from lobefit.fitting.scene_cost import Cost, counted_work, take_turns
from lobefit.fitting.scene_data import Interpolation, half_difference
from lobefit.fitting.scene_file import Exposure, Tolerance
from lobefit.fitting.scene_texts import next_one
from lobefit.kernels import evaluate
from lobefit.kernels.errors import SceneError
from lobefit.kernels.surface import Shading

__all__: list[str] = []

PAINT: dict[str, float | list[float]] = {"k_d": [0.5, 0.3, 0.2], "alpha": 0.5, "F0": 0.04}
SCAN = "hemisphere incidences=0,15,30,45,60,75 theta_step=7.5 phi_step=20"


def test_half_difference_coordinates_are_those_of_an_isotropic_reciprocal_surface() -> None:
    rng = np.random.default_rng(1)
    theta_i, theta_o = rng.uniform(0.0, 1.5, (2, 100))
    turn = rng.uniform(0.0, 6.0, 100)
    here = half_difference(theta_i, theta_o, turn)
    np.testing.assert_allclose(half_difference(theta_o, theta_i, turn), here, atol=1e-7)
    np.testing.assert_allclose(half_difference(theta_i, theta_o, -turn), here, atol=1e-7)
    mirror = half_difference(theta_i, theta_i, np.full(100, np.pi))
    np.testing.assert_allclose(mirror[:, 0], 0.0, atol=1e-3)
    np.testing.assert_allclose(mirror[:, 1], theta_i / (np.pi / 2), atol=1e-7)
    retro = half_difference(theta_i, theta_i, np.zeros(100))
    np.testing.assert_allclose(retro[:, 1], 0.0, atol=1e-7)


def test_interpolated_data_are_the_surface_and_say_how_well() -> None:
    measured = simulate("ggx", PAINT, SCAN, (0.01, 1e-4), seed=3)
    data = Interpolation(measured)
    rng = np.random.default_rng(2)
    theta_i, theta_o = np.arccos(rng.uniform(0.4, 1.0, (2, 2000)))
    turn = rng.uniform(0.0, 2 * np.pi, 2000)
    found, covered = data(theta_i, theta_o, turn)
    truth = evaluate("ggx", PAINT, theta_i, 0.0, theta_o, turn)
    assert covered.mean() > 0.98
    error = np.abs(found / truth - 1.0)[:, covered]
    assert np.median(error) < 0.01
    # Readings have 1 % of noise, and are predicted by the others about as well as that.
    assert 0.003 < data.left_out().relative < 0.02
    grazing = data(np.full(5, 1.5), np.full(5, 1.5), np.full(5, np.pi))[1]
    assert not grazing.any()


def test_too_few_readings_are_not_interpolated() -> None:
    few = simulate("lambert", {"k_d": 0.5}, "in-plane incidences=30 step=20")
    assert not Interpolation(few).usable


def test_colour_differences_are_those_of_cie() -> None:
    pytest.importorskip("skimage")
    # From black (0) to mid grey, L* = 50: linear 0.18418..., ΔE2000 of (50, 0, 0) and (0, 0, 0).
    grey = ((50.0 + 16.0) / 116.0) ** 3
    dark = np.zeros((3, 1, 2))
    light = np.full((3, 1, 2), grey)
    mask = np.ones((1, 2), dtype=bool)
    found = Yardstick("delta_e", dark, mask, 1.0).errors(light, mask)
    # Sharma et al.: dL / S_L with S_L = 1 + 0.015 (25 - 50)^2 / sqrt(20 + 625).
    expected = 50.0 / (1.0 + 0.015 * 625.0 / np.sqrt(645.0))
    assert found.mean == pytest.approx(expected, rel=2e-4)
    assert found.clipped == 0.0
    # Exposure is the same for both, and what is clipped is told.
    bright = Yardstick("delta_e", light, mask, 10.0).errors(2.0 * light, mask)
    assert (bright.mean, bright.clipped) == (0.0, 1.0)


def test_srgb_is_encoded() -> None:
    pytest.importorskip("skimage")
    shown = encoded(np.array([1.0, 0.5, 0.0]).reshape(3, 1, 1), 1.0)
    np.testing.assert_allclose(shown[0, 0], [1.0, 0.735357, 0.0], atol=2e-3)


def test_relative_differences() -> None:
    reference = np.array([1.0, 2.0, 0.0]).reshape(1, 1, 3)
    mask = np.array([[True, True, False]])
    found = Yardstick("relative", reference, mask, 1.0).differences(1.1 * reference)
    np.testing.assert_allclose(found, [[0.1, 0.1, 0.0]], atol=1e-12)


def test_exposure() -> None:
    picture = np.linspace(0.0, 4.0, 401).reshape(1, 1, 401)
    mask = np.ones((1, 401), dtype=bool)
    assert exposure_factor(Exposure(), picture, mask) == pytest.approx(0.9 / 3.96)
    assert exposure_factor(Exposure(factor=3.0), picture, mask) == 3.0
    assert exposure_factor(Exposure(), 0.0 * picture, mask) == 1.0


def test_without_the_extra_it_is_said_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "skimage", None)
    with pytest.raises(SceneError, match=r"pip install 'lobefit\[scene\]'"):
        Yardstick("delta_e", np.ones((3, 1, 1)), np.ones((1, 1), dtype=bool), 1.0)


def combination(
    parameters: int, shading: Shading, ms: float, error: float, work: int = 100
) -> Combination:
    fitted = Fitted("m", "m", {}, {}, ("R",), "", "")
    cost = Cost(1e-3 * np.array([ms, 1.5 * ms, 9.0 * ms]), 10, work)
    model = ShadingModel(fitted, parameters, None, None)
    return Combination(model, shading, 3, cost, Errors(error, error, error, 0.0))


def test_the_simplest_of_the_same_cost_is_enough_however_times_jitter() -> None:
    within = Tolerance("relative", 1.0, 1.0)
    simple, rich = combination(3, "flat", 1.0, 0.9), combination(9, "flat", 1.0, 0.1)
    poor = combination(2, "phong", 1.0, 2.0)
    for slower in (0.55, 1.0, 1.9):
        noisy = combination(3, "flat", slower, 0.9)
        answer = answer_for(sorted([noisy, rich, poor], key=lambda c: c.cost.fastest), within)
        assert (answer.chosen, answer.cheaper, answer.equals) == (noisy, poor, (rich,))
    # A clear difference counts, whatever is simpler.
    dear = combination(3, "flat", 2.1, 0.9)
    assert answer_for([rich, dear], within).chosen is rich
    assert answer_for([rich, dear], within).richer == (dear,)
    # Of equal models and work the shading that is taught first, of less work that one.
    phong, flat = combination(3, "phong", 0.9, 0.5, 90), combination(3, "flat", 1.0, 0.9, 110)
    assert answer_for([phong, flat], within).chosen is flat
    busy = combination(3, "flat", 1.0, 0.9, 200)
    assert answer_for([phong, busy], within).chosen is phong
    # What is next cheaper has the same model where another shading fails, and no richer one.
    best, coarse = combination(7, "phong", 2.0, 0.5, 300), combination(7, "gouraud", 1.0, 2.0, 100)
    richer = combination(9, "flat", 0.5, 1.5, 50)
    assert answer_for([richer, poor, coarse, best], within).cheaper is coarse
    nothing = answer_for([poor, combination(3, "flat", 1.0, 4.0)], within)
    assert nothing.chosen is None and nothing.cheaper is poor
    assert answer_for([simple], within).cheaper is None


def test_what_is_not_cheaper_is_not_called_so() -> None:
    within = Tolerance("relative", 1.0, 1.0)
    enough, poor = combination(3, "flat", 1.0, 0.9), combination(2, "flat", 1.1, 2.0)
    assert next_one(answer_for([enough, poor], within)) == "next simpler"
    poor = combination(2, "flat", 0.9, 2.0)
    assert next_one(answer_for([poor, enough], within)) == "next cheaper"
    assert next_one(answer_for([poor], within)) == "nearest"


def test_the_reference_is_no_fit_with_a_parameter_that_nothing_tells() -> None:
    fitted = Fitted("m", "m", {}, {}, ("R",), "", "")
    plain, vague = (
        ShadingModel(fitted, 4, 0.0, None),
        ShadingModel(fitted, 6, 2.0, None, determined=False),
    )
    richer = ShadingModel(fitted, 5, 3.0, None)
    assert Fits(Path("r"), (plain, vague), True, ("R",), None).reference is plain
    assert Fits(Path("r"), (plain, vague, richer), True, ("R",), None).reference is richer
    # Where nothing else is there, it is what the report recommends.
    assert Fits(Path("r"), (vague,), True, ("R",), None).reference is vague


def test_work_is_counted() -> None:
    assert counted_work("phong", 1000, 2, 1000, 3) == 1000 * (12 + 6 + 12)
    assert counted_work("gouraud", 100, 2, 1000, 3) == 100 * 30 + 54000
    assert counted_work("flat", 200, 2, 1000, 3) == 200 * 30 + 12000


def test_frames_take_turns() -> None:
    order: list[int] = []

    def frame(k: int) -> float:
        order.append(k)
        return float(k)

    found = take_turns({0: lambda: frame(0), 1: lambda: frame(1)}, 3, 0.0)
    assert order == [0, 1, 1, 0, 0, 1]
    np.testing.assert_array_equal(found[1], [1.0, 1.0, 1.0])
