"""The exact Fresnel terms against a transfer-matrix program, and in their limits."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Literal

import numpy as np
import numpy.typing as npt
import pytest

from lobefit.kernels import evaluate
from lobefit.kernels.metals import conductor

Array = npt.NDArray[np.float64]
Precision = Literal["single", "double"]

REFERENCE = Path(__file__).parents[2].parent / "shared/reference/fresnel.json"
TOLERANCE: dict[Precision, float] = {"double": 1e-12, "single": 1e-6}
PRECISIONS = pytest.mark.parametrize("precision", ["double", "single"])


def reflectance(
    theta_d: npt.ArrayLike, kind: str, precision: Precision = "double", **index: float | list[float]
) -> Array:
    """Give F [C, N]: a lobe in the mirror geometry over the same lobe without a Fresnel term."""
    theta = np.atleast_1d(np.asarray(theta_d, dtype=np.float64))
    directions = (theta, 0.3, theta, 0.3 + np.pi)
    lobe = {"k_d": 0.0, "k_s": 1.0, "alpha": 0.5}
    with_it, without = (
        evaluate("ggx", {**lobe, **brought}, *directions, options=options, precision=precision)
        for options, brought in (({"fresnel": kind}, index), ({"fresnel": "none"}, {}))
    )
    ratio: Array = with_it / without
    return ratio


def schlick(theta: Array, F0: float) -> Array:
    return F0 + (1 - F0) * (1 - np.cos(theta)) ** 5


def exact(theta: Array, n: float, k: float) -> Array:
    F: Array = reflectance(theta, "conductor", eta=n, k=k)[0]
    return F


@PRECISIONS
def test_against_a_transfer_matrix_program(precision: Precision) -> None:
    if not REFERENCE.is_file():
        pytest.skip(f"no {REFERENCE.name} beside the checkout")
    table = json.loads(REFERENCE.read_text())
    assert table["columns"] == ["n", "k", "theta_deg", "R_s", "R_p", "R_unpolarised"]
    rows = np.array(table["rows"])
    materials = np.unique(rows[:, :2], axis=0)
    assert len(materials) >= 5
    for n, k in materials:
        theta_deg, R = rows[(rows[:, 0] == n) & (rows[:, 1] == k)][:, [2, 5]].T
        # The file's angles are rounded to 1e-9 degrees: what half of that changes is not ours.
        theta, rounding = np.radians(theta_deg), np.radians(0.5e-9)
        step = 1e3 * rounding  # far enough for a difference
        steeper = np.abs(exact(theta + step, n, k) - exact(np.maximum(theta - step, 0.0), n, k))
        slack = TOLERANCE[precision] * R + steeper / 1e3
        for kind in ("conductor", "dielectric") if k == 0 else ("conductor",):
            index = {"eta": n, "k": k} if kind == "conductor" else {"eta": n}
            ours = reflectance(theta, kind, precision, **index)[0]
            assert np.all(np.abs(ours - R) <= slack), f"{kind} {n} + {k}i"


@PRECISIONS
def test_conductor_without_extinction_is_a_dielectric(precision: Precision) -> None:
    theta = np.radians(np.linspace(0.0, 89.99, 200))
    for eta in (1.33, 1.5, 2.5, 10.0):
        np.testing.assert_allclose(
            reflectance(theta, "conductor", precision, eta=eta, k=0.0),
            reflectance(theta, "dielectric", precision, eta=eta),
            rtol=TOLERANCE[precision],
            atol=TOLERANCE[precision] * 0.1,
        )


@PRECISIONS
def test_an_index_close_to_one(precision: Precision) -> None:
    """The conductor's form takes differences, which leave such an index fewer digits."""
    theta, eta = np.radians(np.linspace(0.0, 89.9, 200)), 1 + 2.0**-13  # exact in both precisions
    metal = reflectance(theta, "conductor", precision, eta=eta, k=0.0)
    glass = reflectance(theta, "dielectric", precision, eta=eta)
    np.testing.assert_allclose(metal, glass, rtol=0, atol=TOLERANCE[precision] * 20)
    truth = reflectance(theta, "dielectric", eta=eta)
    np.testing.assert_allclose(glass, truth, rtol=TOLERANCE[precision] * 10)


@PRECISIONS
@pytest.mark.parametrize("kind", ["dielectric", "conductor"])
def test_without_a_boundary_nothing_is_reflected(kind: str, precision: Precision) -> None:
    index = {"eta": 1.0, "k": 0.0} if kind == "conductor" else {"eta": 1.0}
    found = reflectance(np.radians([0.0, 30.0, 80.0, 89.0]), kind, precision, **index)
    np.testing.assert_allclose(found, 0.0, rtol=0, atol=TOLERANCE[precision])


@PRECISIONS
def test_normal_incidence(precision: Precision) -> None:
    eta = [0.05, 0.246, 1.0, 1.357, 5.0, 20.0]
    k = [0.0, 3.378, 2.0, 7.588, 0.1, 40.0]
    n, x = np.array(eta), np.array(k)
    expected = ((n - 1) ** 2 + x**2) / ((n + 1) ** 2 + x**2)
    found = reflectance(0.0, "conductor", precision, eta=eta, k=k)[:, 0]
    np.testing.assert_allclose(found, expected, rtol=TOLERANCE[precision])
    for value in (1 + 2.0**-13, 1.5, 4.0):  # exact in both precisions
        ours = reflectance(0.0, "dielectric", precision, eta=value)
        expected_there = ((value - 1) / (value + 1)) ** 2
        np.testing.assert_allclose(ours, expected_there, rtol=TOLERANCE[precision])


@PRECISIONS
def test_grazing_incidence_reflects_all(precision: Precision) -> None:
    # 1 - R is about 4 cos (1 + eta^2)/eta for a dielectric, and of that order for a metal.
    theta = np.radians(89.9999)
    assert reflectance(theta, "dielectric", precision, eta=1.5)[0, 0] > 1 - 2e-5
    assert np.all(reflectance(theta, "conductor", precision, **conductor("silver")) > 1 - 1e-4)


@pytest.mark.parametrize(
    ("eta", "largest"), [(1.3, 0.068), (1.5, 0.036), (2.0, 0.044), (3.0, 0.125)]
)
def test_how_far_schlick_is_from_a_dielectric(eta: float, largest: float) -> None:
    theta = np.radians(np.linspace(0.0, 89.9, 900))
    F0 = ((eta - 1) / (eta + 1)) ** 2
    miss = np.abs(schlick(theta, F0) - reflectance(theta, "dielectric", eta=eta)[0])
    assert miss.max() == pytest.approx(largest, abs=5e-4)


@pytest.mark.parametrize(
    ("name", "schlick_largest", "f82_largest"),
    [("copper", 0.043, 0.008), ("aluminium", 0.117, 0.018)],
)
def test_how_far_approximations_are_from_metals(
    name: str, schlick_largest: float, f82_largest: float
) -> None:
    theta = np.radians(np.linspace(0.0, 89.9, 900))
    index = conductor(name, [630.0, 532.0, 465.0])
    misses, misses_f82 = [], []
    for n, k in zip(index["eta"], index["k"], strict=True):
        true = exact(theta, n, k)
        F0 = float(exact(np.zeros(1), n, k)[0])
        F82 = float(exact(np.arccos([1 / 7]), n, k)[0])
        misses.append(np.abs(schlick(theta, F0) - true).max())
        f82 = reflectance(theta, "f82", F0=F0, F82=F82)[0]
        misses_f82.append(np.abs(f82 - true).max())
    assert max(misses) == pytest.approx(schlick_largest, abs=6e-4)
    assert max(misses_f82) == pytest.approx(f82_largest, abs=6e-4)
