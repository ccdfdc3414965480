"""The client on a network that drops, repeats, delays and cuts, and with a busy service."""

from __future__ import annotations

import itertools
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx2
import pytest

from lobefit.service import Client, ServiceError
from lobefit.service.client import Fit, Retries
from tests.service.clients import CSV, Kind, blocking, both
from tests.service.fake_network import Faulty, Pieces, problem
from tests.service.fake_service import FakeService

pytestmark = pytest.mark.usefixtures("quick_polls")


def everything(client: Any, folder: Path) -> list[Any]:
    """Use all of the client; gives all that came of it."""
    stored = client.upload(CSV, name="paint.csv")
    first = client.fit(stored, posterior=True, name="first", wait=True, progress=False)
    second = client.fit(stored.id, ["ggx"], name="second")
    done = client.wait(second, progress=False)
    stopped = client.cancel(client.fit(CSV, name="slow one"))
    removed = client.fit(CSV, name="slow two")
    client.delete(removed)
    files = client.download(first, folder)
    chart = client.chart(stored, name="chart", wait=True, progress=False)
    batch = client.batch([CSV, {"measurement": CSV, "name": "bad"}], wait=True, progress=False)
    return [
        chart,
        batch,
        client.fits(batch=batch),
        stored,
        first,
        done,
        stopped.state,
        client.result(first),
        {name: path.read_bytes() for name, path in files.items()},
        client.evaluate("ggx", {"k_d": 1.0}, theta_i_deg=0, theta_o_deg=[0, 1], phi_o_deg=0),
        client.simulate("ggx", {"k_d": 1.0}),
        client.models(),
        client.check(stored),
        client.ready(),
        [f.name for f in client.fits()],
        client.measurements(),
    ]


@both
def test_faults_change_nothing(client_of: Kind, tmp_path: Path) -> None:
    """Results are those of a clean run, and nothing is submitted twice."""
    clean = everything(blocking(httpx2.MockTransport(FakeService())), tmp_path / "clean")
    met = dict.fromkeys(Faulty.KINDS, 0)
    for seed in range(8):
        service = FakeService()
        network = Faulty(service, seed, share=0.4)
        found = everything(client_of(network), tmp_path / str(seed))
        assert found == clean, f"seed {seed}"
        assert len(service.keys) == 6, "something was submitted twice"
        assert len(service.measurements) == 1
        assert not list((tmp_path / str(seed)).glob(".*")), "a part was left"
        for kind in met:
            met[kind] += network.met[kind]
    assert min(met.values()) > 5


@both
def test_a_wait_resumes_where_the_stream_broke(client_of: Kind, service: FakeService) -> None:
    asked: list[str | None] = []

    def breaking(request: httpx2.Request) -> httpx2.Response:
        response = service(request)
        if not request.url.path.endswith("/events"):
            return response
        asked.append(request.headers.get("last-event-id"))
        whole = response.stream
        assert isinstance(whole, Pieces)

        def half() -> Iterator[bytes]:
            yield from itertools.islice(whole.source, 4)  # an event, and the start of another
            raise httpx2.ReadError("connection reset", request=request)

        return httpx2.Response(200, headers=response.headers, stream=Pieces(half()))

    client = client_of(httpx2.MockTransport(breaking))
    seen: list[Fit] = []
    assert client.wait(client.fit(CSV, name="slow"), progress=seen.append).state == "done"
    assert asked == [None, "1", "2", "3", "4"]
    assert [f.progress.done for f in seen if f.progress] == [1, 2, 3, 4]


@both
def test_a_wait_without_events_asks_again_and_again(client_of: Kind, service: FakeService) -> None:
    honest = service.fit

    def without(request: httpx2.Request, method: str, id: str, rest: list[str]) -> httpx2.Response:
        if rest == ["events"]:
            return httpx2.Response(200, html="<p>a portal</p>")
        return honest(request, method, id, rest)

    service.fit = without  # type: ignore[method-assign]
    client = client_of(httpx2.MockTransport(service))
    assert client.fit(CSV, wait=True, progress=False).state == "done"
    events = sum(n for path, n in service.requests.items() if path.endswith("/events"))
    assert events == 2


@both
def test_a_wait_gives_up_in_time(client_of: Kind, service: FakeService) -> None:
    service.advance = lambda id: service.event(id, 2)  # type: ignore[method-assign]
    client = client_of(httpx2.MockTransport(service))
    fit = client.fit(CSV)
    with pytest.raises(ServiceError, match=r"fit-1 is still queued and goes on in the service"):
        client.wait(fit, timeout=0.05, progress=False)


@both
def test_a_service_that_is_away(client_of: Kind) -> None:
    """It is tried again, then said what is wrong; a refusal to wait for is not waited for."""
    tried = []

    def away(request: httpx2.Request) -> httpx2.Response:
        tried.append(request.url.path)
        raise httpx2.ConnectError("Connection refused", request=request)

    client = client_of(httpx2.MockTransport(away), retries=Retries(attempts=3, first=1e-4))
    with pytest.raises(
        ServiceError, match=r"reached at http://127\.0\.0\.1:8000: Connection refused; is"
    ) as caught:
        client.models()
    assert len(tried) == 4 and caught.value.status is None
    busy = problem(503, "queue-full", "1000 fits wait", headers={"retry-after": "3600"})
    client = client_of(httpx2.MockTransport(lambda _: busy))
    with pytest.raises(ServiceError, match="1000 fits wait") as full:
        client.models()
    assert full.value.slug == "queue-full"


@pytest.mark.parametrize("date", [False, True])
def test_retry_after_is_honoured(
    service: FakeService, monkeypatch: pytest.MonkeyPatch, date: bool
) -> None:
    from datetime import UTC, datetime, timedelta
    from email.utils import format_datetime

    slept: list[float] = []
    monkeypatch.setattr("time.sleep", slept.append)
    moment = format_datetime(datetime.now(UTC) + timedelta(seconds=8))
    service.refusals = [
        problem(429, "too-many-requests", "wait", headers={"retry-after": moment if date else "7"})
    ]
    with Client(transport=httpx2.MockTransport(service)) as client:
        client.models()
    assert len(slept) == 1 and 6.5 <= slept[0] <= 8.2


def test_an_interrupt_closes_the_stream(service: FakeService) -> None:
    """Ctrl-C while waiting leaves no connection behind."""
    closed = []

    class Interrupting(httpx2.SyncByteStream):
        def __iter__(self) -> Any:
            raise KeyboardInterrupt

        def close(self) -> None:
            closed.append(True)

    def handler(request: httpx2.Request) -> httpx2.Response:
        if request.url.path.endswith("/events"):
            kind = {"content-type": "text/event-stream"}
            return httpx2.Response(200, headers=kind, stream=Interrupting())
        return service(request)

    client = blocking(httpx2.MockTransport(handler))
    with pytest.raises(KeyboardInterrupt):
        client.fit(CSV, wait=True)
    assert closed


def test_a_request_is_the_same_each_time_it_is_sent(service: FakeService, tmp_path: Path) -> None:
    path = tmp_path / "large.csv"
    path.write_bytes(CSV + b"0,0,30,180,0.3\n" * 20_000)
    bodies: list[bytes] = []
    keys: list[str] = []

    def handler(request: httpx2.Request) -> httpx2.Response:
        bodies.append(request.content)
        keys.append(request.headers.get("idempotency-key", ""))
        if len(bodies) in (1, 2, 4, 5):
            raise httpx2.WriteError("broken pipe", request=request)
        return service(request)

    client = blocking(httpx2.MockTransport(handler))
    client.fit(path)
    assert bodies[0] == bodies[1] == bodies[2] == path.read_bytes()
    assert len(set(keys[3:])) == 1 and keys[3]
    assert json.loads(bodies[5])["measurement"] in service.measurements
