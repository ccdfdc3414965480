"""The atlas is whole: every mode has a row, every row its tests, every test its row."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

from docs.stability import PAGE, collect, expected
from tests.stability.modes import COUNT, Mode, modes

HERE = Path(__file__).parent
REMEDY = "run `python -m docs.stability`"


def test_every_mode_has_one_row() -> None:
    assert [mode.id for mode in modes()] == [f"F{k}" for k in range(1, COUNT + 1)]


@pytest.mark.parametrize("mode", modes(), ids=lambda mode: mode.id)
def test_a_row_is_complete(mode: Mode) -> None:
    for text in (mode.title, mode.naive, mode.how, mode.lobefit):
        assert text.strip()
        assert mode.filled(text) == mode.filled(text).strip()
    assert mode.status in ("handled", "partly", "not")
    assert mode.tests[0].startswith("tests/stability/")
    missing = [test for test in mode.tests if test not in collect(test.partition("::")[0])]
    assert missing == []


def test_every_test_of_the_atlas_has_a_row() -> None:
    named = {test for mode in modes() for test in mode.tests}
    here = {
        test
        for path in HERE.glob("test_*.py")
        if path.stem != "test_atlas"
        for test in collect(f"tests/stability/{path.name}")
    }
    assert here <= named


def test_every_figure_is_measured_by_a_test() -> None:
    """In calls of `measured`, by name or as a mapping of names."""
    found: dict[str, set[str]] = {}
    for path in HERE.glob("test_*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call) and ast.unparse(node.func) == "measured":
                mode = ast.literal_eval(node.args[0])
                names = {k.arg or "**" for k in node.keywords} - {"rel"}
                found.setdefault(mode, set()).update(names)
    for mode in modes():
        measured = found.get(mode.id, set())
        if "**" not in measured:
            assert measured == set(mode.figures), mode.id
        assert measured - {"**"} <= set(mode.figures), mode.id


def test_the_page_is_current() -> None:
    assert PAGE.read_text(encoding="utf-8") == expected(), REMEDY
