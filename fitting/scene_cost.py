"""What a frame costs: measured seconds, ties broken by the work that is counted.

All combinations take turns, every other round backwards, so that a machine that slows down does so
for all. A frame's cost is the median of its rounds: the time that the device takes to shade the
points and to make pixels of them. On a processor with vector units flat and Gouraud shading are
hardly cheaper than Phong's under few lights, since the pixels have to be filled all the same. So
costs tie that differ by no more than the median's own spread: the median, over the rounds, of the
difference within a round is not larger than two standard errors of such a median (1.86 times the
interquartile range over the root of the number of rounds, as for normal noise). A tie goes to the
simpler shading as taught (flat, Gouraud, Phong), then to fewer shaded points, fewer parameters and
the shorter median. Points alone would call Gouraud cheaper than flat, since a mesh has fewer
vertices than triangles, though it fills a pixel from three of them and not from one.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["Cost", "order_by_cost", "take_turns"]

Array = NDArray[np.float64]

SHADINGS = ("flat", "gouraud", "phong")
MOST_ROUNDS = 101
# A median's standard error is 1.253 sigma / sqrt(n), and sigma the interquartile range / 1.349.
TWO_ERRORS = 2.0 * 1.253 / 1.349


@dataclass(frozen=True, eq=False)
class Cost:
    """What a frame of one combination takes.

    Attributes
    ----------
    seconds : ndarray, shape (rounds,)
        Of each round.
    points : int
        Shaded points: triangles, vertices or pixels.
    n_parameters : int
        Free parameters of the model.
    shading : {"flat", "gouraud", "phong"}
    """

    seconds: Array
    points: int
    n_parameters: int
    shading: str

    @property
    def work(self) -> tuple[int, int, int, float]:
        """What orders costs that tie."""
        return SHADINGS.index(self.shading), self.points, self.n_parameters, self.median

    @property
    def median(self) -> float:
        """Median of the rounds."""
        return float(np.median(self.seconds))

    @property
    def quartiles(self) -> tuple[float, float]:
        """Lower and upper quartile of the rounds."""
        low, high = np.percentile(self.seconds, (25, 75))
        return float(low), float(high)

    def ties(self, faster: Cost) -> bool:
        """Tell whether it costs no more than a faster one, within the spread."""
        difference = self.seconds - faster.seconds
        low, middle, high = np.percentile(difference, (25, 50, 75))
        return bool(middle <= TWO_ERRORS * (high - low) / np.sqrt(len(difference)))


def take_turns(
    frames: Mapping[int, Callable[[], float]], least: int, seconds: float
) -> dict[int, NDArray[np.float64]]:
    """Time frames turn by turn.

    Parameters
    ----------
    frames : mapping of int to callable
        Each renders a frame and gives the seconds that it took; each was called before.
    least : int
        How often each is called at least.
    seconds : float
        More rounds follow, `MOST_ROUNDS` in all at most, until this time has passed.
    """
    found: dict[int, list[float]] = {key: [] for key in frames}
    start = time.perf_counter()
    for turn in range(max(least, MOST_ROUNDS)):
        if turn >= least and time.perf_counter() - start > seconds:
            break
        for key in list(frames)[:: -1 if turn % 2 else 1]:
            found[key].append(frames[key]())
    return {key: np.array(taken) for key, taken in found.items()}


def order_by_cost(costs: Sequence[Cost]) -> list[int]:
    """Order combinations from cheap to dear.

    Returns
    -------
    list of int
        The fastest and all that tie with it, ordered by their work; then
        the fastest of the rest with those that tie with it; and so on.
    """
    left = sorted(range(len(costs)), key=lambda k: costs[k].median)
    ordered: list[int] = []
    while left:
        fastest = costs[left[0]]
        tied = [k for k in left if k == left[0] or costs[k].ties(fastest)]
        ordered += sorted(tied, key=lambda k: costs[k].work)
        left = [k for k in left if k not in tied]
    return ordered
