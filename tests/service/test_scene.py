"""``lobefit scene`` as people meet it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner, Result

from lobefit.fitting import fit, simulate
from lobefit.service.cli import app

__all__: list[str] = []

SCENE: dict[str, Any] = {
    "schema": "lobefit.scene/1",
    "object": {"shape": "plane", "subdivision": 1, "transform": [{"scale": 1.5}]},
    "lights": [{"kind": "directional", "direction": [0, -1, 1], "irradiance": 3}],
    "view": {"eye": [0, -2, 3], "width": 48, "height": 48},
    "tolerance": {"relative": {"mean": 0.05, "p99": 0.1}},
    "models": ["lambert"],
}


def call(*arguments: object) -> Result:
    return CliRunner().invoke(app, ["scene", *map(str, arguments)])


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("scene")
    scan = "in-plane incidences=10,50 step=4"
    measured = simulate("lambert", {"k_d": 0.3}, scan, (0.02, 1e-3), seed=1)
    fit(measured, models="lambert").save(path / "fit")
    (path / "scene.json").write_text(json.dumps(SCENE), encoding="utf-8")
    return path


def test_words_and_files(folder: Path, tmp_path: Path) -> None:
    arguments = (folder / "scene.json", "--fit", folder / "fit", "--timing", 0)
    result = call(*arguments, "--out", tmp_path / "out")
    assert result.exit_code == 0, result.output
    first = " ".join(result.stdout.splitlines()[:3])
    assert first.startswith("lambert with ") and "is enough" in first
    assert "Reference: Readings" in result.stdout
    assert "ms/frame, median (quartiles)" in result.stdout
    assert "of the same cost the simplest is chosen" in " ".join(result.stdout.split())
    assert f"Written to {tmp_path / 'out'}: scene.png, beauty.png, " in result.stdout
    assert (tmp_path / "out" / "scene.png").read_bytes().startswith(b"\x89PNG")


def test_json_alone(folder: Path) -> None:
    result = call(folder / "scene.json", "--fit", folder / "fit", "--timing", 0, "--json")
    assert result.exit_code == 0, result.output
    document = json.loads(result.stdout)
    assert document["answer"]["chosen"]["model"] == "lambert"
    assert len(document["combinations"]) == 3
    assert document["cost"].startswith("Cost: measured seconds")


def test_mistakes_are_one_line_with_status_2(folder: Path, tmp_path: Path) -> None:
    bad = tmp_path / "bad.json"
    bad.write_text(json.dumps(SCENE | {"ambient": -1}), encoding="utf-8")
    result = call(bad, "--fit", folder / "fit")
    assert result.exit_code == 2
    assert result.stderr == "Error: bad.json: /ambient: -1 is outside 0 to 1e+06\n"
    missing = call(folder / "scene.json", "--fit", tmp_path / "none")
    assert missing.exit_code == 2 and "there is no such report" in missing.stderr
    over = call(folder / "scene.json", "--fit", folder / "fit", "--out", bad)
    assert over.exit_code == 2 and "is a file; name a folder" in over.stderr
