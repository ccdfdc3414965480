"""Small work for the tests of the engine: no OpenCL, no fits, and units that kill on demand."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lobefit.fitting.engine import Row, Runner, Work
from lobefit.kernels.errors import LobefitError

__all__ = ["Squares", "squares"]


@dataclass(frozen=True)
class Squares:
    """Opens what squares numbers, each after a pause.

    Attributes
    ----------
    pause : float
        Seconds a unit.
    killers, wrong : frozenset of int
        Units whose worker dies, and those that raise an error.
    shut : bool
        Whether it cannot be opened.
    """

    pause: float = 0.0
    killers: frozenset[int] = frozenset()
    wrong: frozenset[int] = frozenset()
    shut: bool = False

    @contextmanager
    def __call__(self) -> Iterator[Runner]:
        """Open it."""
        if self.shut:
            raise LobefitError("no device here")
        yield self._do

    def _do(self, first: int, stop: int, sent: Any) -> list[int]:
        found = []
        for unit in range(first, stop):
            time.sleep(self.pause)
            if unit in self.killers:
                os.kill(os.getpid(), signal.SIGKILL)
            if unit in self.wrong:
                raise LobefitError(f"unit {unit} is odd")
            found.append(unit * unit)
        return found


def squares(folder: Path, count: int, opener: Squares, **settings: Any) -> Work:
    """Give work that writes a file for each unit and appends its number to a log."""
    folder.mkdir(parents=True, exist_ok=True)

    def keep(first: int, stop: int, result: list[int]) -> Iterable[Row]:
        for unit, square in zip(range(first, stop), result, strict=True):
            (folder / f"{unit}.new").write_text(str(square))
            (folder / f"{unit}.new").replace(folder / f"{unit}.txt")
        return [Row(first, stop, {"sum": sum(result)})]

    chosen: dict[str, Any] = {"seconds": 0.05, "name": lambda unit: f"unit {unit}"} | settings
    return Work(key=repr(opener), opener=opener, keep=keep, wanted=((0, count),), **chosen)
