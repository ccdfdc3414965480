"""A worker for `benchmarks.kills` which notices when a job runs twice at once.

``python -m benchmarks.kills_worker --data-dir DIR --kinds fit --name w1``; with ``LOBEFIT_FAKE``
set it does no fits but five steps of 20 ms with a file at the end, so that killing is quick.
"""

from __future__ import annotations

import fcntl
import hashlib
import json
import os
import sys
import time
from collections.abc import Callable

from lobefit.service import work
from lobefit.service.claim import Made
from lobefit.service.task import Outcome, Task, Work
from lobefit.service.worker import main

__all__ = ["fake", "made_of", "watched"]

STEPS, STEP = 5, 0.02


def fake(task: Task) -> Outcome:
    """Take a tenth of a second and make a file that follows from the request."""
    if task.kind == "catalogue":
        item = {"name": "lambert", "title": "Lambert", "variants": [], "options": {}}
        return Outcome({"items": [item]})
    for step in range(STEPS):
        task.tell({"stage": "fit", "done": step, "total": STEPS, "label": "fake", "seconds": 0.0})
        time.sleep(STEP)
    path = task.folder / "report.json"
    path.write_text(json.dumps(made_of(task.request["name"])))
    return Outcome({"best": "lambert"}, (Made(path, "application/json"),))


def made_of(name: str) -> dict[str, str]:
    """Give the report of a fake job: 10 kB that nothing else has."""
    digest = hashlib.sha256(name.encode()).hexdigest()
    return {"best": "lambert", "name": name, "padding": digest * 160}


def watched(work_of: Callable[[str], Work]) -> Callable[[str], Work]:
    """Note in a file of the job each time that another process does the same job."""

    def wrapped(kind: str) -> Work:
        def perform(task: Task) -> Outcome:
            alone = os.open(task.folder.parent / "alone", os.O_CREAT | os.O_RDWR, 0o600)
            try:
                fcntl.flock(alone, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                overlaps = task.store.files.root / "overlaps"
                with overlaps.open("a", encoding="ascii") as file:
                    file.write(f"{task.folder}\n")
            try:
                return work_of(kind)(task)
            finally:
                os.close(alone)

        return perform

    return wrapped


if __name__ == "__main__":
    if os.environ.get("LOBEFIT_FAKE"):
        sys.exit(main(work_of=watched(lambda kind: fake), warm=lambda kinds: "no device"))
    sys.exit(main(work_of=watched(work.work_of)))
