"""What the routes raise, turned into problem documents."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from starlette.exceptions import HTTPException
from starlette.responses import Response
from starlette.routing import Match

from lobefit.service.problems import MOST_ERRORS, Problem, pointer
from lobefit.service.rows import InUse, KeyConflict, NotFound, QueueFull, StoreError, StoreFull

__all__ = ["add_handlers"]

_STORE: Sequence[tuple[type[StoreError], str]] = (
    (NotFound, "not-found"),
    (InUse, "conflict"),
    (KeyConflict, "conflict"),
    (QueueFull, "queue-full"),
    (StoreFull, "storage-full"),
)
_PLACES = {"query": "parameter", "path": "parameter", "header": "header"}


def add_handlers(app: FastAPI) -> None:
    """Make an application answer with problem documents only."""
    app.add_exception_handler(Problem, _problem)
    app.add_exception_handler(StoreError, _store_error)
    app.add_exception_handler(RequestValidationError, _invalid)
    app.add_exception_handler(HTTPException, _http_error)


async def _problem(request: Request, error: Exception) -> Response:
    # A body may still be on its way: the edge reads it away once it has answered.
    raise error


async def _store_error(request: Request, error: Exception) -> Response:
    for kind, slug in _STORE:
        if isinstance(error, kind):
            headers = {"Retry-After": "5"} if slug == "queue-full" else None
            raise Problem(slug, str(error), headers=headers) from error
    raise error


async def _invalid(request: Request, error: Exception) -> Response:
    assert isinstance(error, RequestValidationError)
    errors = [_place(e, error.body) for e in error.errors()[:MOST_ERRORS]]
    named = next(iter(errors[0].values()))
    raise Problem("invalid-request", f"{named}: {errors[0]['detail']}", errors=errors)


def _place(error: Any, body: Any) -> dict[str, str]:
    """Say where a value is wrong; the value itself is not repeated."""
    where, *steps = error["loc"]
    detail = error["msg"].removeprefix("Value error, ")
    if where in _PLACES:
        return {_PLACES[where]: ".".join(str(s) for s in steps), "detail": detail}
    found: list[str | int] = []
    for step in steps:
        # Steps that are names of pydantic's own choices are not in the body.
        if (isinstance(body, dict) and step in body) or (
            isinstance(body, list) and isinstance(step, int) and step < len(body)
        ):
            body = body[step]
            found.append(step)
        elif error["type"] == "missing" and step == steps[-1]:
            found.append(step)
    return {"pointer": pointer(found), "detail": detail}


async def _http_error(request: Request, error: Exception) -> Response:
    assert isinstance(error, HTTPException)
    if error.status_code == 405:
        return _other_method(request)
    if error.status_code == 404:
        raise Problem("not-found", f"there is nothing at {request.url.path}")
    if request.headers.get("content-type", "").startswith("multipart/"):
        raise Problem("malformed-form", str(error.detail))
    raise Problem("bad-request", str(error.detail))


def _other_method(request: Request) -> Response:
    """Answer OPTIONS, and refuse other methods, with all that the path allows."""
    allowed = {"OPTIONS"}
    for method in ("GET", "POST", "DELETE"):
        scope = {**request.scope, "method": method}
        if any(route.matches(scope)[0] is Match.FULL for route in request.app.routes):
            allowed |= {method, "HEAD"} if method == "GET" else {method}
    allow = ", ".join(sorted(allowed))
    if request.method == "OPTIONS":
        return Response(status_code=204, headers={"Allow": allow})
    raise Problem(
        "method-not-allowed",
        f"{request.method} is not possible here; {allow} are",
        headers={"Allow": allow},
    )
