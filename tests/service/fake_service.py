"""A service in memory that keeps the contract of the HTTP interface, and a network that does not.

`FakeService` is a handler for `httpx2.MockTransport`; `Faulty` puts drops, delays, repeated
requests, cut answers and busy answers between it and a client.
"""

from __future__ import annotations

import gzip
import hashlib
import json
import random
import time
from collections import Counter
from collections.abc import AsyncIterator, Callable, Iterator
from typing import Any

import httpx2

Handler = Callable[[httpx2.Request], httpx2.Response]
TERMINAL = ("done", "failed", "cancelled")
CREATED = "2026-01-02T03:04:05.678Z"

REPORT = {
    "schema": "lobefit.report/1",
    "verdict": "ggx describes this surface to within its noise.",
    "described": True,
    "metric": "relative",
    "results": [
        {
            "rank": rank,
            "candidate": name,
            "model": name,
            "title": f"The model {name} <b>",
            "options": {},
            "channels": ["R"],
            "params": {"k_d": [0.1], "alpha": 0.3},
            "n_parameters": 2,
            "estimates": [
                {
                    "name": "alpha",
                    "channel": None,
                    "value": 0.3,
                    "standard_error": 0.01,
                    "status": "free",
                    "unit": "1",
                    "meaning": "roughness",
                }
            ],
            "rmse": 0.02 * rank,
            "bic_difference": 3.0 * (rank - 1),
        }
        for rank, name in ((1, "ggx"), (2, "beckmann"))
    ],
    "failed": [{"candidate": "ward", "reason": "<script>alert(1)</script>"}],
}
POSTERIOR = {"converged": True, "summary": {"alpha": {"mean": 0.3}}}
STEPS = 6


class FakeService:
    """Handles requests; what was made is in `measurements` and `fits`."""

    def __init__(self) -> None:
        self.measurements: dict[str, dict[str, Any]] = {}
        self.fits: dict[str, dict[str, Any]] = {}
        self.keys: dict[str, tuple[str, bytes]] = {}
        self.requests: Counter[str] = Counter()
        self.refusals: list[httpx2.Response] = []
        self.files = {
            "report.json": json.dumps(REPORT).encode(),
            "fit.png": random.Random(1).randbytes(100_000),
            "posterior.nc": b"netcdf",
        }

    def __call__(self, request: httpx2.Request) -> httpx2.Response:
        """Answer a request."""
        parts = request.url.path.strip("/").split("/")
        self.requests[f"{request.method} {request.url.path}"] += 1
        if self.refusals:
            return self.refusals.pop(0)
        match [request.method, *parts]:
            case ["GET", "readyz"]:
                return answer(200, {"ready": True, "device": "CPU", "store": "ok", "new": 1})
            case ["POST", "v1", "measurements"]:
                return self.upload(request)
            case ["GET", "v1", "measurements"]:
                return self.page(request, self.measurements)
            case ["GET" | "DELETE" as method, "v1", "measurements", id]:
                if id not in self.measurements:
                    return problem(404, "not-found", "there is no such measurement")
                if method == "DELETE":
                    del self.measurements[id]
                    return httpx2.Response(204)
                return answer(200, self.measurements[id])
            case ["POST", "v1", "fits"]:
                return self.submit(request)
            case ["GET", "v1", "fits"]:
                return self.page(request, self.fits)
            case [method, "v1", "fits", id, *rest]:
                if id not in self.fits:
                    return problem(404, "not-found", "there is no such fit")
                return self.fit(request, method, id, rest)
            case ["POST", "v1", "evaluate"]:
                return self.evaluate(json.loads(request.content))
            case ["POST", "v1", "simulate"]:
                return httpx2.Response(200, content=b"theta_i,phi_i,theta_o,phi_o,R\n0,0,10,0,1\n")
            case ["GET", "v1", "models"]:
                item = {"name": "ggx", "title": "GGX", "parameters": [], "later": True}
                return answer(200, {"items": [item]})
        return problem(404, "not-found", "there is nothing")

    def upload(self, request: httpx2.Request) -> httpx2.Response:
        content = request.content
        if request.headers["content-type"] == "application/gzip":
            content = gzip.decompress(content)
        if b"bad" in content:
            place: dict[str, Any] = {
                "file": "x.csv",
                "row": 3,
                "column": "R",
                "text": "bad",
                "expected": "a number",
            }
            return problem(422, "invalid-measurement", "'bad' is not a number", **place)
        id = hashlib.sha256(content).hexdigest()
        new = id not in self.measurements
        self.measurements.setdefault(
            id,
            {
                "id": id,
                "name": request.url.params.get("name", "unnamed"),
                "bytes": len(content),
                "created": CREATED,
                "summary": {"channels": [{"name": "R"}], "rows": {"used": 2}, "notes": ["<i>"]},
                "checks": {
                    "suspicious": ["peak"],
                    "checks": [
                        {
                            "name": "peak",
                            "verdict": "suspicious",
                            "figures": {"theta_deg": 1.5},
                            "sentence": "It is off.",
                            "remedy": "Turn it.",
                        }
                    ],
                },
                "warnings": ["It is off."],
            },
        )
        return answer(201 if new else 200, self.measurements[id])

    def page(self, request: httpx2.Request, rows: dict[str, dict[str, Any]]) -> httpx2.Response:
        query = request.url.params
        items = [
            {k: v for k, v in row.items() if not k.startswith("_")}
            for row in rows.values()
            if query.get("state", row.get("state")) == row.get("state")
        ]
        start = int(query.get("cursor", "0"))
        size = min(int(query["limit"]), 2)  # short pages, so that cursors matter
        following = str(start + size) if start + size < len(items) else None
        return answer(200, {"items": items[start : start + size], "next": following})

    def submit(self, request: httpx2.Request) -> httpx2.Response:
        body = json.loads(request.content)
        key = request.headers["idempotency-key"]
        if key in self.keys:
            id, before = self.keys[key]
            if before != request.content:
                return problem(409, "conflict", "the key belongs to another request")
            return answer(200, self.resource(id))
        if "no_such" in body["models"]:
            detail = "there is no model 'no_such'"
            errors = [{"pointer": "/models/0", "detail": detail}]
            return problem(422, "unknown-model", detail, errors=errors)
        id = f"fit-{len(self.keys) + 1}"
        self.keys[key] = (id, request.content)
        self.fits[id] = {
            "id": id,
            "name": body["name"],
            "measurement": body["measurement"],
            "request": body,
            "state": "queued",
            "created": CREATED,
            "position": 1,
            "_at": 0,
            "_end": "failed" if body["name"] == "bad" else "done",
        }
        return answer(202, self.resource(id))

    def resource(self, id: str, documents: bool = False) -> dict[str, Any]:
        row = {k: v for k, v in self.fits[id].items() if not k.startswith("_")}
        row |= {"artefacts": [], "progress": None, "problem": None, "attempts": 1, "later": "new"}
        if row["state"] == "done":
            row["artefacts"] = [
                {
                    "name": name,
                    "bytes": len(content),
                    "media_type": "application/octet-stream",
                    "sha256": hashlib.sha256(content).hexdigest(),
                    "href": f"/v1/fits/{id}/artefacts/{name}",
                }
                for name, content in self.files.items()
            ]
            row |= {"best": "ggx", "verdict": REPORT["verdict"], "ended": CREATED}
            row |= {"result": REPORT, "posterior": POSTERIOR} if documents else {}
        if row["state"] == "failed":
            row["problem"] = {
                "type": "/problems/invalid-request",
                "detail": "no candidate could be fitted",
            }
        return row

    def advance(self, id: str) -> tuple[int, str, dict[str, Any]]:
        """Let a fit do its next step; gives the event of it."""
        row = self.fits[id]
        row["_at"] += 1
        row["position"] = None
        row["state"] = row["_end"] if row["_at"] == STEPS else "running"
        return self.event(id, row["_at"])

    def event(self, id: str, at: int) -> tuple[int, str, dict[str, Any]]:
        if at == 1 or at == STEPS:
            return at, "state", self.resource(id)
        progress = {"stage": "fit", "done": at - 1, "total": 4, "label": "ggx", "seconds_left": 1.0}
        return at, "progress", progress

    def fit(
        self, request: httpx2.Request, method: str, id: str, rest: list[str]
    ) -> httpx2.Response:
        row = self.fits[id]
        if method == "DELETE":
            if row["state"] in TERMINAL:
                if request.url.params.get("keep") == "true":
                    return problem(409, "conflict", "nothing to cancel")
                del self.fits[id]
                return httpx2.Response(204)
            row["_end"], row["_at"], row["state"] = "cancelled", STEPS, "cancelled"
            return answer(202, self.resource(id))
        if rest == ["events"]:
            return self.events(request, id)
        if rest and rest[0] == "artefacts":
            return self.artefact(request, rest[1])
        if row["state"] not in TERMINAL and not (row["name"] or "").startswith("slow"):
            self.advance(id)  # who only asks sees it go on too
        return answer(200, self.resource(id, documents=True))

    def events(self, request: httpx2.Request, id: str) -> httpx2.Response:
        last = int(request.headers.get("last-event-id", "0"))

        def said() -> Iterator[bytes]:
            yield b"retry: 1000\n\n: a comment\n\n"
            for at in range(last + 1, STEPS + 1):
                row = self.fits[id]
                event = self.event(id, at) if at <= row["_at"] else self.advance(id)
                yield f"id: {event[0]}\nevent: {event[1]}\n".encode()
                yield f"data: {json.dumps(event[2])}\n\n".encode()

        return httpx2.Response(
            200, headers={"content-type": "text/event-stream; charset=utf-8"}, stream=Pieces(said())
        )

    def artefact(self, request: httpx2.Request, name: str) -> httpx2.Response:
        content = self.files[name]
        etag = f'"{hashlib.sha256(content).hexdigest()}"'
        asked = request.headers.get("range", "")
        if asked and request.headers.get("if-range", etag) == etag:
            start = int(asked.removeprefix("bytes=").removesuffix("-"))
            if start >= len(content):
                return problem(416, "range-not-satisfiable", "outside of the file")
            place = f"bytes {start}-{len(content) - 1}/{len(content)}"
            return pieces(206, content[start:], {"content-range": place, "etag": etag})
        return pieces(200, content, {"etag": etag})

    def evaluate(self, body: dict[str, Any]) -> httpx2.Response:
        if "grid" in body:
            angles = [len(body["grid"][k]) for k in ("theta_i_deg", "theta_o_deg", "phi_o_deg")]
            if body["format"] == "exr":
                return httpx2.Response(200, content=b"\x76\x2f\x31\x01picture")
        else:
            angles = [len(body["directions"]["theta_o_deg"])]
            assert {len(a) for a in body["directions"].values()} == set(angles)
        count = 1
        for n in angles:
            count *= n
        row = [body["params"]["k_d"] + k for k in range(count)]
        return answer(200, {"channels": ["R"], "values": [row], "shape": angles})


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
