"""A network that does not keep what was promised, and the answers that go through it.

`Faulty` puts drops, delays, repeated requests, cut answers and busy answers between a service and a
client.
"""

from __future__ import annotations

import json
import random
import time
from collections import Counter
from collections.abc import AsyncIterator, Callable, Iterator
from typing import Any

import httpx2

__all__ = ["Faulty", "Handler", "Pieces", "answer", "pieces", "problem"]

Handler = Callable[[httpx2.Request], httpx2.Response]


class Pieces(httpx2.SyncByteStream, httpx2.AsyncByteStream):
    """An answer that comes in pieces, for both kinds of client."""

    def __init__(self, source: Iterator[bytes]) -> None:
        self.source = source

    def __iter__(self) -> Iterator[bytes]:
        return self.source

    async def __aiter__(self) -> AsyncIterator[bytes]:
        for piece in self.source:
            yield piece


class Faulty(httpx2.BaseTransport, httpx2.AsyncBaseTransport):
    """A network that loses, repeats, delays and cuts; and a service that is busy.

    Parameters
    ----------
    handler : callable
        What answers.
    seed : int
        Of the faults.
    share : float
        Of requests that meet one.
    """

    KINDS = ("lost", "answer lost", "twice", "cut", "short", "delayed", "busy", "broken proxy")

    def __init__(self, handler: Handler, seed: int, share: float) -> None:
        self.handler = handler
        self.random = random.Random(seed)
        self.share = share
        self.met: Counter[str] = Counter()

    def handle_request(self, request: httpx2.Request) -> httpx2.Response:
        request.read()
        return self.answer(request)

    async def handle_async_request(self, request: httpx2.Request) -> httpx2.Response:
        await request.aread()
        return self.answer(request)

    def answer(self, request: httpx2.Request) -> httpx2.Response:
        kind = self.random.choice(self.KINDS) if self.random.random() < self.share else "none"
        self.met[kind] += 1
        if kind == "lost":
            raise httpx2.ConnectError("the network is down", request=request)
        if kind == "busy":
            status = self.random.choice((429, 503))
            return problem(status, "queue-full", "full", headers={"retry-after": "0"})
        if kind == "broken proxy":
            return httpx2.Response(502, html="<h1>Bad gateway</h1>")
        if kind == "twice":
            first = self.handler(request)
            if isinstance(first.stream, Pieces):
                list(first.stream)
        if kind == "delayed":
            time.sleep(0.002)
        response = self.handler(request)
        if kind == "answer lost":
            raise httpx2.ReadTimeout("no answer", request=request)
        if kind in ("cut", "short"):
            return self.cut(response, kind, request)
        return response

    def cut(self, response: httpx2.Response, kind: str, request: httpx2.Request) -> httpx2.Response:
        """Let an answer end too early, with an error or, where its length tells, without one."""
        whole = b"".join(response.stream)  # type: ignore[arg-type]
        keep = self.random.randrange(len(whole)) if whole else 0
        told = "content-length" in response.headers

        def said() -> Iterator[bytes]:
            yield whole[:keep]
            if kind == "cut" or not told:
                raise httpx2.RemoteProtocolError("peer closed connection", request=request)

        return httpx2.Response(
            response.status_code, headers=response.headers, stream=Pieces(said())
        )


def answer(status: int, document: dict[str, Any]) -> httpx2.Response:
    """Answer with JSON."""
    return httpx2.Response(status, json=document)


def problem(
    status: int, slug: str, detail: str, headers: dict[str, str] | None = None, **members: Any
) -> httpx2.Response:
    """Answer with a problem document."""
    document = {"type": f"/problems/{slug}", "title": slug.title(), "status": status}
    document |= {"detail": detail, "instance": "request-7", **members}
    kind = {"content-type": "application/problem+json"}
    return httpx2.Response(
        status, headers={**kind, **(headers or {})}, content=json.dumps(document).encode()
    )


def pieces(status: int, content: bytes, headers: dict[str, str]) -> httpx2.Response:
    """Answer with bytes in pieces."""
    size = 1 << 14
    source = (content[k : k + size] for k in range(0, len(content), size))
    return httpx2.Response(
        status, headers={**headers, "content-length": str(len(content))}, stream=Pieces(source)
    )
