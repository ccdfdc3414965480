"""``lobefit check``: findings for people and programs; a finding is not an error."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner, Result

from lobefit.fitting import Measurement, simulate, write_measurement
from lobefit.service.cli import app
from tests.fitting.reports import strict

SCAN = "in-plane incidences=20,40,60 step=4"


def call(*arguments: str) -> Result:
    return CliRunner().invoke(app, list(arguments))


@pytest.fixture(scope="module")
def surface() -> Measurement:
    return simulate("ggx", {"k_d": 0.1, "F0": 0.5, "alpha": 0.3}, SCAN, noise=(0.02, 1e-4), seed=1)


def written(m: Measurement, folder: Path) -> str:
    write_measurement(m, folder / "surface.csv")
    return str(folder / "surface.csv")


def test_a_clean_file(surface: Measurement, tmp_path: Path) -> None:
    result = call("check", written(surface, tmp_path))
    assert result.exit_code == 0, result.output
    assert "surface.csv: " in result.stdout
    assert "reciprocity" in result.stdout
    assert "0 suspicious" in result.stdout.splitlines()[-1]
    assert max(map(len, result.stdout.splitlines())) <= 100


def test_a_finding_has_a_remedy_and_status_0(surface: Measurement, tmp_path: Path) -> None:
    wrong = replace(surface, values=surface.values * np.cos(surface.theta_o))
    result = call("check", written(wrong, tmp_path))
    assert result.exit_code == 0
    assert "! reciprocity" in result.stdout and "! cosine factor" in result.stdout
    assert "Remedy:" in result.stdout
    assert "2 suspicious" in result.stdout.splitlines()[-1]


def test_json_is_one_document(surface: Measurement, tmp_path: Path) -> None:
    result = call("check", written(surface, tmp_path), "--json")
    assert result.exit_code == 0
    document = strict(result.stdout)
    assert document["file"] == "surface.csv"
    assert document["suspicious"] == []
    assert {"name", "verdict", "figures", "sentence", "remedy"} == set(document["checks"][0])


@pytest.mark.parametrize(
    ("unit", "rows", "says"),
    [
        ("rad", [f"30,0,{t},180,0.1" for t in range(0, 60, 5)], "seems to be in degrees"),
        ("deg", [f"0.52,0,{t / 10},3.14,0.1" for t in range(15)], "look like radians"),
    ],
)
def test_angles_in_the_wrong_unit_are_refused(
    unit: str, rows: list[str], says: str, tmp_path: Path
) -> None:
    path = tmp_path / "wrong.csv"
    head = f"# angle_unit: {unit}\ntheta_i,phi_i,theta_o,phi_o,brdf\n"
    path.write_text(head + "\n".join(rows) + "\n")
    result = call("check", str(path))
    assert result.exit_code == 2
    assert says in result.stderr


def test_a_file_that_is_not_there(tmp_path: Path) -> None:
    assert call("check", str(tmp_path / "none.csv")).exit_code == 2
