"""The file of a form, taken out of multipart/form-data while it arrives.

Parts are read by python-multipart; the file's bytes go on at once, so that a form needs no more
memory or disk than the same file sent as the body.
"""

from __future__ import annotations

from collections.abc import AsyncIterator

from python_multipart.exceptions import MultipartParseError
from python_multipart.multipart import MultipartParser, parse_options_header

from lobefit.service.problems import Problem

__all__ = ["FormFile"]

_FIELD = b"file"
_MOST_PARTS = 32
_MOST_HEAD = 16 * 1024
_LONGEST_BOUNDARY = 256


class FormFile:
    """The field `file` of a form.

    Parameters
    ----------
    content_type : str
        The header, with the boundary.

    Attributes
    ----------
    name : str or None
        The file's name as sent; known once pieces have come.

    Raises
    ------
    Problem
        "malformed-form": there is no boundary.
    """

    def __init__(self, content_type: str) -> None:
        _, options = parse_options_header(content_type)
        boundary = options.get(b"boundary", b"")
        if not 0 < len(boundary) <= _LONGEST_BOUNDARY:
            raise _wrong("its Content-Type names no boundary")
        self.name: str | None = None
        self._parser = MultipartParser(
            boundary,
            {
                "on_part_begin": self._begin,
                "on_header_field": self._head_field,
                "on_header_value": self._head_value,
                "on_header_end": self._head_end,
                "on_headers_finished": self._heads_end,
                "on_part_data": self._data,
                "on_end": self._end,
            },
        )
        self._parts = self._head_bytes = 0
        self._field, self._value, self._disposition = b"", b"", b""
        self._inside = self._found = self._ended = False
        self._ready: list[bytes] = []

    async def pieces(self, stream: AsyncIterator[bytes]) -> AsyncIterator[bytes]:
        """Give the bytes of the file.

        Raises
        ------
        Problem
            "malformed-form": the form is damaged, cut short, or has no such field.
        """
        try:
            async for data in stream:
                self._parser.write(data)
                ready, self._ready = self._ready, []
                for piece in ready:
                    yield piece
            self._parser.finalize()
        except MultipartParseError as error:
            raise _wrong(f"it is damaged: {error}") from None
        if not self._found:
            raise _wrong("it has no field named `file`")
        if not self._ended:
            raise _wrong("it ends too early; the form was cut short")

    def _begin(self) -> None:
        self._parts += 1
        self._inside, self._disposition, self._head_bytes = False, b"", 0
        if self._parts > _MOST_PARTS:
            raise _wrong(f"it has more than {_MOST_PARTS} fields")

    def _head_field(self, data: bytes, start: int, end: int) -> None:
        self._field += self._counted(data[start:end])

    def _head_value(self, data: bytes, start: int, end: int) -> None:
        self._value += self._counted(data[start:end])

    def _counted(self, head: bytes) -> bytes:
        self._head_bytes += len(head)
        if self._head_bytes > _MOST_HEAD:
            raise _wrong(f"the head of a field has more than {_MOST_HEAD} bytes")
        return head

    def _head_end(self) -> None:
        if self._field.lower() == b"content-disposition":
            self._disposition = self._value
        self._field = self._value = b""

    def _heads_end(self) -> None:
        _, options = parse_options_header(self._disposition)
        self._inside = options.get(b"name") == _FIELD
        if not self._inside:
            return
        if self._found:
            raise _wrong("it has two files; send them one by one")
        self._found = True
        name = options.get(b"filename")
        self.name = None if name is None else name.decode("utf-8", "replace")

    def _data(self, data: bytes, start: int, end: int) -> None:
        if self._inside:
            self._ready.append(data[start:end])

    def _end(self) -> None:
        self._ended = True


def _wrong(what: str) -> Problem:
    return Problem(
        "malformed-form",
        f"the form cannot be used: {what}; expected is one file in the field `file`, as "
        "`curl -F file=@measurement.csv` sends it",
    )
