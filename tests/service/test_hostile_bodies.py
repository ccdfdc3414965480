"""Bodies made to break a server, against every operation: no answer is 500 or above.

A fuzzer that follows the schema does not make these. Everything is answered at once, with a
problem document where it is refused.
"""

from __future__ import annotations

import asyncio
import gzip
import json
import re
import zlib
from collections.abc import Iterator
from typing import Any

import pytest
from starlette.types import ASGIApp, Message, Scope

from tests.service.fake_worker import CSV, Service, service

ID = "0" * 64
FORM = "multipart/form-data; boundary=x"


def form(name: str, text: bytes, head: bytes = b"") -> bytes:
    start = b'--x\r\nContent-Disposition: form-data; name="' + name.encode() + b'"' + head
    return start + b"\r\n\r\n" + text + b"\r\n--x--\r\n"


def fit(**more: Any) -> bytes:
    return json.dumps({"measurement": ID, **more}).encode()


def batch(items: Any) -> bytes:
    return json.dumps({"items": items}).encode()


JSON_BODIES: dict[str, bytes] = {
    "nothing": b"",
    "space": b" \n\t ",
    "null": b"null",
    "true": b"true",
    "number": b"1",
    "string": b'"x"',
    "list": b"[]",
    "empty object": b"{}",
    "NaN": b'{"tolerance": NaN}',
    "Infinity": b'{"tolerance": Infinity}',
    "-Infinity": b'{"tolerance": -Infinity}',
    "bare NaN": b"NaN",
    "1e999": b'{"tolerance": 1e999}',
    "-1e999": b'{"tolerance": -1e999}',
    "1e999 in params": b'{"model": "ggx", "params": {"alpha": 1e999}, "noise": [1e999, 0]}',
    "1e999 as seed": b'{"seed": 1e999}',
    "huge integer": b'{"seed": ' + b"9" * 5000 + b"}",
    "integer beyond float": b'{"tolerance": 1' + b"0" * 400 + b"}",
    "integer beyond SQLite": fit(seed=2**63),
    "negative seed": fit(seed=-1),
    "seed as text": fit(seed="1"),
    "seed as truth": fit(seed=True),
    "lone surrogate": b'{"name": "\\ud800"}',
    "low surrogate": b'{"name": "\\udc00"}',
    "swapped surrogates": b'{"name": "\\udc00\\ud800"}',
    "surrogate as key": b'{"\\ud800": 1}',
    "surrogate in models": b'{"measurement": "' + ID.encode() + b'", "models": ["\\ud800"]}',
    "encoded surrogate": b'{"name": "\xed\xa0\x80"}',
    "bad UTF-8": b'{"name": "\xff\xfe"}',
    "cut UTF-8": b'{"name": "\xe2\x82"}',
    "overlong UTF-8": b'{"name": "\xc0\xaf"}',
    "Latin-1": '{"name": "é"}'.encode("latin-1"),
    "byte order mark": b"\xef\xbb\xbf{}",
    "UTF-16": '{"name": 1}'.encode("utf-16"),
    "UTF-32": '{"name": 1}'.encode("utf-32"),
    "NUL": b"\0",
    "NUL in text": b'{"name": "a\\u0000b"}',
    "raw NUL in text": b'{"name": "a\0b"}',
    "raw newline in text": b'{"name": "a\nb"}',
    "100,000 lists": b"[" * 100_000,
    "100,000 lists, closed": b"[" * 100_000 + b"]" * 100_000,
    "100,000 objects": b'{"a":' * 100_000,
    "65 levels": b'{"options":' + b"[" * 65 + b"]" * 65 + b"}",
    "deep options": b'{"options":' + b'{"a":' * 150 + b"1" + b"}" * 151,
    "twice the key": b'{"seed": 1, "seed": 2}',
    "trailing comma": b'{"seed": 1,}',
    "comment": b'{"seed": 1} // x',
    "single quotes": b"{'seed': 1}",
    "cut off": b'{"seed": 1',
    "cut off text": b'{"name": "x',
    "two documents": b"{}{}",
    "bad escape": b'{"name": "\\x"}',
    "cut escape": b'{"name": "\\u12"}',
    "hex number": b'{"seed": 0x10}',
    "leading zero": b'{"seed": 01}',
    "prototype": b'{"__proto__": {"a": 1}, "constructor": 1}',
    "dunder keys": b'{"__class__": "x", "model_config": {}}',
    "long name": fit(name="x" * 100_000),
    "long key": json.dumps({"k" * 100_000: 1}).encode(),
    "many keys": json.dumps({f"k{i}": 1 for i in range(20_000)}).encode(),
    "many models": fit(models=["ggx"] * 20_000),
    "empty models": fit(models=[]),
    "formula": fit(name="=cmd|' /C calc'!A0"),
    "markup": fit(name="<script>alert(1)</script>"),
    "path as id": b'{"measurement": "../../../etc/passwd"}',
    "SQL as id": b'{"measurement": "x\' OR 1=1 --"}',
    "models as object": fit(models={"a": 1}),
    "posterior as list": fit(posterior=[1]),
    "posterior without end": fit(posterior={"steps": 10**18}),
    "denormal": fit(tolerance=5e-324),
    "minus zero": fit(max_theta_deg=-0.0),
    "items as object": batch({"a": 1}),
    "no items": batch([]),
    "too many items": batch([{}] * 1001),
    "items without a measurement": batch([{"name": "x"}] * 1000),
    "items in items": batch([{"measurement": ID, "items": [{"measurement": ID}]}]),
    "unknown measurements": batch([{"measurement": ID}] * 1000),
    "unknown models everywhere": batch([{"measurement": ID, "models": ["gg"] * 64}] * 1000),
    "truth as text": json.dumps({"truth": "ggx"}).encode(),
    "both": fit(truth={"model": "ggx"}),
    "truth of a huge geometry": json.dumps(
        {"truth": {"model": "ggx", "geometry": "in-plane step=1e-300"}}
    ).encode(),
    "endless repeats": fit(repeats=10**18),
    "unknown groups": fit(groups=["fit"] * 3 + ["x"]),
    "wrong lengths": json.dumps(
        {
            "model": "ggx",
            "directions": {
                "theta_i_deg": [1, 2],
                "phi_i_deg": [1],
                "theta_o_deg": [1],
                "phi_o_deg": [1],
            },
        }
    ).encode(),
    "million directions": json.dumps(
        {
            "model": "ggx",
            "grid": {"theta_i_deg": [1] * 900, "theta_o_deg": [1] * 900, "phi_o_deg": [1] * 900},
        }
    ).encode(),
    "huge geometry": b'{"model": "ggx", "geometry": "in-plane step=1e-300"}',
    "huge noise": b'{"model": "ggx", "noise": [1e308, 1e308]}',
    "too large": b'{"name": "' + b"x" * 1_100_000 + b'"}',
}
OTHER_BODIES: dict[str, tuple[str, bytes]] = {
    "form without a file": (FORM, form("other", b"x")),
    "form with text as file": (FORM, form("file", b"x")),
    "form with an empty file": (FORM, form("file", b"", b'; filename=""')),
    "form with a path": (FORM, form("file", CSV, b'; filename="../../etc/passwd"')),
    "form with a bad name": (FORM, form("file", b"x", b"; filename*=utf-8''%ff%fe%00")),
    "form with two files": (FORM, form("file", b"x", b'; filename="a"') * 2),
    "form that is cut": (FORM, form("file", CSV, b'; filename="a"')[:-20]),
    "form without boundary": ("multipart/form-data", form("file", CSV)),
    "form with a long boundary": ("multipart/form-data; boundary=" + "x" * 5000, b"--x--"),
    "form of garbage": (FORM, bytes(range(256)) * 10),
    "form with huge headers": (FORM, form("file", b"x", b"; x=" + b"y" * 200_000)),
    "form with many fields": (FORM, form("a", b"b") * 5000),
    "form with a bad charset": (FORM + "; charset=utf-7", form("file", b"x", b'; filename="a"')),
    "urlencoded": ("application/x-www-form-urlencoded", b"a=%00&b=%ff"),
    "no type": ("", b"{}"),
    "odd type": ("text/csv; charset=\xff; ;;=", CSV),
    "JSON as CSV": ("text/csv", b'{"a": 1}'),
    "NULs as CSV": ("text/csv", bytes(10_000)),
    "UTF-16 CSV": ("text/csv", CSV.decode().encode("utf-16")),
    "one long line": ("text/csv", b"1," * 300_000),
    "formulas": ("text/csv", b"=1+1,@x\n"),
    "gzip that is cut": ("application/gzip", gzip.compress(CSV)[:-5]),
    "gzip with a bad sum": ("application/gzip", gzip.compress(CSV)[:-8] + b"\0" * 8),
    "gzip of nothing": ("application/gzip", gzip.compress(b"")),
    "gzip bomb": ("application/gzip", gzip.compress(gzip.compress(bytes(80_000_000)))),
    "gzip in gzip in gzip": ("application/gzip", gzip.compress(gzip.compress(gzip.compress(CSV)))),
    "gzip's first byte": ("application/gzip", b"\x1f"),
    "zlib": ("application/gzip", zlib.compress(CSV)),
    "rest after gzip": ("application/gzip", gzip.compress(CSV) + b"garbage"),
    "MERL with huge sizes": ("application/octet-stream", b"\xff\xff\xff\x7f" * 3 + bytes(100)),
    "random": ("application/octet-stream", bytes((k * 7919 >> 3) & 255 for k in range(5000))),
}
OPERATIONS = [
    ("POST", "/v1/measurements"),
    ("POST", "/v1/measurements?name=%00%ff%ed%a0%80"),
    ("GET", "/v1/measurements"),
    ("GET", f"/v1/measurements/{ID}"),
    ("DELETE", f"/v1/measurements/{ID}"),
    ("GET", f"/v1/measurements/{ID}/data"),
    ("GET", f"/v1/measurements/{ID}/table"),
    ("POST", "/v1/fits"),
    ("GET", "/v1/fits"),
    ("GET", "/v1/fits/none"),
    ("DELETE", "/v1/fits/none"),
    ("GET", "/v1/fits/none/events"),
    ("GET", "/v1/fits/none/curves"),
    ("GET", "/v1/fits/none/sphere"),
    ("GET", "/v1/fits/none/artefacts/report.json"),
    ("GET", "/v1/fits/none/artefacts.zip"),
    ("POST", "/v1/charts"),
    ("GET", "/v1/charts"),
    ("GET", "/v1/charts/none"),
    ("DELETE", "/v1/charts/none"),
    ("GET", "/v1/charts/none/events"),
    ("GET", "/v1/charts/none/artefacts/chart.json"),
    ("GET", "/v1/charts/none/artefacts.zip"),
    ("POST", "/v1/batches"),
    ("GET", "/v1/batches"),
    ("GET", "/v1/batches/none"),
    ("DELETE", "/v1/batches/none"),
    ("GET", "/v1/batches/none/table.csv"),
    ("GET", "/v1/batches/none/parameters.csv"),
    ("GET", "/v1/batches/none/summary.png"),
    ("GET", "/v1/models"),
    ("GET", "/v1/models/ggx"),
    ("POST", "/v1/evaluate"),
    ("POST", "/v1/simulate"),
    ("GET", "/healthz"),
    ("GET", "/readyz"),
    ("GET", "/metrics"),
]
READERS = [(m, p) for m, p in OPERATIONS if m == "POST"]
OTHERS = [(m, p) for m, p in OPERATIONS if m != "POST"]


@pytest.fixture(scope="module")
def running(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Service]:
    with service(tmp_path_factory.mktemp("data")) as found:
        while found.client.get("/readyz").status_code != 200:
            pass
        yield found


def check(running: Service, method: str, path: str, kind: str, body: bytes) -> None:
    headers = {b"Content-Type": kind.encode("latin-1")} if kind else {}
    answer = running.client.request(method, path, content=body, headers=headers)
    assert answer.status_code < 500, answer.text
    if answer.status_code >= 400:
        assert answer.headers["content-type"] == "application/problem+json"
        assert answer.json()["detail"]


def test_the_corpus_is_large_and_meets_every_operation(running: Service) -> None:
    assert len(JSON_BODIES) + len(OTHER_BODIES) >= 100
    document = running.client.get("/openapi.json").json()
    left = [
        (method, path)
        for path, methods in document["paths"].items()
        for method in methods
        if not any(
            method.upper() == m
            and re.fullmatch(re.sub(r"{\w+}", "[^/]+", path), p.partition("?")[0])
            for m, p in OPERATIONS
        )
    ]
    assert left == []


@pytest.mark.parametrize("name", JSON_BODIES)
def test_hostile_json(running: Service, name: str) -> None:
    for method, path in READERS:
        for kind in ("application/json", "text/csv"):
            check(running, method, path, kind, JSON_BODIES[name])


@pytest.mark.parametrize("name", OTHER_BODIES)
def test_hostile_forms_and_files(running: Service, name: str) -> None:
    for method, path in READERS:
        check(running, method, path, *OTHER_BODIES[name])


async def statuses(app: ASGIApp, method: str, path: str, bodies: list[bytes]) -> list[int]:
    """Ask without a client in between, which takes ten times as long as the application."""
    found: list[int] = []

    async def one(body: bytes) -> None:
        async def receive() -> Message:
            return {"type": "http.request", "body": body}

        async def send(message: Message) -> None:
            if message["type"] == "http.response.start":
                found.append(message["status"])

        headers = [(b"content-type", b"application/json")]
        if body:
            headers.append((b"content-length", str(len(body)).encode()))
        scope: Scope = {"type": "http", "method": method, "path": path, "query_string": b""}
        await app({**scope, "headers": headers, "app": app, "root_path": ""}, receive, send)

    for body in bodies:
        await one(body)
    return found


@pytest.mark.parametrize(("method", "path"), OTHERS)
def test_bodies_where_none_belongs(running: Service, method: str, path: str) -> None:
    """Operations that read no body answer as if there were none."""
    bodies = [*JSON_BODIES.values(), *(body for _, body in OTHER_BODIES.values())]
    without, *found = asyncio.run(statuses(running.client.app, method, path, [b"", *bodies]))
    assert without < 500
    expected = [413 if len(body) > 1 << 20 else without for body in bodies]
    assert found == expected


@pytest.mark.parametrize(
    "query",
    [
        "limit=NaN",
        "limit=1e9",
        "limit=-1",
        "limit=%00",
        "limit=1&limit=2",
        "cursor=%ff",
        "cursor=%ed%a0%80",
        "cursor=99999999999999999999",
        "cursor=x'--",
        "state=%00",
        "measurement=%F0%9F",
        "max_points=1e400",
        "batch=%00",
        "model=%00",
        "model=" + "x" * 5000,
        "a" * 8000,
        "=&=&&;",
    ],
)
def test_hostile_queries(running: Service, query: str) -> None:
    for method, path in OTHERS:
        check(running, method, f"{path}?{query}", "", b"")


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("Idempotency-Key", b"\xff\xfe"),
        ("Idempotency-Key", b"x" * 5000),
        ("Idempotency-Key", b" "),
        ("Last-Event-ID", b"-1"),
        ("Last-Event-ID", b"9" * 400),
        ("Last-Event-ID", "²".encode("latin-1")),
        ("Range", b"bytes=0-99999999999999999999999"),
        ("Range", b"bytes=" + b"0-1," * 3000),
        ("Range", b"bytes=5-1"),
        ("If-None-Match", b'"' * 4000),
        ("If-Range", b"Mon, 99 Foo 9999"),
        ("Accept", b"\x80/*;q=NaN"),
        ("Content-Length", b"1e3"),
        ("Content-Length", "²".encode("latin-1")),
        ("Content-Encoding", b"gzip, gzip"),
        ("X-Request-Id", b'"}{"a":"'),
        ("Host", b"a b\xff"),
        ("Origin", b"null"),
        ("Authorization", b"Bearer \xff"),
    ],
)
def test_hostile_headers(running: Service, name: str, value: bytes) -> None:
    id = running.upload()
    for method, path in (*OPERATIONS, ("GET", f"/v1/measurements/{id}/data")):
        body = fit() if method == "POST" else b""
        headers = {b"Content-Type": b"application/json", name.encode(): value}
        answer = running.client.request(method, path, content=body, headers=headers)
        assert answer.status_code < 500, (path, answer.text)
