"""Charts of speed against accuracy: submit and list; see `lobefit.service.routes.waiting`."""

from __future__ import annotations

from typing import Annotated, Any

from fastapi import Depends, Response

from lobefit.service.catalogue import check_models
from lobefit.service.problems import Problem
from lobefit.service.resources import Chart, ChartPage
from lobefit.service.routes.common import (
    SUBMITTED,
    Cursor,
    Key,
    Limit,
    MeasurementQuery,
    check_measurements,
    problems,
    router,
)
from lobefit.service.routes.waiting import enqueued, listed, waiting_routes
from lobefit.service.rows import CHART, State
from lobefit.service.schemas import ChartRequest
from lobefit.service.state import SharedState, owner

__all__ = ["routes"]

routes = router("charts")


@routes.post(
    "/v1/charts",
    status_code=202,
    summary="Submit a chart of speed against accuracy",
    response_model=Chart,
    responses={
        200: {"model": Chart, "description": "The chart that this Idempotency-Key made before."},
        202: {"model": Chart, "description": "It waits in the queue."},
        **problems(*SUBMITTED),
    },
)
async def submit(
    body: ChartRequest, shared: SharedState, owner: Annotated[str, Depends(owner)], key: Key = None
) -> Response:
    """Put into the queue what `lobefit chart` does: measure what each choice costs and brings.

    Every model, metric, amount of data and search is fitted, timed and scored on what it has not
    seen: the other half of a measurement, or the truth of a simulated one. Groups beside "fit"
    compare arithmetics, grids of the albedo and ways to sample a posterior. The answer names the
    fit to take for the tolerance. Times are those of the worker, beside whatever else runs there.
    """
    if (body.measurement is None) == (body.truth is None):
        detail = "give either a measurement or a truth"
        errors = [{"pointer": f"/{name}", "detail": detail} for name in ("measurement", "truth")]
        raise Problem("invalid-request", detail, errors=errors)
    if body.truth is not None and body.max_theta_deg is not None:
        detail = "it is for a measurement; the geometry says how far a truth is seen"
        errors = [{"pointer": "/max_theta_deg", "detail": detail}]
        raise Problem("invalid-request", f"max_theta_deg: {detail}", errors=errors)
    named = [] if isinstance(body.models, str) else [*enumerate(body.models)]
    names: list[tuple[str, tuple[str | int, ...]]] = [(name, ("models", k)) for k, name in named]
    options = []
    if body.measurement is not None:
        check_measurements(shared.store, [(body.measurement, ("measurement",))])
    if body.truth is not None:
        names.append((body.truth.model, ("truth", "model")))
        options.append((body.truth.options, ("truth", "options")))
    check_models(await shared.catalogue(), names, options)
    return await enqueued(shared, CHART, body, owner, key)


@routes.get(
    "/v1/charts",
    summary="List charts",
    response_model=ChartPage,
    responses=problems("invalid-request"),
)
async def show_list(
    shared: SharedState,
    limit: Limit = 50,
    cursor: Cursor = None,
    measurement: MeasurementQuery = None,
    state: State | None = None,
) -> Any:
    """Give charts, the newest first; without results."""
    return listed(shared, CHART, limit, cursor, measurement=measurement, state=state)


for _made in waiting_routes(CHART):
    routes.include_router(_made)
