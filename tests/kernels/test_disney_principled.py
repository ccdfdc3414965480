"""Disney's principled model: its parts one by one, and its axes."""

from __future__ import annotations

import math

import numpy as np
import pytest

from lobefit.kernels import directional_albedo, evaluate
from tests.kernels.strategies import Directions, Params, directions, rotated
from tests.kernels.transcriptions import Array, geometry

ORDINARY = directions(2000, seed=21)
MASKINGS = ("burley2012", "burley2014")
BARE: Params = {"specular": 0.0, "sheen": 0.0, "clearcoat": 0.0}
# Everything at once, for what must hold of the whole.
RICH: Params = {
    "base_color": [0.7, 0.4, 0.1],
    "tint": [1.5, 0.9, 0.2],
    "metallic": 0.3,
    "subsurface": 0.4,
    "specular": 0.6,
    "specular_tint": 0.3,
    "roughness": 0.35,
    "anisotropic": 0.8,
    "sheen": 0.5,
    "sheen_tint": 0.6,
    "clearcoat": 0.7,
    "clearcoat_gloss": 0.4,
    "phi_x": 0.4,
}


def values(params: Params, d: Directions = ORDINARY, masking: str = "burley2012") -> Array:
    return evaluate("disney_principled", params, *d, options={"masking": masking})


def share_of(name: str, params: Params, d: Directions = ORDINARY) -> Array:
    """Give what a parameter adds when it goes from 0 to 1."""
    return values(params | {name: 1.0}, d) - values(params | {name: 0.0}, d)


@pytest.mark.parametrize("roughness", [0.25, 0.6, 1.0])
def test_the_diffuse_term(roughness: float) -> None:
    """What base_color brings to a dielectric is Burley's diffuse term over pi."""
    found = share_of("base_color", BARE | {"roughness": roughness})[0]
    F90 = 0.5 + 2 * roughness * geometry(*ORDINARY).cos_d ** 2
    expected = np.ones_like(found) / math.pi
    for theta in (ORDINARY.theta_i, ORDINARY.theta_o):
        expected *= 1 + (F90 - 1) * (1 - np.cos(theta)) ** 5
    # The difference of two values of a lobe that is up to 1e3 times as large.
    np.testing.assert_allclose(found, expected, rtol=1e-10)


def test_the_rough_diffuse_term_gives_out_more_than_it_receives() -> None:
    at_85 = np.radians([85.0])
    params = BARE | {"roughness": 1.0}
    white, black = (
        directional_albedo("disney_principled", params | {"base_color": c}, at_85)[0, 0]
        for c in (1.0, 0.0)
    )
    assert white - black == pytest.approx(1.40, abs=5e-3)


def test_at_normal_incidence_subsurface_is_five_eighths() -> None:
    """f_ss pi = 1.25 (F_ss (1/2 - 1/2) + 1/2) = 5/8 along the normal, where f_d pi is 1."""
    normal = Directions(*np.zeros((4, 1)))
    for subsurface, expected in ((0.0, 1.0), (1.0, 0.625)):
        f = share_of("base_color", BARE | {"subsurface": subsurface, "roughness": 0.7}, normal)
        assert f.item() * math.pi == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("roughness", [0.1, 0.4, 1.0])
def test_a_metal_without_remapping_is_ggx(roughness: float) -> None:
    params: Params = {"base_color": [0.9, 0.5, 0.0], "metallic": 1.0, "roughness": roughness}
    ggx: Params = {"k_d": 0.0, "k_s": 1.0, "F0": [0.9, 0.5, 0.0], "alpha": roughness**2}
    expected = evaluate("ggx", ggx, *ORDINARY, options={"masking": "smith_separable"})
    np.testing.assert_allclose(values(params, masking="burley2014"), expected, rtol=1e-12)


def test_the_remapped_masking_is_ggx_of_a_larger_roughness() -> None:
    """D of alpha = roughness^2 with G of (0.5 + roughness/2)^2: a quotient of two GGX."""
    roughness = 0.4
    rough = (0.5 + roughness / 2) ** 2
    metal: Params = {"metallic": 1.0, "base_color": 1.0}
    quotient = values(metal | {"roughness": roughness}) / values(
        metal | {"roughness": math.sqrt(rough)}, masking="burley2014"
    )
    t2 = geometry(*ORDINARY.exact()).tan2_h
    D = [a**2 / (a**2 + t2) ** 2 for a in (roughness**2, rough)]
    np.testing.assert_allclose(quotient[0], (D[0] / D[1]).astype(float), rtol=1e-10)


def test_a_very_smooth_surface_is_as_smooth_as_alpha_0_001() -> None:
    metal: Params = {"metallic": 1.0, "base_color": 0.8}
    for smooth in (0.0, 0.02):
        f = values(metal | {"roughness": smooth}, masking="burley2014")
        limit = values(metal | {"roughness": math.sqrt(0.001)}, masking="burley2014")
        np.testing.assert_allclose(f, limit, rtol=1e-12)


def test_sheen_is_schlicks_rise_in_the_tints_colour() -> None:
    s = geometry(*ORDINARY).one_minus_cos_d ** 5
    for sheen_tint, colour in ((0.0, 1.0), (0.25, 1.5), (1.0, 3.0)):
        params: Params = {"tint": 3.0, "sheen_tint": sheen_tint, "roughness": 0.8}
        found = share_of("sheen", params)[0]
        np.testing.assert_allclose(found, colour * s, rtol=1e-9, atol=1e-12)


def test_specular_is_eight_per_cent_at_most() -> None:
    """Along the normal F is 0.08 specular, in the tint's colour, over 4 pi alpha^2."""
    normal = Directions(*np.zeros((4, 1)))
    for specular_tint, colour in ((0.0, 1.0), (0.5, 2.0)):
        params: Params = {"tint": 3.0, "specular_tint": specular_tint, "roughness": 0.6}
        f = share_of("specular", params, normal).item()
        assert f == pytest.approx(0.08 * colour / (4 * math.pi * 0.6**4), rel=1e-12)


@pytest.mark.parametrize("gloss", [0.0, 0.5, 1.0])
def test_the_coats_distribution_is_normalised(gloss: float) -> None:
    """Seen in retroreflection the coat is 0.25 D 0.04 G1^2 / (4 cos^2), G of alpha = 1/4."""
    x, w = np.polynomial.legendre.leggauss(400)
    # tan(theta) = t: the tail of GTR-1 falls like t^-2, so that log(t) is the variable.
    log_t = np.log(1e-6) + (x + 1) / 2 * np.log(1e12)
    t = np.exp(log_t)
    theta = np.arctan(t)
    seen = theta < math.radians(89.999)
    d = Directions(theta[seen], 0 * t[seen], theta[seen], 0 * t[seen])
    coat = share_of("clearcoat", {"clearcoat_gloss": gloss, "specular": 0.0}, d)[0]
    cos = np.cos(d.theta_i)
    G1 = 2 / (1 + np.sqrt(1 + t[seen] ** 2 / 16))
    D = coat * 4 * cos**2 / (0.25 * 0.04 * G1**2)
    integral = np.sum(w[seen] / 2 * np.log(1e12) * 2 * math.pi * D * cos**4 * t[seen] ** 2)
    assert integral == pytest.approx(1.0, abs=1e-6)


# Angles in degrees; a metal of base_color 0.7, roughness 0.4, anisotropic 0.8; and what a
# base_color of 0.7 adds to a dielectric of roughness 0.8, subsurface 0.6. Mitsuba computes in
# single precision, and cannot be asked for the remapped masking.
MITSUBA_3_9_1 = [
    ((75, 10, 70, 195), 1.81197312, 0.298724796),
    ((60, 20, 45, 170), 0.0227190954, 0.22681166),
    ((30, 0, 40, 180), 2.77071289, 0.191551414),
]


@pytest.mark.parametrize(("angles", "metal", "diffuse"), MITSUBA_3_9_1)
def test_mitsuba(angles: tuple[int, int, int, int], metal: float, diffuse: float) -> None:
    d = Directions(*np.radians(np.array(angles, dtype=float))[:, np.newaxis])
    params: Params = {"base_color": 0.7, "metallic": 1.0, "roughness": 0.4, "anisotropic": 0.8}
    assert values(params, d, "burley2014").item() == pytest.approx(metal, rel=2e-6)
    flat: Params = BARE | {"roughness": 0.8, "subsurface": 0.6}
    assert 0.7 * share_of("base_color", flat, d).item() == pytest.approx(diffuse, rel=2e-6)


@pytest.mark.parametrize("masking", MASKINGS)
def test_the_axes_turn_with_the_sample(masking: str) -> None:
    f = values(RICH, masking=masking)
    turned = rotated(ORDINARY, 0.7)
    same = values(RICH | {"phi_x": 1.1}, turned, masking)
    np.testing.assert_allclose(same, f, rtol=2e-9)
    assert not np.allclose(values(RICH, turned, masking), f, rtol=1e-2)
    equal = RICH | {"anisotropic": 0.0}
    np.testing.assert_allclose(
        values(equal, turned, masking), values(equal, masking=masking), rtol=2e-9
    )


def test_the_wider_axis_is_at_phi_x() -> None:
    """Half vectors tilted by 0.3 along phi_x and across it, where alpha is 10 times smaller."""
    tilt = 0.3
    metal: Params = {"metallic": 1.0, "base_color": 1.0, "roughness": 0.5, "anisotropic": 1.0}
    along, across = (
        values(metal | {"phi_x": 0.2}, Directions(*np.array([[tilt], [phi], [tilt], [phi]])))
        for phi in (0.2, 0.2 + math.pi / 2)
    )
    aspect = math.sqrt(0.1)
    t2 = math.tan(tilt) ** 2
    D = [(1 + t2 / (0.25 * a) ** 2) ** -2 for a in (1 / aspect, aspect)]
    assert (along / across).item() == pytest.approx(D[0] / D[1], rel=1e-12)
