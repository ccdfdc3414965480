"""What the service answers: the shapes of its resources."""

from __future__ import annotations

from typing import Any, Generic, Literal, TypeVar

from pydantic import BaseModel, ConfigDict, Field

from lobefit.service.rows import State
from lobefit.service.schemas import ChartRequest, FitRequest

__all__ = [
    "Artefact",
    "Batch",
    "BatchPage",
    "Chart",
    "ChartPage",
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
]

T = TypeVar("T")


class _Page(BaseModel, Generic[T]):
    items: list[T]
    next: str | None = Field(description="Cursor of the next page; null on the last one.")


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


class MeasurementPage(_Page[Measurement]):
    """Measurements, the newest first."""


class Progress(BaseModel):
    """What a running fit or chart does."""

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
    """A file that a fit or a chart made."""

    name: str
    bytes: int
    media_type: str
    sha256: str
    href: str


class _Job(BaseModel):
    id: str
    name: str | None
    state: State
    created: str
    started: str | None
    ended: str | None
    attempts: int
    position: int | None = Field(description="Place in the queue, from 1.")
    progress: Progress | None
    problem: dict[str, Any] | None = Field(description="Why it failed.")
    artefacts: list[Artefact]


class Fit(_Job):
    """A fit; `result` and `posterior` are in the answer about one fit only."""

    measurement: str
    request: FitRequest
    batch: str | None = Field(description="The batch that it came with.")
    best: str | None = Field(description="The simplest model that is good enough.")
    verdict: str | None
    converged: bool | None = Field(description="Of the posterior.")
    result: dict[str, Any] | None = Field(None, description="The document report.json.")
    posterior: dict[str, Any] | None = Field(None, description="The document posterior.json.")


class FitPage(_Page[Fit]):
    """Fits, the newest first."""


class Chart(_Job):
    """A chart of speed against accuracy; `result` is in the answer about one chart only."""

    measurement: str | None = Field(description="Null where a truth was simulated.")
    request: ChartRequest
    answer: str | None = Field(description="Which fit keeps within the tolerance, and its price.")
    finding: str | None = Field(description="What the choices of how to fit come to.")
    result: dict[str, Any] | None = Field(None, description="The document chart.json.")


class ChartPage(_Page[Chart]):
    """Charts, the newest first."""


class Counts(BaseModel):
    """How many fits are in each state; deleted ones count nowhere."""

    queued: int
    running: int
    done: int
    failed: int
    cancelled: int


class Batch(BaseModel):
    """Fits that were sent in together."""

    id: str
    name: str | None
    created: str
    ended: str | None = Field(description="When the last fit ended, once all have.")
    state: Literal["queued", "running", "done", "cancelled"] = Field(
        description='"done" or "cancelled" once every fit has ended, however it did.'
    )
    total: int
    counts: Counts
    seconds_left: float | None = Field(
        description="As it went so far; null before the first fit has ended."
    )


class BatchPage(_Page[Batch]):
    """Batches, the newest first."""


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
