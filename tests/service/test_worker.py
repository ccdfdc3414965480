"""Worker processes with jobs that need no device: killed, stopped, stuck, too long, too large."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from lobefit.service.rows import JobRow, Limits, StoreError
from lobefit.service.store import Store
from lobefit.service.supervisor import Supervisor
from tests.service.fakes import COMMAND, start_worker, until, wait_for

LIMITS = Limits(lease=2.0)


@pytest.fixture
def store(tmp_path: Path) -> Iterator[Store]:
    made = Store(tmp_path / "data", LIMITS)
    yield made
    made.close()


Start = Callable[..., subprocess.Popen[bytes]]


@pytest.fixture
def start(store: Store) -> Iterator[Start]:
    running = []

    def started(name: str, *options: str) -> subprocess.Popen[bytes]:
        process = start_worker(store.files.root, name, "--lease=2", *options)
        running.append(process)
        until(lambda: any(p.pid == process.pid for p in store.processes()))
        return process

    yield started
    for process in running:
        process.kill()
        process.wait()


def begun(store: Store) -> list[str]:
    path = store.files.root / "began"
    return path.read_text().split("\n")[:-1] if path.exists() else []


def report(store: Store, job: JobRow) -> object:
    return json.loads(store.artefact_path(job.id, "report.json").read_text())


def test_jobs_of_all_sorts_end_as_they_should(store: Store, start: Start) -> None:
    """One worker does them one after the other, and none of them harms the next."""
    requests: dict[str, dict[str, object]] = {
        "good": {"steps": 3},
        "refuse": {"how": "refuse"},
        "break": {"how": "break"},
        "long": {"steps": 1000},
        "large": {"how": "grow", "steps": 1000},
        "last": {},
    }
    ids = {name: store.submit("fit", {"name": name, **r})[0].id for name, r in requests.items()}
    worker = start("w", "--wall=1", f"--memory={70 << 20}")
    found = {name: wait_for(store, id) for name, id in ids.items()}
    assert {name: job.state for name, job in found.items()} == {
        "good": "done",
        "refuse": "failed",
        "break": "failed",
        "long": "failed",
        "large": "failed",
        "last": "done",
    }
    assert report(store, found["good"]) == {"steps": 3}
    problems = {name: job.problem or {} for name, job in found.items()}
    assert problems["refuse"] == {"slug": "invalid-request", "detail": "not like this"}
    assert problems["break"]["slug"] == "internal" and "ZeroDiv" in problems["break"]["detail"]
    assert problems["long"]["slug"] == "timeout" and "1 s" in problems["long"]["detail"]
    assert "70 MiB" in problems["large"]["detail"]
    assert all(job.attempts == 1 for job in found.values())
    told = [e.data for e in store.events(ids["long"], 0, 500) if e.type == "progress"]
    assert 2 <= len(told) <= 6  # about four a second, of a hundred a second
    assert worker.poll() is None


def test_cancelling_a_running_job_keeps_what_is_finished(store: Store, start: Start) -> None:
    start("w")
    job, _ = store.submit("fit", {"steps": 90})
    until(lambda: (store.job(job.id).progress or {}).get("done", 0) > 0)
    began = time.monotonic()
    store.cancel(job.id)
    found = wait_for(store, job.id)
    assert found.state == "cancelled" and time.monotonic() - began < 2.0
    steps = (found.result or {})["steps"]
    assert 0 < steps < 90 and report(store, found) == {"steps": steps}


def test_a_job_that_hears_nothing_is_said_to_be_cancelled_all_the_same(
    store: Store, start: Start
) -> None:
    start("w")
    job, _ = store.submit("fit", {"how": "hang"})
    until(lambda: len(begun(store)) == 1)
    began = time.monotonic()
    store.cancel(job.id)
    assert wait_for(store, job.id).state == "cancelled"
    assert time.monotonic() - began < 2.0


def test_a_worker_that_is_stopped_gives_its_job_back(store: Store, start: Start) -> None:
    first = start("one")
    job, _ = store.submit("fit", {"steps": 60})
    until(lambda: (store.job(job.id).progress or {}).get("done", 0) > 0)
    first.send_signal(signal.SIGTERM)
    assert first.wait(5) == 0
    assert (store.job(job.id).state, store.job(job.id).attempts) == ("queued", 0)
    assert store.processes() == []
    start("two")
    found = wait_for(store, job.id)
    assert (found.state, found.attempts) == ("done", 1)
    assert report(store, found) == {"steps": 60}


def test_a_killed_workers_job_is_done_by_another(store: Store, start: Start) -> None:
    one = start("one")
    job, _ = store.submit("fit", {"steps": 100})
    until(lambda: store.job(job.id).state == "running")
    one.kill()  # first of all: the job lasts a second, and a process may take as long to start
    start("two")
    began = time.monotonic()
    until(lambda: len(begun(store)) == 2)
    assert time.monotonic() - began < LIMITS.lease + 2.0
    found = wait_for(store, job.id)
    assert (found.state, found.attempts) == ("done", 2)
    ends = [e for e in store.events(job.id, 0) if e.data.get("state") == "done"]
    assert len(ends) == 1
    assert [p.name for p in store.files.job(job.id).iterdir()] == ["2"]


def test_a_worker_that_sleeps_over_its_lease_writes_nothing(store: Store, start: Start) -> None:
    one = start("one")
    job, _ = store.submit("fit", {"steps": 30})
    until(lambda: store.job(job.id).state == "running")
    one.send_signal(signal.SIGSTOP)
    start("two")
    until(lambda: store.job(job.id).attempts == 2)
    one.send_signal(signal.SIGCONT)
    found = wait_for(store, job.id)
    assert (found.state, report(store, found)) == ("done", {"steps": 30})
    next_, _ = store.submit("fit", {})
    assert wait_for(store, next_.id).state == "done"
    assert one.poll() is None
    until(lambda: not (store.files.job(job.id) / "1").exists())


def test_an_idle_worker_wakes_at_once(store: Store, start: Start) -> None:
    start("w")
    until(lambda: store.processes()[0].state == "idle")
    time.sleep(0.2)
    took = []
    for _ in range(5):
        job, _ = store.submit("fit", {"step": 0.0})
        began = time.perf_counter()
        wait_for(store, job.id)
        took.append(time.perf_counter() - began)
    assert min(took) < 0.1  # it looks once a second by itself


SUPERVISE = """
import sys
from pathlib import Path
from lobefit.service.rows import Limits
from lobefit.service.supervisor import Supervisor
server = [sys.executable, "-c", "import time; time.sleep(1000)", sys.argv[1]]
made = Supervisor(Path(sys.argv[1]), server, workers=2,
                  limits=Limits(lease=2.0), worker=[sys.executable, sys.argv[2]])
sys.exit(made.run())
"""


@pytest.fixture
def service(store: Store) -> Iterator[subprocess.Popen[bytes]]:
    process = subprocess.Popen([sys.executable, "-c", SUPERVISE, str(store.files.root), COMMAND[1]])
    until(lambda: {p.name for p in store.processes()} == {"desk", "fit-1", "fit-2"})
    yield process
    process.terminate()
    process.wait(30)


def of_folder(store: Store) -> set[int]:
    """Give the processes that work for the folder."""
    found = set()
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            try:
                words = (entry / "cmdline").read_bytes()
            except OSError:
                continue
            if str(store.files.root).encode() in words:
                found.add(int(entry.name))
    return found


def pid_of(store: Store, name: str) -> int | None:
    return next((p.pid for p in store.processes() if p.name == name), None)


def test_what_dies_is_started_again_and_nothing_is_left_behind(
    store: Store, service: subprocess.Popen[bytes]
) -> None:
    # A job that kills its worker each time is given up, at once and with the reason.
    poison, _ = store.submit("fit", {"how": "die"})
    found = wait_for(store, poison.id)
    assert found.state == "failed" and "status 9" in (found.problem or {})["detail"]
    good, _ = store.submit("fit", {"steps": 3})
    assert wait_for(store, good.id).state == "done"
    desk = pid_of(store, "desk")
    assert desk is not None
    os.kill(desk, signal.SIGKILL)
    until(lambda: pid_of(store, "desk") not in (desk, None))
    # Nobody else may use the folder meanwhile.
    with pytest.raises(StoreError, match="another service"):
        Supervisor(store.files.root, None)
    # The job in hand goes back, everybody ends, in little time.
    job, _ = store.submit("fit", {"steps": 2000})
    until(lambda: store.job(job.id).state == "running")
    until(lambda: len(of_folder(store)) == 5)
    service.terminate()
    assert service.wait(20) == 0
    assert of_folder(store) == set()
    assert store.job(job.id).state == "queued"
    assert store.processes() == []


def test_a_killed_supervisor_leaves_nobody_and_the_next_goes_on(
    store: Store, service: subprocess.Popen[bytes]
) -> None:
    job, _ = store.submit("fit", {"steps": 40})
    until(lambda: store.job(job.id).state == "running")
    service.kill()
    service.wait()
    until(lambda: of_folder(store) == set())
    again = subprocess.Popen([sys.executable, "-c", SUPERVISE, str(store.files.root), COMMAND[1]])
    try:
        assert wait_for(store, job.id).state == "done"
    finally:
        again.terminate()
        again.wait(30)
