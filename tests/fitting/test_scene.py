"""The decision of a scene: its answer, its words and its files."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR
import pytest
from numpy.typing import NDArray

from benchmarks.scene import SCENES, fitted
from lobefit.fitting import Decision, decide, fit, read_scene, simulate
from lobefit.fitting import scene as scene_module
from lobefit.fitting.scene_file import Tolerance
from lobefit.kernels import directional_albedo, render
from lobefit.kernels.errors import SceneError
from lobefit.kernels.lights import DirectionalLight
from lobefit.kernels.scene import Scene
from tests.fitting.reports import strict

__all__: list[str] = []

PLASTIC: dict[str, float | list[float]] = {"k_d": [0.4, 0.2, 0.1], "k_s": 0.2, "n": 30.0}
SCAN = "hemisphere incidences=0,25,50,75 theta_step=10 phi_step=30"
WORK = {"flat": 1.0, "gouraud": 2.0, "phong": 4.0}
SCENE: dict[str, Any] = {
    "schema": "lobefit.scene/1",
    "object": {"shape": "sphere", "subdivision": 4},
    "lights": [{"kind": "directional", "direction": [1, -1, 1], "irradiance": [3, 2.8, 2.5]}],
    "view": {"eye": [0, -4, 1], "field": 29, "width": 64, "height": 64},
    "tolerance": {"delta_e": {"mean": 0.4, "p99": 3.0}},
    "models": ["lambert", "blinn_phong", "ggx"],
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A fit of three models, with its samples."""
    path = tmp_path_factory.mktemp("fit")
    measured = simulate("blinn_phong", PLASTIC, SCAN, (0.01, 1e-4), channels=["R", "G", "B"])
    fit(measured, models=["lambert", "blinn_phong", "ggx"]).save(path)
    return path


@pytest.fixture
def known_times(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let frames take what their shading is said to, a busy machine or not."""

    def timed(
        frames: Mapping[int, Callable[[], float]], least: int, seconds: float
    ) -> dict[int, NDArray[np.float64]]:
        assert all(frame() > 0.0 for frame in frames.values())
        shadings = [s for s in WORK for _ in range(len(frames) // 3)]
        noise = 0.05 * (np.arange(least) - (least - 1) / 2)
        return {k: np.asarray(1e-3 * (WORK[shadings[k]] + noise * (k % 3))) for k in frames}

    monkeypatch.setattr(scene_module, "take_turns", timed)


def scene(folder: Path, **changes: Any) -> Path:
    path = folder / "scene.json"
    path.write_text(json.dumps(SCENE | changes), encoding="utf-8")
    return path


@pytest.mark.usefixtures("known_times")
def test_the_cheapest_sufficient_combination(folder: Path, tmp_path: Path) -> None:
    pytest.importorskip("skimage")
    decision = decide(scene(tmp_path), folder)
    assert len(decision.combinations) == 9
    chosen, cheaper = decision.answer.chosen, decision.answer.cheaper
    assert chosen is not None and cheaper is not None
    assert chosen.name == "blinn_phong + gouraud"
    assert cheaper.name == "blinn_phong + flat"
    assert [c.name for c in decision.answer.richer] == ["blinn_phong + phong"]
    flat = next(c for c in decision.combinations if c.name == "blinn_phong + flat")
    assert flat.excess(decision.answer.tolerance) > 1.0
    assert decision.sentence.startswith("blinn_phong with Gouraud shading is enough: mean ΔE2000 ")
    assert "the next cheaper, blinn_phong with flat shading (" in decision.sentence
    assert "times over the tolerance" in decision.sentence
    assert "; blinn_phong with Phong shading is within it too, at " in decision.sentence
    assert "* blinn_phong  gouraud" in decision.table()
    # A tenth of the tolerance takes more, ten times of it less.
    tight = decision.answer_for(decision.answer.tolerance.scaled(0.25)).chosen
    loose = decision.answer_for(decision.answer.tolerance.scaled(20.0)).chosen
    assert tight is not None and tight.name == "blinn_phong + phong"
    assert loose is not None and loose.name == "lambert + flat"
    nothing = decision.answer_for(Tolerance("delta_e", 1e-6, 1e-6))
    assert nothing.chosen is None and nothing.cheaper is not None
    words = replace(decision, answer=nothing, chosen=None).sentence
    assert words.startswith("Nothing stays within the tolerance: blinn_phong with ")


@pytest.mark.usefixtures("known_times")
def test_files(folder: Path, tmp_path: Path) -> None:
    pytest.importorskip("skimage")
    decision = decide(scene(tmp_path, ambient=0.05), folder)
    files = decision.save(tmp_path / "out")
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == [
        *("albedo.exr", "beauty.png", "decision.json", "scene.exr", "scene.png"),
    ]
    document = strict(files["decision"].read_text(encoding="utf-8"))
    assert document["schema"] == "lobefit.decision/1"
    assert document["answer"]["chosen"]["model"] == "blinn_phong"
    assert document["answer"]["next_cheaper"]["times_tolerance"] > 1.0
    assert document["colour"]["space"] == "linear sRGB, D65"
    assert document["reference"]["kind"] in ("data", "fit") and document["reference"]["why"]
    _check_layers(files["layers"], decision)
    _check_albedo(files["albedo"], decision)


def _check_layers(path: Path, decision: Decision) -> None:
    with OpenEXR.File(str(path), separate_channels=True) as file:
        stored = {name: c.pixels for name, c in file.channels().items()}
        header = dict(file.header())
    layers = ("beauty", "diffuse", "specular", "reference")
    assert set(stored) == {"deltaE.Y", *(f"{layer}.{c}" for layer in layers for c in "RGB")}
    assert all(p.dtype == np.float32 and p.shape == (64, 64) for p in stored.values())
    assert decision.chosen is not None
    rendering = decision.chosen.rendering
    for k, c in enumerate("RGB"):
        np.testing.assert_array_equal(stored[f"beauty.{c}"], rendering.beauty[k])
        np.testing.assert_array_equal(stored[f"specular.{c}"], rendering.specular[k])
        both = stored[f"diffuse.{c}"] + stored[f"specular.{c}"]
        np.testing.assert_allclose(both, stored[f"beauty.{c}"], rtol=1e-6)
        reference = decision.reference.picture[k].astype(np.float32)
        np.testing.assert_array_equal(stored[f"reference.{c}"], reference)
    shown = rendering.mask | decision.reference.mask
    assert decision.answer.chosen is not None
    assert stored["deltaE.Y"][shown].mean() == pytest.approx(
        decision.answer.chosen.errors.mean, rel=1e-5
    )
    assert header["chromaticities"][:2] == pytest.approx((0.64, 0.33))
    assert header["lobefit:model"] == "blinn_phong"
    assert header["comments"] == decision.sentence


def _check_albedo(path: Path, decision: Decision) -> None:
    with OpenEXR.File(str(path), separate_channels=True) as file:
        stored = {name: c.pixels for name, c in file.channels().items()}
        theta = json.loads(file.header()["lobefit:theta_i_deg"])
    assert {name.partition(".")[0] for name in stored} == {"blinn_phong"}
    blinn = decision.fits.reference.fitted
    expected = directional_albedo(blinn.model, blinn.params, np.deg2rad(theta))
    for k, c in enumerate("RGB"):
        np.testing.assert_allclose(stored[f"blinn_phong.{c}"], expected[k][None], rtol=1e-6)


@pytest.mark.usefixtures("known_times")
def test_the_data_are_the_reference_where_they_suffice(tmp_path: Path) -> None:
    pytest.importorskip("skimage")
    scan = "hemisphere incidences=0,20,40,60,75,85 theta_step=5 phi_step=15 max=88"
    truth: dict[str, float | list[float]] = {"k_d": [0.4, 0.2, 0.1], "sigma": 0.3}
    measured = simulate("oren_nayar", truth, scan, (0.002, 1e-5), channels=["R", "G", "B"])
    fit(measured, models=["lambert", "oren_nayar"]).save(tmp_path / "fit")
    request = read_scene(scene(tmp_path, models=["lambert", "oren_nayar"], ambient=0.2))
    decision = decide(request, tmp_path / "fit")
    reference = decision.reference
    assert (reference.kind, reference.model) == ("data", "oren_nayar")
    assert reference.covered is not None and reference.covered > 0.95
    assert reference.left_out is not None and 0.0 < reference.left_out.mean < 0.2
    # The interpolated picture is the true surface's, within the noise.
    world = Scene(
        lights=(DirectionalLight((1.0, -1.0, 1.0), (3.0, 2.8, 2.5)),),
        ambient=0.2,
        camera=request.camera,
    )
    picture = render(world, "oren_nayar", truth, shading="exact").beauty
    inside = reference.mask & (picture.max(axis=0) > 0.1)
    off = np.abs(reference.picture / np.where(picture > 0.0, picture, 1.0) - 1.0)[:, inside]
    assert np.median(off) < 0.005 and np.percentile(off, 99) < 0.05
    # Held to a hundredth of the tolerance their noise does not suffice.
    finer = replace(request, tolerance=request.tolerance.scaled(0.01))
    fallen = decide(finer, tmp_path / "fit").reference
    assert fallen.kind == "fit" and "more than half of it" in fallen.why


@pytest.mark.usefixtures("known_times")
def test_other_channels_take_relative_radiance_and_phong_is_fitted(tmp_path: Path) -> None:
    measured = simulate("blinn_phong", {"k_d": 0.3, "k_s": 0.2, "n": 20.0}, SCAN, (0.01, 1e-4))
    fit(measured, models=["lambert", "blinn_phong"]).save(tmp_path / "fit")
    lights = [{"kind": "point", "position": [2, -3, 2], "intensity": 20}]
    changes: dict[str, Any] = {"lights": lights, "models": ["lambert", "phong"]}
    with pytest.raises(SceneError, match=r"/tolerance/delta_e: ΔE2000 needs data of R, G and B"):
        decide(scene(tmp_path, **changes), tmp_path / "fit")
    changes["tolerance"] = {"relative": {"mean": 0.1, "p99": 0.5}}
    decision = decide(scene(tmp_path, **changes, ambient=0.1), tmp_path / "fit")
    assert {c.model.name for c in decision.combinations} == {"lambert", "phong"}
    assert {m.name: m.origin for m in decision.fits.models}["phong"] == "fitted here"
    assert "mean relative error" in decision.sentence
    files = decision.save(tmp_path / "out")
    with OpenEXR.File(str(files["layers"]), separate_channels=True) as file:
        assert "relative.Y" in file.channels() and "beauty.brdf" in file.channels()
        assert "chromaticities" not in file.header()
    changes["lights"] = [{**lights[0], "intensity": [1, 2]}]
    with pytest.raises(SceneError, match="/lights/0/intensity: 2 numbers, but the data have 1"):
        decide(scene(tmp_path, **changes), tmp_path / "fit")


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"models": ["ward"]}, "/models: no result is called 'ward'; the report has "),
        ({"models": ["lambrt"]}, "/models: no model is called 'lambrt'; did you mean 'lambert'?"),
        ({"ambient": [1, 2]}, "/ambient: 2 numbers, but the data have 3 channels"),
        ({"view": {"target": [0, -9, 0], "eye": [0, -4, 0]}}, "/view: it does not show the object"),
        ({"object": {"shape": "sphere", "transform": [{"scale": 0}]}}, "its determinant is not 0"),
    ],
)
def test_scenes_that_do_not_go_with_the_fit(
    folder: Path, tmp_path: Path, changes: dict[str, Any], said: str
) -> None:
    pytest.importorskip("skimage")
    with pytest.raises(SceneError) as caught:
        decide(scene(tmp_path, **changes), folder)
    assert said in str(caught.value)


# What makes an answer right, whatever the machine's frames take.
RIGHT = {
    "painted_ball": ("lambert + flat", set()),
    "plastic_in_showroom": (
        "blinn_phong + gouraud",
        {"lambert", "oren_nayar", "modified_phong", "ggx", "ggx_anisotropic"},
    ),
    "brushed_knob": (
        "ggx_anisotropic + phong",
        {"lambert", "oren_nayar", "modified_phong", "blinn_phong", "ggx"},
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", list(RIGHT))
def test_the_sample_scenes_are_answered_as_they_say(name: str, tmp_path: Path) -> None:
    pytest.importorskip("skimage")
    decision = decide(SCENES / f"{name}.json", fitted(name, tmp_path))
    tolerance = decision.answer.tolerance
    right, too_poor = RIGHT[name]
    model, shading = right.split(" + ")
    # Times jitter, the answer does not.
    assert decision.answer.chosen is not None and decision.answer.chosen.name == right
    within = [c for c in decision.combinations if c.excess(tolerance) <= 1.0]
    # Nothing of a poorer model, or of the same model with a simpler shading, would do.
    assert not too_poor & {c.model.name for c in within}
    simpler = list(WORK)[: list(WORK).index(shading)]
    assert not [c for c in within if c.model.name == model and c.shading in simpler]
    tight = decision.answer_for(tolerance.scaled(0.1)).chosen
    loose = decision.answer_for(tolerance.scaled(10.0)).chosen
    assert loose is not None
    if name == "brushed_knob":
        assert loose.name != right
    else:
        assert tight is not None and (tight.name, tight.level) != (
            right,
            min(decision.request.levels),
        )
