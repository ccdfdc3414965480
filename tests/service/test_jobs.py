"""The queue: one holder at a time, fences, leases by the monotonic clock, attempts."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from lobefit.service import claim as claim_module
from lobefit.service import database, jobs
from lobefit.service.claim import Claim, Made
from lobefit.service.jobs import Queue, identity, is_alive
from lobefit.service.rows import LeaseLost, Limits, NotFound
from lobefit.service.store import Store


@pytest.fixture
def store(tmp_path: Path) -> Iterator[Store]:
    made = Store(tmp_path / "data", Limits(lease=5.0, attempts=3, answers=0.0))
    yield made
    made.close()


@pytest.fixture
def queues(store: Store) -> Iterator[tuple[Queue, Queue]]:
    pair = (Queue(store, identity("one"), ["fit"]), Queue(store, identity("two"), ["fit"]))
    yield pair
    for queue in pair:
        queue.close()


Clock = list[float]


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    now = [database.monotonic()]
    for module in (jobs, claim_module):
        monkeypatch.setattr(module, "monotonic", lambda: now[0])
    return now


def taken(queue: Queue) -> Claim:
    claim = queue.claim()
    assert claim is not None
    return claim


def write(claim: Claim, text: str) -> Made:
    path = claim.folder / "report.json"
    path.write_text(text)
    return Made(path, "application/json")


def test_a_job_is_held_by_one(store: Store, queues: tuple[Queue, Queue]) -> None:
    one, two = queues
    assert one.claim() is None
    job, _ = store.submit("fit", {"models": "quick"})
    claim = taken(one)
    assert two.claim() is None
    assert claim.job.request == {"models": "quick"}
    assert (store.job(job.id).state, store.job(job.id).attempts) == ("running", 1)
    assert claim.beat({"stage": "fit", "done": 1}) is False
    assert store.job(job.id).progress == {"stage": "fit", "done": 1}
    claim.finish({"best": "ggx"}, [write(claim, "{}")])
    found = store.job(job.id)
    assert (found.state, found.result, found.problem) == ("done", {"best": "ggx"}, None)
    (file,) = store.artefacts(job.id)
    assert (file.name, file.bytes, file.media_type) == ("report.json", 2, "application/json")
    assert store.artefact_path(job.id, "report.json").read_text() == "{}"
    types = [(e.type, e.data.get("state")) for e in store.events(job.id, 0)]
    expected = [("state", "queued"), ("state", "running"), ("progress", None), ("state", "done")]
    assert types == expected


def test_the_order_is_first_come_and_kinds_are_apart(store: Store) -> None:
    first, _ = store.submit("fit", {"n": 1})
    store.submit("fit", {"n": 2})
    store.submit("inspect", {})
    queue = Queue(store, identity("desk"), ["inspect", "table"])
    assert taken(queue).job.kind == "inspect"
    assert queue.claim() is None
    queue.close()
    fits = Queue(store, identity("fit"), ["fit"])
    assert taken(fits).job.id == first.id
    fits.close()


def test_whoever_lost_the_lease_writes_nothing(
    store: Store, queues: tuple[Queue, Queue], clock: Clock
) -> None:
    one, two = queues
    job, _ = store.submit("fit", {})
    late = taken(one)
    stale = write(late, "stale")
    clock[0] += 4.9
    assert two.claim() is None
    clock[0] += 0.2
    claim = taken(two)
    assert claim.fence == late.fence + 1 and claim.job.attempts == 2
    for wrong in (
        lambda: late.beat({}),
        lambda: late.finish({}, [stale]),
        lambda: late.publish([stale]),
        lambda: late.fail({}),
        lambda: late.stop(),
        lambda: late.give_back(),
    ):
        with pytest.raises(LeaseLost):
            wrong()
    assert late.is_cancelled() and not claim.is_cancelled()
    claim.finish({}, [write(claim, "good")])
    assert store.artefact_path(job.id, "report.json").read_text() == "good"
    claim.tidy()
    assert [p.name for p in store.files.job(job.id).iterdir()] == ["2"]


def test_heartbeats_keep_a_job(store: Store, queues: tuple[Queue, Queue], clock: Clock) -> None:
    store.submit("fit", {})
    claim = taken(queues[0])
    for _ in range(5):
        clock[0] += 3.0
        claim.beat()
        assert queues[1].claim() is None


def test_no_change_of_the_clock_takes_a_job(
    store: Store, queues: tuple[Queue, Queue], monkeypatch: pytest.MonkeyPatch
) -> None:
    store.submit("fit", {})
    taken(queues[0])
    now = time.time()
    for hours in (-2, 2):
        monkeypatch.setattr(time, "time", lambda hours=hours: now + 3600.0 * hours)
        assert queues[1].claim() is None


def test_after_a_reboot_no_lease_counts(store: Store, queues: tuple[Queue, Queue]) -> None:
    job, _ = store.submit("fit", {})
    taken(queues[0])
    queues[1]._boot = "another boot"
    assert taken(queues[1]).job.id == job.id


def test_a_job_that_loses_its_workers_fails_with_the_reason(
    store: Store, queues: tuple[Queue, Queue], clock: Clock
) -> None:
    job, _ = store.submit("fit", {})
    for attempt in (1, 2, 3):
        assert taken(queues[0]).job.attempts == attempt
        queues[0].bury("one", int(queues[0].worker.split(":")[1]), "it ended with signal 9")
        assert store.job(job.id).problem is None
    assert queues[0].claim() is None
    found = store.job(job.id)
    assert found.state == "failed" and found.problem is not None
    assert "3 times" in found.problem["detail"] and "signal 9" in found.problem["detail"]


def test_a_lost_job_that_was_cancelled_is_cancelled(
    store: Store, queues: tuple[Queue, Queue], clock: Clock
) -> None:
    job, _ = store.submit("fit", {})
    claim = taken(queues[0])
    assert store.cancel(job.id).cancelling
    assert claim.beat() is True
    clock[0] += 6.0
    assert queues[1].claim() is None
    assert store.job(job.id).state == "cancelled"


def test_a_job_given_back_has_lost_nothing(store: Store, queues: tuple[Queue, Queue]) -> None:
    job, _ = store.submit("fit", {})
    store.submit("fit", {})
    for _ in range(5):  # more often than there are attempts
        claim = taken(queues[0])
        assert claim.job.id == job.id
        (claim.folder / "chain.h5").write_text(str(claim.fence))
        claim.give_back()
    assert store.job(job.id).attempts == 0
    again = taken(queues[1])
    earlier = again.earlier("chain.h5")
    assert earlier is not None and earlier.read_text() == "5"
    assert again.earlier("other") is None


def test_a_cancelled_job_keeps_what_is_finished(store: Store, queues: tuple[Queue, Queue]) -> None:
    job, _ = store.submit("fit", {})
    claim = taken(queues[0])
    claim.publish([write(claim, "early")])
    assert store.job(job.id).state == "running" and len(store.artefacts(job.id)) == 1
    claim.stop()
    claim.publish([write(claim, "late")])
    claim.stop({"best": "ggx"})
    found = store.job(job.id)
    assert (found.state, found.result) == ("cancelled", {"best": "ggx"})
    assert store.artefact_path(job.id, "report.json").read_text() == "late"
    with pytest.raises(LeaseLost):
        claim.finish({})
    store.delete_job(job.id)
    with pytest.raises(LeaseLost):
        claim.publish([])
    with pytest.raises(NotFound):
        store.artefact_path(job.id, "report.json")


def test_files_that_are_no_artefacts_go(store: Store, queues: tuple[Queue, Queue]) -> None:
    """Those given out by an attempt that was lost stay until another replaces them."""
    job, _ = store.submit("fit", {})
    first = taken(queues[0])
    first.publish([write(first, "first")])
    (first.folder / "chain.h5").write_text("x")
    first.tidy(own=True)
    assert [p.name for p in first.folder.iterdir()] == ["report.json"]
    queues[0].bury("one", int(queues[0].worker.split(":")[1]), "killed")
    second = taken(queues[1])
    (second.folder / "chain.h5").write_text("x")
    second.fail({"slug": "internal", "detail": "no"})
    second.tidy()
    assert store.artefact_path(job.id, "report.json").read_text() == "first"
    assert [p.name for p in store.files.job(job.id).iterdir()] == ["1"]
    (store.files.job(job.id) / "3").mkdir()
    store.sweep()
    assert [p.name for p in store.files.job(job.id).iterdir()] == ["1"]


def test_progress_is_not_kept_for_ever(store: Store, queues: tuple[Queue, Queue]) -> None:
    job, _ = store.submit("fit", {})
    claim = taken(queues[0])
    for k in range(80):
        claim.beat({"done": k})
    told = [e.data["done"] for e in store.events(job.id, 0, 500) if e.type == "progress"]
    assert told == list(range(30, 80))


def test_answers_of_quick_jobs_go_after_a_while(store: Store) -> None:
    queue = Queue(store, identity("desk"), ["table"])
    job, _ = store.submit("table", {})
    claim = taken(queue)
    claim.finish({"file": "report.json", "media_type": "text/plain"}, [write(claim, "text")])
    assert store.answer(store.job(job.id)) == (b"text", "text/plain")
    fit, _ = store.submit("fit", {})
    store.cancel(fit.id)
    assert queue.tidy() == 1
    assert not store.files.job(job.id).exists()
    with pytest.raises(NotFound):
        store.job(job.id)
    assert store.job(fit.id).state == "cancelled"
    queue.close()


def test_processes_say_that_they_are_there(store: Store, queues: tuple[Queue, Queue]) -> None:
    queues[0].announce("a device", "idle", 1000)
    (row,) = store.processes()
    assert (row.name, row.kinds, row.device, row.state, row.rss) == (
        *("one", ("fit",), "a device", "idle", 1000),
    )
    assert row.age is not None and row.age < 1.0
    queues[0].leave()
    assert store.processes() == []


def test_a_process_is_never_taken_for_another(store: Store, queues: tuple[Queue, Queue]) -> None:
    me = identity("one")
    assert is_alive(me)
    name, pid, born = me.split(":")
    assert not is_alive(f"{name}:{pid}:{int(born) + 1}")
    job, _ = store.submit("fit", {})
    taken(queues[0])
    queues[1].bury_strangers()
    assert queues[1].claim() is None
    with store.database.write() as write_:
        write_.execute("UPDATE jobs SET worker = ?", (f"{name}:{pid}:{int(born) + 1}",))
    queues[1].bury_strangers()
    assert taken(queues[1]).job.id == job.id
