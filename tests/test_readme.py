"""The README's blocks are run: Python as it stands, and the demo's output line by line."""

from __future__ import annotations

import json
import re
import runpy
import shutil
import subprocess
import zipfile
from pathlib import Path

import pytest
from typer.testing import CliRunner

from lobefit.service.cli import app

CHECKOUT = Path(__file__).parents[1]
README = (CHECKOUT / "README.md").read_text(encoding="utf-8")
PYTHON = re.findall(r"```python\n(.*?)```", README, flags=re.DOTALL)
SHELL = re.findall(r"```sh\n(.*?)```", README, flags=re.DOTALL)
SERVED = "http://127.0.0.1:8000"


@pytest.fixture
def checkout(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Give a folder with the samples, in which blocks may write."""
    shutil.copytree(CHECKOUT / "samples", tmp_path / "samples")
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("block", PYTHON, ids=range(len(PYTHON)))
def test_python_blocks_run(
    block: str, checkout: Path, request: pytest.FixtureRequest, capsys: pytest.CaptureFixture[str]
) -> None:
    if SERVED in block:
        block = block.replace(SERVED, request.getfixturevalue("service_url"))
    (checkout / "block.py").write_text(block, encoding="utf-8")
    runpy.run_path("block.py")
    if "Client" in block:
        assert "ggx:k_s=1" in capsys.readouterr().out
        made = {p.name for p in (checkout / "glossy_plastic").iterdir()}
        assert {"report.json", "fit.png", "lobes.exr", "albedo.exr", "samples.csv"} <= made


@pytest.mark.skipif(shutil.which("curl") is None, reason="curl is not installed")
def test_the_curl_lines_run(checkout: Path, service_url: str) -> None:
    (block,) = (b for b in SHELL if "curl" in b)
    done = subprocess.run(
        ["bash", "-euo", "pipefail", "-c", block.replace(SERVED, service_url)],
        cwd=checkout,
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )
    assert done.returncode == 0, done.stderr
    assert "event: state" in done.stdout
    report = json.loads((checkout / "report.json").read_text(encoding="utf-8"))
    assert report["best"] == "ggx:k_s=1"
    with zipfile.ZipFile(checkout / "fit.zip") as files:
        assert files.testzip() is None
        assert "fit.png" in files.namelist()


def test_the_demo_prints_what_the_readme_shows(checkout: Path) -> None:
    shown = re.search(r"```\n(rough_copper\.csv:.*?)```", README, flags=re.DOTALL)
    assert shown is not None
    answer = CliRunner().invoke(app, ["fit", "samples/rough_copper.csv"])
    printed = answer.stdout.splitlines()
    for line in shown.group(1).splitlines():
        # The last digits of a BIC may differ between processors; nothing else does.
        if line != "..." and "BIC" not in line and not re.match(r" *\d+  ", line):
            assert line in printed
    ranks = [line.split()[1] for line in printed if re.match(r" *\d+  ", line)]
    assert len(ranks) > 3
    assert ranks[:3] == re.findall(r"^ *\d+  (\S+)", shown.group(1), flags=re.MULTILINE)
