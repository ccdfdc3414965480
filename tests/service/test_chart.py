"""``lobefit chart``: what it prints and writes, and how it complains."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from lobefit.fitting import simulate, write_measurement
from lobefit.service.cli import app

SCAN = "in-plane incidences=10,20,30,40,50,60,70,75 step=10"
QUICK = ["--models", "lambert", "--groups", "fit", "--repeats", "1"]


@pytest.fixture(scope="module")
def paint(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("chart") / "paint.csv"
    write_measurement(simulate("lambert", {"k_d": 0.3}, SCAN, noise=(0.005, 0.0), seed=1), path)
    return path


def run(*words: str) -> tuple[int, str, str]:
    found = CliRunner().invoke(app, ["chart", *words])
    return found.exit_code, found.stdout, found.stderr


def test_a_file_is_charted_and_compared_with_itself(paint: Path, tmp_path: Path) -> None:
    status, said, _ = run(str(paint), *QUICK, "--tolerance", "0.05", "--out", str(tmp_path))
    assert status == 0, said
    assert "You asked for 5 %: " in said
    assert "How to fit: the Pareto front of" in said
    assert "4 held-out incidences of 8" in said
    document = json.loads((tmp_path / "chart.json").read_text(encoding="utf-8"))
    assert document["tolerance"] == 0.05
    assert document["panels"][0]["front"]
    assert (tmp_path / "chart.png").stat().st_size > 10_000
    status, said, _ = run(str(paint), *QUICK, "--compare", str(tmp_path), "--json")
    assert status == 0, said
    (beside,) = json.loads(said)["compared"]
    assert beside["says"].startswith("fit: fronts of ")


def test_a_model_is_scored_against_its_truth() -> None:
    status, said, _ = run("lambert", "--param", "k_d=0.3", "--geometry", SCAN, *QUICK, "--json")
    assert status == 0, said
    document = json.loads(said)
    assert document["settings"]["subject"]["params"] == {"k_d": 0.3}
    errors = {p["label"]: p["error"]["median"] for p in document["panels"][0]["points"]}
    assert errors["lambert"] < 0.01


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["nowhere.csv"], "nowhere.csv"),
        (["lambert", "--param", "k_d=much"], "is not NAME=NUMBER"),
        (["lambert", "--param", "k_d=0.3", "--noise", "1"], "is not RELATIVE,ADDITIVE"),
        (["lambert", "--param", "k_d=0.3", "--groups", "speed"], "there is no group 'speed'"),
        (["lambert", "--param", "k_d=0.3", "--tolerance", "0"], "tolerance is a relative error"),
        (["lambert", "--param", "k_d=0.3", "--max-theta", "60"], "--max-theta is for a file"),
        (["lambert", "--param", "k_d=0.3", "--compare", "nothing.json"], "cannot be read"),
    ],
)
def test_bad_input_is_one_line_and_status_2(words: list[str], message: str) -> None:
    status, said, complaint = run(*words)
    assert (status, said) == (2, "")
    assert message in complaint
    assert len(complaint.strip().splitlines()) == 1


def test_what_is_no_chart_is_not_compared(paint: Path, tmp_path: Path) -> None:
    for text, message in (("{", "is no JSON"), ("[]", "no chart of the schema")):
        (tmp_path / "chart.json").write_text(text, encoding="utf-8")
        status, _, complaint = run(str(paint), *QUICK, "--compare", str(tmp_path))
        assert status == 2
        assert message in complaint
