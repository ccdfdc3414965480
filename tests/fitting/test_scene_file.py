"""Scene files: what is read, and what is refused with a pointer and a remedy."""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR
import pytest

from lobefit.fitting import read_scene
from lobefit.fitting.exr import write_exr
from lobefit.fitting.scene_environment import read_environment
from lobefit.kernels.errors import SceneError
from lobefit.kernels.lights import DirectionalLight, PointLight

__all__: list[str] = []

SAMPLES = Path(__file__).parents[2] / "samples" / "scenes"


def document(**changes: Any) -> dict[str, Any]:
    return {
        "schema": "lobefit.scene/1",
        "object": {"shape": "sphere"},
        "lights": [{"kind": "directional", "direction": [0, -1, 1], "irradiance": 3}],
        "tolerance": {"delta_e": {"mean": 1, "p99": 3}},
        **changes,
    }


def written(folder: Path, content: Any) -> Path:
    path = folder / "scene.json"
    path.write_text(content if isinstance(content, str) else json.dumps(content), encoding="utf-8")
    return path


def test_everything_that_a_scene_may_say(tmp_path: Path) -> None:
    (tmp_path / "room.exr").write_bytes(b"")
    (tmp_path / "cup.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", encoding="utf-8")
    steps = [
        {"scale": [1, 1, 2]},
        {"rotate": {"axis": [0, 0, 2], "degrees": 90}},
        {"translate": [1, 0, 0]},
    ]
    lights = [
        {"kind": "directional", "direction": [0, -1, 1], "irradiance": [3, 2, 1]},
        {"kind": "point", "position": [1, 2, 3], "intensity": 5},
    ]
    request = read_scene(
        written(
            tmp_path,
            document(
                object={
                    "shape": "mesh",
                    "file": "cup.obj",
                    "subdivision": [2, 0],
                    "transform": steps,
                },
                lights=lights,
                ambient=0.1,
                environment={"file": "room.exr", "scale": 2},
                view={"eye": [0, -3, 0], "kind": "orthographic", "field": 2.5, "width": 64},
                tolerance={"relative": {"mean": 0.01, "p99": 0.05}},
                exposure={"factor": 2},
                models=["ggx"],
                shadings=["phong", "flat"],
            ),
        )
    )
    assert request.lights == (
        DirectionalLight((0.0, -1.0, 1.0), (3.0, 2.0, 1.0)),
        PointLight((1.0, 2.0, 3.0), (5.0,)),
    )
    assert (request.levels, request.shadings) == ((0, 2), ("flat", "phong"))
    # Scaled, then turned, then moved: x goes to y.
    moved = request.matrix @ [1.0, 0.0, 1.0, 1.0]
    np.testing.assert_allclose(moved, [1.0, 1.0, 2.0, 1.0], atol=1e-15)
    assert (request.camera.width, request.camera.height) == (64, 512)
    assert request.tolerance.excess(0.005, 0.1) == 2.0
    assert request.exposure.factor == 2.0


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"colour": 1}, '/: "colour" is not known here; Known are schema'),
        ({"light": []}, "did you mean 'lights'?"),
        ({"schema": "lobefit.scene/2"}, '/schema: "lobefit.scene/2" is not known; choose'),
        ({"lights": []}, "a scene needs light; add an entry to lights"),
        ({"lights": [{}] * 65}, "/lights: 65 entries; 0 to 64 are allowed"),
        ({"lights": [{"kind": "spot"}]}, '/lights/0/kind: "spot" is not known; choose'),
        (
            {"lights": [{"kind": "point", "position": [0, 0, 1], "irradiance": 1}]},
            '/lights/0: "irradiance" is not known here',
        ),
        (
            {"lights": [{"kind": "directional", "direction": [0, 0, 0], "irradiance": 1}]},
            "/lights/0/direction: a direction is not zero; give the vector towards the light",
        ),
        (
            {"lights": [{"kind": "directional", "direction": [0, 1], "irradiance": 1}]},
            "/lights/0/direction: 2 entries; 3 to 3 are allowed",
        ),
        (
            {"lights": [{"kind": "directional", "direction": [0, 0, 1], "irradiance": -1}]},
            "/lights/0/irradiance: -1 is outside 0 to 1e+06",
        ),
        ({"ambient": True}, "/ambient: a number is expected, not true"),
        ({"view": {"width": 1000000}}, "/view/width: 1000000 is outside 1 to 4096"),
        ({"view": {"eye": [0, 0, 0]}}, "/view: a camera looks from eye to target"),
        ({"object": {"shape": "teapot"}}, '/object/shape: "teapot" is not known; choose sphere'),
        ({"object": {"shape": "sphere", "subdivision": 99}}, "/object/subdivision: 99 is outside"),
        ({"object": {"shape": "knot", "subdivision": 7}}, "7 is outside 0 to 6"),
        ({"object": {"shape": "sphere", "subdivision": 2.5}}, "a whole number is expected"),
        ({"object": {"shape": "mesh"}}, "'file' goes with the shape 'mesh'"),
        ({"object": {"shape": "mesh", "file": "../x.obj"}}, "copy the file there"),
        ({"object": {"shape": "mesh", "file": "/etc/passwd"}}, "copy the file there"),
        ({"object": {"shape": "mesh", "file": "x.obj"}}, "no such file beside the scene"),
        ({"environment": {"file": "x.png"}}, "a file whose name ends in .exr"),
        ({"tolerance": {}}, "/tolerance: either"),
        (
            {"tolerance": {"delta_e": {"mean": 0, "p99": 3}}},
            "/tolerance/delta_e/mean: 0 is outside",
        ),
        ({"exposure": {"factor": 1, "level": 0.5}}, "/exposure: a factor leaves nothing"),
        ({"shadings": []}, "/shadings: 0 entries"),
        ({"object": {"shape": "sphere", "transform": [{}]}}, "/object/transform/0: one of scale"),
        ({"ambient": 10**400}, "/ambient: "),
    ],
)
def test_what_is_refused(tmp_path: Path, changes: dict[str, Any], said: str) -> None:
    with pytest.raises(SceneError) as caught:
        read_scene(written(tmp_path, document(**changes)))
    assert str(caught.value).startswith("scene.json: /")
    assert said in str(caught.value)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('{"schema": NaN}', "NaN is no number of JSON"),
        ('{"ambient": 1e999}', "1e999 is too large"),
        ('{"schema": 1, "schema": 2}', "stands twice"),
        ("[" * 100_000, "no JSON that can be used"),
        ("[]", "an object is expected"),
        ("", "no JSON"),
        (" " * (1 << 20) + "{}", "larger than 1 MiB"),
    ],
)
def test_what_is_no_scene_at_all(tmp_path: Path, text: str, said: str) -> None:
    with pytest.raises(SceneError, match=said):
        read_scene(written(tmp_path, text))


def test_a_missing_file(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match="No such file"):
        read_scene(tmp_path / "none.json")


def test_the_samples_are_scenes() -> None:
    paths = [p for p in SAMPLES.glob("*.json") if not p.stem.endswith(".surface")]
    assert len(paths) >= 3
    for path in paths:
        request = read_scene(path)
        assert "simulated" in request.description and "Right answer" in request.description
        assert path.with_suffix(".surface.json").is_file()


def test_an_environment_is_read_with_its_channels(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    planes = {name: rng.random((8, 16)).astype(np.float32) for name in "RGB"}
    write_exr(tmp_path / "room.exr", planes, {})
    read = read_environment(tmp_path / "room.exr", ("R", "G", "B"))
    np.testing.assert_array_equal(read.radiance, np.stack([planes[c] for c in "RGB"], axis=2))


def test_hostile_environments_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "room.exr"
    write_exr(path, {name: np.ones((8, 16)) for name in "RGB"}, {})
    good = path.read_bytes()
    window = struct.pack("<iiii", 0, 0, 15, 7)
    assert good.count(window) == 2
    cases = {
        good.replace(window, struct.pack("<iiii", 0, 0, 2**20 - 1, 2**20 - 1)): "twice as wide",
        good.replace(window, struct.pack("<iiii", 0, 0, 2**21 - 1, 2**20 - 1)): "2048 rows",
        good[: len(good) // 2]: "cannot be|no environment",
        b"not a picture": "cannot be",
    }
    for data, said in cases.items():
        path.write_bytes(data)
        with pytest.raises(SceneError, match=said):
            read_environment(path, ("R", "G", "B"))
    with OpenEXR.File(
        {}, {"Z": np.ones((4, 8), np.float32), "A": np.ones((4, 8), np.float32)}
    ) as f:
        f.write(str(path))
    with pytest.raises(SceneError, match="has the channels A, Z, the data R, G, B"):
        read_environment(path, ("R", "G", "B"))
