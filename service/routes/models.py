"""Models: list them, evaluate them, simulate measurements of them."""

from __future__ import annotations

from typing import Annotated, Any

from fastapi import Depends, Path, Response

from lobefit.service.catalogue import check_models
from lobefit.service.problems import Problem
from lobefit.service.resources import ModelItem, ModelList, Values
from lobefit.service.routes.common import problems, router
from lobefit.service.schemas import EvaluateRequest, SimulateRequest
from lobefit.service.state import SharedState, owner

__all__ = ["routes"]

routes = router("models")

_BODY = problems(
    "malformed-json",
    "request-timeout",
    "unsupported-media-type",
    "unknown-model",
    "invalid-request",
    "queue-full",
    "storage-full",
)


@routes.get(
    "/v1/models",
    summary="All models",
    response_model=ModelList,
    responses=problems("timeout"),
)
async def listed(shared: SharedState) -> Any:
    """Give every model with parameters, variants and options."""
    return {"items": await shared.catalogue()}


@routes.get(
    "/v1/models/{name}",
    summary="One model",
    response_model=ModelItem,
    responses=problems("not-found", "invalid-request", "timeout"),
)
async def shown(shared: SharedState, name: Annotated[str, Path(max_length=200)]) -> Any:
    """Give parameters, variants and options of a model."""
    for item in await shared.catalogue():
        if item["name"] == name:
            return item
    raise Problem("not-found", "there is no such model; /v1/models lists them")


@routes.post(
    "/v1/evaluate",
    summary="Evaluate a model",
    response_class=Response,
    responses={
        200: {
            "model": Values,
            "content": {"image/x-exr": {"schema": {"type": "string", "format": "binary"}}},
        },
        **_BODY,
    },
)
async def evaluated(
    body: EvaluateRequest, shared: SharedState, owner: Annotated[str, Depends(owner)]
) -> Response:
    """Give BRDF values in 1/sr at directions or on a grid, as JSON or an OpenEXR picture."""
    check_models(
        await shared.catalogue(), [(body.model, ("model",))], [(body.options, ("options",))]
    )
    answer, media_type = await shared.answer("evaluate", body.model_dump(mode="json"), owner=owner)
    return Response(answer, media_type=media_type)


@routes.post(
    "/v1/simulate",
    summary="Simulate a measurement",
    response_class=Response,
    responses={200: {"content": {"text/csv": {"schema": {"type": "string"}}}}, **_BODY},
)
async def simulated(
    body: SimulateRequest, shared: SharedState, owner: Annotated[str, Depends(owner)]
) -> Response:
    """Give the CSV that an instrument would have measured of a model surface."""
    check_models(
        await shared.catalogue(), [(body.model, ("model",))], [(body.options, ("options",))]
    )
    answer, media_type = await shared.answer("simulate", body.model_dump(mode="json"), owner=owner)
    return Response(answer, media_type=media_type)
