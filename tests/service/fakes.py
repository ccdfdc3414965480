"""Jobs that need no device, and a worker process that does them."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

from lobefit.service.claim import Made
from lobefit.service.rows import ENDED, JobRow
from lobefit.service.store import Store
from lobefit.service.task import Outcome, Refused, Stopped, Task, Work

__all__ = ["COMMAND", "fake_work", "start_worker", "until", "wait_for"]

COMMAND = (sys.executable, str(Path(__file__)))


def fake_work(kind: str) -> Work:
    """Do what the request says: steps of so many seconds, or some way to go wrong."""
    return _fake


def _fake(task: Task) -> Outcome:
    wanted = task.request
    with (task.store.files.root / "began").open("a", encoding="ascii") as log:
        log.write(f"{wanted.get('name', '')} {os.getpid()}\n")
    how = wanted.get("how")
    if how == "die":
        os._exit(9)
    if how == "break":
        raise ZeroDivisionError("a fault")
    if how == "refuse":
        raise Refused("invalid-request", "not like this")
    if how == "hang":
        time.sleep(60)
    if how == "grow":
        ballast = bytearray(os.urandom(1 << 20) * 64)
    steps = wanted.get("steps", 1)
    done = 0
    try:
        for done in range(steps):
            task.tell({"stage": "fit", "done": done, "total": steps, "label": "step"})
            time.sleep(wanted.get("step", 0.01))
    except Stopped:
        steps = done
    if how == "grow":
        del ballast
    path = task.folder / "report.json"
    path.write_text(f'{{"steps": {steps}}}', encoding="ascii")
    return Outcome({"best": "lambert", "steps": steps}, (Made(path, "application/json"),))


def start_worker(folder: Path, name: str, *options: str) -> subprocess.Popen[bytes]:
    """Start a process that does fake fits."""
    return subprocess.Popen(
        [*COMMAND, "--data-dir", str(folder), "--kinds", "fit", "--name", name, *options]
    )


def until(condition: Callable[[], bool], seconds: float = 20.0) -> None:
    """Wait for a condition; fail where it does not come about."""
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "it did not come about"
        time.sleep(0.01)


def wait_for(store: Store, id: str, seconds: float = 20.0) -> JobRow:
    """Wait for the end of a job."""
    until(lambda: store.job(id).state in ENDED, seconds)
    return store.job(id)


if __name__ == "__main__":
    from lobefit.service.worker import main

    sys.exit(main(work_of=fake_work, warm=lambda kinds: "no device"))
