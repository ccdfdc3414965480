"""Wrong calls: each is a ModelError that says what was found and what would be right."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest

from lobefit.kernels import LobefitError, ModelError, directional_albedo, evaluate, models

ANGLES = (0.1, 0.0, 0.2, 0.0)


def message_of(model: str, params: Mapping[str, Any], *angles: Any, **keywords: Any) -> str:
    with pytest.raises(ModelError) as caught:
        evaluate(model, params, *(angles or ANGLES), **keywords)
    assert isinstance(caught.value, LobefitError)
    return str(caught.value)


@pytest.mark.parametrize(
    ("wrong", "meant"), [("gxx", "ggx"), ("wrad", "ward"), ("cook-torrance", "cook_torrance")]
)
def test_unknown_model_with_a_suggestion(wrong: str, meant: str) -> None:
    message = message_of(wrong, {})
    assert f"{wrong!r}" in message
    assert f"did you mean {meant!r}?" in message


def test_unknown_model_far_from_any_lists_all() -> None:
    message = message_of("zzzzzz", {})
    assert "did you mean" not in message
    for name in models():
        assert name in message


@pytest.mark.parametrize(
    ("model", "wrong", "meant"), [("ggx", "alhpa", "alpha"), ("ward", "alpha_z", "alpha_")]
)
def test_unknown_parameter_with_a_suggestion(model: str, wrong: str, meant: str) -> None:
    message = message_of(model, {wrong: 0.1})
    assert model in message
    assert f"{wrong!r}" in message
    assert f"did you mean '{meant}" in message
    for parameter in models()[model].parameters:
        assert parameter.name in message


def test_unknown_parameter_without_a_suggestion() -> None:
    message = message_of("lambert", {"zzz": 0.1})
    assert "did you mean" not in message
    assert "'zzz'. " in message  # a sentence of its own
    assert "k_d" in message


@pytest.mark.parametrize("name", models())
def test_every_bound_is_enforced(name: str) -> None:
    checked = 0
    for parameter in models()[name].parameters:
        if parameter.period is not None:
            continue
        low, high = parameter.bounds
        outside = [low - 1e-6 * max(abs(low), 1e-3)]
        outside += [high + 1e-6 * max(abs(high), 1e-3)] if math.isfinite(high) else []
        for value in outside:
            message = message_of(name, {parameter.name: value})
            assert name in message
            assert parameter.name in message
            assert f"{low:g}" in message
            assert f"{high:g}" in message
            checked += 1
        evaluate(name, {parameter.name: low}, *ANGLES)  # the bound itself is legal
    assert checked > 0


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_parameters_must_be_finite(value: float) -> None:
    for parameter in models()["ward"].parameters:
        message = message_of("ward", {parameter.name: value})
        assert parameter.name in message
        assert f"{value:g}" in message


@pytest.mark.parametrize(
    ("params", "words"),
    [
        ({"alpha": "rough"}, ["alpha", "rough", "number"]),
        ({"alpha": None}, ["alpha"]),
        ({"alpha": [0.1, 0.2]}, ["alpha", "all channels"]),
        ({"F0": []}, ["F0"]),
        ({"F0": [[0.1, 0.2]]}, ["F0"]),
        ({"F0": [0.1, 0.2], "k_d": [0.1, 0.2, 0.3]}, ["2", "3", "channels"]),
    ],
)
def test_shapes_of_parameters(params: dict[str, Any], words: list[str]) -> None:
    message = message_of("ggx", params)
    for word in words:
        assert word in message


@pytest.mark.parametrize("position", range(4))
@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_angles_must_be_finite(position: int, value: float) -> None:
    angles = [np.full(5, angle) for angle in ANGLES]
    angles[position][3] = value
    name = ("theta_i", "phi_i", "theta_o", "phi_o")[position]
    assert name in message_of("ggx", {}, *angles)


@pytest.mark.parametrize("position", [0, 2])
@pytest.mark.parametrize("value", [45.0, -0.1])
def test_zenith_angles_in_degrees_or_negative(position: int, value: float) -> None:
    angles = list(ANGLES)
    angles[position] = value
    message = message_of("ggx", {}, *angles)
    assert ("theta_i", "phi_i", "theta_o")[position] in message
    assert "radians" in message


def test_angles_of_different_lengths() -> None:
    message = message_of("ggx", {}, np.zeros(3), np.zeros(3), np.zeros(4), np.zeros(3))
    assert "(3,)" in message
    assert "(4,)" in message


def test_angles_in_a_table() -> None:
    assert "2-dimensional" in message_of("ggx", {}, np.zeros((2, 2)), 0.0, 0.1, 0.0)


def test_angles_that_are_no_numbers() -> None:
    message_of("ggx", {}, "north", 0.0, 0.1, 0.0)


@pytest.mark.parametrize("precision", ["half", "Double", None])
def test_precision(precision: Any) -> None:
    message = message_of("ggx", {}, precision=precision)
    assert "single" in message
    assert "double" in message


def test_options() -> None:
    message = message_of("ggx", {}, options={"maskng": "smith_separable"})
    assert "'maskng'" in message
    assert "masking" in message.replace("'maskng'", "")
    message = message_of("ggx", {}, options={"masking": "none"})
    assert "'none'" in message
    assert "smith_separable" in message
    assert "none" in message_of("lambert", {}, options={"masking": "smith_separable"})


def test_no_directions_is_an_empty_answer() -> None:
    empty = np.zeros(0)
    f = evaluate("ggx", {"F0": [0.1, 0.2, 0.3]}, empty, empty, empty, empty)
    assert f.shape == (3, 0)


def test_albedo_checks_its_arguments_too() -> None:
    theta_i = np.array([0.1])
    with pytest.raises(ModelError, match="did you mean 'ggx'"):
        directional_albedo("gxx", {}, theta_i)
    with pytest.raises(ModelError, match="alpha = 3"):
        directional_albedo("ggx", {"alpha": 3.0}, theta_i)
    for theta in (math.nan, 45.0, -0.1, math.pi / 2):
        with pytest.raises(ModelError, match=r"theta_i.* radians"):
            directional_albedo("ggx", {}, np.array([0.1, theta]))
