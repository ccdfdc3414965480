"""The store: content-addressed measurements, the list of jobs, keys, limits, a full disk."""

from __future__ import annotations

import hashlib
import os
import sqlite3
import stat
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest

from lobefit.service import files
from lobefit.service.database import LAYOUTS, Database
from lobefit.service.jobs import Queue
from lobefit.service.rows import (
    InUse,
    KeyConflict,
    Limits,
    MeasurementRow,
    NotFound,
    QueueFull,
    StoreError,
    StoreFull,
)
from lobefit.service.store import Store


@pytest.fixture
def store(tmp_path: Path) -> Iterator[Store]:
    made = Store(tmp_path / "data", Limits(queue=5, queue_per_owner=3, quick=2))
    yield made
    made.close()


def put(store: Store, data: bytes = b"abc", name: str = "a.csv") -> tuple[MeasurementRow, bool]:
    with store.upload() as upload:
        upload.write(data)
        upload.finish()
        return store.adopt(upload, name, {"summary": {"channels": ["R"]}})


def test_the_folder_is_for_its_owner_alone(store: Store) -> None:
    root = store.files.root
    assert stat.S_IMODE(root.stat().st_mode) == 0o700
    assert stat.S_IMODE((root / "store.sqlite").stat().st_mode) == 0o600


def test_the_same_content_is_one_measurement(store: Store) -> None:
    first, new = put(store, b"abc", "a.csv")
    again, known = put(store, b"abc", "b.csv")
    assert new and not known
    assert first == again
    assert first.id == hashlib.sha256(b"abc").hexdigest()
    assert first.bytes == 3 and first.summary == {"summary": {"channels": ["R"]}}
    assert store.data_path(first.id).read_bytes() == b"abc"
    assert list(store.files.tmp.iterdir()) == []


def test_an_upload_that_nobody_adopts_leaves_nothing(store: Store) -> None:
    with pytest.raises(RuntimeError), store.upload() as upload:
        upload.write(b"half")
        raise RuntimeError
    assert list(store.files.tmp.iterdir()) == []
    assert store.measurements(10) == ([], None)


def test_lists_go_on_where_they_ended(store: Store) -> None:
    ids = [put(store, bytes([k]))[0].id for k in range(5)]
    page, cursor = store.measurements(2)
    put(store, b"newer")  # does not shift the pages after
    rest, end = store.measurements(10, cursor)
    assert [m.id for m in (*page, *rest)] == ids[::-1]
    assert end is None
    assert store.measurements(1, "no cursor")[0][0].bytes == 5


def test_a_measurement_in_use_stays(store: Store) -> None:
    m, _ = put(store)
    job, _ = store.submit("fit", {}, measurement=m.id)
    with pytest.raises(InUse):
        store.delete_measurement(m.id)
    store.cancel(job.id)
    path = store.data_path(m.id)
    store.delete_measurement(m.id)
    assert not path.exists()
    for forget in (store.delete_measurement, store.measurement, store.data_path):
        with pytest.raises(NotFound):
            forget(m.id)
    with pytest.raises(NotFound):
        store.submit("fit", {}, measurement=m.id)


@pytest.mark.parametrize("id", ["", "..", "../../etc/passwd", "a/b", "\0", "é"])
def test_no_path_comes_from_a_text(store: Store, id: str) -> None:
    calls = (store.measurement, store.data_path, store.job, store.cancel, store.delete_job)
    for call in calls:
        with pytest.raises(NotFound):
            call(id)
    job, _ = store.submit("fit", {})
    with pytest.raises(NotFound):
        store.artefact_path(job.id, id)
    for place in (store.files.measurement, store.files.job, store.files.upload):
        with pytest.raises(NotFound):
            place(id)
    with pytest.raises(NotFound):
        store.files.artefact(job.id, 1, id)


def test_a_key_makes_one_job(store: Store) -> None:
    job, new = store.submit("fit", {"a": 1, "b": 2}, key="k", owner="anna")
    again, known = store.submit("fit", {"b": 2, "a": 1}, key="k", owner="anna")
    assert new and not known and again.id == job.id
    with pytest.raises(KeyConflict):
        store.submit("fit", {"a": 2}, key="k", owner="anna")
    other, fresh = store.submit("fit", {"a": 2}, key="k", owner="bert")
    assert fresh and other.id != job.id
    store.cancel(job.id)
    store.delete_job(job.id)
    assert store.submit("fit", {"a": 2}, key="k", owner="anna")[1]


def test_one_key_from_many_threads_makes_one_job(store: Store) -> None:
    ids: list[str] = []
    threads = [
        threading.Thread(target=lambda: ids.append(store.submit("fit", {}, key="k")[0].id))
        for _ in range(8)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(ids) == 8 and len(set(ids)) == 1
    assert store.depth("fit") == 1


def test_the_queue_has_a_length(store: Store) -> None:
    for _ in range(3):
        store.submit("fit", {}, owner="anna")
    with pytest.raises(QueueFull, match="yours"):
        store.submit("fit", {}, owner="anna")
    for _ in range(2):
        store.submit("fit", {}, owner="bert")
    with pytest.raises(QueueFull):
        store.submit("fit", {}, owner="carl")
    for kind in ("inspect", "evaluate"):  # fits do not stand in their way
        store.submit(kind, {})
    with pytest.raises(QueueFull):
        store.submit("table", {})
    assert store.depth("fit") == 5
    assert store.counts()["fit", "queued"] == 5


def test_posteriors_stand_behind_fits_that_come_soon_after(store: Store) -> None:
    slow, _ = store.submit("fit", {"posterior": {}})
    quick, _ = store.submit("fit", {})
    assert (store.position(quick.id), store.position(slow.id)) == (1, 2)
    store.cancel(quick.id)
    assert (store.position(quick.id), store.position(slow.id)) == (None, 1)


def test_cancelling_what_waits_ends_it_at_once(store: Store) -> None:
    job, _ = store.submit("fit", {})
    with pytest.raises(InUse):
        store.delete_job(job.id)
    assert store.cancel(job.id).state == "cancelled"
    assert store.cancel(job.id).state == "cancelled"
    assert [e.data["state"] for e in store.events(job.id, 0)] == ["queued", "cancelled"]
    first = store.events(job.id, 0, limit=1)[0]
    assert [e.data["state"] for e in store.events(job.id, first.seq)] == ["cancelled"]
    store.delete_job(job.id)
    assert store.events(job.id, 0) == []


def test_jobs_are_listed_by_state_and_measurement(store: Store) -> None:
    m, _ = put(store)
    one, _ = store.submit("fit", {"n": 1}, measurement=m.id)
    two, _ = store.submit("fit", {"n": 2})
    store.submit("inspect", {})
    store.cancel(two.id)
    assert [j.id for j in store.jobs(9)[0]] == [two.id, one.id]
    assert [j.id for j in store.jobs(9, measurement=m.id)[0]] == [one.id]
    assert [j.id for j in store.jobs(9, state="cancelled")[0]] == [two.id]


def test_what_json_has_not_is_refused(store: Store) -> None:
    with pytest.raises(StoreError, match="JSON"):
        store.submit("fit", {"x": float("nan")})
    job, _ = store.submit("fit", {"name": "\ud800 und ü"})  # a lone surrogate is text to JSON
    assert store.job(job.id).request == {"name": "\ud800 und ü"}


def test_orphans_are_swept_and_the_rest_stays(store: Store) -> None:
    m, _ = put(store)
    job, _ = store.submit("fit", {})
    store.files.attempt(job.id, 1).mkdir(parents=True)
    orphans = [
        store.files.tmp / "upload-1",
        store.files.measurements / m.id[:2] / ("0" * 64),
        store.files.jobs / "gone" / "1",
    ]
    for path in orphans:
        path.parent.mkdir(exist_ok=True)
        path.write_text("x")
    assert store.sweep() == 3
    assert not any(p.exists() for p in orphans)
    assert store.data_path(m.id).exists() and store.files.job(job.id).exists()
    assert store.sweep() == 0


def test_a_full_disk_is_told_and_the_store_stays_sound(
    store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    m, _ = put(store)
    monkeypatch.setattr(files.Files, "free", lambda self: (1000, 1 << 30))
    for call in (store.upload, store.check, lambda: store.submit("fit", {})):
        with pytest.raises(StoreFull, match="free"):
            call()
    monkeypatch.undo()
    store.check()

    def no_space(fd: int, data: object) -> int:
        raise OSError(28, "No space left on device")

    with pytest.raises(StoreFull), store.upload() as upload:
        monkeypatch.setattr(os, "write", no_space)
        upload.write(b"x")
    monkeypatch.undo()
    assert list(store.files.tmp.iterdir()) == []
    assert store.measurement(m.id) == m


def test_a_full_database_is_told_and_rolled_back(store: Store) -> None:
    with store.database.write() as write:
        (pages,) = write.execute("PRAGMA page_count").fetchone()
    # The writer's connection alone is limited.
    assert store.database._writer is not None
    store.database._writer.execute(f"PRAGMA max_page_count = {pages}")
    with pytest.raises(StoreFull):
        store.submit("fit", {"padding": "x" * 100_000})
    assert store.jobs(9)[0] == []
    store.database._writer.execute("PRAGMA max_page_count = 1000000")
    store.submit("fit", {})
    assert store.database.one("PRAGMA integrity_check")[0] == "ok"  # type: ignore[index]


def test_a_folder_that_cannot_be_used_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("x")
    with pytest.raises(StoreError, match="file"):
        Store(tmp_path / "file")


def test_a_folder_of_the_first_layout_goes_on_working(tmp_path: Path) -> None:
    path = tmp_path / "store.sqlite"
    with closing(sqlite3.connect(path, isolation_level=None)) as old:
        old.executescript(LAYOUTS[0] + "PRAGMA user_version = 1")
        digest = hashlib.sha256(b"fit\nNone\n{}").hexdigest()
        old.execute("INSERT INTO measurements VALUES (1, 'm', 'a.csv', 1, 1.0, '{}')")
        for seq, (id, state) in enumerate((("done-1", "done"), ("waits-2", "queued")), 1):
            old.execute(
                "INSERT INTO jobs (seq, id, kind, state, request, owner, rank, created)"
                " VALUES (?, ?, 'fit', ?, '{}', '', ?, 1.0)",
                (seq, id, state, seq),
            )
            old.execute("INSERT INTO events (job, type, data) VALUES (?, 'state', '{}')", (id,))
        old.execute("INSERT INTO artefacts VALUES ('done-1', 'report.json', 1, 2, '', '')")
        old.execute("INSERT INTO keys VALUES ('', 'k', 'done-1', ?)", (digest,))
    for _ in range(2):  # brought to the layout of today once
        with closing(Store(tmp_path)) as store:
            assert [(j.id, j.batch) for j in store.jobs(9)[0]] == [
                ("waits-2", None),
                ("done-1", None),
            ]
            assert store.measurement("m").name == "a.csv" and store.batches(9) == ([], None)
            known, new = store.submit("fit", {}, key="k")
            assert (known.id, new) == ("done-1", False)
            assert [a.name for a in store.artefacts("done-1")] == ["report.json"]
    with closing(Store(tmp_path)) as store, closing(Queue(store, "w:1:0", ["fit"])) as queue:
        claim = queue.claim()
        assert claim is not None and claim.job.id == "waits-2"
        claim.finish(None)
        store.delete_job("done-1")
        assert store.artefacts("done-1") == [] and store.events("done-1", 0) == []
        assert store.submit("fit", {}, key="k")[1], "the key went with its job"
        batch, _ = store.submit_batch("b", [{"measurement": None}])
        assert batch.counts["queued"] == 1
        assert store.database.read("PRAGMA foreign_key_check") == []


def test_another_layout_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "store.sqlite"
    connection = sqlite3.connect(path)
    connection.execute("PRAGMA user_version = 99")
    connection.close()
    with pytest.raises(StoreError, match="99"):
        Database(path)
    path.write_bytes(b"no database at all" * 100)
    with pytest.raises(StoreError, match="cannot open"):
        Database(path)


def test_a_closed_store_says_so(tmp_path: Path) -> None:
    made = Store(tmp_path)
    made.close()
    with pytest.raises(StoreError, match="closed"):
        made.jobs(1)
    with pytest.raises(StoreError, match="closed"):
        made.submit("fit", {})


def test_the_store_needs_no_numpy() -> None:
    script = (
        "import sys, lobefit.service.store, lobefit.service.jobs, lobefit.service.supervisor\n"
        "heavy = {'numpy', 'pyopencl', 'nlopt', 'emcee', 'matplotlib', 'h5py'} & set(sys.modules)\n"
        "assert not heavy, heavy"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
