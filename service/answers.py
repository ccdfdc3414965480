"""How rows of the store become what the service answers."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any

from pydantic import BaseModel

from lobefit.service.problems import Problem
from lobefit.service.resources import Chart, Fit
from lobefit.service.rows import CHART, FIT, BatchRow, JobRow, MeasurementRow
from lobefit.service.store import Store

__all__ = ["WAITERS", "Waiter", "batch_resource", "job_resource", "measurement_resource"]


@dataclass(frozen=True, slots=True)
class Waiter:
    """A kind that waits in the queue, as a client sees it.

    Attributes
    ----------
    noun : str
        What one is called.
    path : str
        Of the list.
    resource : type
        What is answered.
    said : tuple of str
        Members of the resource that the job's result has.
    documents : mapping of str to str
        Members in the answer about one alone, and the artefacts that they repeat.
    files : tuple of str
        Artefacts that most of them have.
    """

    noun: str
    path: str
    resource: type[BaseModel]
    said: tuple[str, ...]
    documents: Mapping[str, str]
    files: tuple[str, ...]


WAITERS: Mapping[str, Waiter] = {
    FIT: Waiter(
        "fit",
        "/v1/fits",
        Fit,
        ("best", "verdict", "converged"),
        {"result": "report.json", "posterior": "posterior.json"},
        ("report.json", "fit.png", "lobes.exr", "posterior.nc"),
    ),
    CHART: Waiter(
        "chart",
        "/v1/charts",
        Chart,
        ("answer", "finding"),
        {"result": "chart.json"},
        ("chart.json", "chart.png"),
    ),
}
"""By kind."""


def _time(seconds: float | None) -> str | None:
    if seconds is None:
        return None
    moment = datetime.fromtimestamp(seconds, UTC)
    return moment.isoformat(timespec="milliseconds").replace("+00:00", "Z")


def measurement_resource(row: MeasurementRow) -> dict[str, Any]:
    """Give the members of a `Measurement`."""
    kept = row.summary
    return {
        "id": row.id,
        "name": row.name,
        "bytes": row.bytes,
        "created": _time(row.created),
        "summary": kept.get("summary", {}),
        "checks": kept.get("checks"),
        "warnings": kept.get("warnings", []),
    }


def job_resource(store: Store, row: JobRow) -> dict[str, Any]:
    """Give the members of a `Fit` or a `Chart` but for its documents."""
    waiter, said = WAITERS[row.kind], row.result or {}
    return {
        "id": row.id,
        "name": row.request.get("name"),
        "measurement": row.measurement or row.request.get("measurement"),
        **({"batch": row.batch} if row.kind == FIT else {}),
        "request": row.request,
        "state": row.state,
        "created": _time(row.created),
        "started": _time(row.started),
        "ended": _time(row.ended),
        "attempts": row.attempts,
        "position": store.position(row.id) if row.state == "queued" else None,
        "progress": row.progress,
        "problem": None if row.problem is None else Problem.stored(row.problem).document(),
        **{name: said.get(name) for name in waiter.said},
        "artefacts": [
            {
                "name": a.name,
                "bytes": a.bytes,
                "media_type": a.media_type,
                "sha256": a.sha256,
                "href": f"{waiter.path}/{row.id}/artefacts/{a.name}",
            }
            for a in store.artefacts(row.id)
        ],
    }


def batch_resource(row: BatchRow) -> dict[str, Any]:
    """Give the members of a `Batch`."""
    counts, total = row.counts, sum(row.counts.values())
    waits = counts["queued"] + counts["running"]
    left = None
    if waits == 0:
        state = "cancelled" if row.cancelled else "done"
    else:
        state = "queued" if waits == total and not counts["running"] else "running"
        if row.started is not None and total > waits:
            left = round(max(0.0, time.time() - row.started) / (total - waits) * waits, 1)
    return {
        "id": row.id,
        "name": row.name,
        "created": _time(row.created),
        "ended": _time(row.ended),
        "state": state,
        "total": total,
        "counts": counts,
        "seconds_left": left,
    }
