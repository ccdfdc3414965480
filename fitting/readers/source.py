"""Bytes from a file: what kind of file it is, unpacking, and blocks of whole lines.

The kind is told by content, never by the name's ending. Everything is streamed, and what
comes out of a compressed file is bounded, so that a gzip bomb ends in an error.
"""

from __future__ import annotations

import gzip
import io
import re
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

from lobefit.kernels.errors import MeasurementError

__all__ = ["BLOCK_BYTES", "MAX_LINE_BYTES", "MAX_TEXT_BYTES", "line_blocks", "open_text"]

MAX_TEXT_BYTES = 2 * 2**30
"""Longest text read, after unpacking: 2 GiB."""

BLOCK_BYTES = 2**20
"""Text is handled in blocks of about this size."""

MAX_LINE_BYTES = 2**20
"""A line longer than this is no table."""

_GZIP = b"\x1f\x8b"
_CONTROL = re.compile(rb"[\x00-\x08\x0e-\x19]")
_UTF8_MARK = b"\xef\xbb\xbf"
_NOT_TEXT = (
    (b"\xff\xfe", "text in UTF-16", "the text saved as UTF-8"),
    (b"\xfe\xff", "text in UTF-16", "the text saved as UTF-8"),
    (b"PK\x03\x04", "a zip archive or an Excel workbook", "the sheet exported as CSV"),
    (b"\xd0\xcf\x11\xe0", "an old Excel workbook", "the sheet exported as CSV"),
    (b"BZh", "compressed with bzip2", "the file unpacked, or compressed with gzip"),
    (b"\xfd7zXZ", "compressed with xz", "the file unpacked, or compressed with gzip"),
    (b"\x28\xb5\x2f\xfd", "compressed with zstd", "the file unpacked, or compressed with gzip"),
    (b"\x89HDF", "an HDF5 file", "the table as CSV"),
    (b"\x76\x2f\x31\x01", "an OpenEXR picture", "the table as CSV"),
    (b"\x89PNG", "a picture", "the table as CSV"),
    (b"%PDF", "a PDF document", "the table as CSV"),
)


@contextmanager
def open_text(path: Path) -> Iterator[BinaryIO]:
    """Open a table, unpacked if it is gzip and without its byte order mark.

    Parameters
    ----------
    path : Path
        The file.

    Yields
    ------
    binary stream
        The text's bytes.

    Raises
    ------
    MeasurementError
        If there is no such file, it cannot be read, or it is no text; also when reading
        inside the ``with`` block meets a damaged or truncated gzip stream.
    """
    name = path.name or str(path)
    try:
        with path.open("rb") as raw:
            if raw.peek(2)[:2] == _GZIP:
                with gzip.GzipFile(fileobj=raw) as unpacked:
                    yield _checked(io.BufferedReader(unpacked), name)
            else:
                yield _checked(raw, name)
    except FileNotFoundError:
        raise MeasurementError("there is no such file", file=str(path)) from None
    except IsADirectoryError:
        raise MeasurementError(
            "is a folder", file=str(path), expected="a CSV file, such as one inside it"
        ) from None
    except (EOFError, gzip.BadGzipFile, zlib.error) as error:
        raise MeasurementError(
            f"the gzip stream is damaged or cut short ({error})",
            file=name,
            expected="a complete .csv.gz; copy the file again",
        ) from error
    except OSError as error:
        reason = error.strerror or str(error)
        raise MeasurementError(f"cannot be read: {reason}", file=str(path)) from error
    except ValueError as error:  # a NUL in the path
        if "null" not in str(error):
            raise
        raise MeasurementError("the path contains a NUL character") from None


def _checked(stream: io.BufferedReader, name: str) -> BinaryIO:
    head = stream.peek(8192)[:8192]
    if not head:
        raise MeasurementError(
            "the file is empty", file=name, expected="a header row and rows of numbers"
        )
    for magic, what, remedy in _NOT_TEXT:
        if head.startswith(magic):
            raise MeasurementError(f"the file is {what}, not CSV", file=name, expected=remedy)
    if binary := _CONTROL.search(head):
        what = "NUL bytes" if binary[0] == b"\0" else f"the control byte 0x{binary[0][0]:02x}"
        raise MeasurementError(
            f"{what}: the file is binary or in UTF-16",
            file=name,
            row=head.count(b"\n", 0, binary.start()) + 1,
            expected="CSV as UTF-8 text",
        )
    if head.startswith(_UTF8_MARK):
        stream.read(len(_UTF8_MARK))
    return stream


def line_blocks(stream: BinaryIO, line: int, name: str) -> Iterator[tuple[int, bytes]]:
    r"""Cut a stream into blocks of whole lines.

    Parameters
    ----------
    stream : binary stream
        Positioned at the start of a line.
    line : int
        The number of that line.
    name : str
        The file, for errors.

    Yields
    ------
    tuple of int and bytes
        Number of the block's first line; the block, which ends in ``\n``.

    Raises
    ------
    MeasurementError
        If a line is longer than `MAX_LINE_BYTES` or the text than `MAX_TEXT_BYTES`.
    """
    total, rest = 0, b""
    while chunk := stream.read(BLOCK_BYTES):
        total += len(chunk)
        if total > MAX_TEXT_BYTES:
            raise MeasurementError(
                f"the text is longer than {MAX_TEXT_BYTES / 2**30:g} GiB after unpacking",
                file=name,
                expected="a smaller file: thin the measurement out, or split it",
            )
        end = chunk.rfind(b"\n") + 1
        if end:
            block = rest + chunk[:end]
            yield line, block
            line += block.count(b"\n")
            rest = chunk[end:]
        else:
            rest += chunk
        if len(rest) > MAX_LINE_BYTES:
            raise MeasurementError(
                f"the line is longer than {MAX_LINE_BYTES} bytes",
                file=name,
                row=line,
                expected="one row of a table per line, ended by LF or CRLF",
            )
    if rest:
        yield line, rest + b"\n"
