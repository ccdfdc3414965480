"""`lobefit scene` as a whole: environments, meshes, other shapes and other channels than RGB."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR
import pytest
import trimesh
from matplotlib.image import imread
from numpy.typing import NDArray
from typer.testing import CliRunner

from lobefit.fitting import fit, read_scene, simulate
from lobefit.fitting.scene_colour import Yardstick, exposure_factor
from lobefit.fitting.scene_environment import read_environment
from lobefit.kernels.lights import Environment
from lobefit.kernels.render import render
from lobefit.kernels.scene import Scene
from lobefit.service.cli import app
from tests.fitting.reports import strict

__all__: list[str] = []

SCAN = "hemisphere incidences=0,30,60 theta_step=15 phi_step=30"
COPPER: dict[str, float | list[float]] = {
    "k_d": [0.02, 0.015, 0.01],
    "F0": [0.95, 0.64, 0.54],
    "alpha": 0.25,
}
BANDS = ("450nm", "650nm")
LAMP = {"kind": "directional", "direction": [1, -1, 1], "irradiance": 3}
POINT = {"kind": "point", "position": [0.3, 1.0, 1.0], "intensity": [5, 4.5, 4]}
DELTA_E = {"delta_e": {"mean": 1, "p99": 4}}
RELATIVE = {"relative": {"mean": 0.03, "p99": 0.2}}


def room(rows: int) -> NDArray[np.float32]:
    """Sky, floor, a window with hard edges and a small lamp."""
    picture = np.full((rows, 2 * rows, 3), (0.12, 0.1, 0.08), np.float32)
    picture[: rows // 2] = (0.25, 0.35, 0.6)
    picture[rows // 3 : rows // 2, rows : 4 * rows // 3] = (8.0, 7.5, 6.5)
    picture[rows // 4 : rows // 4 + 2, rows // 2 : rows // 2 + 2] = 60.0
    return picture


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Fits of copper in R, G, B and in two bands, with what scenes refer to."""
    path = tmp_path_factory.mktemp("scenes")
    rgb = simulate("ggx", COPPER, SCAN, (0.01, 1e-4), channels=["R", "G", "B"])
    fit(rgb, models=["lambert", "ggx"]).save(path / "rgb")
    two: dict[str, float | list[float]] = {"k_d": [0.05, 0.02], "F0": [0.5, 0.9], "alpha": 0.3}
    bands = simulate("ggx", two, SCAN, (0.01, 1e-4), channels=list(BANDS))
    fit(bands, models=["lambert", "ggx"]).save(path / "bands")
    for name, planes in (("room", {"RGB": room(128)}), ("grey", {"Y": room(32).mean(axis=2)})):
        with OpenEXR.File({}, planes) as file:
            file.write(str(path / f"{name}.exr"))
    trimesh.creation.torus(0.8, 0.3, major_sections=24, minor_sections=12).export(path / "ring.obj")
    return path


@dataclass(frozen=True)
class Run:
    """What a run printed and wrote."""

    words: str
    document: dict[str, Any]
    layers: dict[str, NDArray[np.float32]]
    folder: Path


def run(folder: Path, report: str, scene: dict[str, Any]) -> Run:
    document = {
        "schema": "lobefit.scene/1",
        "view": {"eye": [0, -4, 1], "field": 32, "width": 40, "height": 40},
        "models": ["lambert", "ggx"],
    } | scene
    path, out = folder / "scene.json", folder / "out"
    path.write_text(json.dumps(document), encoding="utf-8")
    arguments = ["scene", str(path), "--fit", str(folder / report), "--out", str(out)]
    done = CliRunner().invoke(app, [*arguments, "--timing", "0"])
    assert done.exit_code == 0, done.output
    decision = strict((out / "decision.json").read_text(encoding="utf-8"))
    words = " ".join(done.stdout.split())
    assert decision["sentence"] in words and decision["reference"]["why"] in words
    with OpenEXR.File(str(out / "scene.exr"), separate_channels=True) as file:
        layers = {name: np.array(c.pixels) for name, c in file.channels().items()}
    assert all(np.isfinite(plane).all() for plane in layers.values())
    for name in ("scene.png", "beauty.png"):
        picture = imread(out / name)[..., :3]
        assert picture.std() > 0.01
        assert picture.shape[0] >= decision["scene"]["height"]
    return Run(words, decision, layers, out)


CASES: dict[str, tuple[str, dict[str, Any]]] = {
    "mesh": ("rgb", {"object": {"shape": "mesh", "file": "ring.obj"}, "lights": [LAMP]}),
    "knot": ("rgb", {"object": {"shape": "knot", "subdivision": [2, 3]}, "lights": [LAMP]}),
    "plane": (
        "rgb",
        {
            "object": {"shape": "plane"},
            "lights": [POINT],
            "view": {"eye": [0, -2, 2.2], "field": 45, "width": 40, "height": 40},
        },
    ),
    "cylinder": (
        "rgb",
        {
            "object": {"shape": "cylinder", "transform": [{"scale": [0.5, 0.5, 0.7]}]},
            "lights": [LAMP],
            "ambient": 0.1,
        },
    ),
}


QUICK = ("mesh", "cylinder")


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=() if n in QUICK else pytest.mark.slow) for n in CASES]
)
def test_shapes_are_decided_whole(folder: Path, name: str) -> None:
    pytest.importorskip("skimage")
    report, scene = CASES[name]
    found = run(folder, report, {"tolerance": DELTA_E, **scene})
    chosen = found.document["answer"]["chosen"]
    assert chosen["model"] == "ggx" and chosen["within"]
    assert found.document["reference"]["environment_error"] is None
    shown = found.layers["reference.G"] > 0.0
    assert 0.1 < shown.mean() < 0.9
    inside = found.layers["deltaE.Y"][shown]
    assert inside.mean() == pytest.approx(chosen["mean"], rel=0.2, abs=0.02)
    levels = {c["level"] for c in found.document["combinations"]}
    assert len(levels) == (2 if name == "knot" else 1)
    assert (" at level " in found.document["sentence"]) == (name == "knot")


def test_an_environment_is_decided_whole_and_its_error_is_honest(folder: Path) -> None:
    pytest.importorskip("skimage")
    scene = {"environment": {"file": "room.exr", "scale": 2}, "object": {"shape": "sphere"}}
    found = run(folder, "rgb", {"tolerance": DELTA_E, **scene})
    assert found.document["answer"]["chosen"]["model"] == "ggx"
    assert "An environment takes directions that were not measured" in found.words
    assert "Its integral over the environment is estimated to be known within 0.0" in found.words
    stated = found.document["reference"]["environment_error"]
    # The same picture with sixteen times as many nodes, and every pixel of the room a light.
    request = read_scene(folder / "scene.json")
    assert request.environment is not None
    around = read_environment(request.environment, ("R", "G", "B"))
    best = strict((folder / "rgb" / "report.json").read_text(encoding="utf-8"))["results"][0]
    world = Scene(environment=Environment(2.0 * around.radiance), camera=request.camera)
    finest = render(
        world, best["model"], best["params"], shading="exact", nodes=(64, 192), cells=10**9
    )
    picture = np.stack([found.layers[f"reference.{c}"] for c in "RGB"])
    factor = exposure_factor(request.exposure, picture, finest.mask)
    yardstick = Yardstick("delta_e", finest.beauty, finest.mask, factor)
    true = yardstick.errors(picture, finest.mask)
    assert 0.0 < true.mean <= stated["mean"] < 0.2
    assert true.p99 <= stated["p99"]


def test_an_integral_that_is_not_known_well_enough_is_said(folder: Path) -> None:
    """Held to a tolerance finer than the integral is known, the answer says so."""
    pytest.importorskip("skimage")
    fine = {"delta_e": {"mean": 1e-4, "p99": 1e-3}}
    scene = {"environment": {"file": "room.exr"}, "object": {"shape": "sphere"}}
    found = run(folder, "rgb", {"tolerance": fine, "shadings": ["phong"], **scene})
    assert "too little to rely on the answer: replace what is small and bright" in found.words


@pytest.mark.parametrize("light", ["lamp", "grey environment"])
def test_bands_are_decided_by_relative_radiance(folder: Path, light: str) -> None:
    given: dict[str, Any] = {"lights": [{**LAMP, "irradiance": [3, 2]}]}
    if light != "lamp":
        given = {"environment": {"file": "grey.exr"}}
    found = run(folder, "bands", {"tolerance": RELATIVE, "object": {"shape": "sphere"}, **given})
    layers = ("beauty", "diffuse", "specular", "reference")
    assert set(found.layers) == {"relative.Y", *(f"{a}.{b}" for a in layers for b in BANDS)}
    assert "mean relative error" in found.words and found.document["colour"] is None
    chosen = found.document["answer"]["chosen"]
    reference = np.stack([found.layers[f"reference.{b}"] for b in BANDS])
    beauty = np.stack([found.layers[f"beauty.{b}"] for b in BANDS])
    shown = reference.any(axis=0) | beauty.any(axis=0)
    floor = 0.05 * reference[:, reference.any(axis=0)].mean(axis=1)[:, None, None]
    off = (np.abs(beauty - reference) / np.maximum(reference, floor)).max(axis=0)
    # Pixels that show the object where no light falls are not known here.
    assert off[shown].mean() == pytest.approx(chosen["mean"], rel=0.1)


@pytest.mark.slow
def test_a_room_with_lights_and_a_mesh_at_full_size(folder: Path) -> None:
    pytest.importorskip("skimage")
    with OpenEXR.File({}, {"RGB": room(256)}) as file:
        file.write(str(folder / "large.exr"))
    scene = {
        "tolerance": DELTA_E,
        "object": {"shape": "mesh", "file": "ring.obj", "subdivision": [0, 1]},
        "environment": {"file": "large.exr"},
        "lights": [LAMP],
        "ambient": 0.05,
        "view": {"eye": [0, -4, 1], "field": 32, "width": 256, "height": 256},
    }
    found = run(folder, "rgb", scene)
    assert found.document["answer"]["chosen"]["model"] == "ggx"
    assert found.document["seconds"] < 60.0
