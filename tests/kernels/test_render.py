"""The renderer against closed forms: the reflection equation, environments, shadings."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from lobefit.kernels import evaluate
from lobefit.kernels.camera import Camera
from lobefit.kernels.environment_lights import environment_lights
from lobefit.kernels.errors import SceneError
from lobefit.kernels.geometry import Precision
from lobefit.kernels.lights import DirectionalLight, Environment, PointLight
from lobefit.kernels.render import Prepared, render
from lobefit.kernels.scene import Scene
from lobefit.kernels.surface import Shading

__all__: list[str] = []

SMALL = Camera(eye=(0.0, -4.0, 1.0), width=48, height=48)
KEY = DirectionalLight((1.0, -1.0, 1.0), (3.0, 2.0, 1.0))
FILL = DirectionalLight((-1.0, -0.5, 0.2), (0.5, 0.6, 1.0))
LAMP = PointLight((0.5, -2.0, 1.0), (1.0, 0.5, 0.25))
SHADINGS: tuple[Shading, ...] = ("flat", "gouraud", "phong", "exact")
PRECISIONS: tuple[tuple[Precision, float], ...] = (("single", 1e-6), ("double", 1e-15))
# Above the plane z = 0, which the default camera would see from its edge.
ABOVE = Camera(eye=(0.0, -2.0, 3.0), width=32, height=32)


def relative(found: Any, expected: Any) -> float:
    return float(np.max(np.abs(found - expected)) / np.max(np.abs(expected)))


def test_a_white_sphere_in_a_white_room_is_white() -> None:
    room = Scene(environment=Environment(np.ones((8, 16))), camera=SMALL)
    for shading in SHADINGS:
        picture = render(room, "lambert", {"k_d": 1.0}, shading=shading, subdivision=3)
        inside = picture.beauty[0][picture.mask]
        assert inside.size > 900
        assert np.abs(inside - 1.0).max() < 2e-3
        assert not picture.beauty[0][~picture.mask].any()
        assert picture.error.max() < 1e-2


@pytest.mark.parametrize("precision, tolerance", [("single", 1e-6), ("double", 1e-14)])
def test_one_light_on_a_plane(precision: Any, tolerance: float) -> None:
    """L = albedo E cos_theta_i / pi, with the ambient term k_d L_a added."""
    scene = Scene(shape="plane", lights=(KEY,), ambient=(0.1, 0.2, 0.3), camera=ABOVE)
    k_d = np.array([0.2, 0.5, 0.8])
    expected = k_d * (np.array([3.0, 2.0, 1.0]) / np.sqrt(3.0) / np.pi + [0.1, 0.2, 0.3])
    for shading in SHADINGS:
        picture = render(
            scene,
            "lambert",
            {"k_d": k_d.tolist()},
            shading=shading,
            subdivision=2,
            precision=precision,
        )
        inside = picture.beauty[:, picture.mask]
        assert relative(inside, expected[:, None]) < tolerance
        assert not picture.specular.any()


def test_a_point_light_falls_off_with_the_squared_distance() -> None:
    scene = Scene(shape="plane", lights=(LAMP,), camera=ABOVE)
    picture = render(scene, "lambert", {"k_d": 1.0}, shading="exact", precision="double")
    with Prepared(scene, shading="exact", precision="double") as prepared:
        position = prepared.surface.position
    away = np.array([0.5, -2.0, 1.0]) - position
    distance = np.linalg.norm(away, axis=1)
    expected = away[:, 2] / distance**3 / np.pi
    assert relative(picture.beauty[0][picture.mask], expected) < 1e-14


@pytest.mark.parametrize(
    "model, params",
    [
        ("ggx", {"k_d": [0.1, 0.2, 0.3], "alpha": 0.2}),
        ("ggx+ggx", {"alpha_1": 0.1, "alpha_2": 0.4}),
        ("lambert+ward", {"alpha_x": 0.4, "alpha_y": 0.1, "phi_x": 0.7}),
        ("disney_principled", {"roughness": 0.4}),
    ],
)
def test_every_pixel_is_the_sum_over_lights_of_the_brdf(model: str, params: Any) -> None:
    """By evaluate() at angles in the frame of tangent and normal, with no code of the renderer."""
    lights = (KEY, FILL)
    scene = Scene(lights=lights, camera=SMALL)
    with Prepared(scene, shading="phong", subdivision=3, precision="double") as prepared:
        s, picture = prepared.surface, prepared.render(model, params)
    frame = np.stack([s.tangent, np.cross(s.normal, s.tangent), s.normal])
    expected = np.zeros((3, len(s.pixels)))
    for light in lights:
        towards = np.array(light.direction) / np.linalg.norm(light.direction)
        i = frame @ towards
        o = (frame * s.view).sum(axis=2)
        angles = [f(v) for v in (i, o) for f in (theta, phi)]
        lit = np.maximum(i[2], 0.0) * (i[2] > 1e-6)
        irradiance = np.asarray(light.irradiance)[:, None]
        expected += evaluate(model, params, *angles) * lit * irradiance
    assert relative(picture.beauty[:, picture.mask], expected) < 1e-9


def theta(v: Any) -> Any:
    return np.arctan2(np.hypot(v[0], v[1]), v[2])


def phi(v: Any) -> Any:
    return np.arctan2(v[1], v[0])


def test_several_lights_are_the_sum_of_single_renders() -> None:
    lights = (KEY, FILL, LAMP)
    params: dict[str, Any] = {"k_d": [0.1, 0.3, 0.2], "alpha": 0.15}
    for precision, tolerance in PRECISIONS:
        every = render(
            Scene(lights=lights, camera=SMALL),
            "ggx",
            params,
            precision=precision,
            subdivision=3,
        )
        alone = np.zeros_like(every.beauty)
        for light in lights:
            scene = Scene(lights=(light,), camera=SMALL)
            alone += render(scene, "ggx", params, precision=precision, subdivision=3).beauty
        assert relative(every.beauty, alone) < tolerance


def test_phongs_lighting_model() -> None:
    """k_a I_a + sum of I (k_d n.l + k_s (r.v)^n), with irradiance I, or pi I for the diffuse."""
    scene = Scene(lights=(KEY, FILL), ambient=0.3, camera=SMALL)
    params = {"k_d": 0.4, "k_s": 0.5, "n": 12.0}
    with Prepared(scene, shading="phong", subdivision=3, precision="double") as prepared:
        s, picture = prepared.surface, prepared.render("phong", params)
    diffuse, specular = np.full((3, len(s.pixels)), 0.3 * 0.4), np.zeros((3, len(s.pixels)))
    for light in (KEY, FILL):
        towards = np.array(light.direction) / np.linalg.norm(light.direction)
        n_l = s.normal @ towards
        mirrored = 2.0 * n_l[:, None] * s.normal - towards
        r_v = np.maximum((mirrored * s.view).sum(axis=1), 0.0)
        intensity = np.asarray(light.irradiance)[:, None]
        diffuse += intensity * 0.4 / np.pi * np.maximum(n_l, 0.0)
        specular += intensity * 0.5 * r_v**12.0 * (n_l > 0.0)
    assert relative(picture.diffuse[:, picture.mask], diffuse) < 1e-12
    assert relative(picture.specular[:, picture.mask], specular) < 1e-12


def test_sets_of_parameters_share_a_launch() -> None:
    sets = [{"k_d": 0.1, "alpha": 0.1}, {"k_d": 0.5, "alpha": 0.4}]
    with Prepared(Scene(lights=(KEY,), camera=SMALL), subdivision=3) as prepared:
        together = prepared.render_sets("ggx", sets)
        for one, params in zip(together, sets, strict=True):
            np.testing.assert_array_equal(one.beauty, prepared.render("ggx", params).beauty)


def sky(rows: int) -> Environment:
    """A bright side and a dim one, smooth."""
    phi_of, theta_of = np.meshgrid(
        np.pi - (np.arange(2 * rows) + 0.5) * np.pi / rows, (np.arange(rows) + 0.5) * np.pi / rows
    )
    x, y = np.sin(theta_of) * np.cos(phi_of), np.sin(theta_of) * np.sin(phi_of)
    z = np.cos(theta_of)
    return Environment(np.stack([1.0 + x, 1.0 + y * z, 1.0 + z], axis=-1))


def test_a_mirror_like_ggx_shows_the_reflected_environment() -> None:
    """Smoother and smoother, it converges; away from the outline, where masking takes light."""
    around = sky(64)
    params = {"k_d": 0.0, "k_s": 1.0, "F0": 1.0}
    errors = []
    with Prepared(
        Scene(environment=around, camera=SMALL), shading="exact", nodes=(16, 24)
    ) as prepared:
        s = prepared.surface
        n_v = (s.normal * s.view).sum(axis=1)
        reflected = around.towards(2.0 * n_v[:, None] * s.normal - s.view)
        inner = n_v > 0.3
        for alpha in (0.3, 0.1, 0.03):
            picture = prepared.render("ggx", params | {"alpha": alpha})
            found = picture.beauty[:, picture.mask]
            errors.append(np.abs(found - reflected)[:, inner].mean())
    assert errors[0] > 4.0 * errors[1] > 16.0 * errors[2] > 0.0
    assert errors[2] < 0.01


def windowed(rows: int) -> Environment:
    """A dim room with a bright window of hard edges and a small lamp."""
    picture = 0.2 * sky(rows).radiance
    picture[rows // 4 : rows // 2, rows // 3 : rows // 2] = 8.0
    picture[rows // 3 : rows // 3 + 2, rows : rows + 2] = 100.0
    return Environment(picture)


LOBES: list[tuple[str, dict[str, Any]]] = [
    ("lambert", {"k_d": 0.5}),
    ("ggx", {"k_d": 0.2, "alpha": 0.3}),
    ("ggx", {"k_d": 0.2, "alpha": 0.05}),
    ("lafortune", {"k_d": 0.2}),
]


@pytest.mark.parametrize("model, params", LOBES)
def test_the_estimated_error_of_an_environment_covers_the_true_one(
    model: str, params: dict[str, Any]
) -> None:
    scene = Scene(environment=windowed(64), camera=Camera(width=16, height=16))
    finest = render(scene, model, params, shading="exact", nodes=(64, 256), cells=10**9)
    made = render(scene, model, params, shading="exact")
    finer = render(scene, model, params, shading="exact", nodes=(32, 96), cells=32768)
    inside = np.broadcast_to(made.mask, made.beauty.shape)
    true = np.abs(made.beauty - finest.beauty)[inside]
    assert true.mean() < made.error[inside].mean() < 0.03 * finest.beauty[inside].mean()
    # It may be exceeded in single pixels, but not by much.
    assert np.percentile(true, 99) < np.percentile(made.error[inside], 99)
    assert finer.error.mean() < 0.5 * made.error.mean()


def test_an_environment_as_lights_keeps_its_irradiance_and_where_it_comes_from() -> None:
    """Whatever the number of lights: sums of L dw and of L w dw, the latter for the mean."""
    around = windowed(128)
    theta_of = (np.arange(128) + 0.5) * np.pi / 128
    solid = 2.0 * np.sin(theta_of) * np.sin(np.pi / 256) * np.pi / 128
    power = (around.radiance * solid[:, None, None]).sum(axis=(0, 1))
    phi_of = np.pi - (np.arange(256) + 0.5) * np.pi / 128
    up = (around.radiance.mean(axis=2) * solid[:, None] * np.cos(theta_of)[:, None]).sum()
    side = around.radiance.mean(axis=2) * (solid * np.sin(theta_of))[:, None] * np.cos(phi_of)
    for count in (512, 2048, 8192):
        lights = environment_lights(around, count)
        assert 0.9 * count < len(lights) < 1.1 * count
        np.testing.assert_allclose(np.linalg.norm(lights[:, :3], axis=1), 1.0)
        assert not lights[:, 3].any()
        np.testing.assert_allclose(lights[:, 4:].sum(axis=0), power, rtol=1e-6)
        mean = lights[:, 4:].mean(axis=1)
        # Directions within a cell add up to a shorter vector than its light's.
        assert (lights[:, 2] * mean).sum() == pytest.approx(up, rel=3e-2)
        assert (lights[:, 0] * mean).sum() == pytest.approx(side.sum(), rel=3e-2)


def test_a_black_environment_is_black() -> None:
    dark = Scene(environment=Environment(np.zeros((4, 8))), camera=SMALL)
    assert not render(dark, "ggx", {}, subdivision=2).beauty.any()


def test_sets_of_parameters_in_an_environment_are_each_integrated_as_if_alone() -> None:
    sets = [{"k_d": 0.1, "alpha": 0.05}, {"k_d": 0.5, "alpha": 0.5}]
    scene = Scene(environment=windowed(64), lights=(KEY,), camera=SMALL)
    with Prepared(scene, subdivision=3) as prepared:
        together = prepared.render_sets("ggx", sets)
        for one, params in zip(together, sets, strict=True):
            alone = prepared.render("ggx", params, estimate=False)
            np.testing.assert_array_equal(one.beauty, alone.beauty)
            assert one.error.any() and not alone.error.any()


def highlight(shading: Shading, level: int) -> float:
    """Brightest specular radiance on a square lit and seen so that its highlight is inside."""
    view = Camera(eye=(0.3, -1.0, 2.0), target=(0.3, 0.1, 0.0), width=64, height=64, field=30.0)
    scene = Scene(shape="plane", lights=(PointLight((0.3, 1.2, 2.0), 5.0),), camera=view)
    params = {"k_d": 0.0, "k_s": 1.0, "n": 400.0}
    picture = render(scene, "blinn_phong", params, shading=shading, subdivision=level)
    return float(picture.specular.max())


def test_gouraud_misses_a_highlight_inside_a_polygon() -> None:
    exact = highlight("exact", 0)
    assert highlight("phong", 0) == pytest.approx(exact, rel=1e-3)
    assert highlight("gouraud", 0) < 1e-6 * exact
    assert highlight("gouraud", 7) == pytest.approx(exact, rel=0.05)


def test_flat_becomes_phong_as_triangles_shrink() -> None:
    """The normal of a flat triangle is off by half its size: the error falls with the edge."""
    scene = Scene(lights=(KEY,), camera=Camera(eye=(0.0, -4.0, 1.0), width=96, height=96))
    params = {"k_d": 0.3, "alpha": 0.4}
    exact = render(scene, "ggx", params, shading="exact")
    errors: dict[Shading, list[float]] = {"flat": [], "gouraud": [], "phong": []}
    for level in (2, 3, 4, 5):
        for shading, found in errors.items():
            picture = render(scene, "ggx", params, shading=shading, subdivision=level)
            both = picture.mask & exact.mask
            found.append(float(np.abs(picture.beauty - exact.beauty)[:, both].mean()))
    order = {name: np.log2(np.array(e[:-1]) / e[1:]) for name, e in errors.items()}
    assert order["flat"][1:] == pytest.approx(1.0, abs=0.25)
    assert (order["gouraud"] > 1.6).all()
    assert (order["phong"] > 1.6).all()
    assert all(errors["phong"][k] < errors["gouraud"][k] < errors["flat"][k] for k in range(4))


@pytest.mark.parametrize(
    "change",
    [
        {"shape": "teapot"},
        {"lights": (DirectionalLight((0.0, 0.0, 0.0)),)},
        {"lights": (DirectionalLight((1.0, 0.0, 0.0), -1.0),)},
        {"lights": (KEY, DirectionalLight((1.0, 0.0, 0.0), (1.0, 2.0)))},
        {"transform": np.zeros((4, 4))},
        {"transform": np.diag([1.0, 1.0, 0.0, 1.0])},
    ],
)
def test_what_is_no_scene_is_refused(change: dict[str, Any]) -> None:
    with pytest.raises(SceneError):
        given: dict[str, Any] = {"lights": (KEY,), "camera": SMALL} | change
        render(Scene(**given), "lambert", {})


def test_what_is_no_view_or_environment_is_refused() -> None:
    with pytest.raises(SceneError, match="up is not along"):
        Camera(eye=(0.0, 0.0, 3.0))
    with pytest.raises(SceneError, match="twice as wide"):
        Environment(np.ones((4, 4, 3)))
    with pytest.raises(SceneError, match="numbers of channels"):
        render(Scene(lights=(KEY,), camera=SMALL), "lambert", {"k_d": [0.1, 0.2]})
    with pytest.raises(SceneError, match="exact shading"):
        render(Scene(shape="knot", camera=SMALL), "lambert", {}, shading="exact")


def test_an_object_out_of_view_is_black() -> None:
    away = Camera(eye=(0.0, -4.0, 0.0), target=(0.0, -8.0, 0.0), width=8, height=8)
    for shading in SHADINGS:
        picture = render(Scene(lights=(KEY,), camera=away), "ggx", {}, shading=shading)
        assert not picture.mask.any()
        assert picture.beauty.shape == (3, 8, 8)
        assert not picture.beauty.any()
