"""Limits, headers, refusals, logs and metrics: what holds for every request."""

from __future__ import annotations

import asyncio
import gzip
import io
import json
import subprocess
import sys
import zlib
from collections.abc import AsyncIterator, Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from starlette.datastructures import Headers
from starlette.types import Message, Receive, Scope, Send

from lobefit.service.edge import CONTENT_SECURITY_POLICY, Edge, Seen
from lobefit.service.observe import logged
from lobefit.service.problems import Problem
from lobefit.service.rows import Limits
from lobefit.service.settings import Settings
from tests.service.fake_worker import CSV, Service, service
from tests.service.test_http_resources import is_problem

TEXT = {"Content-Type": "text/csv"}
JSON = {"Content-Type": "application/json"}


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Service]:
    """A service with small limits."""
    with service(
        tmp_path_factory.mktemp("data"),
        Limits(queue=2, reserve=0),
        upload_bytes=100_000,
        json_bytes=2000,
        json_depth=8,
        uploads=1,
        quick_seconds=0.3,
    ) as found:
        yield found


def chunked(data: bytes) -> Iterator[bytes]:
    """Make a body whose length is not declared."""
    for k in range(0, len(data), 1000):
        yield data[k : k + 1000]


def test_every_answer_has_an_id_and_the_security_headers(small: Service) -> None:
    for path in (
        "/healthz",
        "/nothing",
        "/v1/fits",
        "/openapi.json",
        "/docs",
        "/problems/internal",
    ):
        answer = small.client.get(path)
        assert answer.headers["content-security-policy"] == CONTENT_SECURITY_POLICY
        assert "default-src 'self'" in CONTENT_SECURITY_POLICY
        assert answer.headers["x-content-type-options"] == "nosniff"
        assert answer.headers["x-frame-options"] == "DENY"
        assert answer.headers["referrer-policy"] == "no-referrer"
        assert "access-control-allow-origin" not in answer.headers
        assert len(answer.headers["x-request-id"]) == 32
    given = small.client.get("/healthz", headers={"X-Request-Id": "mine-1"})
    assert given.headers["x-request-id"] == "mine-1"
    bad = small.client.get("/healthz", headers={"X-Request-Id": 'a" b'})
    assert len(bad.headers["x-request-id"]) == 32


@pytest.mark.parametrize("send", [bytes, chunked])
def test_bodies_are_bounded_declared_or_not(small: Service, send: Callable[[bytes], Any]) -> None:
    answer = small.client.post("/v1/measurements", content=send(bytes(200_000)), headers=TEXT)
    is_problem(answer, 413, "too-large")
    answer = small.client.post("/v1/measurements", content=send(b"1" * 100_001), headers=TEXT)
    assert "100000" in is_problem(answer, 413, "too-large")["detail"]
    bomb = gzip.compress(gzip.compress(bytes(50_000_000)))
    assert len(bomb) < 2000
    answer = small.client.post("/v1/measurements", content=send(bomb), headers=TEXT)
    assert "decompression" in is_problem(answer, 413, "too-large")["detail"]
    answer = small.client.post("/v1/fits", content=send(b" " * 2001), headers=JSON)
    is_problem(answer, 413, "too-large")
    assert list(small.store.files.tmp.iterdir()) == []


def test_a_form_file_is_bounded_too(small: Service) -> None:
    answer = small.client.post("/v1/measurements", files={"file": ("a", bytes(100_001))})
    is_problem(answer, 413, "too-large")


def test_encodings_that_are_not_read(small: Service) -> None:
    for path, headers in (
        ("/v1/measurements", {**TEXT, "Content-Encoding": "br"}),
        ("/v1/fits", {**JSON, "Content-Encoding": "gzip"}),
    ):
        answer = small.client.post(path, content=zlib.compress(CSV), headers=headers)
        is_problem(answer, 415, "unsupported-media-type")


def test_more_uploads_at_once_than_allowed_are_told_to_come_again(small: Service) -> None:
    shared = small.client.app.state.shared  # type: ignore[attr-defined]
    shared.uploads += 1
    try:
        answer = small.client.post("/v1/measurements", content=CSV, headers=TEXT)
        is_problem(answer, 429, "too-many-requests")
        assert int(answer.headers["retry-after"]) >= 1
    finally:
        shared.uploads -= 1


def test_a_full_queue_is_told(small: Service) -> None:
    small.worker.silent.set()
    try:
        body = {"measurement": "0" * 64}
        small.worker.silent.clear()
        body["measurement"] = small.upload()
        small.client.get("/v1/models")
        small.worker.silent.set()
        for seed in range(2):
            assert small.client.post("/v1/fits", json={**body, "seed": seed}).status_code == 202
        answer = small.client.post("/v1/fits", json={**body, "seed": 9})
        is_problem(answer, 503, "queue-full")
        assert int(answer.headers["retry-after"]) >= 1
        places = [f["position"] for f in small.client.get("/v1/fits").json()["items"]]
        assert places == [2, 1]
    finally:
        small.worker.silent.clear()


def test_a_worker_that_does_not_answer_is_a_timeout(small: Service) -> None:
    small.worker.silent.set()
    try:
        answer = small.client.post("/v1/measurements", content=CSV + b"# late\n", headers=TEXT)
        is_problem(answer, 503, "timeout")
        assert small.store.counts().get(("inspect", "queued"), 0) == 0
    finally:
        small.worker.silent.clear()


def test_nesting_is_bounded(small: Service) -> None:
    deep = b'{"measurement":' + b"[" * 9 + b"]" * 9 + b"}"
    answer = small.client.post("/v1/fits", content=deep, headers=JSON)
    assert "8 levels" in is_problem(answer, 400, "malformed-json")["detail"]


def test_a_key_that_stands_twice_is_refused(small: Service) -> None:
    answer = small.client.post("/v1/fits", content=b'{"seed":1,"seed":2}', headers=JSON)
    assert "'seed' stands twice" in is_problem(answer, 400, "malformed-json")["detail"]


@pytest.mark.parametrize(
    ("path", "allowed"),
    [
        ("/healthz", "GET, HEAD, OPTIONS"),
        ("/v1/fits", "GET, HEAD, OPTIONS, POST"),
        ("/v1/fits/x", "DELETE, GET, HEAD, OPTIONS"),
        ("/v1/evaluate", "OPTIONS, POST"),
        ("/", "GET, HEAD, OPTIONS"),
    ],
)
def test_methods(small: Service, path: str, allowed: str) -> None:
    options = small.client.options(path)
    assert (options.status_code, options.headers["allow"]) == (204, allowed)
    for method in ("PUT", "PATCH", "TRACE", "NONSENSE"):
        answer = small.client.request(method, path)
        is_problem(answer, 405, "method-not-allowed")
        assert answer.headers["allow"] == allowed
    head = small.client.head(path)
    assert head.content == b""
    assert (head.status_code == 405) == ("GET" not in allowed)


def test_head_is_get_without_the_body(small: Service) -> None:
    get, head = small.client.get("/openapi.json"), small.client.head("/openapi.json")
    assert head.headers["content-length"] == str(len(get.content))
    assert head.content == b""


def test_readiness_tells_device_and_store(small: Service) -> None:
    for _ in range(100):
        answer = small.client.get("/readyz")
        if answer.status_code == 200:
            break
    found = answer.json()
    assert found["ready"] is True
    assert found["device"] == "a fake device"
    assert (found["store"], found["workers"]) == ("ok", 2)
    assert found["free_bytes"] > 0


def test_metrics_count_by_route_and_tell_of_jobs(small: Service) -> None:
    small.client.get("/v1/measurements/" + "0" * 64)
    text = small.client.get("/metrics").text
    assert (
        'lobefit_http_requests_total{method="GET",route="/v1/measurements/{id}",status="404"} 1.0'
        in text
    )
    assert 'lobefit_jobs{kind="inspect",state="done"}' in text
    assert 'lobefit_worker_heartbeat_age_seconds{name="desk"}' in text
    assert "lobefit_store_free_bytes" in text
    assert "0000000000" not in text


def test_the_page_and_the_documents_need_no_network(small: Service) -> None:
    page = small.client.get("/docs")
    assert page.headers["content-type"] == "text/html; charset=utf-8"
    for name in ("docs.js", "docs.css"):
        assert f'"/docs/{name}"' in page.text
        assert small.client.get(f"/docs/{name}").status_code == 200
    assert "http://" not in page.text
    assert "https://" not in page.text
    same = small.client.get("/docs", headers={"If-None-Match": page.headers["etag"]})
    assert same.status_code == 304
    for path in (
        "/static/../app.py",
        "/static/%2e%2e/app.py",
        "/static/..%2fapp.py",
        "/static//etc/passwd",
        "/static/%2Fetc/passwd",
        "/static/.hidden",
        "/static/",
        "/docs/..%2fapp.py",
        "/static/%00",
    ):
        is_problem(small.client.get(path), 404, "not-found")


def exchange(app: Any, settings: Settings, messages: list[Message], **scope: Any) -> Any:
    """Send one request to an edge; give the messages it sent and what was observed."""
    sent: list[Message] = []
    seen: list[Seen] = []
    waiting = list(messages)

    async def receive() -> Message:
        if waiting:
            return waiting.pop(0)
        await asyncio.sleep(3600)
        raise AssertionError

    async def send(message: Message) -> None:
        sent.append(message)

    edge = Edge(app, settings, seen.append, lambda scope, headers: None)
    whole: Scope = {"type": "http", "method": "POST", "path": "/v1/fits", "headers": [], **scope}
    asyncio.run(edge(whole, receive, send))
    return sent, seen


async def reads_all(scope: Scope, receive: Receive, send: Send) -> None:
    while (message := await receive())["type"] == "http.request":
        if not message.get("more_body"):
            break
    await send({"type": "http.response.start", "status": 200, "headers": []})
    await send({"type": "http.response.body", "body": b"ok"})


def test_a_body_that_stops_coming_is_given_up(tmp_path: Path) -> None:
    sent, seen = exchange(
        reads_all,
        Settings(tmp_path, body_seconds=0.05),
        [{"type": "http.request", "body": b"a", "more_body": True}],
        headers=[(b"content-length", b"10"), (b"expect", b"100-continue")],
    )
    assert sent[0]["status"] == 408
    assert Headers(raw=sent[0]["headers"])["connection"] == "close"
    assert seen[0].status == 408


def test_a_client_that_leaves_is_499_in_the_log(tmp_path: Path) -> None:
    stream = io.StringIO()

    async def waits(scope: Scope, receive: Receive, send: Send) -> None:
        from starlette.requests import ClientDisconnect

        await receive()
        raise ClientDisconnect

    _, seen = exchange(
        waits,
        Settings(tmp_path),
        [{"type": "http.disconnect"}],
        headers=[(b"content-length", b"10")],
    )
    logged(stream)(seen[0])
    line = json.loads(stream.getvalue())
    assert (line["status"], line["level"], line["path"]) == (499, "info", "/v1/fits")


def test_what_nobody_expected_is_a_problem_and_a_traceback_in_the_log(tmp_path: Path) -> None:
    async def breaks(scope: Scope, receive: Receive, send: Send) -> None:
        raise RuntimeError("secret of the house")

    stream = io.StringIO()
    sent, seen = exchange(breaks, Settings(tmp_path), [{"type": "http.request", "body": b""}])
    assert sent[0]["status"] == 500
    document = json.loads(sent[1]["body"])
    assert document["type"] == "/problems/internal"
    assert "secret" not in sent[1]["body"].decode()
    logged(stream)(seen[0])
    line = json.loads(stream.getvalue())
    assert "secret of the house" in json.dumps(line["exception"])
    assert line["request_id"] == document["instance"]


def test_a_refused_body_is_read_away_before_the_connection_closes(tmp_path: Path) -> None:
    async def refuses(scope: Scope, receive: Receive, send: Send) -> None:
        raise Problem("too-many-requests", "later")

    read: list[int] = []

    async def pieces() -> AsyncIterator[Message]:
        for k in range(5):
            read.append(k)
            yield {"type": "http.request", "body": b"x" * 100, "more_body": k < 4}

    source = pieces()
    sent: list[Message] = []

    async def receive() -> Message:
        return await anext(source)

    async def send(message: Message) -> None:
        sent.append({**message, "read": len(read)})

    edge = Edge(refuses, Settings(tmp_path), lambda seen: None, lambda scope, headers: None)
    scope: Scope = {"type": "http", "method": "POST", "path": "/v1/fits"}
    scope["headers"] = [(b"content-length", b"500")]
    asyncio.run(edge(scope, receive, send))
    # The answer is on its way before the rest is read, and ends after it.
    assert [(m["type"][14:], m["read"]) for m in sent] == [("start", 0), ("body", 0), ("body", 5)]


def test_the_server_process_imports_nothing_heavy() -> None:
    script = (
        "import sys, lobefit.service.server, lobefit.service.serve\n"
        "heavy = {'numpy', 'pyopencl', 'nlopt', 'emcee', 'matplotlib', 'h5py', 'OpenEXR'}\n"
        "assert not heavy & set(sys.modules), heavy & set(sys.modules)\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, timeout=60, check=False
    )
    assert done.returncode == 0, done.stderr
