"""Fits: submit, look, follow, cancel, delete."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

from anyio import to_thread
from fastapi import Depends, Header, Query, Response
from starlette.responses import JSONResponse, StreamingResponse

from lobefit.service.catalogue import check_models
from lobefit.service.events import event_stream
from lobefit.service.problems import Problem
from lobefit.service.resources import Curves, Fit, FitPage, Sphere, fit_resource
from lobefit.service.routes.common import Cursor, Id, Limit, ModelQuery, problems, router
from lobefit.service.rows import ENDED, FIT, JobRow, NotFound
from lobefit.service.schemas import FitRequest
from lobefit.service.state import Shared, SharedState, owner
from lobefit.service.store import Store

__all__ = ["fit_row", "routes"]

routes = router("fits")

State = Literal["queued", "running", "done", "failed", "cancelled"]


def fit_row(store: Store, id: str) -> JobRow:
    """Give the row of a fit; other jobs are nobody's business."""
    row = store.job(id)
    if row.kind != FIT:
        raise NotFound("there is no such fit")
    return row


def _named(body: FitRequest) -> Iterator[tuple[str, Sequence[str | int]]]:
    if not isinstance(body.models, str):
        for k, name in enumerate(body.models):
            yield name, ("models", k)
    if body.posterior is not None and body.posterior.model is not None:
        yield body.posterior.model, ("posterior", "model")


@routes.post(
    "/v1/fits",
    status_code=202,
    summary="Submit a fit",
    response_model=Fit,
    responses={
        200: {"model": Fit, "description": "The fit that this Idempotency-Key made before."},
        202: {"model": Fit, "description": "It waits in the queue."},
        **problems(
            "malformed-json",
            "not-found",
            "request-timeout",
            "conflict",
            "unsupported-media-type",
            "unknown-model",
            "invalid-request",
            "queue-full",
            "storage-full",
        ),
    },
)
async def submitted(
    body: FitRequest,
    shared: SharedState,
    owner: Annotated[str, Depends(owner)],
    key: Annotated[
        str | None,
        Header(
            alias="Idempotency-Key",
            max_length=200,
            pattern=r"^[\x21-\x7e]+$",
            description="The same key with the same body makes one fit, however often it is sent.",
        ),
    ] = None,
) -> Response:
    """Put a fit into the queue.

    Models, variants and options that do not exist are refused at once.
    """
    try:
        shared.store.measurement(body.measurement)
    except NotFound:
        raise Problem(
            "not-found",
            "there is no such measurement; upload it first",
            errors=[{"pointer": "/measurement", "detail": "there is no such measurement"}],
        ) from None
    check_models(await shared.catalogue(), _named(body), body.options)
    row, new = await shared.write(
        shared.store.submit,
        FIT,
        body.model_dump(mode="json"),
        owner=owner,
        key=key,
        measurement=body.measurement,
    )
    return JSONResponse(
        fit_resource(shared.store, row),
        202 if new else 200,
        headers={"Location": f"/v1/fits/{row.id}"},
    )


@routes.get(
    "/v1/fits",
    summary="List fits",
    response_model=FitPage,
    responses=problems("invalid-request"),
)
async def listed(
    shared: SharedState,
    limit: Limit = 50,
    cursor: Cursor = None,
    measurement: Annotated[str | None, Query(pattern=r"^[0-9a-f]{64}$")] = None,
    state: State | None = None,
) -> Any:
    """Give fits, the newest first; without results."""
    rows, following = shared.store.jobs(limit, cursor, measurement=measurement, state=state)
    return {"items": [fit_resource(shared.store, row) for row in rows], "next": following}


@routes.get(
    "/v1/fits/{id}",
    summary="One fit with its result",
    response_class=Response,
    responses={200: {"model": Fit}, **problems("not-found", "invalid-request")},
)
async def shown(shared: SharedState, id: Id) -> Response:
    """Give the fit; once there are reports, with their documents."""
    row = fit_row(shared.store, id)
    body = await to_thread.run_sync(_with_documents, shared.store, row)
    return Response(body, media_type="application/json")


def _with_documents(store: Store, row: JobRow) -> bytes:
    """Join the resource and the reports' texts, which are JSON already and may be large."""
    resource = fit_resource(store, row)
    there = {a["name"] for a in resource["artefacts"]}
    members = [json.dumps(resource, separators=(",", ":"))[1:-1].encode()]
    for member, name in (("result", "report.json"), ("posterior", "posterior.json")):
        text = _read(store.artefact_path(row.id, name)) if name in there else b"null"
        members.append(f'"{member}":'.encode() + text)
    return b"{" + b",".join(members) + b"}"


def _read(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except FileNotFoundError:
        raise NotFound("the fit was deleted") from None


@routes.delete(
    "/v1/fits/{id}",
    status_code=204,
    summary="Cancel or delete a fit",
    responses={
        202: {"model": Fit, "description": "It is being cancelled; what is finished is kept."},
        204: {"description": "It had ended and is deleted."},
        **problems("not-found", "conflict", "invalid-request"),
    },
)
async def deleted(
    shared: SharedState,
    id: Id,
    keep: Annotated[
        bool, Query(description="Cancel only: one that has ended is refused (409).")
    ] = False,
) -> Response:
    """Cancel a fit that waits or runs; delete one that has ended, with its files."""
    row = fit_row(shared.store, id)
    if row.state not in ENDED:
        row = await shared.write(shared.store.cancel, id)
        return JSONResponse(fit_resource(shared.store, row), 202)
    if keep:
        raise Problem("conflict", f"the fit is {row.state}: there is nothing to cancel")
    await shared.write(shared.store.delete_job, id)
    return Response(status_code=204)


@routes.get(
    "/v1/fits/{id}/events",
    summary="Follow a fit",
    response_class=StreamingResponse,
    responses={
        200: {
            "description": 'Events "state" (a fit without result) and "progress".',
            "content": {
                "text/event-stream": {
                    "example": 'id: 7\nevent: progress\ndata: {"stage":"fit","done":3,"total":12}\n\n',
                }
            },
        },
        **problems("not-found", "invalid-request"),
    },
)
async def events(
    shared: SharedState,
    id: Id,
    last: Annotated[
        str | None,
        Header(
            alias="Last-Event-ID",
            max_length=18,
            pattern=r"^[0-9]*$",
            description="Number of the last event seen; those after it are sent.",
        ),
    ] = None,
) -> Response:
    """Server-sent events until the fit has ended, with a comment now and then."""
    fit_row(shared.store, id)
    return StreamingResponse(
        event_stream(shared, id, int(last or 0)), media_type="text/event-stream"
    )


async def _ask(shared: Shared, kind: str, id: str, model: str | None, owner: str) -> Response:
    row = fit_row(shared.store, id)
    request = {"fit": row.id, "model": model}
    body, media_type = await shared.answer(kind, request, owner=owner)
    return Response(body, media_type=media_type)


_QUICK = problems("not-found", "unknown-model", "conflict", "invalid-request", "timeout")


@routes.get(
    "/v1/fits/{id}/curves",
    summary="Measured against fitted",
    response_class=Response,
    responses={200: {"model": Curves}, **_QUICK},
)
async def curves(
    shared: SharedState, id: Id, owner: Annotated[str, Depends(owner)], model: ModelQuery = None
) -> Response:
    """Give one curve per incidence, and the residuals over the angles."""
    return await _ask(shared, "curves", id, model, owner)


@routes.get(
    "/v1/fits/{id}/sphere",
    summary="A table of the fitted BRDF for shading",
    response_class=Response,
    responses={200: {"model": Sphere}, **_QUICK},
)
async def sphere(
    shared: SharedState, id: Id, owner: Annotated[str, Depends(owner)], model: ModelQuery = None
) -> Response:
    """Give the BRDF over half-angles, as a page's shader reads it."""
    return await _ask(shared, "sphere", id, model, owner)
