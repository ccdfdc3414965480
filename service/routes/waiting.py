"""Fits and charts alike: look, follow, cancel, delete, and give out the files they made."""

from __future__ import annotations

import json
from pathlib import Path as FilePath
from typing import Annotated, Any

from anyio import to_thread
from fastapi import APIRouter, Header, Path, Request, Response
from starlette.responses import JSONResponse, StreamingResponse

from lobefit.service.answers import WAITERS, job_resource
from lobefit.service.downloads import file_response, zip_response
from lobefit.service.events import event_stream
from lobefit.service.problems import Problem
from lobefit.service.routes.common import BINARY, Cursor, Id, Keep, Key, problems, router, submitted
from lobefit.service.rows import ENDED, JobRow, NotFound
from lobefit.service.schemas import ChartRequest, FitRequest
from lobefit.service.state import Shared, SharedState
from lobefit.service.store import Store

__all__ = ["enqueued", "job_of", "listed", "waiting_routes"]

_FILES = {
    kind: BINARY
    for kind in (
        "application/octet-stream",
        "application/x-hdf5",
        "application/x-netcdf",
        "image/png",
        "image/x-exr",
        "text/csv",
    )
} | {"application/json": {"schema": {"type": "object"}}}


def job_of(store: Store, kind: str, id: str) -> JobRow:
    """Give the row of a fit or a chart; other jobs are nobody's business."""
    row = store.job(id)
    if row.kind != kind:
        raise NotFound(f"there is no such {WAITERS[kind].noun}")
    return row


async def enqueued(
    shared: Shared, kind: str, body: FitRequest | ChartRequest, owner: str, key: Key
) -> JSONResponse:
    """Put a job into the queue and answer that it waits there."""
    row, new = await shared.write(
        shared.store.submit,
        kind,
        body.model_dump(mode="json"),
        owner=owner,
        key=key,
        measurement=body.measurement,
    )
    return submitted(job_resource(shared.store, row), WAITERS[kind].path, new=new)


def listed(shared: Shared, kind: str, limit: int, cursor: Cursor, **only: str | None) -> Any:
    """Give a page, the newest first; without results."""
    rows, following = shared.store.jobs(limit, cursor, kind=kind, **only)
    return {"items": [job_resource(shared.store, row) for row in rows], "next": following}


def waiting_routes(kind: str) -> tuple[APIRouter, APIRouter]:
    """Make what can be done with one job of a kind once it is queued.

    Parameters
    ----------
    kind : str
        A key of `lobefit.service.answers.WAITERS`.

    Returns
    -------
    jobs, artefacts : APIRouter
    """
    waiter = WAITERS[kind]
    noun, one, resource = waiter.noun, f"{waiter.path}/{{id}}", waiter.resource
    jobs, artefacts = router(f"{noun}s"), router("artefacts")

    @jobs.get(
        one,
        summary=f"One {noun} with its result",
        description=f"Give the {noun}; once there are reports, with their documents.",
        response_class=Response,
        responses={200: {"model": resource}, **problems("not-found", "invalid-request")},
    )
    async def shown(shared: SharedState, id: Id) -> Response:
        row = job_of(shared.store, kind, id)
        body = await to_thread.run_sync(_with_documents, shared.store, row)
        return Response(body, media_type="application/json")

    @jobs.delete(
        one,
        status_code=204,
        summary=f"Cancel or delete a {noun}",
        description=f"Cancel a {noun} that waits or runs; delete one that has ended, with its "
        "files.",
        responses={
            202: {"model": resource, "description": "It is being cancelled; see its state."},
            204: {"description": "It had ended and is deleted."},
            **problems("not-found", "conflict", "invalid-request"),
        },
    )
    async def deleted(
        shared: SharedState,
        id: Id,
        keep: Keep = False,
    ) -> Response:
        row = job_of(shared.store, kind, id)
        if row.state not in ENDED:
            row = await shared.write(shared.store.cancel, id)
            return JSONResponse(job_resource(shared.store, row), 202)
        if keep:
            raise Problem("conflict", f"the {noun} is {row.state}: there is nothing to cancel")
        await shared.write(shared.store.delete_job, id)
        return Response(status_code=204)

    @jobs.get(
        f"{one}/events",
        summary=f"Follow a {noun}",
        description=f"Server-sent events until the {noun} has ended, with a comment now and then.",
        response_class=StreamingResponse,
        responses={
            200: {
                "description": f'Events "state" (a {noun} without result) and "progress".',
                "content": {
                    "text/event-stream": {
                        "example": f"id: 7\nevent: progress\ndata: "
                        f'{{"stage":"{kind}","done":3,"total":12}}\n\n',
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
        job_of(shared.store, kind, id)
        return StreamingResponse(
            event_stream(shared, id, int(last or 0)), media_type="text/event-stream"
        )

    @artefacts.get(
        f"{one}/artefacts/{{name}}",
        summary=f"One file of a {noun}",
        description=f"Give {', '.join(waiter.files)}... as the {noun} lists them.",
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
        job_of(shared.store, kind, id)
        for row in shared.store.artefacts(id):
            if row.name == name:
                return file_response(
                    request,
                    shared.store.artefact_path(id, row.name),
                    etag=row.sha256,
                    media_type=row.media_type,
                    filename=row.name,
                )
        raise Problem("not-found", f"the {noun} has no such artefact; it lists those that it has")

    @artefacts.get(
        f"{one}/artefacts.zip",
        summary=f"All files of a {noun} in a zip",
        description=f"Give what the {noun} has made so far.",
        response_class=StreamingResponse,
        responses={
            200: {"content": {"application/zip": BINARY}},
            **problems("not-found", "invalid-request"),
        },
    )
    async def archive(shared: SharedState, id: Id) -> Response:
        store = shared.store
        job_of(store, kind, id)
        files = [(row.name, store.artefact_path(id, row.name)) for row in store.artefacts(id)]
        return zip_response(files, f"lobefit-{id}.zip")

    return jobs, artefacts


def _with_documents(store: Store, row: JobRow) -> bytes:
    """Join the resource and the reports' texts, which are JSON already and may be large."""
    resource = job_resource(store, row)
    there = {a["name"] for a in resource["artefacts"]}
    members = [json.dumps(resource, separators=(",", ":"))[1:-1].encode()]
    for member, name in WAITERS[row.kind].documents.items():
        text = _read(store.artefact_path(row.id, name)) if name in there else b"null"
        members.append(f'"{member}":'.encode() + text)
    return b"{" + b",".join(members) + b"}"


def _read(path: FilePath) -> bytes:
    try:
        return path.read_bytes()
    except FileNotFoundError:
        raise NotFound("it was deleted") from None
