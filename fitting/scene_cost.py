"""What a frame costs: measured seconds.

All combinations take turns, every other round backwards, so that a machine that slows down does so
for all. A round is the time that the device takes to shade the points and to make pixels of them.
Beside it the work is counted, which no other process disturbs: each number that is read or written
for a shaded point or a pixel counts 1, each light at a shaded point `PER_LIGHT`, about as they
compare in time under PoCL.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["Cost", "counted_work", "take_turns"]

Array = NDArray[np.float64]

MOST_ROUNDS = 101
PER_LIGHT = 6
PER_POINT = 12  # position, normal, tangent and view
# Read for each value of a pixel: the colour and which it is; of three corners, with their weights.
PER_VALUE = {"flat": 2, "gouraud": 9, "phong": 0}


@dataclass(frozen=True, eq=False)
class Cost:
    """What a frame of one combination takes.

    Attributes
    ----------
    seconds : ndarray, shape (rounds,)
        Of each round.
    points : int
        Shaded points: triangles, vertices or pixels.
    work : int
        See `counted_work`.
    """

    seconds: Array
    points: int
    work: int

    @property
    def fastest(self) -> float:
        """Shortest of the rounds."""
        return float(self.seconds.min())

    @property
    def median(self) -> float:
        """Median of the rounds."""
        return float(np.median(self.seconds))

    @property
    def quartiles(self) -> tuple[float, float]:
        """Lower and upper quartile of the rounds."""
        low, high = np.percentile(self.seconds, (25, 75))
        return float(low), float(high)


def counted_work(shading: str, points: int, lights: int, pixels: int, channels: int) -> int:
    """Count the work of a frame.

    Parameters
    ----------
    shading : {"flat", "gouraud", "phong"}
    points, lights : int
        Shaded points, and the lights at each, those that an environment is cut into included.
    pixels, channels : int
        Pixels that show the object; each has a diffuse and a specular part per channel.
    """
    values = 2 * channels
    return points * (PER_POINT + values + PER_LIGHT * lights) + pixels * values * PER_VALUE[shading]


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
