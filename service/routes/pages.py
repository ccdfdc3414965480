"""What a browser shows: the page at `/`, its files, and the documents of the interface."""

from __future__ import annotations

import hashlib
import re
from functools import lru_cache
from pathlib import Path

from fastapi import Request, Response
from starlette.responses import PlainTextResponse

from lobefit.service.downloads import file_response
from lobefit.service.problems import PROBLEMS, Problem
from lobefit.service.routes.common import router

__all__ = ["routes"]

routes = router("pages")

_ROOT = Path(__file__).resolve().parents[1]
_WEB = _ROOT / "web"
_DOCS = _ROOT / "apidocs"
# Not asked of the system, whose answers differ.
_TYPES = {
    ".css": "text/css; charset=utf-8",
    ".csv": "text/csv; charset=utf-8",
    ".glsl": "text/plain; charset=utf-8",
    ".html": "text/html; charset=utf-8",
    ".ico": "image/x-icon",
    ".js": "text/javascript; charset=utf-8",
    ".json": "application/json",
    ".md": "text/plain; charset=utf-8",
    ".png": "image/png",
    ".svg": "image/svg+xml",
    ".txt": "text/plain; charset=utf-8",
    ".woff2": "font/woff2",
}
_SAFE = re.compile(r"(?:[A-Za-z0-9_-][A-Za-z0-9._-]*/)*[A-Za-z0-9_-][A-Za-z0-9._-]*")


@lru_cache(maxsize=256)
def _digest(path: Path, changed: int, size: int) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def _file(request: Request, folder: Path) -> Response:
    name = request.path_params.get("name", "index.html")
    path = folder / name
    if not _SAFE.fullmatch(name) or not path.is_file() or path.resolve() != path:
        # Also where a link leads out of the folder.
        raise Problem("not-found", "there is no such page")
    stat = path.stat()
    return file_response(
        request,
        path,
        etag=_digest(path, stat.st_mtime_ns, stat.st_size),
        media_type=_TYPES.get(path.suffix, "application/octet-stream"),
        cache="no-cache",
    )


@routes.get("/", include_in_schema=False)
@routes.get("/static/{name:path}", include_in_schema=False)
async def page(request: Request) -> Response:
    """Give the page, or a file of it."""
    return _file(request, _WEB)


@routes.get("/docs", include_in_schema=False)
@routes.get("/docs/{name}", include_in_schema=False)
async def docs(request: Request) -> Response:
    """Give the list of operations, made in the browser of /openapi.json alone, or a file of it."""
    return _file(request, _DOCS)


@routes.get("/problems/{slug}", include_in_schema=False)
async def problem(slug: str) -> Response:
    """Explain a type of problem, for who opens its address."""
    if slug not in PROBLEMS:
        raise Problem("not-found", "there is no such kind of problem")
    status, title = PROBLEMS[slug]
    return PlainTextResponse(f"{title} (status {status}).\n")
