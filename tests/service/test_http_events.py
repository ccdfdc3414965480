"""Server-sent events: in order, resumable, alive while nothing happens, and they end."""

from __future__ import annotations

import asyncio
import gc
import json
import time
from collections.abc import Iterator
from typing import Any

import pytest

from lobefit.service.events import event_stream
from lobefit.service.rows import StoreError
from lobefit.service.settings import Settings
from lobefit.service.state import Shared
from lobefit.service.store import Store
from lobefit.service.watch import Watch
from tests.service.fake_worker import Service, service
from tests.service.test_http_resources import is_problem


@pytest.fixture(scope="module")
def running(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Service]:
    with service(tmp_path_factory.mktemp("data"), keep_alive_seconds=0.1) as found:
        yield found


def events_of(text: str) -> list[tuple[int, str, Any]]:
    """Read a whole stream."""
    found = []
    for block in text.split("\n\n"):
        fields = dict(
            line.split(": ", 1) for line in block.splitlines() if line and not line.startswith(":")
        )
        if "data" in fields:
            found.append((int(fields["id"]), fields["event"], json.loads(fields["data"])))
    return found


def test_the_stream_tells_everything_and_ends(running: Service) -> None:
    id = running.fit(seed=1)
    answer = running.client.get(f"/v1/fits/{id}/events")
    assert answer.headers["content-type"].startswith("text/event-stream")
    assert answer.headers["cache-control"] == "no-store"
    events = events_of(answer.text)
    numbers = [number for number, _, _ in events]
    assert numbers == sorted(set(numbers))
    states = [data["state"] for _, kind, data in events if kind == "state"]
    assert states == ["queued", "running", "done"]
    assert all(data["id"] == id for _, kind, data in events if kind == "state")
    progress = [data for _, kind, data in events if kind == "progress"]
    assert progress == [{"stage": "fit", "done": 0, "total": 1, "label": "ggx"}]
    last = events[-1][2]
    assert last["best"] == "ggx"
    assert {a["name"] for a in last["artefacts"]} == {"fit.png", "report.json"}
    assert "result" not in last


def test_the_stream_resumes_after_any_event(running: Service) -> None:
    id = running.fit(seed=2)
    whole = events_of(running.client.get(f"/v1/fits/{id}/events").text)
    for k in range(len(whole) + 1):
        after = whole[k - 1][0] if k else 0
        rest = running.client.get(f"/v1/fits/{id}/events", headers={"Last-Event-ID": str(after)})
        assert [e[:2] for e in events_of(rest.text)] == [e[:2] for e in whole[k:]]


def test_a_held_fit_is_followed_live_with_comments(running: Service) -> None:
    running.worker.held.set()
    try:
        id = running.fit(seed=3)
        running.wait(id, "running")
        shared: Shared = running.client.app.state.shared  # type: ignore[attr-defined]

        async def follow() -> tuple[str, float]:
            text, released = "", 0.0
            async for piece in event_stream(shared, id, 0):
                text += piece.decode()
                if text.count(": still here") == 2 and not released:
                    running.worker.held.clear()
                    released = time.monotonic()
            return text, time.monotonic() - released

        # The watch belongs to the loop of the test's client; here is another one.
        shared.watch = Watch(shared.store, 0.01)
        text, seconds = asyncio.run(follow())
        assert [e[2].get("state") for e in events_of(text)][-1] == "done"
        assert seconds < 2.0
    finally:
        running.worker.held.clear()


def test_what_cannot_be_followed(running: Service) -> None:
    is_problem(running.client.get("/v1/fits/none/events"), 404, "not-found")
    id = running.fit(seed=4)
    answer = running.client.get(f"/v1/fits/{id}/events", headers={"Last-Event-ID": "x"})
    assert is_problem(answer, 422, "invalid-request")["errors"][0]["header"] == "Last-Event-ID"


def test_head_does_not_wait_for_the_end(running: Service) -> None:
    running.worker.held.set()
    try:
        id = running.fit(seed=5)
        head = running.client.head(f"/v1/fits/{id}/events")
        assert (head.status_code, head.content) == (200, b"")
    finally:
        running.worker.held.clear()
    running.wait(id)


def test_nobody_waits_longer_than_the_server_runs(tmp_path: Any) -> None:
    store = Store(tmp_path)
    job, _ = store.submit("fit", {})
    shared = Shared(Settings(tmp_path), store)

    async def follow() -> list[bytes]:
        asyncio.get_running_loop().call_later(0.2, shared.close)
        return [piece async for piece in event_stream(shared, job.id, 0)]

    text = b"".join(asyncio.run(follow())).decode()
    assert [e[2]["state"] for e in events_of(text)] == ["queued"]
    store.close()


def test_one_poller_wakes_everybody_and_rests(tmp_path: Any) -> None:
    store = Store(tmp_path)
    watch = Watch(store, 0.005)

    async def scene() -> None:
        version = watch.version()
        waiting = [asyncio.create_task(watch.changed(version, 5.0)) for _ in range(50)]
        await asyncio.sleep(0.02)
        assert not any(task.done() for task in waiting)
        store.submit("fit", {})
        assert all(await asyncio.gather(*waiting))
        # What changed before the wait began is not waited for.
        assert await watch.changed(version, 5.0)
        assert not await watch.changed(watch.version(), 0.02)
        await asyncio.sleep(0.02)
        assert watch._poller is not None
        assert watch._poller.done()

    asyncio.run(scene())
    store.close()


def test_a_store_that_cannot_be_read_wakes_who_waits(tmp_path: Any) -> None:
    store = Store(tmp_path)
    watch = Watch(store, 0.005)
    unheard: list[dict[str, Any]] = []

    async def scene() -> None:
        asyncio.get_running_loop().set_exception_handler(lambda _, said: unheard.append(said))
        waiting = asyncio.create_task(watch.changed(watch.version(), 5.0))
        await asyncio.sleep(0.02)
        store.close()
        assert await waiting
        # The next look is theirs, and says what is wrong.
        with pytest.raises(StoreError, match="the store is closed"):
            watch.version()
        watch._poller = None
        gc.collect()

    asyncio.run(scene())
    assert not unheard
