"""A chart of speed against accuracy: of a measurement, or of a surface that is simulated."""

from __future__ import annotations

import time
from typing import Any

from lobefit.fitting.tradeoff import chart
from lobefit.fitting.tradeoff_subject import Subject, held_out, simulated
from lobefit.service.task import Outcome, Task
from lobefit.service.work.files import made_of
from lobefit.service.work.measured import wanted_measurement
from lobefit.service.work.simulate import check_geometry

__all__ = ["perform"]


def perform(task: Task) -> Outcome:
    """Measure every choice, and write the chart and its picture.

    A job that is to end does so between two runs of what is being timed; nothing is kept.
    """
    wanted, told = task.request, _Told(task)
    made = chart(
        _subject(task),
        models=wanted.get("models", "all"),
        metric=wanted.get("metric", "auto"),
        tolerance=wanted.get("tolerance", 0.02),
        groups=wanted.get("groups", ["fit"]),
        repeats=wanted.get("repeats", 5),
        seed=wanted.get("seed", 0),
        progress=told.stage,
        clock=told.clock,
    )
    told.stage(0, 1, "picture of the chart")
    paths = made.save(task.folder).values()
    return Outcome(
        {"answer": made.answer, "finding": made.finding}, tuple(made_of(path) for path in paths)
    )


def _subject(task: Task) -> Subject:
    truth = task.request.get("truth")
    if truth is None:
        return held_out(wanted_measurement(task)[0])
    geometry = truth.get("geometry", "in-plane")
    check_geometry(geometry)
    relative, additive = truth.get("noise", (0.02, 0.001))
    return simulated(
        truth["model"],
        truth.get("params") or {},
        geometry=geometry,
        noise=(relative, additive),
        seed=truth.get("seed", 0),
        options=truth.get("options") or None,
    )


class _Told:
    """Passes on what the chart tells, and looks at each reading of the clock whether to end."""

    def __init__(self, task: Task) -> None:
        self._task, self._began = task, time.perf_counter()
        self._latest: dict[str, Any] = {}

    def stage(self, done: int, total: int, label: str) -> None:
        """Tell what is measured next; raises `Stopped` where the job is to end."""
        self._latest = {"stage": "chart", "done": done, "total": total, "label": label}
        self.clock()

    def clock(self) -> float:
        """Give seconds; raises `Stopped` where the job is to end."""
        now = time.perf_counter()
        if self._latest:
            self._task.tell({**self._latest, "seconds": round(now - self._began, 3)})
        return now
