"""Diffuse models: what they reflect, what they lose, and what they become in their limits."""

from __future__ import annotations

import math

import numpy as np
import pytest

from lobefit.kernels import directional_albedo, evaluate
from tests.kernels.strategies import Directions, Params, directions
from tests.kernels.transcriptions.eon import fujii_albedo

DEGREES = [0.0, 30.0, 60.0, 75.0, 85.0]
OREN_NAYAR = {
    0.3: [0.8929, 0.9202, 0.9599, 0.9837, 0.9987],
    1.0: [0.6241, 0.6743, 0.7471, 0.7908, 0.8183],
}
FUJII_OF_R_ONE = [0.77652, 0.78857, 0.86532, 0.93094, 0.97770]
ASHIKHMIN_SHIRLEY_BASE = [0.96875, 0.94140, 0.76270, 0.49989, 0.19971]
# Half a unit of the last digit printed.
FOUR_DIGITS, FIVE_DIGITS = 0.5e-4, 0.5e-5


def albedo(model: str, params: Params, degrees: float, nodes: int = 40) -> float:
    """Integrate over wo with panels that end where the models have a kink.

    These are theta_o = theta_i, where the larger cosine changes hands, and the right angle of
    azimuth, where s changes sign. On the panels the models are smooth.
    """
    theta_i = math.radians(degrees)
    x, w = np.polynomial.legendre.leggauss(nodes)
    x, w = 0.5 * (x + 1), 0.5 * w
    edges = sorted({0.0, theta_i, math.pi / 2})
    panels = list(zip(edges[:-1], np.diff(edges), strict=True))
    theta = np.concatenate([low + width * x for low, width in panels])
    theta_weight = np.concatenate([width * w for _, width in panels])
    phi = np.concatenate([0.5 * math.pi * x, 0.5 * math.pi * (1 + x)])
    phi_weight = math.pi * np.concatenate([w, w])  # twice, for the other side
    theta_o, phi_o = (a.ravel() for a in np.meshgrid(theta, phi, indexing="ij"))
    f = evaluate(model, params, theta_i, 0.0, theta_o, phi_o)[0].reshape(theta.size, phi.size)
    return float(theta_weight * np.sin(theta) * np.cos(theta) @ f @ phi_weight)


@pytest.mark.parametrize("sigma", OREN_NAYAR)
def test_oren_nayar_loses_what_its_grooves_keep(sigma: float) -> None:
    found = [albedo("oren_nayar", {"k_d": 1.0, "sigma": sigma}, angle) for angle in DEGREES]
    assert found == pytest.approx(OREN_NAYAR[sigma], abs=FOUR_DIGITS)


def test_oren_nayar_gains_at_most_two_per_cent() -> None:
    sigmas = np.linspace(0.0, math.pi / 2, 33)
    largest = [albedo("oren_nayar", {"k_d": 1.0, "sigma": sigma}, 89.99) for sigma in sigmas]
    assert 1.01 < max(largest) < 1 / 0.98
    assert max(largest[i] for i in range(33) if sigmas[i] >= 0.35) < 1.0
    at_60 = [albedo("oren_nayar", {"k_d": 1.0, "sigma": sigma}, 60.0) for sigma in sigmas]
    assert max(at_60) <= 1.0 + 1e-12


@pytest.mark.parametrize("r", [0.0, 0.1, 0.35, 0.7, 1.0])
def test_eon_of_a_white_surface_reflects_all_light(r: float) -> None:
    found = [albedo("eon", {"rho": 1.0, "r": r}, angle) for angle in [*DEGREES, 89.9]]
    assert found == pytest.approx([1.0] * 6, abs=1e-12)


@pytest.mark.parametrize("r", [0.0, 0.1, 0.35, 0.7, 1.0])
def test_directional_albedo_sees_the_white_surface_too(r: float) -> None:
    found = directional_albedo("eon", {"rho": 1.0, "r": r}, np.radians(DEGREES))[0]
    # Its nodes do not know of the kinks.
    np.testing.assert_allclose(found, 1.0, atol=1e-5)


def test_eon_minus_what_it_gives_back_is_fujiis_albedo() -> None:
    """For rho -> 0 only one bounce is left, and the albedo is rho E_F."""
    rho = 1e-9
    found = [albedo("eon", {"rho": rho, "r": 1.0}, angle) / rho for angle in DEGREES]
    assert found == pytest.approx(FUJII_OF_R_ONE, abs=FIVE_DIGITS)
    exact = fujii_albedo(np.cos(np.radians(DEGREES)), 1.0)
    np.testing.assert_allclose(found, exact, rtol=1e-8)


def test_eon_keeps_colour_between_its_bounds() -> None:
    """Grey surfaces reflect less than rho, and more than one bounce does."""
    for angle in DEGREES:
        grey = albedo("eon", {"rho": 0.5, "r": 1.0}, angle)
        one_bounce = 0.5 * fujii_albedo(np.cos(np.radians(np.array([angle]))), 1.0)[0]
        assert one_bounce < grey < 0.5


@pytest.mark.parametrize("model", ["oren_nayar", "eon"])
def test_without_roughness_lambert_is_left(model: str) -> None:
    d = directions(500, seed=3)
    smooth: dict[str, Params] = {
        "oren_nayar": {"k_d": [0.2, 0.9], "sigma": 0.0},
        "eon": {"rho": [0.2, 0.9], "r": 0.0},
    }
    lambert = evaluate("lambert", {"k_d": [0.2, 0.9]}, *d)
    np.testing.assert_allclose(evaluate(model, smooth[model], *d), lambert, rtol=1e-14)


@pytest.mark.parametrize(
    ("model", "params"),
    [("oren_nayar", {"k_d": 1.0, "sigma": 1.0}), ("eon", {"rho": 1.0, "r": 1.0})],
)
def test_rough_surfaces_brighten_towards_the_light(model: str, params: Params) -> None:
    theta = math.radians(75.0)
    back = evaluate(model, params, theta, 0.3, theta, 0.3).item()
    forth = evaluate(model, params, theta, 0.3, theta, 0.3 + math.pi).item()
    assert back > 1.5 / math.pi > forth


@pytest.mark.parametrize(
    ("model", "params"),
    [("oren_nayar", {"k_d": 1.0, "sigma": 1.5}), ("eon", {"rho": 0.9, "r": 1.0})],
)
def test_single_precision_keeps_right_angles_at_grazing(model: str, params: Params) -> None:
    """There i_xy.o_xy is a difference of equal products, over a cosine of 2e-6."""
    theta, phi = math.radians(89.9999), np.radians(np.arange(0.0, 360.0, 7.0))
    d = Directions(*np.broadcast_arrays(theta, phi, theta, phi + math.pi / 2))
    double, single = (evaluate(model, params, *d, precision=p) for p in ("double", "single"))
    np.testing.assert_allclose(single, double, rtol=1e-5)


def test_disney_diffuse_gains_light_at_grazing_incidence() -> None:
    found = [albedo("disney_diffuse", {"k_d": 1.0, "roughness": 1.0}, a) for a in (85.0, 89.9)]
    assert found[0] == pytest.approx(1.40, abs=0.5e-2)
    assert found[1] == pytest.approx(1.554, abs=0.5e-3)


def test_disney_diffuse_at_normal_incidence_has_a_closed_form() -> None:
    """F90 = 1/2 + r (1 + c): the integral of 2 c (1 + (F90 - 1)(1 - c)^5), c from 0 to 1."""
    for roughness in (0.0, 0.3, 1.0):
        expected = 1 - 1 / 42 + roughness * (1 / 21 + 1 / 84)
        found = albedo("disney_diffuse", {"k_d": 1.0, "roughness": roughness}, 0.0)
        assert found == pytest.approx(expected, abs=1e-12)


def test_disney_diffuse_conserves_energy_up_to_roughness_0_4() -> None:
    for roughness in (0.0, 0.2, 0.4):
        params: Params = {"k_d": 1.0, "roughness": roughness}
        largest = max(albedo("disney_diffuse", params, a) for a in [*DEGREES, 70.0, 80.0, 89.9])
        assert largest <= 1.0 + 1e-12  # 1 at normal incidence, for 0.4


def test_ashikhmin_shirley_base_fades_at_grazing_incidence() -> None:
    params: Params = {"k_d": 1.0, "k_s": 0.0}
    found = [albedo("ashikhmin_shirley", params, angle) for angle in DEGREES]
    assert found == pytest.approx(ASHIKHMIN_SHIRLEY_BASE, abs=FIVE_DIGITS)
