"""The README's blocks are run: Python as it stands, and the demo's output line by line."""

from __future__ import annotations

import re
import runpy
import shutil
from pathlib import Path

import pytest
from typer.testing import CliRunner

from lobefit.service.cli import app

CHECKOUT = Path(__file__).parents[1]
README = (CHECKOUT / "README.md").read_text(encoding="utf-8")
PYTHON = re.findall(r"```python\n(.*?)```", README, flags=re.DOTALL)


@pytest.fixture
def checkout(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Give a folder with the samples, in which blocks may write."""
    shutil.copytree(CHECKOUT / "samples", tmp_path / "samples")
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("block", PYTHON, ids=range(len(PYTHON)))
def test_python_blocks_run(block: str, checkout: Path) -> None:
    (checkout / "block.py").write_text(block, encoding="utf-8")
    runpy.run_path("block.py")


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
