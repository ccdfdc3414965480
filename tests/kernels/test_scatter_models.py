"""Stray light, ABC, mirror and retro-reflection: closed forms and relations between models."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
import pytest

from lobefit.kernels import directional_albedo, evaluate
from lobefit.kernels.geometry import Precision
from tests.kernels.quadrature import albedo
from tests.kernels.strategies import Directions, Params, directions
from tests.kernels.test_near_mirror import RELATIVE, largest_relative_error, near_mirror
from tests.kernels.transcriptions import Array

NO_DIFFUSE: Params = {"k_d": 0.0}


def tis(model: str, params: Params) -> float:
    """Total integrated scatter: the albedo at normal incidence."""
    return float(directional_albedo(model, NO_DIFFUSE | params, 0.0)[0, 0])


# Stray light


@pytest.mark.parametrize("B", [1e-6, 1e-3, 0.1, 10.0])
def test_abg_total_scatter_for_g_2(B: float) -> None:
    """With x = sin(theta): 2 pi A times the integral of x/(B + x^2) over 0..1."""
    expected = math.pi * math.log(1 + 1 / B)
    assert tis("abg", {"A": 1.0, "B": B, "g": 2.0}) == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("g", [0.5, 1.0, 1.5])
def test_abg_total_scatter_without_a_knee(g: float) -> None:
    """For g < 2 and B -> 0 it stays finite: 2 pi A/(2 - g); the knee takes B^((2-g)/g) off."""
    expected = 2 * math.pi / (2 - g)
    found = tis("abg", {"A": 1.0, "B": 1e-12, "g": g})
    # What the cells next to the mirror miss of x^(1-g): 1e-4 of theta_h, at g = 1.5 its root.
    assert found == pytest.approx(expected, rel=3e-3)


def test_abg_total_scatter_grows_without_bound_for_g_2_and_more() -> None:
    """By pi A ln 10 for each decade of B at g = 2; as B^(2/g - 1) above."""
    log, power = (
        [tis("abg", {"A": 1.0, "B": B, "g": g}) for B in (1e-5, 1e-6, 1e-7)] for g in (2.0, 3.0)
    )
    assert np.diff(log) == pytest.approx(math.pi * math.log(10), rel=1e-4)
    # The tail beyond x = 1 is missing: 2 pi of 1e3.
    assert np.divide(power[1:], power[:-1]) == pytest.approx(10 ** (1 / 3), rel=0.05)


def test_abg_is_harvey_shack_for_g_2() -> None:
    d = directions(2000, seed=21)
    A, B = 0.003, 1e-4
    abg = evaluate("abg", {"k_d": 0.1, "A": A, "B": B, "g": 2.0}, *d)
    shoulder: Params = {"k_d": 0.1, "b": A / B, "l": math.sqrt(B), "s": -2.0}
    np.testing.assert_allclose(evaluate("harvey_shack", shoulder, *d), abg, rtol=1e-13)


def test_abg_peak_knee_and_slope() -> None:
    A, B, g = 0.02, 1e-3, 1.7
    params: Params = {"k_d": 0.0, "A": A, "B": B, "g": g}
    theta_i = 0.4
    x = np.array([0.0, B ** (1 / g), 0.3, 0.6])
    theta_o = np.arcsin(math.sin(theta_i) - x)  # towards the normal, and beyond it
    f = evaluate("abg", params, theta_i, 0.0, np.abs(theta_o), np.where(theta_o > 0, math.pi, 0))[0]
    assert f[0] == pytest.approx(A / B, rel=1e-12)
    assert f[1] == pytest.approx(A / (2 * B), rel=1e-12)
    # Beyond the knee the power law, up to B x^-g of it.
    assert f[2:] == pytest.approx(A * x[2:] ** -g, rel=0.01)


@pytest.mark.parametrize("l", [0.003, 0.1, 1.0])
@pytest.mark.parametrize("s", [-0.7, -2.0, -2.5, -6.0])
def test_harvey_shack_total_scatter(l: float, s: float) -> None:
    if s == -2.0:
        expected = math.pi * l**2 * math.log(1 + l**-2)
    else:
        expected = 2 * math.pi * l**2 * ((1 + l**-2) ** (s / 2 + 1) - 1) / (s + 2)
    assert tis("harvey_shack", {"b": 1.0, "l": l, "s": s}) == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize(
    ("model", "params"),
    [
        ("abg", {"A": 1.0, "B": 1e-3, "g": 2.5}),
        ("harvey_shack", {"b": 1.0, "l": 0.03, "s": -1.5}),
    ],
)
def test_shift_invariance_and_the_worst_incidence(model: str, params: Params) -> None:
    """The shape in x does not depend on the incidence, and the horizon only takes off."""
    x = np.array([0.01, 0.1, 0.3])
    values = []
    for theta_i in (0.0, 0.5, 0.9):
        theta_o = np.arcsin(math.sin(theta_i) - x)
        phi_o = np.where(theta_o > 0, math.pi, 0.0)
        values.append(evaluate(model, NO_DIFFUSE | params, theta_i, 0.0, np.abs(theta_o), phi_o))
    np.testing.assert_allclose(values[1], values[0], rtol=1e-12)
    np.testing.assert_allclose(values[2], values[0], rtol=1e-12)
    albedos = directional_albedo(model, NO_DIFFUSE | params, np.radians([0.0, 30.0, 60.0, 85.0]))[0]
    assert np.all(np.diff(albedos) < 0)


# ABC


def fresnel(cos_i: Array | float, eta: float) -> Array:
    """Fresnel's equations by Snell's law, squared and averaged."""
    cos_i = np.asarray(cos_i)
    cos_t = np.sqrt(1 - (1 - cos_i**2) / eta**2)
    r_s = (cos_i - eta * cos_t) / (cos_i + eta * cos_t)
    r_p = (eta * cos_i - cos_t) / (eta * cos_i + cos_t)
    return np.asarray((r_s**2 + r_p**2) / 2)


@pytest.mark.parametrize("eta", [1.01, 1.5, 4.0, 100.0])
@pytest.mark.parametrize("model", ["abc", "abc_microfacet"])
def test_fresnel_at_the_mirror_direction(model: str, eta: float) -> None:
    """There x = 0, the half vector is the normal, and V-cavities mask nothing."""
    theta = np.radians([0.0, 20.0, 50.0, math.degrees(math.atan(eta)), 80.0, 89.0])
    params: Params = {"k_d": 0.0, "A": 1.0, "B": 50.0, "C": 1.0, "eta": eta}
    found = evaluate(model, params, theta, 0.0, theta, math.pi)[0]
    if model == "abc_microfacet":
        found = found * np.cos(theta) ** 2
    # r_s and r_p as written above cancel for eta near 1.
    np.testing.assert_allclose(found, fresnel(np.cos(theta), eta), rtol=1e-11)
    assert found[0] == pytest.approx(((eta - 1) / (eta + 1)) ** 2, rel=1e-12)


def test_abc_is_harvey_shack_times_fresnel() -> None:
    d = directions(2000, seed=22)
    B, C, eta = 3000.0, 0.8, 1.7
    found = evaluate("abc", {"k_d": 0.0, "A": 2.0, "B": B, "C": C, "eta": eta}, *d)
    shoulder: Params = {"k_d": 0.0, "b": 2.0, "l": B**-0.5, "s": -2 * C}
    sines = [np.sin(t) * np.array([np.cos(p), np.sin(p)]) for t, p in (d[:2], d[2:])]
    sin2_d = np.sum((sines[0] - sines[1]) ** 2, axis=0) / 4
    expected = evaluate("harvey_shack", shoulder, *d) * fresnel(np.sqrt(1 - sin2_d), eta)
    np.testing.assert_allclose(found, expected, rtol=1e-11)


def test_abc_microfacet_albedo_of_a_narrow_lobe() -> None:
    """For C = 3 the integral of u (1 + B (1 - u))^-3 over 0..1 is 1/(2 (1 + B))."""
    B, eta = 1e6, 1.5
    params: Params = {"A": (1 + B) / (4 * math.pi), "B": B, "C": 3.0, "eta": eta}
    # Facets tilted by 1e-3 see F0 and mask nothing; a lobe that narrow loses 1e-5.
    assert tis("abc_microfacet", params) == pytest.approx(0.04, rel=1e-4)


@pytest.mark.parametrize("C", [0.3, 1.0, 3.0])
def test_abc_microfacet_stays_below_its_energy_bound(C: float) -> None:
    B = 40.0
    u = (np.arange(200_000) + 0.5) / 200_000
    total = 8 * math.pi * float(np.mean(u * (1 + B * (1 - u)) ** -C))
    params: Params = {"k_d": 0.0, "A": 1 / total, "B": B, "C": C, "eta": 100.0}
    albedos = directional_albedo(
        "abc_microfacet", params, np.radians([0.0, 40.0, 70.0, 85.0, 89.0])
    )
    assert np.all(albedos <= 1.0)
    assert np.all(albedos > 0.4)


@pytest.mark.parametrize(
    ("model", "width", "params"),
    [
        ("abc", 1e-4, {"A": 1.0, "B": 1e8, "C": 1.5, "eta": 1.5}),
        ("abc_microfacet", 1e-4, {"A": 1.0, "B": 1e8, "C": 3.0, "eta": 1.5}),
        ("abg", 1e-4, {"A": 1.0, "B": 1e-12, "g": 3.0}),
        ("harvey_shack", 1e-4, {"b": 1.0, "l": 1e-4, "s": -3.0}),
    ],
)
def test_single_precision_near_the_mirror(model: str, width: float, params: Params) -> None:
    d = near_mirror(width)
    double, single = (
        evaluate(model, NO_DIFFUSE | params, *d, precision=p) for p in ("double", "single")
    )
    assert largest_relative_error(single, double) < RELATIVE
    assert np.any(single != double)


# Mirror


def around(theta_i: float, phi_i: float, angle: Array, turn: Array) -> Directions:
    """Directions at an angle from the mirror direction of (theta_i, phi_i)."""
    theta, phi = theta_i, phi_i + math.pi
    r = np.array(
        [math.sin(theta) * math.cos(phi), math.sin(theta) * math.sin(phi), math.cos(theta)]
    )
    u = np.array(
        [math.cos(theta) * math.cos(phi), math.cos(theta) * math.sin(phi), -math.sin(theta)]
    )
    v = np.cross(r, u)
    o = np.multiply.outer(r, np.cos(angle)) + np.sin(angle) * (
        np.multiply.outer(u, np.cos(turn)) + np.multiply.outer(v, np.sin(turn))
    )
    theta_o = np.arctan2(np.hypot(o[0], o[1]), o[2])
    full = np.full_like(theta_o, 1.0)
    return Directions(theta_i * full, phi_i * full, theta_o, np.arctan2(o[1], o[0]))


def cone_integral(aperture: float, theta_i: float) -> float:
    """Integrate f cos_theta_o over the cone by Gauss in 1 - cos(angle), evenly in turn."""
    x, w = np.polynomial.legendre.leggauss(40)
    whole = 2 * math.sin(aperture / 2) ** 2
    versine = whole * (x + 1) / 2
    turns = 2 * np.pi * (np.arange(64) + 0.5) / 64
    angle, turn = np.meshgrid(2 * np.arcsin(np.sqrt(versine / 2)), turns, indexing="ij")
    d = around(theta_i, 0.7, angle.ravel(), turn.ravel())
    f = evaluate("mirror", {"k_d": 0.0, "k_s": 0.8, "aperture": aperture}, *d)[0]
    weights = np.repeat(w / 2 * whole, 64) * 2 * np.pi / 64
    return float(np.sum(weights * f * np.cos(d.theta_o)))


@pytest.mark.parametrize("aperture", [1e-4, 0.01, 0.2, 0.5])
@pytest.mark.parametrize("degrees", [0.0, 30.0, 60.0])
def test_a_mirror_reflects_k_s(aperture: float, degrees: float) -> None:
    # The edge itself is no node, so that the integrand is smooth: what is left is rounding.
    assert cone_integral(aperture, math.radians(degrees)) == pytest.approx(0.8, rel=1e-10)


def test_a_mirror_loses_what_is_below_the_horizon() -> None:
    assert 0.2 < cone_integral(0.5, math.radians(85.0)) < 0.75


@pytest.mark.parametrize("precision", ["double", "single"])
@pytest.mark.parametrize("aperture", [1e-4, 1e-3, 0.03, 0.5])
def test_the_edge_of_the_aperture_is_sharp(aperture: float, precision: Precision) -> None:
    """Inside and outside differ by 3e-7 of the aperture, in single precision as in double."""
    turn = np.linspace(0, 2 * np.pi, 200)
    for theta_i in (0.0, 0.5, 1.0):
        for factor, inside in ((1 - 3e-7, True), (1 + 3e-7, False)):
            d = around(theta_i, 0.2, np.full_like(turn, aperture * factor), turn)
            f = evaluate(
                "mirror",
                {"k_d": 0.0, "k_s": 1.0, "aperture": aperture},
                *d,
                precision=precision,
            )
            assert np.all((f > 0) == inside)


# Retro-reflection


def half_turn(d: Directions) -> Directions:
    return Directions(d.theta_i, d.phi_i + math.pi, d.theta_o, d.phi_o)


@pytest.mark.parametrize("alpha", [0.01, 0.3, 1.0])
def test_retro_is_ggx_with_the_light_turned_by_half_a_turn(alpha: float) -> None:
    d = half_turn(directions(2000, seed=23))
    retro = evaluate("retro", {"k_d": 0.1, "k_s": 0.7, "alpha": alpha}, *d)
    ggx = evaluate("ggx", {"k_d": 0.1, "k_s": 0.7, "F0": 1.0, "alpha": alpha}, *half_turn(d))
    # Slopes of 1e-5 carry 1e-16 of the directions; the lobe 0.01 wide sees 1e-12 of it.
    np.testing.assert_allclose(retro, ggx, rtol=1e-11)


def turned_retro(
    theta_i: npt.ArrayLike,
    phi_i: npt.ArrayLike,
    theta_o: npt.ArrayLike,
    phi_o: npt.ArrayLike,
    **params: float,
) -> Array:
    """The lobe at the place where the quadrature has its nodes, on the other side."""
    return evaluate("retro", params, theta_i, phi_i, theta_o, np.asarray(phi_o) + math.pi)


@pytest.mark.parametrize("alpha", [0.02, 0.1, 0.5, 1.0])
def test_retro_albedo_is_that_of_ggx(alpha: float) -> None:
    degrees = np.radians([0.0, 45.0, 75.0])
    white: Params = {"k_d": 0.0, "k_s": 1.0, "F0": 1.0, "alpha": alpha}
    ggx = directional_albedo("ggx", white, degrees)[0]
    params: Params = {"k_d": 0.0, "k_s": 1.0, "alpha": alpha}
    for theta_i, expected in zip(degrees, ggx, strict=True):
        found = albedo(turned_retro, theta_i, alpha, params, refine=1)[0]
        assert found == pytest.approx(expected, abs=1e-5)


@pytest.mark.parametrize("alpha", [0.3, 1.0])
def test_retro_albedo_of_the_kernels(alpha: float) -> None:
    """Their nodes crowd at the mirror direction; a wide lobe is integrated all the same."""
    degrees = np.radians([0.0, 45.0, 75.0])
    params: Params = {"k_d": 0.0, "k_s": 1.0, "alpha": alpha}
    ggx = directional_albedo("ggx", params | {"F0": 1.0}, degrees)
    np.testing.assert_allclose(directional_albedo("retro", params, degrees), ggx, atol=1e-4)


def test_single_precision_of_retro_next_to_its_peak() -> None:
    d = half_turn(near_mirror(0.002))
    params: Params = {"k_d": 0.0, "k_s": 1.0, "alpha": 0.002}
    double, single = (evaluate("retro", params, *d, precision=p) for p in ("double", "single"))
    assert largest_relative_error(single, double) < RELATIVE


@pytest.mark.parametrize("model", ["abc", "abc_microfacet", "abg", "harvey_shack", "retro"])
def test_a_lobe_of_zero_leaves_the_diffuse_term(model: str) -> None:
    d = directions(100, seed=24)
    scale = {"abg": "A", "abc": "A", "abc_microfacet": "A", "harvey_shack": "b", "retro": "k_s"}
    f = evaluate(model, {"k_d": 0.3, scale[model]: 0.0}, *d)
    np.testing.assert_allclose(f, 0.3 / math.pi, rtol=1e-15)
