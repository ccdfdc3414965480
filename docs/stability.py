"""Make docs/stability.md from the records beside the tests of tests/stability.

Run as ``python -m docs.stability``. A test fails when the page is older than the records.
"""

from __future__ import annotations

import ast
from functools import cache
from pathlib import Path

from tests.stability.modes import COUNT, Mode, Status, counts, modes

__all__ = ["PAGE", "collect", "expected"]

ROOT = Path(__file__).parents[1]
PAGE = Path(__file__).parent / "stability.md"

INTRODUCTION = """\
<!-- Made by `python -m docs.stability` from tests/stability/rows_*.py; do not edit. -->

# The stability atlas

{count} ways in which fits of reflectance models go wrong, each reproduced by a test: what plain
use of numpy, scipy, NLopt, emcee, OpenCL or OpenEXR does, and what the user of Lobefit sees
instead. Of these, {handled} are handled, {partly} partly, {none} not.

*Handled*: the mode cannot spoil a result unseen: it is avoided, corrected, or told. *Partly*: some
forms of it can; the row says which. *Not*: nothing is done about it.

Figures are measured again by the test, which fails when they differ:
`python -m pytest tests/stability` (PoCL 3.0 on x86-64; elsewhere they may differ)."""

HEAD = ("", "mode", "plain use (measured)", "measured by", "Lobefit", "status", "tests")


@cache
def collect(path: str) -> frozenset[str]:
    """Give the ids of a file's tests, without importing it.

    Parameters
    ----------
    path : str
        From the checkout's root.
    """
    file = ROOT / path
    if not file.is_file():
        return frozenset()
    body = ast.parse(file.read_text(encoding="utf-8")).body
    return frozenset(
        f"{path}::{node.name}"
        for node in body
        if isinstance(node, ast.FunctionDef) and node.name.startswith("test_")
    )


def _cell(text: str) -> str:
    return text.replace("|", "\\|").replace("*", "\\*").replace("<", "\\<")


def _test(test: str) -> str:
    path, _, name = test.partition("::")
    return f"[{name}](../{path})"


def _row(mode: Mode) -> str:
    texts = [_cell(mode.filled(text)) for text in (mode.title, mode.naive, mode.how, mode.lobefit)]
    tests = "<br>".join(_test(test) for test in mode.tests)
    return f"| {mode.id} | {' | '.join(texts)} | **{mode.status}** | {tests} |"


def expected() -> str:
    """Give the text of the page."""
    number = counts()
    by_status: list[Status] = ["handled", "partly", "not"]
    handled, partly, none = (number[status] for status in by_status)
    text = INTRODUCTION.format(count=COUNT, handled=handled, partly=partly, none=none)
    rows = [f"| {' | '.join(HEAD)} |", "|---" * len(HEAD) + "|", *map(_row, modes())]
    return "\n".join([text, "", *rows, ""])


def main() -> None:
    """Write the page where it is not current."""
    if not PAGE.is_file() or PAGE.read_text(encoding="utf-8") != expected():
        PAGE.write_text(expected(), encoding="utf-8")
        print("docs/stability.md")


if __name__ == "__main__":
    main()
