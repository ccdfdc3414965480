"""Work on many processes, without OpenCL: deaths, errors, resumption, what people are told."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from concurrent.futures import Future
from pathlib import Path
from typing import Any
from unittest import mock

import pytest

from lobefit.fitting.engine import EngineError, Ledger, Status, open_crew, run
from lobefit.fitting.engine.crew import Crew, Fate, PoolCrew
from lobefit.fitting.engine.ledger import Row
from lobefit.fitting.engine.worker import THREADS, run_chunk
from tests.fitting.engine_cases import Squares, squares

pools = pytest.mark.parametrize("kind", ["loky", "processes"])
ROOT = Path(__file__).parents[2]


@pytest.fixture(autouse=True)
def own_environment() -> Iterator[None]:
    """Take back what chunks that run in this process say of its threads."""
    with mock.patch.dict(os.environ):
        os.environ.pop(THREADS, None)
        yield


def results(folder: Path) -> dict[int, int]:
    return {int(p.stem): int(p.read_text()) for p in folder.glob("*.txt")}


@pools
def test_a_unit_that_kills_its_worker_and_one_that_errs_are_named_and_all_others_are_done(
    tmp_path: Path, kind: str
) -> None:
    opener = Squares(0.001, killers=frozenset({17}), wrong=frozenset({40, 41}))
    said: list[Status] = []
    with Ledger(tmp_path / "ledger.sqlite") as ledger:
        work = squares(tmp_path / "out", 60, opener, smallest=4)
        run(work, ledger, open_crew(2, kind=kind), progress=said.append)
        failed = {row.first: row.reason for row in ledger.rows("failed")}
        assert ledger.missing([(0, 60)]) == []
    assert set(failed) == {17, 40, 41}
    assert "dies every time" in failed[17]
    assert failed[40] == "unit 40 is odd"
    assert results(tmp_path / "out") == {k: k * k for k in range(60) if k not in failed}
    assert any("unit 17 is left out" in status.message for status in said)
    assert (said[-1].done, said[-1].total, said[-1].failed) == (60, 60, 3)


@pools
def test_no_process_is_left_behind(tmp_path: Path, kind: str) -> None:
    pids: set[int] = set()

    class Watched(PoolCrew):
        def close(self, *, at_once: bool = False) -> None:
            pids.update(getattr(self._pool, "_processes", None) or {})
            super().close(at_once=at_once)

    def interrupt(status: Status) -> None:
        if status.done:
            raise KeyboardInterrupt

    work = squares(tmp_path / "out", 1000, Squares(0.01))
    with Ledger(tmp_path / "ledger.sqlite") as ledger:
        with pytest.raises(KeyboardInterrupt):
            run(work, ledger, Watched(2, kind), progress=interrupt)
        done = sum(row.stop - row.first for row in ledger.rows("done"))
    assert pids
    assert not [pid for pid in pids if Path(f"/proc/{pid}").exists()]
    assert len(results(tmp_path / "out")) == done > 0


DRIVER = """
import sys
from pathlib import Path
from lobefit.fitting.engine import Ledger, open_crew, run
from tests.fitting.engine_cases import Squares, squares
if __name__ == "__main__":
    folder = Path(sys.argv[1])
    with Ledger(folder / "ledger.sqlite") as ledger:
        run(squares(folder / "out", 200, Squares(0.01)), ledger, open_crew(2))
"""


def test_a_killed_driver_leaves_no_worker_and_the_next_does_the_rest(tmp_path: Path) -> None:
    script = tmp_path / "driver.py"
    script.write_text(DRIVER)
    command = [sys.executable, str(script), str(tmp_path)]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    driver = subprocess.Popen(command, env=environment)
    out = tmp_path / "out"
    try:
        until = time.monotonic() + 60
        while len(list(out.glob("*.txt"))) < 20 and time.monotonic() < until:
            time.sleep(0.02)
        task = Path(f"/proc/{driver.pid}/task/{driver.pid}/children")
        children = [Path(f"/proc/{pid}") for pid in task.read_text().split()]
    finally:
        driver.kill()
        driver.wait()
    before = {path: path.stat().st_mtime_ns for path in out.glob("*.txt")}
    with Ledger(tmp_path / "ledger.sqlite") as ledger:
        noted = [k for row in ledger.rows() for k in range(row.first, row.stop)]
    assert 0 < len(noted) < 200
    subprocess.run(command, env=environment, check=True, timeout=120)
    assert results(out) == {k: k * k for k in range(200)}
    # What was noted was not done again.
    assert all(before[p] == p.stat().st_mtime_ns for k in noted if (p := out / f"{k}.txt"))
    until = time.monotonic() + 10
    while any(c.exists() for c in children) and time.monotonic() < until:
        time.sleep(0.05)
    assert not [c for c in children if c.exists()]


def test_work_that_cannot_be_begun_ends_at_once(tmp_path: Path) -> None:
    work = squares(tmp_path, 10, Squares(shut=True))
    with (
        Ledger(tmp_path / "ledger.sqlite") as ledger,
        pytest.raises(EngineError, match="no device here"),
    ):
        run(work, ledger, open_crew(1))


def test_errors_everywhere_end_the_work_instead_of_going_through_all_of_it(
    tmp_path: Path,
) -> None:
    work = squares(tmp_path, 10_000, Squares(wrong=frozenset(range(10_000))), smallest=1000)
    with (
        Ledger(tmp_path / "ledger.sqlite") as ledger,
        pytest.raises(EngineError, match=r"40 times in a row nothing came of it: unit \d+ is odd"),
    ):
        run(work, ledger, open_crew(1, kind="processes"))


class Threads(Crew):
    """Workers that are there or not, as the test says; tasks run in threads or never."""

    breaks, alone, shares_disk, neighbours = False, 1, True, 1
    remedy = "start some"

    def __init__(self, workers: int, *, lose: int = 0, swallow: int = 0) -> None:
        self.count, self.lose, self.swallow, self.closed = workers, lose, swallow, False

    def submit(self, task: Any, *arguments: Any) -> Future[Any]:
        future: Future[Any] = Future()
        if self.lose:
            self.lose -= 1
            self.count = 0
            future.cancel()
            future.set_running_or_notify_cancel()
        elif self.swallow:
            self.swallow -= 1
        elif self.count:
            threading.Thread(target=lambda: future.set_result(task(*arguments))).start()
        return future

    def workers(self) -> int:
        return self.count

    def known(self) -> int:
        return 0

    def fate(self, error: BaseException) -> Fate:
        return "lost"

    def close(self, *, at_once: bool = False) -> None:
        self.closed = True


@pytest.fixture
def hasty(monkeypatch: pytest.MonkeyPatch) -> None:
    for name, seconds in (("QUIET", 0.1), ("BEAT", 0.02), ("LOOK", 0.05)):
        monkeypatch.setattr(f"lobefit.fitting.engine.driver.{name}", seconds)


@pytest.mark.usefixtures("hasty")
def test_a_driver_without_workers_says_so_and_then_gives_up(tmp_path: Path) -> None:
    said: list[str] = []
    crew = Threads(0)
    work = squares(tmp_path, 10, Squares())
    with (
        Ledger(tmp_path / "ledger.sqlite") as ledger,
        pytest.raises(EngineError, match=r"no worker for .*what is done is kept. start some"),
    ):
        run(work, ledger, crew, progress=lambda s: said.append(s.message), patience=0.5)
    assert "nothing heard for 0 s, 0 workers; start some" in said
    assert crew.closed


@pytest.mark.usefixtures("hasty")
def test_chunks_lost_with_a_scheduler_are_given_again_when_workers_are_back(
    tmp_path: Path,
) -> None:
    crew = Threads(2, lose=4)
    said: list[str] = []

    def back(status: Status) -> None:
        said.append(status.message)
        if status.message:
            crew.lose, crew.count = 0, 2

    with Ledger(tmp_path / "ledger.sqlite") as ledger:
        run(squares(tmp_path / "out", 30, Squares(0.001)), ledger, crew, progress=back)
    assert results(tmp_path / "out") == {k: k * k for k in range(30)}
    assert any(said)


@pytest.mark.usefixtures("hasty")
def test_chunks_that_nobody_knows_are_given_again(tmp_path: Path) -> None:
    """As when a scheduler dies in the moment that it is given them."""
    said: list[str] = []
    with Ledger(tmp_path / "ledger.sqlite") as ledger:
        work = squares(tmp_path / "out", 30, Squares(0.001))
        run(work, ledger, Threads(2, swallow=3), progress=lambda s: said.append(s.message))
    assert results(tmp_path / "out") == {k: k * k for k in range(30)}
    assert any("lost chunks" in message for message in said)


def test_a_second_driver_is_refused(tmp_path: Path) -> None:
    with Ledger(tmp_path / "ledger.sqlite") as ledger:
        ledger.settle([Row(0, 1)])
        with pytest.raises(EngineError, match="another run is writing"):
            Ledger(tmp_path / "ledger.sqlite")


@pools
def test_a_worker_shares_the_cores_and_leaves_interrupts_to_the_driver(kind: str) -> None:
    """Of a pool as large as the machine each worker gets one thread of PoCL's."""
    crew = PoolCrew(os.cpu_count() or 1, kind)
    try:
        assert crew.submit(_environment).result() == ("1", "1", True)
    finally:
        crew.close()


def _environment() -> tuple[str | None, str | None, bool]:
    ignored = signal.getsignal(signal.SIGINT) == signal.SIG_IGN
    return os.environ.get(THREADS), os.environ.get("OPENBLAS_NUM_THREADS"), ignored


def test_what_is_opened_is_kept_until_other_work_comes(tmp_path: Path) -> None:
    from lobefit.fitting.engine import worker

    first, second = Squares(0.0), Squares(0.0, wrong=frozenset({3}))
    try:
        assert run_chunk("a", first, 0, 3, None, 1).result == [0, 1, 4]
        kept = worker._opened
        assert run_chunk("a", first, 3, 4, None, 1).result == [9]
        assert worker._opened is kept
        assert run_chunk("b", second, 3, 4, None, 1).error == "unit 3 is odd"
        assert worker._opened is not kept
    finally:
        worker.release()
    assert worker._opened is None


def test_bad_crews_are_refused() -> None:
    with pytest.raises(EngineError, match="at least 1 job"):
        open_crew(0)
    with pytest.raises(EngineError, match="one of loky, processes"):
        open_crew(1, kind="threads")
    with pytest.raises(EngineError, match="leave out either"):
        open_crew(1, "tcp://127.0.0.1:1")
