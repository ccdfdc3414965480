"""What the store gives back and what it refuses with; plain records, standard library only."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

from lobefit.kernels.errors import LobefitError

__all__ = [
    "CHART",
    "ENDED",
    "FIT",
    "MEBIBYTE",
    "WAITING",
    "ArtefactRow",
    "BatchRow",
    "EventRow",
    "InUse",
    "JobRow",
    "KeyConflict",
    "LeaseLost",
    "Limits",
    "MeasurementRow",
    "NotFound",
    "ProcessRow",
    "QueueFull",
    "State",
    "StoreError",
    "StoreFull",
]

State = Literal["queued", "running", "done", "failed", "cancelled"]
ENDED: tuple[State, ...] = ("done", "failed", "cancelled")
FIT, CHART = "fit", "chart"
WAITING = (FIT, CHART)
"""The kinds that wait in the queue; all other kinds are quick and wait for nobody's fit."""

MEBIBYTE = 1 << 20


class StoreError(LobefitError):
    """The data folder or its database cannot be used; the message says why."""


class StoreFull(StoreError):  # noqa: N818
    """No space is left for what was to be kept; what was there before is sound."""


class NotFound(StoreError):  # noqa: N818
    """There is no such measurement, job or artefact."""


class InUse(StoreError):  # noqa: N818
    """A measurement that a waiting or running fit needs, or a job that has not ended."""


class QueueFull(StoreError):  # noqa: N818
    """The queue has its full length; try again later."""


class KeyConflict(StoreError):  # noqa: N818
    """An idempotency key came again with another request."""


class LeaseLost(StoreError):  # noqa: N818
    """A job that this worker no longer holds; nothing of it was written."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """Bounds of the store and its jobs.

    Attributes
    ----------
    queue : int
        Fits and charts that may wait, of everybody.
    queue_per_owner : int
        Fits and charts that one owner may have waiting.
    quick : int
        Quick jobs that may wait.
    attempts : int
        How often a job is begun before it counts as failed.
    lease : float
        Seconds without a heartbeat after which a job is taken from its worker.
    heartbeat : float
        Seconds between heartbeats; a lease must hold several.
    wall : float
        Seconds that one attempt may take.
    memory : int
        Resident bytes of a worker above which its job fails.
    answers : float
        Seconds for which the answer of a quick job is kept.
    reserve : int or None
        Bytes of the disk that uploads and new jobs leave free, so that running ones can
        end; None takes 2 % of it, 2 MiB at least and 64 MiB at most.
    """

    queue: int = 2000
    queue_per_owner: int = 1000
    quick: int = 1000
    attempts: int = 3
    lease: float = 10.0
    heartbeat: float = 0.25
    wall: float = 3600.0
    memory: int = 4096 * MEBIBYTE
    answers: float = 600.0
    reserve: int | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class MeasurementRow:
    """A stored measurement; `created` in seconds since the epoch."""

    id: str
    name: str
    bytes: int
    created: float
    summary: dict[str, Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class JobRow:
    """A job as it stands; times in seconds since the epoch.

    Attributes
    ----------
    progress : dict or None
        What it was last heard to do.
    problem : dict or None
        Why it failed: slug, title, detail and, for a file, its place.
    result : dict or None
        The answer of a quick job, or what a fit or a chart says in a few words.
    cancelling : bool
        It was told to stop and has not stopped yet.
    batch : str or None
        Which batch it belongs to.
    """

    id: str
    kind: str
    request: dict[str, Any]
    state: State
    created: float
    started: float | None
    ended: float | None
    attempts: int
    progress: dict[str, Any] | None
    problem: dict[str, Any] | None
    result: dict[str, Any] | None
    measurement: str | None
    owner: str
    cancelling: bool
    batch: str | None


@dataclass(frozen=True, slots=True, kw_only=True)
class BatchRow:
    """Fits that were sent in together; times in seconds since the epoch.

    Attributes
    ----------
    counts : dict of str to int
        How many of its fits are in each state; deleted ones count nowhere.
    cancelled : bool
        It was told to stop.
    started, ended : float or None
        When the first of its fits began, and when the last one ended once all have.
    """

    id: str
    name: str | None
    created: float
    cancelled: bool
    counts: dict[State, int]
    started: float | None
    ended: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class EventRow:
    """Something that happened to a job; `seq` grows."""

    seq: int
    type: Literal["state", "progress"]
    data: dict[str, Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class ArtefactRow:
    """A file that a job made."""

    name: str
    bytes: int
    sha256: str
    media_type: str


@dataclass(frozen=True, slots=True, kw_only=True)
class ProcessRow:
    """A worker process; `age` is seconds since its last heartbeat, None after a reboot."""

    name: str
    pid: int
    kinds: tuple[str, ...]
    device: str
    state: Literal["starting", "idle", "busy"]
    age: float | None
    rss: int
