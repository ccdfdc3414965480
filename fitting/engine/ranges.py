"""Ranges of numbered units: what is left of them, cut into chunks from the front."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable

__all__ = ["Ranges", "without"]

Range = tuple[int, int]


def without(wanted: Iterable[Range], taken: Iterable[Range]) -> list[Range]:
    """Give what is left of ranges, both in order and each without overlaps.

    Parameters
    ----------
    wanted, taken : iterable of (int, int)
        (first, stop).
    """
    left: list[Range] = []
    holes = list(taken)
    at = 0
    for first, stop in wanted:
        while at < len(holes) and holes[at][1] <= first:
            at += 1
        k = at
        while first < stop:
            if k == len(holes) or holes[k][0] >= stop:
                left.append((first, stop))
                break
            if holes[k][0] > first:
                left.append((first, holes[k][0]))
            first = holes[k][1]
            k += 1
    return left


class Ranges:
    """What is still to be done.

    Parameters
    ----------
    ranges : iterable of (int, int)
        (first, stop), in order.
    """

    def __init__(self, ranges: Iterable[Range]) -> None:
        self._left = deque(r for r in ranges if r[0] < r[1])
        self.count = sum(stop - first for first, stop in self._left)

    def take(self, most: int) -> Range:
        """Cut off at most so many units at the front."""
        first, stop = self._left.popleft()
        cut = min(stop, first + max(most, 1))
        if cut < stop:
            self._left.appendleft((cut, stop))
        self.count -= cut - first
        return first, cut
