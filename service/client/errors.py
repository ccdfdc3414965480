"""What the service answers as problem documents (RFC 9457), as the errors of the local API."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

from lobefit.kernels.errors import (
    DeviceError,
    FitError,
    LobefitError,
    MeasurementError,
    ModelError,
)

__all__ = ["ServiceError", "error_of", "refused_as"]

# Slugs that say which error of the local API it is.
KINDS: Mapping[str, type[LobefitError]] = {
    "unknown-model": ModelError,
    "invalid-model": ModelError,
    "impossible-fit": FitError,
    "no-device": DeviceError,
}


class ServiceError(LobefitError):
    """The service cannot be reached, or answered that it cannot do what was asked.

    What is wrong with a measurement, a model or a fit is raised as `MeasurementError`,
    `ModelError` or `FitError`, as without the service.

    Parameters
    ----------
    message : str
        What happened and what to do.
    status : int, optional
        HTTP status of the answer; None where there was none.
    title : str, optional
        Kind of problem, in words.
    slug : str, optional
        Kind of problem, for programs: "not-found", "queue-full", ...
    request_id : str, optional
        Under which the service logged the request.
    """

    def __init__(
        self,
        message: str,
        *,
        status: int | None = None,
        title: str | None = None,
        slug: str | None = None,
        request_id: str | None = None,
    ) -> None:
        self.message = message
        self.status = status
        self.title = title
        self.slug = slug
        self.request_id = request_id
        super().__init__(message)

    def __str__(self) -> str:
        """Give the message, the status and the id to look for in the service's log."""
        facts = [f"HTTP {self.status}"] if self.status is not None else []
        if self.request_id:
            facts.append(f"request {self.request_id}")
        return f"{self.message} ({', '.join(facts)})" if facts else self.message


def error_of(problem: Mapping[str, Any], status: int | None = None) -> LobefitError:
    """Turn a problem document into the error that the local API would raise.

    Parameters
    ----------
    problem : mapping
        As the service answered or stored it; members of a wrong type count as missing.
    status : int, optional
        HTTP status of the answer, where there was one.

    Returns
    -------
    LobefitError
        To be raised.
    """
    slug = _text(problem, "type", "").rpartition("/")[2] or _text(problem, "slug", "")
    title = _text(problem, "title", "") or None
    detail = _text(problem, "detail", "") or title or "the service gave no reason"
    places = []
    for entry in problem.get("errors") or ():
        if not isinstance(entry, Mapping) or not isinstance(entry.get("detail"), str):
            continue
        place = str(entry.get("pointer") or entry.get("parameter") or entry.get("header") or "")
        if entry["detail"] not in detail:
            places += [f"{place}: {entry['detail']}"] if place else []
        elif place.startswith("/items/"):
            # Said in detail already, but not of which of many.
            places.append(f"see {place}")
    message = "; ".join([detail, *places])
    if slug == "invalid-measurement":
        row = problem.get("row")
        return MeasurementError(
            message,
            file=_text(problem, "file"),
            row=row if isinstance(row, int) else None,
            column=_text(problem, "column"),
            text=_text(problem, "text"),
            expected=_text(problem, "expected"),
        )
    if slug in KINDS:
        return KINDS[slug](message)
    return ServiceError(
        message,
        status=status,
        title=title,
        slug=slug or None,
        request_id=_text(problem, "instance"),
    )


@contextmanager
def refused_as(kind: type[LobefitError]) -> Iterator[None]:
    """Raise what the service calls an invalid request as the local API does."""
    try:
        yield
    except ServiceError as error:
        if error.slug != "invalid-request":
            raise
        raise kind(error.message) from None


def _text(problem: Mapping[str, Any], name: str, default: str | None = None) -> Any:
    value = problem.get(name)
    return value if isinstance(value, str) else default
