"""Files on their way out: strong ETags, conditional and partial answers, and a zip of all.

A file's ETag is the SHA-256 of its content, so an answer can be kept for good and checked.
"""

from __future__ import annotations

import re
import zipfile
from collections.abc import Iterator, Sequence
from pathlib import Path

from starlette.datastructures import Headers
from starlette.requests import Request
from starlette.responses import FileResponse, Response, StreamingResponse

from lobefit.service.problems import Problem

__all__ = ["file_response", "zip_response"]

_RANGE = re.compile(r"bytes=(?:(\d{1,18})-(\d{0,18})|-(\d{1,18}))")
_CHUNK = 64 * 1024


def file_response(
    request: Request,
    path: Path,
    *,
    etag: str,
    media_type: str,
    filename: str | None = None,
    cache: str = "private, no-cache",
) -> Response:
    """Answer with a file, a part of it, or that it has not changed.

    Parameters
    ----------
    request : Request
        Whose If-None-Match, If-Range and Range count.
    path : Path
        Chosen by the service, never by the client.
    etag : str
        Without quotes.
    media_type : str
        Of the content.
    filename : str, optional
        Under which a browser stores it.
    cache : str
        Cache-Control.

    Raises
    ------
    Problem
        "not-found" where the file has gone, "range-not-satisfiable".
    """
    quoted = f'"{etag}"'
    headers = {"etag": quoted, "cache-control": cache}
    if _matches(request.headers, quoted):
        return Response(status_code=304, headers=headers)
    try:
        stat = path.stat()
    except OSError:
        raise Problem("not-found", "the file was deleted") from None
    asked = request.headers.get("range")
    if asked is not None:
        match = _RANGE.fullmatch(asked.replace(" ", ""))
        if match is None or (match[2] and int(match[2]) < int(match[1])):
            # Several ranges, other units and nonsense may be ignored, says RFC 9110.
            _without_range(request)
        elif int(match[1] or 0) >= stat.st_size or match[3] == "0" or stat.st_size == 0:
            raise Problem(
                "range-not-satisfiable",
                f"the file has {stat.st_size} bytes",
                headers={"Content-Range": f"bytes */{stat.st_size}"},
            )
    return FileResponse(
        path, headers=headers, media_type=media_type, filename=filename, stat_result=stat
    )


def _matches(headers: Headers, quoted: str) -> bool:
    wanted = [part.strip() for part in headers.get("if-none-match", "").split(",")]
    return "*" in wanted or quoted in [w.removeprefix("W/") for w in wanted]


def _without_range(request: Request) -> None:
    request.scope["headers"] = [(k, v) for k, v in request.scope["headers"] if k != b"range"]


class _Pipe:
    """What zipfile writes into; emptied after each piece."""

    def __init__(self) -> None:
        self._pieces: list[bytes] = []
        self._told = 0

    def write(self, data: bytes) -> int:
        self._pieces.append(bytes(data))
        self._told += len(data)
        return len(data)

    def tell(self) -> int:
        return self._told

    def flush(self) -> None:
        """Nothing waits here."""

    def take(self) -> bytes:
        data, self._pieces = b"".join(self._pieces), []
        return data


def _zipped(files: Sequence[tuple[str, Path]]) -> Iterator[bytes]:
    pipe = _Pipe()
    with zipfile.ZipFile(pipe, "w", zipfile.ZIP_DEFLATED) as archive:  # type: ignore[call-overload]
        for name, path in files:
            # Always the same date, so that the same files give the same bytes.
            entry = zipfile.ZipInfo(name, (1980, 1, 1, 0, 0, 0))
            entry.compress_type = zipfile.ZIP_DEFLATED
            entry.external_attr = 0o644 << 16
            with path.open("rb") as source, archive.open(entry, "w") as target:
                while chunk := source.read(_CHUNK):
                    target.write(chunk)
                    yield pipe.take()
    yield pipe.take()


def zip_response(files: Sequence[tuple[str, Path]], filename: str) -> Response:
    """Answer with a zip that is made while it is sent.

    Parameters
    ----------
    files : sequence of (str, Path)
        Names in the zip and where the files lie.
    filename : str
        Under which a browser stores it.
    """
    disposition = f'attachment; filename="{filename}"'
    return StreamingResponse(
        (piece for piece in _zipped(files) if piece),
        media_type="application/zip",
        headers={"content-disposition": disposition},
    )
