"""How many units go into a chunk: as many as take a few seconds."""

from __future__ import annotations

import math

__all__ = ["Sizes"]

# Share of the newest chunk in the running mean; chunks differ by their texels and the machine.
NEWEST = 0.3


class Sizes:
    """The size of the next chunk, from the time that earlier ones took.

    Parameters
    ----------
    seconds : float
        How long a chunk should take.
    smallest, largest : int
        Units in a chunk.
    """

    def __init__(self, seconds: float, smallest: int, largest: int) -> None:
        self.seconds, self.smallest, self.largest = seconds, smallest, max(smallest, largest)
        self.per_unit: float | None = None

    def saw(self, units: int, seconds: float) -> None:
        """Learn from a chunk that is done."""
        found = seconds / units
        old = found if self.per_unit is None else self.per_unit
        self.per_unit = NEWEST * found + (1.0 - NEWEST) * old

    def next(self, left: int, workers: int) -> int:
        """Give the units of the next chunk.

        Parameters
        ----------
        left : int
            Units that no worker has yet. Towards the end chunks get smaller, so that
            workers end together.
        workers : int
            Who share them.
        """
        if self.per_unit is None:
            return self.smallest
        fitting = self.largest
        if self.per_unit * self.largest > self.seconds:
            fitting = int(self.seconds / self.per_unit)
        share = math.ceil(left / (2 * max(workers, 1)))
        return max(self.smallest, min(fitting, share))
