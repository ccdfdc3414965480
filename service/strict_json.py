"""JSON bodies read strictly, and request models checked on them.

Python's own reader takes NaN, Infinity and lone surrogates, which no answer can repeat; a
validation error that echoes them breaks the server. So bytes are read by pydantic's reader, which
knows only UTF-8 and RFC 8259, and `1e999`, which it does turn into infinity, is caught by models
that allow no infinities. Depth is bounded and keys may stand only once.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Coroutine
from typing import Any

from fastapi.routing import APIRoute
from pydantic_core import from_json
from starlette.requests import Request
from starlette.responses import Response

from lobefit.service.problems import Problem

__all__ = ["MOST_KEYS", "StrictRoute", "read_json"]

MOST_KEYS = 200
"""Most members of one object."""


def read_json(body: bytes, depth: int = 64) -> Any:
    """Read a JSON text.

    Parameters
    ----------
    body : bytes
        UTF-8.
    depth : int
        Most levels of arrays and objects.

    Raises
    ------
    Problem
        "malformed-json", with the reader's message.
    """
    try:
        value = from_json(body, allow_inf_nan=False)
        # Harmless now: what this reader is too lenient about was refused above.
        json.loads(body, object_pairs_hook=_once)
    except (ValueError, RecursionError) as error:
        raise Problem("malformed-json", f"{error}; JSON in UTF-8 is expected") from None
    levels, inner = 0, [value]
    while inner := [v for v in inner if isinstance(v, (dict, list))]:
        levels += 1
        if levels > depth:
            raise Problem("malformed-json", f"more than {depth} levels of arrays and objects")
        if any(isinstance(v, dict) and len(v) > MOST_KEYS for v in inner):
            # Each unknown one would be an error to be told.
            raise Problem("malformed-json", f"an object has more than {MOST_KEYS} members")
        inner = [w for v in inner for w in (v.values() if isinstance(v, dict) else v)]
    return value


def _once(pairs: list[tuple[str, Any]]) -> None:
    keys: set[str] = set()
    for key, _ in pairs:
        if key in keys:
            raise ValueError(f"the key {key!r} stands twice in one object")
        keys.add(key)


class _StrictRequest(Request):
    async def json(self) -> Any:
        if not hasattr(self, "_strict"):
            self._strict = read_json(await self.body(), self.app.state.settings.json_depth)
        return self._strict


class StrictRoute(APIRoute):
    """A route whose JSON body is read by `read_json` and must be declared as JSON."""

    def get_route_handler(self) -> Callable[[Request], Coroutine[Any, Any, Response]]:
        """Give the handler of the route, with the strict request in front."""
        handle = super().get_route_handler()

        async def strict(request: Request) -> Response:
            if self.body_field is None:
                return await handle(request)
            kind = request.headers.get("content-type", "").partition(";")[0].strip().lower()
            if kind != "application/json" and not kind.endswith("+json"):
                raise Problem(
                    "unsupported-media-type",
                    f"the body's Content-Type is {kind or 'not given'}; "
                    "application/json is expected",
                )
            request = _StrictRequest(request.scope, request.receive)
            # FastAPI would turn what goes wrong while it reads into an answer of its own.
            await request.json()
            return await handle(request)

        return strict
