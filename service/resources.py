"""What the service answers: resources, and how rows of the store become them."""

from __future__ import annotations

from datetime import UTC, datetime
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field

from lobefit.service.problems import Problem
from lobefit.service.rows import ArtefactRow, JobRow, MeasurementRow
from lobefit.service.schemas import FitRequest
from lobefit.service.store import Store

__all__ = [
    "Artefact",
    "Curves",
    "Fit",
    "FitPage",
    "Health",
    "Measurement",
    "MeasurementPage",
    "ModelItem",
    "ModelList",
    "Progress",
    "Ready",
    "Sphere",
    "Table",
    "Values",
    "artefact_resource",
    "fit_resource",
    "measurement_resource",
]

State = Literal["queued", "running", "done", "failed", "cancelled"]


class Measurement(BaseModel):
    """An uploaded measurement."""

    id: str = Field(description="SHA-256 of the decompressed bytes.")
    name: str
    bytes: int
    created: str = Field(description="RFC 3339, UTC.")
    summary: dict[str, Any] = Field(description="Channels, counts, incidences, notes.")
    checks: dict[str, Any] | None = Field(
        description="Whether it can be what it is declared to be; null where that cannot be told."
    )
    warnings: list[str]


class MeasurementPage(BaseModel):
    """Measurements, the newest first."""

    items: list[Measurement]
    next: str | None = Field(description="Cursor of the next page.")


class Progress(BaseModel):
    """What a running fit does."""

    model_config = ConfigDict(extra="allow")

    stage: str
    done: int
    total: int
    label: str
    evaluations: int | None = None
    tau: float | None = None
    acceptance: float | None = None
    ess: float | None = None
    seconds: float | None = None
    seconds_left: float | None = None


class Artefact(BaseModel):
    """A file that a fit made."""

    name: str
    bytes: int
    media_type: str
    sha256: str
    href: str


class Fit(BaseModel):
    """A fit; `result` and `posterior` are in the answer about one fit only."""

    id: str
    name: str | None
    measurement: str
    request: FitRequest
    state: State
    created: str
    started: str | None
    ended: str | None
    attempts: int
    position: int | None = Field(description="Place in the queue, from 1.")
    progress: Progress | None
    problem: dict[str, Any] | None = Field(description="Why it failed.")
    best: str | None = Field(description="The simplest model that is good enough.")
    verdict: str | None
    converged: bool | None = Field(description="Of the posterior.")
    artefacts: list[Artefact]
    result: dict[str, Any] | None = Field(None, description="The document report.json.")
    posterior: dict[str, Any] | None = Field(None, description="The document posterior.json.")


class FitPage(BaseModel):
    """Fits, the newest first."""

    items: list[Fit]
    next: str | None = Field(description="Cursor of the next page.")


class ModelItem(BaseModel):
    """A model with its parameters and options."""

    model_config = ConfigDict(extra="allow")

    name: str
    title: str


class ModelList(BaseModel):
    """All models."""

    items: list[ModelItem]


class Table(BaseModel):
    """Rows of a measurement, thinned evenly; degrees and 1/sr."""

    model_config = ConfigDict(extra="allow")

    theta_i_deg: list[float]
    phi_i_deg: list[float]
    theta_o_deg: list[float]
    phi_o_deg: list[float]
    channels: list[str]
    values: list[list[float | None]] = Field(description="One list per channel.")
    sigma: list[list[float | None]] | None
    total: int


class Values(BaseModel):
    """BRDF values of a model in 1/sr."""

    model_config = ConfigDict(extra="allow")

    channels: list[str]
    values: list[Any] = Field(description="One list per channel, flat in the order of `shape`.")
    shape: list[int]


class Curves(BaseModel):
    """Measured against fitted, one curve per incidence."""

    model_config = ConfigDict(extra="allow")

    model: str
    channels: list[str]
    curves: list[dict[str, Any]]


class Sphere(BaseModel):
    """A table over half-angles, for shading."""

    model_config = ConfigDict(extra="allow")


class Health(BaseModel):
    """The process answers."""

    status: Literal["ok"] = "ok"


class Ready(BaseModel):
    """Whether fits can be taken."""

    ready: bool
    device: str | None = Field(description="OpenCL device of the workers.")
    store: str = Field(description='"ok", or what is wrong.')
    free_bytes: int
    workers: int = Field(description="Worker processes that were heard of lately.")


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


def artefact_resource(fit: str, row: ArtefactRow) -> dict[str, Any]:
    """Give the members of an `Artefact`."""
    return {
        "name": row.name,
        "bytes": row.bytes,
        "media_type": row.media_type,
        "sha256": row.sha256,
        "href": f"/v1/fits/{fit}/artefacts/{row.name}",
    }


def fit_resource(store: Store, row: JobRow) -> dict[str, Any]:
    """Give the members of a `Fit` but for `result` and `posterior`."""
    said = row.result or {}
    return {
        "id": row.id,
        "name": row.request.get("name"),
        "measurement": row.measurement or row.request.get("measurement"),
        "request": row.request,
        "state": row.state,
        "created": _time(row.created),
        "started": _time(row.started),
        "ended": _time(row.ended),
        "attempts": row.attempts,
        "position": store.position(row.id) if row.state == "queued" else None,
        "progress": row.progress,
        "problem": None if row.problem is None else Problem.stored(row.problem).document(),
        "best": said.get("best"),
        "verdict": said.get("verdict"),
        "converged": said.get("converged"),
        "artefacts": [artefact_resource(row.id, a) for a in store.artefacts(row.id)],
    }
