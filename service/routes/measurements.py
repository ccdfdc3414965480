"""Measurements: upload, look, list, delete."""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Annotated, Any

from fastapi import Depends, Query, Request, Response
from starlette.responses import JSONResponse

from lobefit.service.answers import measurement_resource
from lobefit.service.downloads import file_response
from lobefit.service.files import Upload
from lobefit.service.forms import FormFile
from lobefit.service.problems import Problem
from lobefit.service.resources import Measurement, MeasurementPage, Table
from lobefit.service.routes.common import BINARY, Cursor, Id, Limit, problems, router
from lobefit.service.rows import MeasurementRow, NotFound
from lobefit.service.state import Shared, SharedState, owner
from lobefit.service.uploads import receive, shown_name

__all__ = ["routes"]

routes = router("measurements")

_FORM = "multipart/form-data"
_RAW = (
    "text/csv",
    "application/gzip",
    "application/x-gzip",
    "application/octet-stream",
)
_BODY = {
    "required": True,
    "content": {
        "text/csv": {
            "schema": {"type": "string", "minLength": 1},
            "example": "theta_i,phi_i,theta_o,phi_o,brdf\n30,0,30,180,0.31\n",
        },
        "application/gzip": BINARY,
        "application/octet-stream": BINARY,
        _FORM: {
            "schema": {
                "type": "object",
                "properties": {"file": {"type": "string", "format": "binary"}},
                "required": ["file"],
            }
        },
    },
}
_CONTENT = {"model": Measurement}


@routes.post(
    "/v1/measurements",
    status_code=201,
    summary="Upload a measurement",
    response_model=Measurement,
    openapi_extra={"requestBody": _BODY},
    responses={
        200: {**_CONTENT, "description": "The same content was there already."},
        201: {**_CONTENT, "description": "It is new."},
        **problems(
            "malformed-form",
            "request-timeout",
            "unsupported-media-type",
            "invalid-measurement",
            "invalid-request",
            "too-many-requests",
            "queue-full",
            "storage-full",
        ),
    },
)
async def upload(
    request: Request,
    shared: SharedState,
    owner: Annotated[str, Depends(owner)],
    name: Annotated[
        str | None, Query(max_length=400, description="What to call it; a file's name.")
    ] = None,
) -> Response:
    """Send a CSV, plain or gzip, or a MERL table as the body; forms use the field `file`.

    The measurement is read and checked before the answer. The same content sent again is the
    same measurement.
    """
    kind = request.headers.get("content-type", "").partition(";")[0].strip().lower()
    if kind != _FORM and kind not in _RAW:
        raise Problem(
            "unsupported-media-type",
            f"the body's Content-Type is {kind or 'not given'}; expected is one of "
            f"{', '.join((*_RAW, _FORM))}, as `curl --data-binary @file.csv -H "
            "'Content-Type: text/csv'` sends it",
        )
    async with _turn(shared):
        with await shared.write(shared.store.upload) as file:
            if kind == _FORM:
                form = FormFile(request.headers["content-type"])
                await receive(form.pieces(request.stream()), file, shared.settings.upload_bytes)
                name = name or form.name
            else:
                await receive(request.stream(), file, shared.settings.upload_bytes)
            row, new = await _kept(shared, file, shown_name(name), owner)
    return JSONResponse(
        measurement_resource(row),
        201 if new else 200,
        headers={"Location": f"/v1/measurements/{row.id}"},
    )


@asynccontextmanager
async def _turn(shared: Shared) -> AsyncIterator[None]:
    """Let so many uploads in and no more."""
    if shared.uploads >= shared.settings.uploads:
        raise Problem(
            "too-many-requests",
            f"{shared.uploads} uploads are being received; try again in a moment",
            # What the client is still sending is not read.
            headers={"Retry-After": "3", "Connection": "close"},
        )
    shared.uploads += 1
    try:
        yield
    finally:
        shared.uploads -= 1


async def _kept(shared: Shared, file: Upload, name: str, owner: str) -> tuple[MeasurementRow, bool]:
    """Have a finished upload read by a worker, and keep it."""
    path, digest = await shared.write(file.finish)
    try:
        return shared.store.measurement(digest), False
    except NotFound:
        pass
    job = await shared.ask("inspect", {"upload": path.name, "name": name}, owner=owner)
    return await shared.write(shared.store.adopt, file, name, job.result or {})


@routes.get(
    "/v1/measurements",
    summary="List measurements",
    response_model=MeasurementPage,
    responses=problems("invalid-request"),
)
async def listed(shared: SharedState, limit: Limit = 50, cursor: Cursor = None) -> Any:
    """Give measurements, the newest first."""
    rows, following = shared.store.measurements(limit, cursor)
    return {"items": [measurement_resource(row) for row in rows], "next": following}


@routes.get(
    "/v1/measurements/{id}",
    summary="One measurement",
    response_model=Measurement,
    responses=problems("not-found", "invalid-request"),
)
async def shown(shared: SharedState, id: Id) -> Any:
    """Give what was understood of a measurement."""
    return measurement_resource(shared.store.measurement(id))


@routes.delete(
    "/v1/measurements/{id}",
    status_code=204,
    summary="Delete a measurement",
    responses=problems("not-found", "conflict", "invalid-request"),
)
async def deleted(shared: SharedState, id: Id) -> None:
    """Delete it; a measurement that a waiting or running fit or chart needs stays."""
    await shared.write(shared.store.delete_measurement, id)


@routes.get(
    "/v1/measurements/{id}/data",
    summary="The stored bytes",
    response_class=Response,
    responses={
        200: {
            "content": {
                "text/csv": {"schema": {"type": "string"}},
                "application/octet-stream": BINARY,
            }
        },
        206: {"description": "The range that was asked for."},
        304: {"description": "Not changed."},
        **problems("not-found", "range-not-satisfiable", "invalid-request"),
    },
)
async def data(request: Request, shared: SharedState, id: Id) -> Response:
    """Give the bytes as they were uploaded, decompressed."""
    row = shared.store.measurement(id)
    path = shared.store.data_path(id)
    # A MERL table begins with its sizes, in which there are zero bytes.
    with path.open("rb") as stream:
        binary = b"\0" in stream.read(12)
    return file_response(
        request,
        path,
        etag=row.id,
        media_type="application/octet-stream" if binary else "text/csv; charset=utf-8",
        filename=f"{row.id[:12]}{'.binary' if binary else '.csv'}",
    )


@routes.get(
    "/v1/measurements/{id}/table",
    summary="The rows, thinned for a plot",
    response_class=Response,
    responses={200: {"model": Table}, **problems("not-found", "invalid-request", "timeout")},
)
async def table(
    shared: SharedState,
    id: Id,
    owner: Annotated[str, Depends(owner)],
    max_points: Annotated[int, Query(ge=1, le=200_000)] = 20_000,
) -> Response:
    """Give angles in degrees and values in 1/sr, in the file's order."""
    shared.store.measurement(id)
    body, media_type = await shared.answer(
        "table", {"measurement": id, "max_points": max_points}, owner=owner, measurement=id
    )
    return Response(body, media_type=media_type)
