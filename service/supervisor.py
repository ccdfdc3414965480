"""The supervisor: starts the server and the workers, starts anew what dies, ends all in order.

Every child is the leader of a process group and is told by the kernel when the supervisor dies
(``PR_SET_PDEATHSIG``), so that nothing is left behind however it ends. It imports nothing heavy.
"""

from __future__ import annotations

import ctypes
import fcntl
import os
import signal
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

from lobefit.service.database import store_error
from lobefit.service.jobs import Queue
from lobefit.service.limits_option import limits_arguments
from lobefit.service.rows import WAITING, Limits, StoreError
from lobefit.service.store import Store

__all__ = ["Supervisor", "supervise"]

# Seconds between two looks at the children.
LOOK = 0.2
# A child that dies is started again at once, then after 1, 2, 4... seconds; one that has run
# for STEADY seconds counts as new.
BACKOFF = 30.0
STEADY = 60.0
# A worker that was not heard of for so long is killed; a start may take longer, since the
# kernels are compiled then.
SILENT = 8.0
SILENT_START = 180.0
# Seconds that children get to end: workers their job, the server its requests.
WORKERS_END = 8.0
SERVER_END = 12.0

WORKER = (sys.executable, "-m", "lobefit.service.worker")

_PR_SET_PDEATHSIG = 1


@dataclass
class _Child:
    name: str
    command: Sequence[str]
    is_worker: bool
    environment: Mapping[str, str]
    process: subprocess.Popen[bytes] | None = None
    began: float = 0.0
    due: float = 0.0
    failures: int = 0
    heard: float = field(default=0.0)


class Supervisor:
    """Keeps a server and its workers running.

    Parameters
    ----------
    data_dir : Path
        The data folder; no other supervisor may use it.
    server : sequence of str or None
        Command of the server process; None for workers alone.
    workers : int
        How many do fits and charts; one more process does everything quick.
    limits : Limits
        Handed to the workers.
    environment : mapping of str to str, optional
        Added to the environment of the server.
    worker : sequence of str
        Command of a worker; options are added.

    Raises
    ------
    StoreError
        The data folder cannot be used, or another supervisor uses it.
    """

    def __init__(
        self,
        data_dir: Path,
        server: Sequence[str] | None,
        *,
        workers: int = 2,
        limits: Limits = Limits(),  # noqa: B008 (frozen)
        environment: Mapping[str, str] | None = None,
        worker: Sequence[str] = WORKER,
    ) -> None:
        self.store = Store(data_dir, limits)
        self._lock = _lock(self.store.files.root / "lock")
        self.queue = Queue(self.store, f"supervisor:{os.getpid()}:", ())
        self.store.sweep()
        self.queue.bury_strangers()
        self.stopping = False
        kinds = ["quick", *([",".join(WAITING)] * workers)]
        names = ["desk", *(f"fit-{k + 1}" for k in range(workers))]
        cores = len(os.sched_getaffinity(0))
        threads = {"POCL_MAX_PTHREAD_COUNT": str(max(1, cores // max(1, workers)))}
        self.children = [
            _Child(name, [*worker, *self._options(name, kind)], True, threads | dict(os.environ))
            for name, kind in zip(names, kinds, strict=True)
        ]
        if server is not None:
            added = {**os.environ, **(environment or {})}
            self.children.insert(0, _Child("server", server, False, added))

    def _options(self, name: str, kinds: str) -> list[str]:
        return [
            *("--data-dir", str(self.store.files.root), "--kinds", kinds, "--name", name),
            *limits_arguments(self.store.limits),
        ]

    def run(self) -> int:
        """Run until told to stop, by a signal or `stop`; gives the exit status."""
        before = {
            number: signal.signal(number, self.stop) for number in (signal.SIGTERM, signal.SIGINT)
        }
        try:
            while not self.stopping:
                for child in self.children:
                    self._look(child)
                time.sleep(LOOK)
        finally:
            self._end()
            for number, handler in before.items():
                signal.signal(number, handler)
        return 0

    def stop(self, *_: object) -> None:
        """End everything; a signal handler."""
        self.stopping = True

    def _look(self, child: _Child) -> None:
        """Start a child that is due, notice one that died, kill one that is silent."""
        now = time.monotonic()
        if child.process is None:
            if now >= child.due:
                self._start(child)
            return
        status = child.process.poll()
        if status is not None:
            self._reap(child, status)
        elif child.is_worker and self._silent(child, now):
            _log(f"{child.name} is not heard of; it is killed")
            _kill(child.process, signal.SIGKILL)

    def _start(self, child: _Child) -> None:
        child.began = child.heard = time.monotonic()
        parent = os.getpid()

        def die_with_parent() -> None:
            _libc.prctl(_PR_SET_PDEATHSIG, signal.SIGTERM)
            if os.getppid() != parent:
                os._exit(1)

        try:
            child.process = subprocess.Popen(
                child.command,
                env=dict(child.environment),
                start_new_session=True,
                stdin=subprocess.DEVNULL,
                preexec_fn=die_with_parent,  # noqa: PLW1509 (no threads here)
            )
        except OSError as error:
            _log(f"{child.name} cannot be started: {error}")
            self._again(child)

    def _reap(self, child: _Child, status: int) -> None:
        """Clean up after a child that died, and plan its next start."""
        assert child.process is not None
        pid = child.process.pid
        _kill(child.process, signal.SIGKILL)  # what is left of its group
        child.process = None
        how = f"signal {-status}" if status < 0 else f"status {status}"
        _log(f"{child.name} (process {pid}) ended with {how}")
        if child.is_worker:
            with suppress(StoreError):  # the lease ends by itself
                self.queue.bury(child.name, pid, f"the worker ended with {how}")
        self._again(child)

    def _again(self, child: _Child) -> None:
        now = time.monotonic()
        child.failures = 0 if now - child.began > STEADY else child.failures + 1
        wait = 0.0 if child.failures <= 1 else min(BACKOFF, 2.0 ** (child.failures - 2))
        child.due = now + wait

    def _silent(self, child: _Child, now: float) -> bool:
        """Tell whether a worker has not been heard of for too long."""
        if now - child.heard < SILENT / 2:
            return False
        assert child.process is not None
        try:
            rows = {row.pid: row for row in self.store.processes()}
        except StoreError:
            return False
        row = rows.get(child.process.pid)
        if row is None or row.age is None:
            return now - child.began > SILENT_START
        child.heard = now - row.age
        return row.age > (SILENT_START if row.state == "starting" else SILENT)

    def _end(self) -> None:
        """End the server first, so that nothing new comes in, then the workers."""
        for worker, seconds in ((False, SERVER_END), (True, WORKERS_END)):
            running = [c for c in self.children if c.is_worker is worker and c.process is not None]
            for child in running:
                assert child.process is not None
                with suppress(ProcessLookupError):
                    child.process.terminate()
            until = time.monotonic() + seconds
            for child in running:
                assert child.process is not None
                with suppress(subprocess.TimeoutExpired):
                    child.process.wait(max(0.0, until - time.monotonic()))
                _kill(child.process, signal.SIGKILL)
                child.process.wait()
                child.process = None
        self.queue.bury_strangers()
        self.queue.close()
        self.store.close()
        os.close(self._lock)


def supervise(
    data_dir: Path,
    server_command: Sequence[str] | None,
    *,
    workers: int = 2,
    limits: Limits = Limits(),  # noqa: B008 (frozen)
    environment: Mapping[str, str] | None = None,
) -> int:
    """Run server and workers until SIGTERM or SIGINT; see `Supervisor`."""
    made = Supervisor(
        data_dir, server_command, workers=workers, limits=limits, environment=environment
    )
    return made.run()


_libc = ctypes.CDLL(None, use_errno=True)


def _kill(process: subprocess.Popen[bytes], number: int) -> None:
    """Send a signal to a child's whole group."""
    with suppress(ProcessLookupError, PermissionError):
        os.killpg(process.pid, number)


def _lock(path: Path) -> int:
    """Keep other supervisors away for as long as this process lives."""
    try:
        fd = os.open(path, os.O_RDWR | os.O_CREAT, 0o600)
    except OSError as error:
        raise store_error(error, "cannot use the data folder") from error
    try:
        fcntl.flock(fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        os.close(fd)
        raise StoreError(
            f"another service uses the data folder {path.parent}; stop it, or give another"
        ) from error
    return fd


def _log(text: str) -> None:
    print(f"{time.strftime('%Y-%m-%dT%H:%M:%S')} supervisor: {text}", file=sys.stderr, flush=True)
