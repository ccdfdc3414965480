"""The shifted gamma distribution: its normaliser, its limits, and the published parameters."""

from __future__ import annotations

import ast
import math
import re
from pathlib import Path
from typing import get_args

import numpy as np
import pytest

from lobefit.kernels import evaluate
from lobefit.kernels.geometry import Precision
from tests.kernels.strategies import Params, directions
from tests.kernels.transcriptions import Array, geometry

PUBLISHED = Path(__file__).parents[3] / "shared/reference/published_fits/bagher_sgd.fit"

# Masking that is 1 up to 89 degrees.
UNMASKED: Params = {"Lambda": 1e-8, "k_g": 1000.0, "theta0": 0.0}
WHITE: Params = {"F0": 1.0, "F_g": 1.0}

# alpha, p, K = 1/(alpha Gamma(1 - p, alpha)) in 40-digit arithmetic (mpmath)
NORMALISERS = [
    (1.62017e-05, 0.2, 53023.61535122012711),
    (1e-5, 2.0, 1.0001193713958299627),
    (2.0, 2.0, 26.642324945207439761),
    (2.0, 0.0, 3.6945280494653251136),
    (0.5, 1.0, 3.5728730662970071085),
    (0.5, 0.999999999, 3.5728730664867669881),
    (0.03, 1.5, 3.9935530653182946568),
    (0.03, 0.5, 23.318554386971172549),
    (0.0490339, 0.529272, 14.826088255804588483),
]

ALUM_BRONZE = {
    "k_d": [0.0478786, 0.0313514, 0.0200638],
    "k_s": [0.0364976, 0.664975, 0.268836],
    "F0": [6.05524 - 5.05524, 0.235756 - 0.182842, 0.580647 - 0.476088],
    "F_g": [6.05524, 0.235756, 0.580647],
    "alpha": [0.014832, 0.0300126, 0.0490339],
    "p": [0.459076, 0.450056, 0.529272],
    "Lambda": [2.60672, 2.97371, 2.7827],
    "k_g": [47.783, 36.2767, 31.6066],
    "theta0": [0.205635, 0.066289, -0.0661091],
}
# The paper's formula with its K and c, in 50-digit arithmetic (mpmath); angles in degrees.
ALUM_BRONZE_VALUES = {
    (0, 0, 0, 0): (1.183260984456774, 0.4222732104292729, 0.2047055603739046),
    (30, 0, 40, 180): (0.4102614533929985, 0.2989675344961348, 0.2284732096572747),
    (75, 10, 70, 195): (1.522957353375823, 3.311261982756346, 2.197357718374359),
    (60, 0, 20, 90): (0.01524023171679121, 0.009979607721779729, 0.006404477028377857),
    (10, 0, 80, 30): (0.01524023171663914, 0.009979460565709459, 0.006386506840774244),
}


def normaliser(alpha: float, p: float) -> float:
    """Give K from the value at normal incidence, K exp(-alpha) / (pi^2 alpha^p)."""
    params = UNMASKED | WHITE | {"k_d": 0.0, "k_s": 1.0, "alpha": alpha, "p": p}
    peak = evaluate("sgd", params, 0, 0, 0, 0).item()
    return float(peak * math.pi**2 * alpha**p * math.exp(alpha))


@pytest.mark.parametrize(("alpha", "p", "K"), NORMALISERS)
def test_normaliser(alpha: float, p: float, K: float) -> None:
    assert normaliser(alpha, p) == pytest.approx(K, rel=1e-12)


def test_normaliser_where_the_parts_of_its_formula_meet() -> None:
    """The recurrence and the series take over from one another at p = 0.5 and 1.5."""
    for alpha in (1e-5, 1e-2, 2.0):
        for p in (0.5, 1.0, 1.5):
            below, above = (normaliser(alpha, p + step) for step in (-1e-13, 1e-13))
            # K may change by |ln alpha| times the step itself.
            assert above == pytest.approx(below, rel=1e-11)


def test_without_a_tail_it_is_beckmann() -> None:
    """p = 0: D is Beckmann's with roughness sqrt(alpha), here without masking and over pi."""
    d = directions(1000, seed=11, theta_max=80.0)
    alpha = 0.04
    params = UNMASKED | WHITE | {"k_d": 0.0, "k_s": 1.0, "alpha": alpha, "p": 0.0}
    g = geometry(*d.exact())
    D = np.exp(-g.tan2_h / alpha) * (1 + g.tan2_h) ** 2 / (math.pi * alpha)
    expected = (D / (math.pi * g.i[2] * g.o[2]))[np.newaxis]
    np.testing.assert_allclose(evaluate("sgd", params, *d), expected, rtol=1e-11, atol=1e-200)


def test_equal_ends_of_the_fresnel_factor_are_schlick() -> None:
    d = directions(1000, seed=12)
    white, grey = (
        evaluate("sgd", {"k_d": 0.0, "F0": F, "F_g": F, "alpha": 0.3}, *d) for F in (1.0, 0.3)
    )
    schlick = 0.3 + 0.7 * geometry(*d).one_minus_cos_d ** 5
    np.testing.assert_allclose(grey, schlick * white, rtol=1e-13, atol=1e-200)


@pytest.mark.parametrize("precision", get_args(Precision))
def test_masking_goes_to_zero_in_proportion_to_the_elevation(precision: Precision) -> None:
    """Nothing cancels at grazing: D and F are constant there, and so is G1 / cos(theta)."""
    theta_i = np.radians([89.99, 89.999, 89.9999])
    params: Params = {"k_d": 0.0, "alpha": 0.5, "Lambda": 1e3}
    f = evaluate("sgd", params, theta_i, 0.0, 0.3, math.pi, precision=precision)
    np.testing.assert_allclose(f / f[0, 2], 1.0, rtol=3e-3)


@pytest.mark.parametrize("angles", ALUM_BRONZE_VALUES)
def test_alum_bronze(angles: tuple[int, int, int, int]) -> None:
    f = evaluate("sgd", ALUM_BRONZE, *np.radians(angles))
    # The table prints K to six digits.
    assert f[:, 0] == pytest.approx(ALUM_BRONZE_VALUES[angles], rel=2e-6)


def published() -> dict[str, tuple[Params, dict[str, list[float]]]]:
    """Read the table: for each material our parameters, and the paper's as printed."""
    if not PUBLISHED.exists():
        pytest.skip("the table of published parameters is not on this machine")
    found: dict[str, tuple[Params, dict[str, list[float]]]] = {}
    for line in PUBLISHED.read_text(encoding="utf-8").splitlines():
        row = re.fullmatch(r"(\S+) = Aggregate\(Lambertian\((.*)\), Bagher\((.*)\)\)", line)
        if row is None:
            continue
        numbers = {
            key: ast.literal_eval(value)
            for key, value in re.findall(r"(\w+) = (\[\[.*?\]\]|\[.*?\])", row[3])
        }
        [(_, albedo)] = re.findall(r"(\w+) = (\[.*?\])", row[2])
        F0, F1 = numbers["eta"]
        ours: Params = {
            "k_d": ast.literal_eval(albedo),
            "k_s": numbers["albedo"],
            # The fit's own bound of 1, printed with more digits than it has.
            "F0": [min(a - b, 1.0) for a, b in zip(F0, F1, strict=True)],
            "F_g": F0,
            **{name: numbers[name] for name in ("alpha", "p", "Lambda", "theta0")},
            "k_g": numbers["k"],
        }
        found[row[1]] = ours, numbers
    assert len(found) == 100
    return found


def test_published_normalisers() -> None:
    worst = 0.0
    for _, paper in published().values():
        for alpha, p, K in zip(paper["alpha"], paper["p"], paper["K"], strict=True):
            worst = max(worst, abs(normaliser(alpha, p) / K - 1))
    assert worst < 5e-6  # half a unit of the sixth digit


def test_published_masking() -> None:
    """G1 with the published c, in 80-bit arithmetic, is ours with c from the other numbers."""
    theta = np.radians(np.linspace(0.0, 89.0, 90))
    worst = 0.0
    for ours, paper in published().values():
        shape: Params = {name: ours[name] for name in ("Lambda", "k_g", "theta0")}
        params = shape | WHITE | {"k_d": 0.0, "alpha": 2.0, "p": 0.0}
        # Seen along the normal: G1 of both directions times what does not depend on them.
        masked, bare = (
            evaluate("sgd", params | change, theta, 0, 0, 0) for change in ({}, UNMASKED)
        )
        columns: list[Array] = [
            np.asarray(paper[n], dtype=np.longdouble)[:, None]
            for n in ("Lambda", "c", "k", "theta0")
        ]
        Lambda, c, k, theta0 = columns
        exponent = c * np.maximum(theta - theta0, 0) ** k
        G1 = np.clip(1 - Lambda * np.expm1(exponent), 0, 1)
        worst = max(worst, float(np.max(np.abs(masked / bare - G1 * G1[:, :1]))))
    assert worst < 1e-4  # six digits of c, and of k_g up to 856


def test_published_fresnel_factors_are_in_bounds_but_for_seven() -> None:
    low = [F for ours, _ in published().values() for F in np.atleast_1d(ours["F0"]) if F < 0]
    assert len(low) == 7
    assert min(low) == pytest.approx(-0.073, abs=1e-3)
