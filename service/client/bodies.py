"""What can be uploaded, as bytes or as a file that is read while it is sent."""

from __future__ import annotations

import os
import tempfile
from collections.abc import AsyncIterator, Iterator
from pathlib import Path
from typing import IO, TYPE_CHECKING, TypeAlias

import anyio
import httpx2

from lobefit.kernels.errors import MeasurementError

if TYPE_CHECKING:
    from lobefit.fitting import Measurement

__all__ = ["FileBody", "Source", "body_of", "media_type", "name_of"]

Source: TypeAlias = "str | os.PathLike[str] | bytes | IO[bytes] | IO[str] | Measurement"
"""A path, the bytes of a file, an open file, or a measurement."""

CHUNK = 1 << 16


class FileBody(httpx2.SyncByteStream, httpx2.AsyncByteStream):
    """A file as the body of a request, for both clients; each sending reads it anew."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.size = path.stat().st_size

    def __iter__(self) -> Iterator[bytes]:
        """Read it in chunks."""
        with self.path.open("rb") as file:
            while chunk := file.read(CHUNK):
                yield chunk

    async def __aiter__(self) -> AsyncIterator[bytes]:
        """Read it in chunks, in a thread."""
        async with await anyio.open_file(self.path, "rb") as file:
            while chunk := await file.read(CHUNK):
                yield chunk


def body_of(source: Source) -> bytes | Path:
    """Give what is to be sent.

    Raises
    ------
    MeasurementError
        There is no such file, or it cannot be read.
    """
    if isinstance(source, bytes):
        return source
    if isinstance(source, str | os.PathLike):
        path = Path(source)
        if not path.is_file():
            raise MeasurementError("there is no such file", file=str(path))
        if not os.access(path, os.R_OK):
            raise MeasurementError("the file cannot be read; see its permissions", file=str(path))
        return path
    if hasattr(source, "read"):
        content = source.read()
        return content.encode() if isinstance(content, str) else content
    from lobefit.fitting.writers import write_measurement  # needs numpy, as its argument does

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "measurement.csv")
        write_measurement(source, path)
        return path.read_bytes()


def name_of(source: Source) -> str | None:
    """Give the name of a file, or of what a measurement was read from."""
    if isinstance(source, bytes):
        return None
    if isinstance(source, str | os.PathLike):
        return Path(source).name
    if hasattr(source, "read"):
        name = getattr(source, "name", None)
        return Path(name).name if isinstance(name, str) else None
    return source.source or None


def media_type(body: bytes | Path, name: str | None) -> str:
    """Say what a body is, by its first bytes and its name."""
    if isinstance(body, Path):
        with body.open("rb") as file:
            start = file.read(2)
    else:
        start = body[:2]
    if start == b"\x1f\x8b":
        return "application/gzip"
    return "application/octet-stream" if (name or "").endswith(".binary") else "text/csv"
