"""Whether the service is well: `/healthz`, `/readyz`, `/metrics`."""

from __future__ import annotations

from typing import Annotated

from anyio import to_thread
from fastapi import Depends, Request, Response
from starlette.responses import JSONResponse

from lobefit.service.observe import Metrics
from lobefit.service.resources import Health, Ready
from lobefit.service.routes.common import problems, router
from lobefit.service.rows import StoreError
from lobefit.service.state import SharedState
from lobefit.service.store import Store

__all__ = ["routes"]

routes = router("system")

# A worker says something several times a second; one that was silent so long is not counted.
SILENT_SECONDS = 15.0


@routes.get("/healthz", summary="Whether the server process answers", responses=problems())
async def healthz() -> Health:
    """Ask nothing but the process itself."""
    return Health()


@routes.get(
    "/readyz",
    summary="Whether fits can be taken",
    response_model=Ready,
    responses={503: {"model": Ready, "description": "Not yet, or no more."}, **problems()},
)
async def readyz(shared: SharedState) -> Response:
    """Write to the store and look whether a worker with a device answers."""
    trouble = await shared.write(_trouble, shared.store)
    found = Ready(ready=False, device=None, store=trouble or "ok", free_bytes=0, workers=0)
    try:
        alive = [
            p
            for p in shared.store.processes()
            if p.age is not None and p.age < SILENT_SECONDS and p.state != "starting"
        ]
        found.free_bytes = shared.store.free_bytes()
    except StoreError as error:
        alive, found.store = [], str(error)
    kinds = {kind for p in alive for kind in p.kinds}
    found.workers = len(alive)
    found.device = next((p.device for p in alive if p.device), None)
    found.ready = found.store == "ok" and {"fit", "inspect"} <= kinds
    return JSONResponse(found.model_dump(), 200 if found.ready else 503)


def _trouble(store: Store) -> str:
    try:
        store.check()
    except StoreError as error:
        return str(error)
    return ""


def _metrics(request: Request) -> Metrics:
    metrics: Metrics = request.app.state.metrics
    return metrics


@routes.get(
    "/metrics",
    summary="Numbers for Prometheus",
    response_class=Response,
    responses={200: {"content": {"text/plain": {"schema": {"type": "string"}}}}, **problems()},
)
async def metrics(numbers: Annotated[Metrics, Depends(_metrics)]) -> Response:
    """Give requests, jobs, workers and space in Prometheus' text format."""
    text = await to_thread.run_sync(numbers.text)
    return Response(text, media_type="text/plain; version=0.0.4")
