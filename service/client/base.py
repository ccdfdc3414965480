"""What all groups of operations share."""

from __future__ import annotations

import json
import uuid
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from lobefit.kernels.errors import LobefitError, ModelError
from lobefit.service.client.errors import ServiceError
from lobefit.service.client.retries import Retries, exchange
from lobefit.service.client.wire import Operation, Reply, Request, Work

__all__ = ["JSON", "STATUS_SILENCE", "Operations", "json_body", "write_whole", "writing"]

STATUS_SILENCE = 30.0
"""Seconds without a byte, in answers that the service has at hand."""

JSON = {"Content-Type": "application/json"}
PAGE = 200


class Operations:
    """Requests with retries; the clients add how they are sent."""

    _retries: Retries

    def _exchange(self, request: Request) -> Operation[Reply]:
        return exchange(self._retries, request)

    def _get(self, path: str, query: Mapping[str, str] | None = None) -> Operation[dict[str, Any]]:
        request = Request(path=path, query=query or {}, silence=STATUS_SILENCE)
        reply = yield from self._exchange(request)
        return reply.document()

    def _remove(self, path: str) -> Operation[None]:
        """Delete what was there; it may have gone with an answer that was lost."""
        try:
            yield from self._exchange(Request(method="DELETE", path=path, silence=STATUS_SILENCE))
        except ServiceError as error:
            if error.status != 404:
                raise

    def _pages(
        self, path: str, query: Mapping[str, str], limit: int | None
    ) -> Operation[list[dict[str, Any]]]:
        """Give the newest items, all of them where there is no limit."""
        found: list[dict[str, Any]] = []
        cursor: str | None = None
        while limit is None or len(found) < limit:
            size = PAGE if limit is None else min(PAGE, limit - len(found))
            asked = {**query, "limit": str(size)} | ({"cursor": cursor} if cursor else {})
            page = yield from self._get(path, asked)
            found += page.get("items", [])
            cursor = page.get("next")
            if not cursor:
                break
        return found


def json_body(document: Mapping[str, Any]) -> bytes:
    """Write a body.

    Raises
    ------
    ModelError
        A number is not finite.
    """
    try:
        return json.dumps(document, allow_nan=False).encode()
    except ValueError as error:
        raise ModelError("a number is not finite; expected finite parameters and angles") from error


@contextmanager
def writing(path: Path) -> Iterator[None]:
    """Say which file could not be written."""
    try:
        yield
    except OSError as error:
        raise LobefitError(f"{path} cannot be written: {error.strerror or error}") from error


def write_whole(path: Path, content: bytes) -> Operation[Path]:
    """Write a file, whole or not at all.

    Raises
    ------
    LobefitError
        It cannot be written.
    """

    def write() -> None:
        part = path.with_name(f".{path.name}.{uuid.uuid4().hex}.part")
        try:
            part.write_bytes(content)
            part.replace(path)
        finally:
            part.unlink(missing_ok=True)

    with writing(path):
        yield Work(write)
    return path
