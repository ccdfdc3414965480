"""Table and picture of a batch, over the fits that have ended by now."""

from __future__ import annotations

import json
from functools import lru_cache
from pathlib import Path
from typing import Any

from lobefit.fitting.batch_figure import write_batch_figure
from lobefit.fitting.batch_table import REPORT, item_row, table_makers
from lobefit.service.rows import ENDED, JobRow, NotFound
from lobefit.service.store import Store
from lobefit.service.task import Outcome, Refused, Task, file_answer
from lobefit.service.work.files import MEDIA_TYPES

__all__ = ["perform"]

STATUS = {"done": "fitted", "failed": "failed", "cancelled": "cancelled"}
# Rows of reports that are kept, a few kilobytes each: a page asks again while a batch runs.
KEPT_ROWS = 2000


def perform(task: Task) -> Outcome:
    """Write the file that is asked for, as ``lobefit batch`` does."""
    id, name = task.request["batch"], task.request["file"]
    task.store.batch(id)
    jobs = task.store.batch_jobs(id)
    rows = [row for job in jobs if job.state in ENDED and (row := _row(task.store, job))]
    path = task.folder / name
    if name == "summary.png":
        if not rows:
            raise Refused("conflict", "no fit of the batch has ended yet; ask again later")
        write_batch_figure(path, rows)
    else:
        table_makers(rows)[name](path)
    return file_answer(path, MEDIA_TYPES[path.suffix])


def _row(store: Store, job: JobRow) -> dict[str, Any] | None:
    """Give the row of a fit, or None where it was deleted since it was listed."""
    try:
        made, file = _of_report(store.artefact_path(job.id, REPORT))
    except (NotFound, OSError):
        if job.state == "done":
            return None
        made, file = {"model": None}, _file(store, job)
    reason = "" if made["model"] else "cancelled before its end"
    return {
        "name": job.request.get("name") or file,
        "file": file,
        "status": STATUS[job.state],
        **made,
        "reason": (job.problem or {}).get("detail", reason),
    }


@lru_cache(maxsize=KEPT_ROWS)
def _of_report(path: Path) -> tuple[dict[str, Any], str]:
    report = json.loads(path.read_text(encoding="utf-8"))
    return item_row(report), report["measurement"]["file"] or ""


def _file(store: Store, job: JobRow) -> str:
    try:
        return store.measurement(job.request["measurement"]).name
    except NotFound:
        return ""
