"""The stability atlas: where fitting methods fail, what they do then, and what Lobefit does.

Each mode is a `Mode` in one of the ``rows_*.py`` beside the tests that show it; `python -m
docs.stability` makes docs/stability.md of them. Figures of what naive code does stand in the
record once, are printed from there, and are measured again by the mode's test (`measured`).
"""

from __future__ import annotations

import importlib
import re
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import pytest

__all__ = ["COUNT", "Mode", "Status", "counts", "measured", "modes"]

Status = Literal["handled", "partly", "not"]

COUNT = 43
"""Modes of the atlas, F1 to F43."""

HERE = Path(__file__).parent


@dataclass(frozen=True, slots=True, kw_only=True)
class Mode:
    """One way in which fits fail.

    Attributes
    ----------
    id : str
        F1 to F43.
    title : str
        In a few words.
    naive : str
        What plain use of numpy, scipy, NLopt, emcee, OpenCL or OpenEXR does;
        ``{name}`` stands for a figure, here and in `lobefit`.
    how : str
        How that was measured.
    figures : mapping of str to float
        Measured, and measured again by the tests.
    lobefit : str
        What its user sees.
    status : {"handled", "partly", "not"}
        "handled" where the mode cannot spoil a result unseen.
    tests : tuple of str
        ``tests/FOLDER/FILE.py::test_NAME``, the one of this atlas first.
    """

    id: str
    title: str
    naive: str
    how: str
    lobefit: str
    status: Status
    tests: tuple[str, ...]
    figures: Mapping[str, float] = field(default_factory=dict)

    @property
    def number(self) -> int:
        """1 to 43."""
        return int(self.id.removeprefix("F"))

    def filled(self, text: str) -> str:
        """Give `naive`, `how` or `lobefit` with its figures."""
        return re.sub(r"(?<=\d)%", " %", text.format(**self.figures))


def modes() -> tuple[Mode, ...]:
    """Give every mode, in order."""
    rows: list[Mode] = []
    for path in sorted(HERE.glob("rows_*.py")):
        rows += importlib.import_module(f"tests.stability.{path.stem}").ROWS
    return tuple(sorted(rows, key=lambda mode: mode.number))


def counts() -> Counter[Status]:
    """Count the modes by status."""
    return Counter(mode.status for mode in modes())


def measured(mode: str, *, rel: float = 0.1, **figures: float) -> None:
    """Assert that figures just measured are those of the mode's record.

    Parameters
    ----------
    mode : str
        Its id.
    rel : float
        Relative tolerance; what is random on other processors needs more than rounding.
    **figures : float
        Named as in the record.
    """
    recorded = next(m for m in modes() if m.id == mode).figures
    for name, value in figures.items():
        assert value == pytest.approx(recorded[name], rel=rel, nan_ok=True), f"{mode}: {name}"
