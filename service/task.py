"""What a worker hands to the code that does a job, and what it gets back."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lobefit.kernels.errors import (
    DeviceError,
    FitError,
    LobefitError,
    MeasurementError,
    ModelError,
)
from lobefit.service.claim import Claim, Made
from lobefit.service.rows import NotFound, StoreFull
from lobefit.service.store import Store

__all__ = [
    "Outcome",
    "Refused",
    "Stopped",
    "Task",
    "Work",
    "answer",
    "file_answer",
    "problem_of",
]

# Answers up to this many bytes are kept in the database.
SMALL = 64 << 10


class Stopped(Exception):  # noqa: N818 (nothing went wrong)
    """Raised by `Task.tell` where the job is to end; what is finished should be kept."""


class Refused(Exception):  # noqa: N818 (an answer, not a fault)
    """A job that cannot be done as it was asked for.

    Parameters
    ----------
    slug : str
        Kind of problem.
    detail : str
        What was found, and what to do.
    """

    def __init__(self, slug: str, detail: str) -> None:
        super().__init__(detail)
        self.slug = slug


@dataclass(frozen=True, slots=True)
class Outcome:
    """What came of a job: a small result, and files that go with it."""

    result: dict[str, Any] | None = None
    made: tuple[Made, ...] = ()


class Task:
    """A job while it is done.

    Attributes
    ----------
    kind : str
    request : dict
        What was asked for.
    store : Store
        To read measurements and earlier jobs.
    noticed : bool
        The work has heard that it is to end, so that it may be less than whole.
    """

    def __init__(self, store: Store, claim: Claim) -> None:
        self.store, self._claim = store, claim
        self.kind, self.request = claim.job.kind, claim.job.request
        self._latest: dict[str, Any] | None = None
        self._reason = ""
        self.noticed = False

    @property
    def folder(self) -> Path:
        """Where this attempt keeps its files; made."""
        return self._claim.folder

    def earlier(self, name: str) -> Path | None:
        """Give a file that an attempt before left."""
        return self._claim.earlier(name)

    def publish(self, made: Iterable[Made]) -> None:
        """Give out files before the end."""
        self._claim.publish(made)

    def tell(self, progress: dict[str, Any]) -> None:
        """Say where the job stands; costs nothing, the worker passes on the latest.

        Raises
        ------
        Stopped
            The job is to end.
        """
        self._latest = progress
        if self.stopped():
            raise Stopped(self._reason)

    def stopped(self) -> bool:
        """Tell whether the job is to end."""
        self.noticed = self.noticed or bool(self._reason)
        return self.noticed

    @property
    def reason(self) -> str:
        """Why it is to end: "cancel", "shutdown", "wall", "memory" or "lost"; else empty."""
        return self._reason

    def stop(self, reason: str) -> None:
        """Ask it to end; the first reason counts."""
        self._reason = self._reason or reason

    def news(self) -> dict[str, Any] | None:
        """Give the progress told since the last call."""
        latest, self._latest = self._latest, None
        return latest


Work = Callable[[Task], Outcome]


def answer(task: Task, value: dict[str, Any]) -> Outcome:
    """Give a JSON answer, in a file where it is large."""
    text = json.dumps(value, allow_nan=False, separators=(",", ":")).encode()
    if len(text) <= SMALL:
        return Outcome(value)
    path = task.folder / "answer.json"
    path.write_bytes(text)
    return file_answer(path, "application/json")


def file_answer(path: Path, media_type: str) -> Outcome:
    """Give a file as the answer."""
    return Outcome({"file": path.name, "media_type": media_type}, (Made(path, media_type),))


def problem_of(error: BaseException) -> dict[str, Any] | None:
    """Turn an error that a user can do something about into a problem, else None.

    Parameters
    ----------
    error : BaseException
        What was raised.
    """
    if isinstance(error, Refused):
        return {"slug": error.slug, "detail": str(error)}
    if isinstance(error, MeasurementError):
        return {
            "slug": "invalid-measurement",
            "detail": error.message,
            "file": error.file,
            "row": error.row,
            "column": error.column,
            "text": error.text,
            "expected": error.expected,
        }
    if isinstance(error, NotFound):
        return {"slug": "not-found", "detail": str(error)}
    if isinstance(error, StoreFull):
        return {"slug": "storage-full", "detail": str(error)}
    if isinstance(error, LobefitError):
        slugs = {ModelError: "invalid-model", FitError: "impossible-fit", DeviceError: "no-device"}
        return {"slug": slugs.get(type(error), "invalid-request"), "detail": str(error)}
    return None
