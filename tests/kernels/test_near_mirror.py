"""Single precision must survive next to the mirror direction, where lobes are narrowest."""

from __future__ import annotations

import math

import numpy as np
import pytest

from lobefit.kernels import evaluate
from tests.kernels.strategies import Directions
from tests.kernels.transcriptions import Array, geometry

# What the measured geometry must keep: 1e-5 of the value, up to 20 widths off the mirror.
RELATIVE = 1e-5


def near_mirror(width: float) -> Directions:
    """Directions around the mirror one, 0 to 20 widths away, both within 85 degrees."""
    rng = np.random.default_rng(7)
    count = 20_000
    theta_i = np.radians(rng.uniform(0, 85, count))
    distance, turn = width * rng.uniform(0, 20, count), rng.uniform(0, 2 * np.pi, count)
    theta_o = np.minimum(np.abs(theta_i + distance * np.cos(turn)), np.radians(85))
    azimuth = distance * np.sin(turn) / np.maximum(np.sin(theta_i), distance)
    phi_i = rng.uniform(0, 2 * np.pi, count)
    return Directions(theta_i, phi_i, theta_o, phi_i + np.pi + azimuth)


def largest_relative_error(values: Array, reference: Array) -> float:
    """Where the value is above 1e-12 of the largest one."""
    seen = reference > 1e-12 * reference.max()
    assert np.count_nonzero(seen) > reference.size // 4
    return float(np.max(np.abs(values[seen] / reference[seen] - 1)))


@pytest.mark.parametrize("alpha", [0.001, 0.005, 0.02, 0.1])
def test_single_precision_ggx(alpha: float) -> None:
    d = near_mirror(alpha)
    params = {"k_d": 0.0, "k_s": 1.0, "F0": 1.0, "alpha": alpha}
    double = evaluate("ggx", params, *d, precision="double")
    single = evaluate("ggx", params, *d, precision="single")
    assert largest_relative_error(single, double) < RELATIVE
    assert np.any(single != double)  # or the switch does nothing


def test_single_precision_is_lost_by_the_textbook_formula() -> None:
    """D from n.h in single precision is off by per cent: what the kernels must avoid."""
    alpha = np.float32(0.001)
    g = geometry(*near_mirror(float(alpha)))
    exact = alpha.astype(float) ** 2 / (
        math.pi * ((alpha.astype(float) ** 2 + g.tan2_h) / (1 + g.tan2_h)) ** 2
    )
    cos_h = (g.H[2] / np.sqrt(g.H2)).astype(np.float32)
    naive = alpha**2 / (np.float32(np.pi) * (cos_h**2 * (alpha**2 - 1) + 1) ** 2)
    assert naive.dtype == np.float32
    assert largest_relative_error(naive, exact) > 0.02


@pytest.mark.parametrize(
    ("model", "width", "shape"),
    [
        ("cook_torrance", 0.002, {"F0": 1.0, "alpha": 0.002}),
        ("ward", 0.002, {"alpha_x": 0.004, "alpha_y": 0.002, "phi_x": 0.3}),
        ("blinn_phong", 0.002, {"n": 5e5}),
        ("modified_phong", 0.002, {"n": 5e5}),
    ],
)
def test_single_precision_of_exponentials(
    model: str, width: float, shape: dict[str, float]
) -> None:
    d = near_mirror(width)
    params = {"k_d": 0.0, "k_s": 1.0, **shape}
    double = evaluate(model, params, *d, precision="double")
    single = evaluate(model, params, *d, precision="single")
    assert largest_relative_error(single, double) < RELATIVE
    assert np.any(single != double)
