"""Medians of interleaved runs, and the machine they were taken on."""

from __future__ import annotations

import os
import platform
import statistics
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

__all__ = ["Timing", "cores", "interleave", "machine", "ratio", "single"]


@dataclass(frozen=True, slots=True)
class Timing:
    """Seconds per call of one task, one entry a round.

    Parameters
    ----------
    wall, cpu : tuple of float
        Elapsed seconds, and CPU seconds of all threads of this process.
    """

    wall: tuple[float, ...]
    cpu: tuple[float, ...]

    @property
    def median(self) -> float:
        """Median elapsed seconds per call."""
        return statistics.median(self.wall)

    @property
    def spread(self) -> tuple[float, float]:
        """Fastest and slowest round, seconds per call."""
        return min(self.wall), max(self.wall)

    def to_dict(self) -> dict[str, object]:
        """Everything measured, for JSON."""
        return {"median_s": self.median, "wall_s": list(self.wall), "cpu_s": list(self.cpu)}


def single(task: Callable[[], object], *, least_s: float = 0.0) -> tuple[float, float]:
    """Time one task once, or over as many calls as fill `least_s` seconds.

    Returns
    -------
    tuple of float
        Elapsed and CPU seconds per call.
    """
    calls = 0
    cpu = time.process_time()
    start = time.perf_counter()
    while True:
        task()
        calls += 1
        elapsed = time.perf_counter() - start
        if elapsed >= least_s:
            return elapsed / calls, (time.process_time() - cpu) / calls


def interleave(
    tasks: Mapping[str, Callable[[], object]],
    *,
    rounds: int = 7,
    warmup: int = 1,
    least_s: float = 0.0,
) -> dict[str, Timing]:
    """Time several tasks turn by turn.

    Every round runs each task once and every other round runs them backwards, so that a machine
    that speeds up or slows down meanwhile does so for all of them.

    Parameters
    ----------
    tasks : mapping of str to callable
        What to time, by name.
    rounds : int
        Timed rounds.
    warmup : int
        Untimed calls of each task before the first round (compilation, caches, page faults).
    least_s : float
        A task is called again within its turn until this many seconds have passed.
    """
    for task in tasks.values():
        for _ in range(warmup):
            task()
    wall: dict[str, list[float]] = {name: [] for name in tasks}
    cpu: dict[str, list[float]] = {name: [] for name in tasks}
    for turn in range(rounds):
        for name in list(tasks)[:: -1 if turn % 2 else 1]:
            elapsed, busy = single(tasks[name], least_s=least_s)
            wall[name].append(elapsed)
            cpu[name].append(busy)
    return {name: Timing(tuple(wall[name]), tuple(cpu[name])) for name in tasks}


def ratio(slow: Timing, fast: Timing) -> float:
    """Median over the rounds of how many times longer `slow` took."""
    return statistics.median(a / b for a, b in zip(slow.wall, fast.wall, strict=True))


def cores() -> int:
    """CPU cores this process may run on."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def machine() -> dict[str, str]:
    """CPU, cores, and versions, for the head of a report."""
    name = platform.processor() or platform.machine()
    info = Path("/proc/cpuinfo")
    if info.exists():
        for line in info.read_text(encoding="utf-8", errors="replace").splitlines():
            if line.startswith("model name"):
                name = line.partition(":")[2].strip()
                break
    return {
        "cpu": name,
        "cores": str(cores()),
        "system": f"{platform.system()} {platform.machine()}",
        "python": platform.python_version(),
        "numpy": np.__version__,
    }
