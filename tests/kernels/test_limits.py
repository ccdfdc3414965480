"""Closed forms, printed albedos and independent quadrature."""

from __future__ import annotations

import math

import numpy as np
import pytest

from lobefit.kernels import directional_albedo, evaluate, models
from tests.kernels.quadrature import albedo
from tests.kernels.strategies import Params, directions
from tests.kernels.transcriptions import load

LOBE: Params = {"k_d": 0.0, "k_s": 1.0}

GGX_CORRELATED = {
    0.1: {0: 0.98830, 30: 0.98609, 60: 0.96920, 75: 0.92442, 85: 0.88638},
    0.5: {0: 0.68785, 30: 0.68305, 60: 0.69825, 75: 0.76137, 85: 0.87202},
    1.0: {0: 0.30685, 30: 0.33519, 60: 0.45069, 75: 0.59060, 85: 0.78005},
}
GGX_SEPARABLE = {
    0.1: {0: 0.98830, 30: 0.98608, 60: 0.96912, 75: 0.92324, 85: 0.87313},
    0.5: {0: 0.68785, 30: 0.68165, 60: 0.68601, 75: 0.72340, 85: 0.77720},
    1.0: {0: 0.30685, 30: 0.32888, 60: 0.40914, 75: 0.48752, 85: 0.56451},
}
BECKMANN_V_CAVITY = {0.5: {0: 0.89242, 30: 0.87504, 60: 0.88688, 75: 0.93437, 85: 0.97720}}
WARD_1992 = {
    0.1: {0: 0.971, 60: 0.489, 85: 0.120},
    0.5: {0: 0.585, 60: 0.351, 85: 0.286},
}
# Half a unit of the last digit printed, and the error of our own quadrature.
FIVE_DIGITS = 0.5e-5 + 1e-6
THREE_DIGITS = 0.5e-3


def albedo_of(
    model: str, params: Params, degrees: list[float], options: dict[str, str] | None = None
) -> list[float]:
    theta_i = np.radians(degrees)
    found = directional_albedo(model, params, theta_i, options=options)
    assert found.shape == (1, len(degrees))
    return [float(value) for value in found[0]]


def test_lambert_is_k_d_over_pi() -> None:
    f = evaluate("lambert", {"k_d": [0.2, 0.5, 1.0]}, *directions(100, seed=2))
    expected = np.array([0.2, 0.5, 1.0])[:, np.newaxis] / math.pi
    np.testing.assert_allclose(f, np.broadcast_to(expected, (3, 100)), rtol=1e-15)


def test_lambert_albedo_is_k_d() -> None:
    found = directional_albedo("lambert", {"k_d": [0.2, 0.9]}, np.radians([0.0, 45.0, 89.0]))
    # Smooth integrand: only rounding and the quadrature's weights remain.
    np.testing.assert_allclose(found, [[0.2] * 3, [0.9] * 3], rtol=1e-7)


@pytest.mark.parametrize("model", [name for name, m in models().items() if m.lobe.diffuse])
def test_without_a_lobe_only_lambert_remains(model: str) -> None:
    d = directions(100, seed=3)
    dark = {p.name: 0.0 for p in models()[model].lobe.parameters if p.linear}
    f = evaluate(model, dark | {"k_d": 0.7}, *d)
    np.testing.assert_allclose(f, evaluate("lambert", {"k_d": 0.7}, *d), rtol=1e-15)


def test_ggx_closed_form() -> None:
    """At normal incidence alpha = 1 (D = 1/pi for all normals) reflects 1 - ln 2."""
    found = albedo_of("ggx", LOBE | {"F0": 1.0, "alpha": 1.0}, [0.0])
    assert found[0] == pytest.approx(1 - math.log(2), abs=1e-6)


@pytest.mark.parametrize("alpha", GGX_CORRELATED)
def test_ggx_albedo(alpha: float) -> None:
    expected = GGX_CORRELATED[alpha]
    found = albedo_of("ggx", LOBE | {"F0": 1.0, "alpha": alpha}, [*expected])
    assert found == pytest.approx(list(expected.values()), abs=FIVE_DIGITS)


@pytest.mark.parametrize("alpha", GGX_SEPARABLE)
def test_ggx_albedo_with_separable_masking(alpha: float) -> None:
    expected = GGX_SEPARABLE[alpha]
    params = LOBE | {"F0": 1.0, "alpha": alpha}
    found = albedo_of("ggx", params, [*expected], {"masking": "smith_separable"})
    assert found == pytest.approx(list(expected.values()), abs=FIVE_DIGITS)


@pytest.mark.parametrize("alpha", BECKMANN_V_CAVITY)
def test_cook_torrance_albedo(alpha: float) -> None:
    expected = BECKMANN_V_CAVITY[alpha]
    found = albedo_of("cook_torrance", LOBE | {"F0": 1.0, "alpha": alpha}, [*expected])
    assert found == pytest.approx(list(expected.values()), abs=FIVE_DIGITS)


@pytest.mark.parametrize("alpha", WARD_1992)
def test_ward_albedo(alpha: float) -> None:
    expected = WARD_1992[alpha]
    params = LOBE | {"alpha_x": alpha, "alpha_y": alpha, "phi_x": 0.0}
    assert albedo_of("ward", params, [*expected]) == pytest.approx(
        list(expected.values()), abs=THREE_DIGITS
    )


@pytest.mark.parametrize(("n", "at_60"), [(1.0, 0.609), (10.0, 0.505), (100.0, 0.500)])
def test_modified_phong_albedo(n: float, at_60: float) -> None:
    normal, oblique = albedo_of("modified_phong", LOBE | {"n": n}, [0.0, 60.0])
    assert normal == pytest.approx(1.0, abs=1e-6)  # (n+2)/(2 pi) is its exact normalisation
    assert oblique == pytest.approx(at_60, abs=THREE_DIGITS)


def test_blinn_phong_albedo_at_normal_incidence() -> None:
    """Half angle t: integral of (n+2) cos^(n+1) t cos 2t sin t, 0 to 45 degrees, in closed form."""
    n = 20.0
    cos_45 = math.sqrt(0.5)
    expected = (n + 2) * (2 * (1 - cos_45 ** (n + 4)) / (n + 4) - (1 - cos_45 ** (n + 2)) / (n + 2))
    assert albedo_of("blinn_phong", LOBE | {"n": n}, [0.0])[0] == pytest.approx(expected, abs=1e-6)


NARROW: list[tuple[str, float, Params]] = [
    ("ggx", 0.01, LOBE | {"F0": 1.0, "alpha": 0.01}),
    ("ggx", 0.05, LOBE | {"F0": 0.04, "alpha": 0.05}),
    ("cook_torrance", 0.01, LOBE | {"F0": 1.0, "alpha": 0.01}),
    ("ward", 0.01, LOBE | {"alpha_x": 0.03, "alpha_y": 0.01, "phi_x": 0.5}),
    ("ward", 0.03, LOBE | {"alpha_x": 0.3, "alpha_y": 0.03, "phi_x": 0.0}),
    ("blinn_phong", 0.01, LOBE | {"n": 2e4}),
    ("modified_phong", 0.01, LOBE | {"n": 2e4}),
]


@pytest.mark.parametrize(("model", "width", "params"), NARROW)
def test_narrow_lobes_are_resolved(model: str, width: float, params: Params) -> None:
    degrees = [0.0, 30.0, 60.0, 80.0]
    found = albedo_of(model, params, degrees)
    for value, theta_i in zip(found, np.radians(degrees), strict=True):
        coarse, fine = (
            albedo(load(model), theta_i, width, params, refine=refine)[0] for refine in (1, 2)
        )
        assert coarse == pytest.approx(fine, abs=2e-6)  # the reference itself has converged
        assert value == pytest.approx(fine, abs=1e-5)


def test_albedo_of_an_anisotropic_lobe_follows_the_azimuth() -> None:
    params: Params = LOBE | {"alpha_x": 0.4, "alpha_y": 0.1, "phi_x": 0.3}
    theta_i = math.radians(70.0)
    along, across = (
        float(directional_albedo("ward", params, np.array([theta_i]), phi_i)[0, 0])
        for phi_i in (0.3, 0.3 + math.pi / 2)
    )
    assert abs(along / across - 1) > 0.02
    for found, phi_i in ((along, 0.3), (across, 0.3 + math.pi / 2)):
        expected = albedo(load("ward"), theta_i, 0.1, params, phi_i=phi_i)[0]
        assert found == pytest.approx(expected, abs=1e-5)


def test_ward_with_equal_axes_is_isotropic() -> None:
    d = directions(1000, seed=4)
    axes: Params = {"alpha_x": 0.2, "alpha_y": 0.2}
    f = evaluate("ward", LOBE | axes | {"phi_x": 0.0}, *d)
    turned = evaluate("ward", LOBE | axes | {"phi_x": 1.1}, *d)
    # The exponent, up to 700, is added up from rotated slopes with 2e-16 each.
    np.testing.assert_allclose(turned, f, rtol=1e-12, atol=1e-200)


def test_ward_axes_may_be_named_either_way() -> None:
    d = directions(1000, seed=5)
    f = evaluate("ward", LOBE | {"alpha_x": 0.3, "alpha_y": 0.1, "phi_x": 0.2}, *d)
    swapped: Params = {"alpha_x": 0.1, "alpha_y": 0.3, "phi_x": 0.2 + math.pi / 2}
    np.testing.assert_allclose(evaluate("ward", LOBE | swapped, *d), f, rtol=1e-12, atol=1e-200)


@pytest.mark.parametrize("model", ["cook_torrance", "ggx"])
def test_f0_one_removes_fresnel_and_f0_scales_the_rest(model: str) -> None:
    """f is linear in F0: F0 and 1 - F0 weigh the full mirror and the grazing rise."""
    d = directions(1000, seed=6)
    params = LOBE | {"alpha": 0.3}
    white, black, grey = (evaluate(model, params | {"F0": F0}, *d) for F0 in (1.0, 0.0, 0.25))
    np.testing.assert_allclose(grey, 0.25 * white + 0.75 * black, rtol=1e-13)
    cos_d = np.sqrt(1 + np.cos(0.9)) / np.sqrt(2)  # i and o 0.9 rad apart
    ratio = [evaluate(model, params | {"F0": F0}, 0.45, 0.0, 0.45, math.pi) for F0 in (0.0, 1.0)]
    assert (ratio[0] / ratio[1]).item() == pytest.approx((1 - cos_d) ** 5, rel=1e-12)


def test_mirror_peak_of_ggx() -> None:
    """At the mirror direction D = 1/(pi alpha^2) and Lambda is the same for both."""
    theta, alpha = 1.0, 0.02
    f = evaluate("ggx", LOBE | {"F0": 1.0, "alpha": alpha}, theta, 0.0, theta, math.pi)
    root = math.sqrt(1 + alpha**2 * math.tan(theta) ** 2)
    expected = 1 / (math.pi * alpha**2) / root / (4 * math.cos(theta) ** 2)
    assert f.item() == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("alpha", [0.3, 0.03, 1e-3])
def test_albedo_follows_a_lobe_that_looks_back(alpha: float) -> None:
    """By symmetry a retro lobe gives back what GGX with F = 1 does, however narrow."""
    degrees = [0.0, 30.0, 60.0, 75.0]
    retro = albedo_of("retro", LOBE | {"alpha": alpha}, degrees)
    ggx = albedo_of("ggx", LOBE | {"alpha": alpha}, degrees, {"fresnel": "none"})
    assert retro == pytest.approx(ggx, abs=1e-9)
    summed: Params = {"k_d": 0.1, "k_s_1": 0.5, "F0_1": 1.0, "alpha_1": alpha, "k_s_2": 0.4}
    both = albedo_of("ggx+retro", summed | {"alpha_2": alpha}, degrees)
    assert both == pytest.approx([0.1 + 0.9 * value for value in ggx], abs=1e-6)


@pytest.mark.parametrize("aperture", [1e-3, 0.02, 0.2])
def test_albedo_of_a_mirror_is_its_reflectance_in_spite_of_its_edge(aperture: float) -> None:
    found = albedo_of("mirror", LOBE | {"k_s": 0.8, "aperture": aperture}, [0.0, 30.0, 60.0, 75.0])
    assert found == pytest.approx([0.8] * 4, abs=1e-6)


def test_albedo_of_a_lobe_that_may_look_either_way() -> None:
    """Lafortune's lobe with C = 1 is the modified Phong lobe, with C = -1 its retro image."""
    degrees = [0.0, 30.0, 60.0, 75.0]
    for n in (20.0, 2e4):
        phong = albedo_of("modified_phong", LOBE | {"n": n}, degrees)
        for C in (1.0, -1.0):
            found = albedo_of("lafortune", LOBE | {"n": n, "C": C}, degrees)
            # Two grids share the integral; their weights are less smooth than the lobe.
            assert found == pytest.approx(phong, abs=5e-5)
