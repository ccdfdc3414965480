"""Bytes on their way in: unpacked, counted and hashed while they arrive.

What a file is, is told by its first bytes, never by its name. Gzip may be there twice, once for
the transfer and once as the file's own; the limit holds for what comes out, and what comes out is
made in small pieces, so that a bomb costs neither memory nor time.
"""

from __future__ import annotations

import asyncio
import zlib
from collections.abc import AsyncIterator, Iterator

from lobefit.service.files import Upload
from lobefit.service.problems import Problem

__all__ = ["Unpacked", "receive", "shown_name"]

_PIECE = 256 * 1024
_MAGIC = b"\x1f\x8b"


class _Layer:
    """One gzip stream, perhaps of several members."""

    def __init__(self) -> None:
        self._inflate = zlib.decompressobj(wbits=31)

    def pieces(self, data: bytes) -> Iterator[bytes]:
        while data:
            if self._inflate.eof:
                if not data.strip(b"\0"):  # padding, as tape drives leave it
                    return
                self._inflate = zlib.decompressobj(wbits=31)
            try:
                piece = self._inflate.decompress(data, _PIECE)
            except zlib.error as error:
                raise Problem(
                    "invalid-measurement", f"the gzip stream is damaged: {error}"
                ) from None
            data = self._inflate.unconsumed_tail or self._inflate.unused_data
            if piece:
                yield piece

    def finish(self) -> None:
        if not self._inflate.eof:
            raise Problem(
                "invalid-measurement",
                "the gzip stream ends too early; the file was cut short",
            )


class Unpacked:
    """Turns pieces as sent into pieces of the file.

    Parameters
    ----------
    layers : int
        Most gzip streams within each other; a further one counts as the file.
    """

    def __init__(self, layers: int = 2) -> None:
        self._layers = layers
        self._start: bytes | None = b"" if layers else None
        self._layer: _Layer | None = None
        self._inner: Unpacked | None = None

    def pieces(self, data: bytes) -> Iterator[bytes]:
        """Give what the next bytes turn into; raises `Problem` where they are damaged."""
        if self._start is not None:
            data = self._start + data
            if len(data) < len(_MAGIC):
                self._start = data
                return
            self._start = None
            if data.startswith(_MAGIC):
                self._layer, self._inner = _Layer(), Unpacked(self._layers - 1)
        if self._layer is None or self._inner is None:
            yield data
            return
        for piece in self._layer.pieces(data):
            yield from self._inner.pieces(piece)

    def finish(self) -> Iterator[bytes]:
        """Give what was held back; raises `Problem` where a stream is cut short."""
        if self._start:
            yield self._start
        if self._layer is not None and self._inner is not None:
            self._layer.finish()
            yield from self._inner.finish()


async def receive(stream: AsyncIterator[bytes], upload: Upload, limit: int) -> None:
    """Write a body into an upload.

    Parameters
    ----------
    stream : async iterator of bytes
        The body as sent.
    upload : Upload
        Where it goes; not finished yet.
    limit : int
        Most bytes after decompression.

    Raises
    ------
    Problem
        "too-large" or "invalid-measurement".
    """
    unpacked = Unpacked()

    def write(piece: bytes) -> None:
        if upload.bytes + len(piece) > limit:
            raise Problem(
                "too-large",
                f"the measurement has more than {limit} bytes after decompression; "
                "thin it out, or fit it on the command line",
                headers={"Connection": "close"},
            )
        upload.write(piece)

    async for data in stream:
        for piece in unpacked.pieces(data):
            write(piece)
            if len(piece) == _PIECE:
                await asyncio.sleep(0)  # others are answered meanwhile
    for piece in unpacked.finish():
        write(piece)
    if not upload.bytes:
        raise Problem("invalid-measurement", "the body is empty; send the measurement in it")


def shown_name(given: str | None) -> str:
    """Make a label of a file name that somebody sent; no path is ever made of it."""
    text = (given or "").encode("utf-8", "replace").decode("utf-8", "replace")
    text = text.replace("\\", "/").rpartition("/")[2]
    text = "".join(c for c in text if c.isprintable()).strip()
    return text[:120] or "measurement"
