"""Files that a fit made: one by one, in parts, or all in a zip."""

from __future__ import annotations

from typing import Annotated

from fastapi import Path, Request, Response
from starlette.responses import StreamingResponse

from lobefit.service.downloads import file_response, zip_response
from lobefit.service.problems import Problem
from lobefit.service.routes.common import Id, problems, router
from lobefit.service.routes.fits import fit_row
from lobefit.service.state import SharedState

__all__ = ["routes"]

routes = router("artefacts")

_BINARY = {"schema": {"type": "string", "format": "binary"}}
_FILES = {
    kind: _BINARY
    for kind in (
        "application/octet-stream",
        "application/x-hdf5",
        "application/x-netcdf",
        "image/png",
        "image/x-exr",
        "text/csv",
    )
} | {"application/json": {"schema": {"type": "object"}}}


@routes.get(
    "/v1/fits/{id}/artefacts/{name}",
    summary="One file",
    response_class=Response,
    responses={
        200: {"content": _FILES},
        206: {"description": "The range that was asked for."},
        304: {"description": "Not changed."},
        **problems("not-found", "range-not-satisfiable", "invalid-request"),
    },
)
async def artefact(
    request: Request,
    shared: SharedState,
    id: Id,
    name: Annotated[str, Path(max_length=200)],
) -> Response:
    """Give report.json, fit.png, lobes.exr, posterior.nc..., as the fit lists them."""
    fit_row(shared.store, id)
    for row in shared.store.artefacts(id):
        if row.name == name:
            return file_response(
                request,
                shared.store.artefact_path(id, row.name),
                etag=row.sha256,
                media_type=row.media_type,
                filename=row.name,
            )
    raise Problem("not-found", "the fit has no such artefact; it lists those that it has")


@routes.get(
    "/v1/fits/{id}/artefacts.zip",
    summary="All files in a zip",
    response_class=StreamingResponse,
    responses={
        200: {"content": {"application/zip": _BINARY}},
        **problems("not-found", "invalid-request"),
    },
)
async def archive(shared: SharedState, id: Id) -> Response:
    """Give what the fit has made so far."""
    fit_row(shared.store, id)
    files = [
        (row.name, shared.store.artefact_path(id, row.name)) for row in shared.store.artefacts(id)
    ]
    return zip_response(files, f"lobefit-{id}.zip")
