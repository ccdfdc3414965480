"""Fits: submit, list, and look at the curves; see `lobefit.service.routes.waiting` for the rest."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Annotated, Any

from fastapi import Depends, Query, Response

from lobefit.service.catalogue import check_models
from lobefit.service.resources import Curves, Fit, FitPage, Sphere
from lobefit.service.routes.common import (
    SUBMITTED,
    Cursor,
    Id,
    Key,
    Limit,
    MeasurementQuery,
    ModelQuery,
    check_measurements,
    problems,
    router,
)
from lobefit.service.routes.waiting import enqueued, job_of, listed, waiting_routes
from lobefit.service.rows import FIT, State
from lobefit.service.schemas import FitRequest, FitSettings
from lobefit.service.state import Shared, SharedState, owner

__all__ = ["models_of", "routes"]

routes = router("fits")


def models_of(body: FitSettings, *at: str | int) -> Iterator[tuple[str, Sequence[str | int]]]:
    """Give the names of models in a fit's settings, each with its place in the body."""
    if not isinstance(body.models, str):
        for k, name in enumerate(body.models):
            yield name, (*at, "models", k)
    if body.posterior is not None and body.posterior.model is not None:
        yield body.posterior.model, (*at, "posterior", "model")


@routes.post(
    "/v1/fits",
    status_code=202,
    summary="Submit a fit",
    response_model=Fit,
    responses={
        200: {"model": Fit, "description": "The fit that this Idempotency-Key made before."},
        202: {"model": Fit, "description": "It waits in the queue."},
        **problems(*SUBMITTED),
    },
)
async def submit(
    body: FitRequest, shared: SharedState, owner: Annotated[str, Depends(owner)], key: Key = None
) -> Response:
    """Put a fit into the queue.

    Models, variants and options that do not exist are refused at once.
    """
    check_measurements(shared.store, [(body.measurement, ("measurement",))])
    check_models(await shared.catalogue(), models_of(body), [(body.options, ("options",))])
    return await enqueued(shared, FIT, body, owner, key)


@routes.get(
    "/v1/fits",
    summary="List fits",
    response_model=FitPage,
    responses=problems("invalid-request"),
)
async def show_list(
    shared: SharedState,
    limit: Limit = 50,
    cursor: Cursor = None,
    measurement: MeasurementQuery = None,
    state: State | None = None,
    batch: Annotated[
        str | None, Query(pattern=r"^[0-9a-z-]{1,64}$", description="Of this batch only.")
    ] = None,
) -> Any:
    """Give fits, the newest first; without results."""
    only = {"measurement": measurement, "state": state, "batch": batch}
    return listed(shared, FIT, limit, cursor, **only)


for _made in waiting_routes(FIT):
    routes.include_router(_made)


async def _ask(shared: Shared, kind: str, id: str, model: str | None, owner: str) -> Response:
    row = job_of(shared.store, FIT, id)
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
