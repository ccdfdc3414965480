"""Batches: many fits sent in together, counted, cancelled and summed up together."""

from __future__ import annotations

from itertools import chain
from typing import Annotated, Any

from anyio import to_thread
from fastapi import Depends, Response
from starlette.responses import JSONResponse

from lobefit.service.answers import batch_resource
from lobefit.service.catalogue import check_models
from lobefit.service.problems import Problem
from lobefit.service.resources import Batch, BatchPage
from lobefit.service.routes.common import (
    BINARY,
    SUBMITTED,
    Cursor,
    Id,
    Keep,
    Key,
    Limit,
    check_measurements,
    problems,
    router,
    submitted,
)
from lobefit.service.routes.fits import models_of
from lobefit.service.schemas import BatchRequest
from lobefit.service.state import Shared, SharedState, owner

__all__ = ["routes"]

routes = router("batches")


@routes.post(
    "/v1/batches",
    status_code=202,
    summary="Submit many fits together",
    response_model=Batch,
    responses={
        200: {"model": Batch, "description": "The batch that this Idempotency-Key made before."},
        202: {"model": Batch, "description": "All its fits wait in the queue."},
        **problems(*SUBMITTED),
    },
)
async def submit(
    body: BatchRequest, shared: SharedState, owner: Annotated[str, Depends(owner)], key: Key = None
) -> Response:
    """Put a fit for each item into the queue: all of them, or none where anything is wrong.

    What an item leaves out is taken from the batch. Each fit is a fit as any other: it is listed
    with `GET /v1/fits?batch=ID`, followed, cancelled and deleted alone if need be. One that fails
    does not stop the others. Fits of others go in between.
    """
    limits = shared.store.limits
    most = min(limits.queue, limits.queue_per_owner)
    if len(body.items) > most:
        detail = f"there are {len(body.items)} items; {most} fits are the most that may wait here"
        raise Problem("invalid-request", detail, errors=[{"pointer": "/items", "detail": detail}])
    given = list(enumerate(body.items))
    check_measurements(
        shared.store, [(item.measurement, ("items", k, "measurement")) for k, item in given]
    )
    check_models(
        await shared.catalogue(),
        chain(models_of(body), *(models_of(item, "items", k) for k, item in given)),
        [
            (body.options, ("options",)),
            *((item.options, ("items", k, "options")) for k, item in given),
        ],
    )
    row, new = await shared.write(
        shared.store.submit_batch,
        body.name,
        [request.model_dump(mode="json") for request in body.requests()],
        owner=owner,
        key=key,
    )
    return submitted(batch_resource(row), "/v1/batches", new=new)


@routes.get(
    "/v1/batches",
    summary="List batches",
    response_model=BatchPage,
    responses=problems("invalid-request"),
)
async def show_list(shared: SharedState, limit: Limit = 50, cursor: Cursor = None) -> Any:
    """Give batches, the newest first; `GET /v1/fits?batch=ID` lists the fits of one."""
    # Counting the fits of many batches takes milliseconds.
    rows, following = await to_thread.run_sync(shared.store.batches, limit, cursor)
    return {"items": [batch_resource(row) for row in rows], "next": following}


@routes.get(
    "/v1/batches/{id}",
    summary="One batch",
    response_model=Batch,
    responses=problems("not-found", "invalid-request"),
)
async def shown(shared: SharedState, id: Id) -> Any:
    """Count the fits of a batch by state, and say how long the rest may take."""
    return batch_resource(shared.store.batch(id))


@routes.delete(
    "/v1/batches/{id}",
    status_code=204,
    summary="Cancel or delete a batch",
    responses={
        202: {"model": Batch, "description": "What has not ended is being cancelled."},
        204: {"description": "All had ended: the batch is deleted with its fits."},
        **problems("not-found", "conflict", "invalid-request"),
    },
)
async def deleted(
    shared: SharedState,
    id: Id,
    keep: Keep = False,
) -> Response:
    """Cancel the fits that wait or run; delete a batch that has ended, with all its fits.

    Measurements stay.
    """
    row = shared.store.batch(id)
    if row.ended is None:
        row = await shared.write(shared.store.cancel_batch, id)
        return JSONResponse(batch_resource(row), 202)
    if keep:
        raise Problem("conflict", "every fit of the batch has ended: there is nothing to cancel")
    await shared.write(shared.store.delete_batch, id)
    return Response(status_code=204)


async def _file(shared: Shared, id: str, name: str, owner: str) -> Response:
    shared.store.batch(id)
    body, media_type = await shared.answer("batch", {"batch": id, "file": name}, owner=owner)
    return Response(body, media_type=media_type)


_CSV: dict[int | str, dict[str, Any]] = {
    200: {"content": {"text/csv": {"schema": {"type": "string"}}}}
}
_QUICK = problems("not-found", "conflict", "invalid-request", "timeout")


@routes.get(
    "/v1/batches/{id}/table.csv",
    summary="A row for each fit",
    response_class=Response,
    responses={**_CSV, **_QUICK},
)
async def table(shared: SharedState, id: Id, owner: Annotated[str, Depends(owner)]) -> Response:
    """Give the fits that have ended, in the order of the items: model, errors, time, verdict.

    Failed ones are there too, with the reason. The columns are those of `lobefit batch`.
    """
    return await _file(shared, id, "table.csv", owner)


@routes.get(
    "/v1/batches/{id}/parameters.csv",
    summary="A row for each parameter",
    response_class=Response,
    responses={**_CSV, **_QUICK},
)
async def parameters(
    shared: SharedState, id: Id, owner: Annotated[str, Depends(owner)]
) -> Response:
    """Give the parameters of the best model of each fit that has ended, with their errors."""
    return await _file(shared, id, "parameters.csv", owner)


@routes.get(
    "/v1/batches/{id}/summary.png",
    summary="A picture of all fits",
    response_class=Response,
    responses={200: {"content": {"image/png": BINARY}}, **_QUICK},
)
async def summary(shared: SharedState, id: Id, owner: Annotated[str, Depends(owner)]) -> Response:
    """Draw for each fit that has ended the chosen model, how well it fits, and its time."""
    return await _file(shared, id, "summary.png", owner)
