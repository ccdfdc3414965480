"""A service in memory that keeps the contract of the HTTP interface.

`FakeService` is a handler for `httpx2.MockTransport`.
"""

from __future__ import annotations

import gzip
import hashlib
import json
import random
import tempfile
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx2

from lobefit.fitting.batch_table import table_makers
from tests.service.fake_network import Pieces, answer, pieces, problem

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
CHART = {"schema": "lobefit.chart/1", "answer": "Fit lambert.", "finding": "It is <b>fast."}
STEPS = 6


class FakeService:
    """Handles requests; what was made is in `measurements`, `fits`, `charts` and `batches`."""

    def __init__(self) -> None:
        self.measurements: dict[str, dict[str, Any]] = {}
        self.fits: dict[str, dict[str, Any]] = {}
        self.charts: dict[str, dict[str, Any]] = {}
        self.batches: dict[str, dict[str, Any]] = {}
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
            case ["POST", "v1", "fits" | "charts" | "batches" as kind]:
                return self.submit(request, kind)
            case ["GET", "v1", "fits" | "charts" | "batches" as kind]:
                rows = {id: self.resource(id) for id in self.kept(kind)}
                # In a batch's list the newest is first; others are read in the order of making.
                newest = dict(reversed(rows.items())) if "batch" in request.url.params else rows
                return self.page(request, newest)
            case [method, "v1", "fits" | "charts" | "batches" as kind, id, *rest]:
                if id not in self.kept(kind):
                    return problem(404, "not-found", f"there is no such {id.partition('-')[0]}")
                do = self.batch if kind == "batches" else self.fit
                return do(request, method, id, rest)
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
            if all(query.get(k, row.get(k)) == row.get(k) for k in ("state", "batch"))
        ]
        start = int(query.get("cursor", "0"))
        size = min(int(query["limit"]), 2)  # short pages, so that cursors matter
        following = str(start + size) if start + size < len(items) else None
        return answer(200, {"items": items[start : start + size], "next": following})

    def kept(self, kind: str) -> dict[str, dict[str, Any]]:
        return {"fits": self.fits, "charts": self.charts, "batches": self.batches}[kind]

    def row(self, id: str) -> dict[str, Any]:
        return next(rows[id] for rows in (self.fits, self.charts, self.batches) if id in rows)

    def submit(self, request: httpx2.Request, kind: str) -> httpx2.Response:
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
        for k, item in enumerate(body.get("items", ())):
            if item["measurement"] not in self.measurements:
                detail = "there is no such measurement"
                errors = [{"pointer": f"/items/{k}/measurement", "detail": detail}]
                return problem(404, "not-found", f"{detail}; upload it first", errors=errors)
        id = f"{kind.removesuffix('s').removesuffix('e')}-{len(self.keys) + 1}"
        self.keys[key] = (id, request.content)
        if kind == "batches":
            self.batches[id] = {"id": id, "name": body["name"], "created": CREATED}
            for k, item in enumerate(body["items"]):
                given = {**body, "name": None, **item}
                del given["items"]
                self.fits[f"{id}-{k}"] = self.queued(f"{id}-{k}", given) | {"batch": id}
        else:
            self.kept(kind)[id] = self.queued(id, body)
        return answer(202, self.resource(id))

    def queued(self, id: str, body: dict[str, Any]) -> dict[str, Any]:
        return {
            "id": id,
            "name": body["name"],
            "measurement": body.get("measurement"),
            "request": body,
            "state": "queued",
            "created": CREATED,
            "position": 1,
            "_at": 0,
            "_end": "failed" if body["name"] == "bad" else "done",
        }

    def resource(self, id: str, documents: bool = False) -> dict[str, Any]:
        row = {k: v for k, v in self.row(id).items() if not k.startswith("_")}
        if id in self.batches:
            return row | self.tally(id)
        kind = "charts" if id in self.charts else "fits"
        row |= {"artefacts": [], "progress": None, "problem": None, "attempts": 1, "later": "new"}
        if row["state"] == "done":
            row["artefacts"] = [
                {
                    "name": name,
                    "bytes": len(content),
                    "media_type": "application/octet-stream",
                    "sha256": hashlib.sha256(content).hexdigest(),
                    "href": f"/v1/{kind}/{id}/artefacts/{name}",
                }
                for name, content in self.files.items()
            ]
            said: dict[str, Any] = {"best": "ggx", "verdict": REPORT["verdict"]}
            full: dict[str, Any] = {"result": REPORT, "posterior": POSTERIOR}
            if kind == "charts":
                said = {name: CHART[name] for name in ("answer", "finding")}
                full = {"result": CHART}
            row |= {**said, "ended": CREATED, **(full if documents else {})}
        if row["state"] == "failed":
            row["problem"] = {
                "type": "/problems/invalid-request",
                "detail": "no candidate could be fitted",
            }
        return row

    def advance(self, id: str) -> tuple[int, str, dict[str, Any]]:
        """Let a fit do its next step; gives the event of it."""
        row = self.row(id)
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
        row = self.row(id)
        if method == "DELETE":
            if row["state"] in TERMINAL:
                if request.url.params.get("keep") == "true":
                    return problem(409, "conflict", "nothing to cancel")
                (self.charts if id in self.charts else self.fits).pop(id)
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

    def fits_of(self, batch: str) -> list[dict[str, Any]]:
        return [row for row in self.fits.values() if row.get("batch") == batch]

    def tally(self, id: str) -> dict[str, Any]:
        """Count the fits of a batch."""
        counts = Counter({state: 0 for state in ("queued", "running", *TERMINAL)})
        counts.update(row["state"] for row in self.fits_of(id))
        ended = sum(counts[state] for state in TERMINAL) == counts.total()
        state = "running" if not ended else "cancelled" if counts["cancelled"] else "done"
        return {
            "state": state,
            "total": counts.total(),
            "counts": dict(counts),
            "ended": CREATED if ended else None,
            "seconds_left": None if ended else 2.0,
        }

    def batch(
        self, request: httpx2.Request, method: str, id: str, rest: list[str]
    ) -> httpx2.Response:
        rows = self.fits_of(id)
        if method == "DELETE":
            if self.tally(id)["ended"]:
                if request.url.params.get("keep") == "true":
                    return problem(409, "conflict", "nothing to cancel")
                for row in (*rows, self.batches[id]):
                    (self.batches if row["id"] == id else self.fits).pop(row["id"])
                return httpx2.Response(204)
            for row in rows:
                if row["state"] not in TERMINAL:
                    row["_at"], row["state"] = STEPS, "cancelled"
            return answer(202, self.resource(id))
        if rest == ["summary.png"]:
            return httpx2.Response(200, content=b"\x89PNG")
        if rest:
            table = [
                {"name": row["name"], "status": row["state"], "described": True, "rmse": 0.25}
                | {"model": "ggx", "directions": 2, "verdict": '-"so, so"\nand so', "file": "12"}
                | {"parameters": [{"parameter": "alpha", "value": 0.3, "unit": "1"}]}
                for row in rows
            ]
            with tempfile.TemporaryDirectory() as folder:
                table_makers(table)[rest[0]](path := Path(folder, rest[0]))
                return httpx2.Response(200, content=path.read_bytes())
        for row in rows:
            if row["state"] not in TERMINAL and not (row["name"] or "").startswith("slow"):
                self.advance(row["id"])
        return answer(200, self.resource(id))

    def events(self, request: httpx2.Request, id: str) -> httpx2.Response:
        last = int(request.headers.get("last-event-id", "0"))

        def said() -> Iterator[bytes]:
            yield b"retry: 1000\n\n: a comment\n\n"
            for at in range(last + 1, STEPS + 1):
                row = self.row(id)
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
