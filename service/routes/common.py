"""What the routes have in common: parameters, and the problems that an operation documents."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Annotated, Any

from fastapi import APIRouter, Depends, Header, Path, Query
from starlette.responses import JSONResponse

from lobefit.service.problems import MEDIA_TYPE, MOST_ERRORS, PROBLEMS, Problem, pointer
from lobefit.service.store import Store
from lobefit.service.strict_json import StrictRoute

__all__ = [
    "BINARY",
    "SUBMITTED",
    "Cursor",
    "Id",
    "Keep",
    "Key",
    "Limit",
    "MeasurementQuery",
    "ModelQuery",
    "check_measurements",
    "problems",
    "router",
    "submitted",
]

_ID = re.compile(r"[0-9A-Za-z-]{1,64}")


def router(tag: str) -> APIRouter:
    """Give a router whose JSON bodies are read strictly."""
    return APIRouter(tags=[tag], route_class=StrictRoute)


def problems(*slugs: str) -> dict[int | str, dict[str, Any]]:
    """Describe problem answers for the OpenAPI document.

    Parameters
    ----------
    *slugs : str
        Keys of `lobefit.service.problems.PROBLEMS`, besides those of every operation.
    """
    by_status: dict[int, list[str]] = {}
    for slug in (*slugs, "bad-request", "unauthorized", "forbidden", "too-large", "internal"):
        titles = by_status.setdefault(PROBLEMS[slug][0], [])
        if PROBLEMS[slug][1] not in titles:
            titles.append(PROBLEMS[slug][1])
    schema = {"$ref": "#/components/schemas/Problem"}
    return {
        status: {
            "description": ". ".join(titles) + ".",
            "content": {MEDIA_TYPE: {"schema": schema}},
        }
        for status, titles in sorted(by_status.items())
    }


def _id(id: Annotated[str, Path(description="Id.", max_length=200)]) -> str:
    # Whatever cannot be an id is as unknown as any other that was never given out.
    if not _ID.fullmatch(id):
        raise Problem("not-found", "there is nothing with this id")
    return id


BINARY = {"schema": {"type": "string", "format": "binary"}}
SUBMITTED = (
    "malformed-json",
    "not-found",
    "request-timeout",
    "conflict",
    "unsupported-media-type",
    "unknown-model",
    "invalid-request",
    "queue-full",
    "storage-full",
)
"""What can be wrong where something is put into the queue."""

Id = Annotated[str, Depends(_id)]
Key = Annotated[
    str | None,
    Header(
        alias="Idempotency-Key",
        max_length=200,
        pattern=r"^[\x21-\x7e]+$",
        description="The same key with the same body makes it once, however often it is sent.",
    ),
]
MeasurementQuery = Annotated[
    str | None, Query(pattern=r"^[0-9a-f]{64}$", description="Of this measurement only.")
]
Keep = Annotated[bool, Query(description="Cancel only: what has ended is refused (409).")]
Limit = Annotated[int, Query(ge=1, le=200, description="Most items on a page.")]
Cursor = Annotated[
    str | None,
    Query(max_length=18, pattern=r"^[0-9]+$", description='"next" of the page before.'),
]
ModelQuery = Annotated[
    str | None,
    Query(
        max_length=120,
        pattern=r"^[\x21-\x7e]+$",
        description="Name of a fitted candidate; the best where left out.",
    ),
]


def check_measurements(store: Store, given: Iterable[tuple[str, Sequence[str | int]]]) -> None:
    """Refuse measurements that do not exist, each with its place in the body.

    Raises
    ------
    Problem
        "not-found", with pointers.
    """
    places = list(given)
    missing = store.missing({id for id, _ in places})
    detail = "there is no such measurement; upload it first"
    errors = [
        {"pointer": pointer(place), "detail": detail} for id, place in places if id in missing
    ]
    if errors:
        raise Problem("not-found", detail, errors=errors[:MOST_ERRORS])


def submitted(resource: Mapping[str, Any], path: str, *, new: bool) -> JSONResponse:
    """Answer that something waits in the queue, or that its key has made it before."""
    location = {"Location": f"{path}/{resource['id']}"}
    return JSONResponse(resource, 202 if new else 200, headers=location)
