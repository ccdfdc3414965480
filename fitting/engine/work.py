"""What the engine is given to do."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

from lobefit.fitting.engine.ledger import Row
from lobefit.fitting.engine.worker import Opener

__all__ = ["Work"]


def _nothing(first: int, stop: int) -> None:
    return None


def _no_more() -> None:
    """Have nothing to wait for."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Work:
    """Numbered units and how to do them; a unit's result depends on that unit alone.

    Attributes
    ----------
    key : str
        Tells this work from others: workers keep what they opened for it.
    opener : callable
        Called in a worker once, without arguments: a context manager that gives the runner.
        Pickled with every chunk, so small.
    keep : callable
        Called in the driver with (first, stop, result): puts the result where it stays, and
        gives the ledger's rows for it. May be called again with the same result.
    sync : callable
        Called after some of that and before the ledger says so: what was kept must be on the
        disk when it returns.
    wanted : tuple of (int, int)
        Ranges of units, each (first, stop), in order.
    sent : callable
        Called in the driver with (first, stop): what travels to the worker with a chunk.
    name : callable
        What people call a unit.
    seconds : float
        How long a chunk should take.
    smallest, largest : int
        Units in a chunk; the first chunks have `smallest`.
    """

    key: str
    opener: Opener
    keep: Callable[[int, int, Any], Iterable[Row]]
    wanted: tuple[tuple[int, int], ...]
    sent: Callable[[int, int], Any] = _nothing
    sync: Callable[[], None] = _no_more
    name: Callable[[int], str] = str
    seconds: float = 3.0
    smallest: int = 1
    largest: int = 1_000_000

    @property
    def total(self) -> int:
        """How many units there are."""
        return sum(stop - first for first, stop in self.wanted)
