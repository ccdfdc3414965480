"""Lobes of powers of cosines: their mutual limits, albedos, and published parameters."""

from __future__ import annotations

import math

import numpy as np
import pytest

from lobefit.kernels import directional_albedo, evaluate
from tests.kernels.strategies import Params, directions
from tests.kernels.transcriptions import Array

LOBE: Params = {"k_d": 0.0, "k_s": 1.0}
THREE_DIGITS = 0.5e-3


def albedo(model: str, params: Params, degrees: list[float], phi_i: float = 0.0) -> Array:
    found: Array = directional_albedo(model, params, np.radians(degrees), phi_i)[0]
    return found


def normalised(n: float) -> float:
    """Give the k_s for which `phong` reflects all light at normal incidence."""
    return (n + 2) / (2 * math.pi)


# Phong


def test_phong_swapped_differs_by_the_ratio_of_the_cosines() -> None:
    a, b = math.radians(11.5), math.radians(68.8)
    for n in (1.0, 5.0, 40.0):
        params = LOBE | {"n": n}
        there = evaluate("phong", params, a, 0.0, b, 2.9).item()
        back = evaluate("phong", params, b, 2.9, a, 0.0).item()
        # f(i, o) over f(o, i) is n.o over n.i, whatever n and k_s.
        assert there / back == pytest.approx(math.cos(b) / math.cos(a), rel=1e-13)
        assert there / back == pytest.approx(0.3690, abs=0.5e-4)


def test_phong_is_modified_phong_over_the_cosine_without_its_norm() -> None:
    d = directions(500, seed=11, theta_max=80.0)
    f = evaluate("phong", {"k_d": 0.0, "k_s": normalised(12.0), "n": 12.0}, *d)
    modified = evaluate("modified_phong", LOBE | {"n": 12.0}, *d)
    np.testing.assert_allclose(f * np.cos(d.theta_i), modified, rtol=1e-13, atol=1e-200)


def test_phong_gives_out_more_than_it_gets_at_grazing_incidence() -> None:
    params: Params = {"k_d": 0.0, "k_s": normalised(10.0), "n": 10.0}
    found = albedo("phong", params, [0.0, 75.0, 85.0, 89.0, 89.9])
    assert found == pytest.approx([1.0, 1.1278, 1.9652, 7.561, 71.00], rel=1e-4)


# Lafortune


def of_lafortune_1997(C_xy: float, C_z: float, n: float) -> Params:
    """Translate a lobe of the 1997 paper as the model's page says."""
    M = max(abs(C_xy), C_z)
    C = -C_xy / C_z if C_z == M else math.copysign(2 - C_z / M, -C_xy)
    return {"k_d": 0.0, "k_s": 2 * math.pi * M**n / (n + 2), "C": C, "n": n}


# Light-blue house paint, red channel: C_xy, C_z and n of three lobes.
HOUSE_PAINT = [
    (0.870567, 0.774290, 21.820103),
    (-0.451218, 0.023123, 3.029342),
    (-1.031545, 0.706734, 66.899060),
]


@pytest.mark.parametrize("lobe", [*HOUSE_PAINT, (-0.3, 0.9, 7.0), (0.2, 1.1, 4.0), (-1.1, -1.3, 8)])
def test_lafortune_takes_published_lobes(lobe: tuple[float, float, float]) -> None:
    C_xy, C_z, n = lobe
    d = directions(2000, seed=12)
    across = np.sin(d.theta_i) * np.sin(d.theta_o) * np.cos(d.phi_o - d.phi_i)
    base = C_xy * across + C_z * np.cos(d.theta_i) * np.cos(d.theta_o)
    expected = np.maximum(base, 0) ** n
    found = evaluate("lafortune", of_lafortune_1997(*lobe), *d)[0]
    np.testing.assert_allclose(found, expected, rtol=1e-10, atol=1e-15)
    assert np.count_nonzero(expected > 1e-6) > 100


def test_lafortune_of_c_one_is_modified_phong() -> None:
    d = directions(1000, seed=13)
    for n in (1.0, 30.0, 1e5):
        f = evaluate("lafortune", LOBE | {"C": 1.0, "n": n}, *d)
        expected = evaluate("modified_phong", LOBE | {"n": n}, *d)
        np.testing.assert_allclose(f, expected, rtol=1e-9, atol=1e-12)


def test_lafortune_of_c_minus_one_is_the_same_lobe_towards_the_light() -> None:
    d = directions(1000, seed=14)
    f = evaluate("lafortune", LOBE | {"C": -1.0, "n": 30.0}, *d)
    behind = d._replace(phi_i=d.phi_i + math.pi)
    expected = evaluate("modified_phong", LOBE | {"n": 30.0}, *behind)
    np.testing.assert_allclose(f, expected, rtol=1e-9, atol=1e-12)


def test_lafortune_of_c_zero_reflects_a_power_of_the_cosine() -> None:
    degrees = [0.0, 30.0, 60.0, 75.0]
    for n in (1.0, 6.0):
        found = albedo("lafortune", LOBE | {"C": 0.0, "n": n}, degrees)
        np.testing.assert_allclose(found, np.cos(np.radians(degrees)) ** n, atol=1e-6)


def test_lafortune_never_reflects_more_than_k_s() -> None:
    for C in (-2.0, -1.3, -1.0, -0.4, 0.0, 0.4, 1.0, 1.3, 2.0, 3.0, 5.0):
        for n in (1.0, 10.0, 100.0):
            found = albedo("lafortune", LOBE | {"C": C, "n": n}, [0.0, 20.0, 45.0, 70.0, 89.0])
            assert found.max() <= 1.0 + 1e-6


def test_lafortune_leans_to_grazing_beyond_the_mirror() -> None:
    """At 60 degrees the lobe of C > 1 peaks beyond the mirror direction, and C < 1 before it."""
    theta_o = np.radians(np.linspace(1.0, 89.0, 881))
    peak = {
        C: math.degrees(
            theta_o[
                np.argmax(
                    evaluate(
                        "lafortune", LOBE | {"C": C, "n": 30.0}, math.pi / 3, 0.0, theta_o, math.pi
                    )
                )
            ]
        )
        for C in (0.5, 1.0, 1.5)
    }
    assert peak[1.0] == pytest.approx(60.0, abs=0.1)
    # tan(theta_o) = (|C_xy|/C_z) tan(theta_i)
    for C, ratio in ((0.5, 0.5), (1.5, 2.0)):
        expected = math.degrees(math.atan(ratio * math.tan(math.pi / 3)))
        assert peak[C] == pytest.approx(expected, abs=0.1)


# Ashikhmin-Shirley


def exponents(n_x: float, n_y: float) -> Params:
    return {"alpha_x": math.sqrt(2 / n_x), "alpha_y": math.sqrt(2 / n_y)}


@pytest.mark.parametrize(("n", "expected"), [(10.0, 0.696), (100.0, 0.961), (1000.0, 0.996)])
def test_ashikhmin_shirley_lobe_at_normal_incidence(n: float, expected: float) -> None:
    params = LOBE | {"F0": 1.0} | exponents(n, n)
    assert albedo("ashikhmin_shirley", params, [0.0])[0] == pytest.approx(
        expected, abs=THREE_DIGITS
    )


def test_ashikhmin_shirley_conserves_energy_under_its_gloss() -> None:
    for n_x, n_y in ((1.03, 1.03), (10.0, 10.0), (10.0, 200.0), (1000.0, 1000.0)):
        for F0 in (0.0, 0.04, 0.5, 1.0):
            params = LOBE | exponents(n_x, n_y) | {"k_d": 1 - F0, "F0": F0}
            for phi_i in (0.0, math.pi / 2):
                found = albedo("ashikhmin_shirley", params, [0.0, 45.0, 75.0, 85.0, 89.0], phi_i)
                assert found.max() < 1.0


def test_ashikhmin_shirley_with_equal_axes_is_isotropic() -> None:
    d = directions(1000, seed=15)
    equal = LOBE | {"F0": 0.3} | exponents(60.0, 60.0)
    f = evaluate("ashikhmin_shirley", equal | {"phi_x": 0.0}, *d)
    turned = evaluate("ashikhmin_shirley", equal | {"phi_x": 1.1}, *d)
    np.testing.assert_allclose(turned, f, rtol=1e-12, atol=1e-200)


def test_ashikhmin_shirley_axes_may_be_named_either_way() -> None:
    d = directions(1000, seed=16)
    wide: Params = {"alpha_x": 0.4, "alpha_y": 0.1}
    narrow: Params = {"alpha_x": 0.1, "alpha_y": 0.4}
    f = evaluate("ashikhmin_shirley", LOBE | wide | {"phi_x": 0.2}, *d)
    swapped = evaluate("ashikhmin_shirley", LOBE | narrow | {"phi_x": 0.2 + math.pi / 2}, *d)
    np.testing.assert_allclose(swapped, f, rtol=1e-12, atol=1e-200)


def test_ashikhmin_shirley_is_widest_along_phi_x() -> None:
    """Half vectors 0.3 rad off the normal, along and across the wider axis at azimuth 0.7."""
    shape: Params = {"F0": 1.0, "alpha_x": 0.4, "alpha_y": 0.1, "phi_x": 0.7}
    along, across = (
        evaluate("ashikhmin_shirley", LOBE | shape, 0.6, phi, 0.0, 0.0).item()
        for phi in (0.7, 0.7 + math.pi / 2)
    )
    n_x, n_y = 2 / 0.4**2, 2 / 0.1**2
    assert along / across == pytest.approx(math.cos(0.3) ** (n_x - n_y), rel=1e-12)


def test_ashikhmin_shirley_of_a_small_alpha_is_a_gaussian_of_the_slope() -> None:
    """cos^n of theta_h with n = 2/alpha^2 and exp(-tan^2(theta_h)/alpha^2) agree to alpha^2."""
    alpha = 0.01
    theta_h = np.linspace(0.0, 3 * alpha, 50)
    params = LOBE | {"F0": 1.0, "alpha_x": alpha, "alpha_y": alpha}
    f = evaluate("ashikhmin_shirley", params, 2 * theta_h, 0.0, 0.0, 0.0)[0]
    gaussian = np.exp(-((np.tan(theta_h) / alpha) ** 2))
    # Relative, (theta_h/alpha)^2 theta_h^2/2 = 81/2 alpha^2 of the exponents, and the cosines.
    np.testing.assert_allclose(f / f[0], gaussian, rtol=60 * alpha**2)


@pytest.mark.parametrize(
    ("model", "shape", "width"),
    [
        ("ashikhmin_shirley", {"F0": 1.0, "alpha_x": 0.004, "alpha_y": 0.002, "phi_x": 0.3}, 0.002),
        ("phong", {"n": 5e5}, 0.002),
        ("lafortune", {"C": 1.0, "n": 1e5}, 0.004),
    ],
)
def test_single_precision_keeps_narrow_lobes(model: str, shape: Params, width: float) -> None:
    """0 to 20 widths off the mirror, where the value is above 1e-12 of the largest."""
    rng = np.random.default_rng(17)
    count = 20_000
    theta_i = np.radians(rng.uniform(0, 85, count))
    distance, turn = width * rng.uniform(0, 20, count), rng.uniform(0, 2 * np.pi, count)
    theta_o = np.minimum(np.abs(theta_i + distance * np.cos(turn)), np.radians(85))
    azimuth = np.pi + distance * np.sin(turn) / np.maximum(np.sin(theta_i), distance)
    double, single = (
        evaluate(model, LOBE | shape, theta_i, 0.0, theta_o, azimuth, precision=precision)
        for precision in ("double", "single")
    )
    seen = double > 1e-12 * double.max()
    assert np.count_nonzero(seen) > count // 4
    np.testing.assert_allclose(single[seen], double[seen], rtol=1e-5)
