"""Times of many tasks, run turn by turn: a machine that slows down does so for all of them."""

from __future__ import annotations

from collections.abc import Callable, Sequence

__all__ = ["LIMIT_S", "Clock", "interleaved"]

Clock = Callable[[], float]

# A task that has taken this long is not run again: nobody chooses it for its speed.
LIMIT_S = 1.0


def interleaved(
    tasks: Sequence[Callable[[], object]], repeats: int, clock: Clock, calls: int = 1
) -> list[tuple[float, ...]]:
    """Time tasks that were run before, each `repeats` times.

    Parameters
    ----------
    tasks : sequence of callable
    repeats : int
        Rounds; every other one runs the tasks backwards.
    clock : callable
        Gives seconds.
    calls : int
        A task is called so often within its turn.

    Returns
    -------
    list of tuple of float
        Seconds per call of each round, by task. Slow tasks have fewer, at least one.
    """
    found: list[list[float]] = [[] for _ in tasks]
    for turn in range(repeats):
        for k in list(range(len(tasks)))[:: -1 if turn % 2 else 1]:
            if sum(found[k]) * calls > LIMIT_S:
                continue
            began = clock()
            for _ in range(calls):
                tasks[k]()
            found[k].append((clock() - began) / calls)
    return [tuple(times) for times in found]
