"""Who does the work: loky or a process pool on this machine, or the workers of a Dask scheduler."""

from __future__ import annotations

import multiprocessing
import os
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from concurrent.futures import (
    BrokenExecutor,
    CancelledError,
    Executor,
    Future,
    ProcessPoolExecutor,
)
from contextlib import contextmanager, suppress
from typing import Any, Literal

from lobefit.fitting.engine.errors import EngineError
from lobefit.fitting.engine.worker import prepare, release

__all__ = ["Crew", "DaskCrew", "PoolCrew", "open_crew"]

Fate = Literal["died", "lost", "broken"]
# Sums that BLAS shares among threads depend on their number in the last digit; Dask gives its
# workers one, and so do we.
BLAS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
# loky takes a worker that has grown by 300 MB for one that leaks, and says so to the user; large
# files grow it by more than that.
LEAK, ENOUGH_MEMORY = "LOKY_MAX_MEMORY_LEAK_SIZE", "2e9"
# Seconds that a scheduler may take to answer.
ANSWER = 5.0


class Crew(ABC):
    """Workers behind an executor.

    Attributes
    ----------
    breaks : bool
        Whether the executor is of no use any more once a worker died.
    alone : int
        A unit is given up once it killed its worker so many times while nothing else ran.
    neighbours : int
        Workers that share a machine's cores.
    shares_disk : bool
        Whether workers see the driver's files.
    remedy : str
        What to do when there are no workers.
    """

    breaks: bool
    alone: int
    neighbours: int
    shares_disk: bool
    remedy: str

    @abstractmethod
    def submit(self, task: Callable[..., Any], *arguments: Any) -> Future[Any]:
        """Hand a task to the executor."""

    @abstractmethod
    def workers(self) -> int:
        """Count the workers that are there now."""

    @abstractmethod
    def fate(self, error: BaseException) -> Fate:
        """Tell what an exception says of its task.

        "died": it, or another at the same time, killed its worker; "lost": it is to be given
        again; "broken": no task can work.
        """

    def known(self) -> int | None:
        """Count the tasks that are still waited for by whom they were given to, if it can tell."""
        return None

    def reopen(self) -> None:  # noqa: B027 - most have nothing to do
        """Get a new executor for one that a dead worker broke."""

    def refresh(self) -> None:  # noqa: B027
        """Connect again where the connection is gone for good."""

    @abstractmethod
    def close(self, *, at_once: bool = False) -> None:
        """Let the workers go, in the middle of their tasks where it is to be at once."""


def pool_of(kind: str, jobs: int) -> Executor:
    """Make an executor of processes that start afresh and share nothing with this one."""
    told = (jobs, os.getpid())
    if kind == "processes":
        fresh = multiprocessing.get_context("spawn")
        return ProcessPoolExecutor(jobs, fresh, initializer=prepare, initargs=told)
    import loky

    own = {**dict.fromkeys(BLAS, "1"), LEAK: os.environ.get(LEAK, ENOUGH_MEMORY)}
    pool: Executor = loky.ProcessPoolExecutor(jobs, initializer=prepare, initargs=told, env=own)
    return pool


@contextmanager
def one_thread_each() -> Iterator[None]:
    """Let processes that are started meanwhile use one thread for linear algebra.

    It must be said before they load numpy, which a program's main module may do at once.
    """
    before = {name: os.environ.get(name) for name in BLAS}
    os.environ.update(dict.fromkeys(BLAS, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


class PoolCrew(Crew):
    """Processes of this machine, started afresh, never forked.

    Parameters
    ----------
    jobs : int
        How many.
    kind : {"loky", "processes"}
        loky, or the standard library's pool with the start method "spawn".
    """

    breaks = True
    alone = 3
    shares_disk = True
    remedy = "try fewer --jobs, and look at this machine's memory"

    def __init__(self, jobs: int, kind: str = "loky") -> None:
        self.jobs = self.neighbours = jobs
        self.kind = kind
        self._pool = pool_of(kind, jobs)

    def submit(self, task: Callable[..., Any], *arguments: Any) -> Future[Any]:
        """Hand over a task; a pool that broke in between is found out by the future."""
        try:
            with one_thread_each():  # the first task starts the processes
                return self._pool.submit(task, *arguments)
        except BrokenExecutor as error:
            failed: Future[Any] = Future()
            failed.set_exception(error)
            return failed

    def workers(self) -> int:
        """Give the number of processes, which the pool sees to."""
        return self.jobs

    def fate(self, error: BaseException) -> Fate:
        """Know a pool that lost a process."""
        if isinstance(error, BrokenExecutor):
            return "died"
        return "lost" if isinstance(error, CancelledError) else "broken"

    def reopen(self) -> None:
        """Start a new pool."""
        self.close(at_once=True)
        self._pool = pool_of(self.kind, self.jobs)

    def close(self, *, at_once: bool = False) -> None:
        """End the processes and wait for them, so that none is left behind."""
        pool: Any = self._pool
        if at_once and self.kind == "loky":
            pool.shutdown(wait=True, kill_workers=True)
            return
        if at_once:
            # Python offers no other way to this before 3.14.
            for process in list((pool._processes or {}).values()):
                process.kill()
        pool.shutdown(wait=True)


class DaskCrew(Crew):
    """Workers of a Dask scheduler, wherever they are; they may come and go.

    Parameters
    ----------
    address : str
        As ``tcp://host:8786``.
    shares_disk : bool
        Whether they see this machine's files under the same names.

    Raises
    ------
    EngineError
        Dask is not installed, or nothing answers there.
    """

    breaks = False
    # Dask has tried it on four workers by then (its `allowed-failures`).
    alone = 1

    def __init__(self, address: str, *, shares_disk: bool = False) -> None:
        self.address, self.shares_disk = address, shares_disk
        self.remedy = (
            f"look whether the scheduler at {address} runs (`dask scheduler`) and start workers "
            f"(`dask worker {address} --nthreads 1`), then give the same command again"
        )
        try:
            import dask
            import distributed
        except ImportError as error:
            raise EngineError(
                "a scheduler needs Dask; install it with `pip install lobefit[dask]`"
            ) from error
        self._distributed = distributed
        # Only this crew's connections: a dead scheduler is noticed in seconds, and chunks may
        # be larger than what Dask thinks wise within a graph of many tasks.
        self._settings: Any = dask.config.set(
            {
                "distributed.comm.timeouts.connect": f"{ANSWER}s",
                "distributed.admin.large-graph-warning-threshold": "1GB",
            }
        )
        self.neighbours = 1
        self._known = 0
        self._client: Any = None
        try:
            self._connect()
        except OSError as error:
            raise EngineError(f"no scheduler answers at {address}; {self.remedy}") from error
        except ValueError as error:
            raise EngineError(f"{address!r} is no address such as tcp://host:8786") from error

    def _connect(self) -> None:
        client: Any = self._distributed.Client
        self._client = client(self.address, timeout=ANSWER, set_as_default=False, name="lobefit")
        self._executor = self._client.get_executor(pure=False)

    def submit(self, task: Callable[..., Any], *arguments: Any) -> Future[Any]:
        """Hand over a task; a connection that is gone is found out by the future."""
        try:
            future: Future[Any] = self._executor.submit(task, *arguments)
        except Exception as error:  # noqa: BLE001
            future = Future()
            future.set_exception(CancelledError(str(error)))
        return future

    def workers(self) -> int:
        """Count the threads of all workers; 0 while the scheduler is away."""
        if self._client.status != "running":
            return 0
        self._known, found = 0, {}
        with suppress(Exception):  # whatever a connection that breaks may raise
            self._known, found = self._client.run_on_scheduler(
                _seen, self._client.id, callback_timeout=ANSWER
            )
        hosts = [address.rpartition(":")[0] for address in found]
        self.neighbours = max((hosts.count(h) for h in set(hosts)), default=1)
        return sum(found.values())

    def known(self) -> int | None:
        """Count the tasks that the scheduler has for this client, as last seen.

        What was given to a scheduler in the moment that it died is never answered.
        """
        return self._known

    def fate(self, error: BaseException) -> Fate:
        """Know a task that killed its workers, and one that went with the scheduler."""
        if isinstance(error, self._distributed.KilledWorker):
            return "died"
        # distributed's own CancelledError, CommClosedError and timeouts among them.
        lost = (CancelledError, OSError, TimeoutError)
        return "lost" if isinstance(error, lost) or "Cancel" in type(error).__name__ else "broken"

    def refresh(self) -> None:
        """Connect again where the client gave up."""
        if self._client.status in ("running", "connecting"):
            return
        with suppress(Exception):  # it is closed in any case
            self._client.close(timeout=1)
        with suppress(OSError):  # the scheduler is still away
            self._connect()

    def close(self, *, at_once: bool = False) -> None:
        """Leave the workers to others; what they hold for this work is freed."""
        with suppress(Exception):  # there may be nobody to tell
            self._executor.shutdown(wait=False)
            if not at_once and self._client.status == "running":
                self._client.run(release)
        with suppress(Exception):
            self._client.close(timeout=ANSWER)
        self._settings.__exit__(None, None, None)


def _seen(client: str, dask_scheduler: Any = None) -> tuple[int, dict[str, int]]:
    """Run in the scheduler: tasks that a client waits for, and the threads of each worker."""
    state = dask_scheduler.clients.get(client)
    threads = {address: worker.nthreads for address, worker in dask_scheduler.workers.items()}
    return (0 if state is None else len(state.wants_what)), threads


def open_crew(
    jobs: int | None = None,
    scheduler: str | None = None,
    kind: str = "loky",
    *,
    shares_disk: bool = False,
) -> Crew:
    """Find workers.

    Parameters
    ----------
    jobs : int, optional
        Processes on this machine; as many as cores may be used where left out.
    scheduler : str, optional
        Address of a Dask scheduler, whose workers are taken instead.
    kind : {"loky", "processes"}
        Which pool.
    shares_disk : bool
        Whether the scheduler's workers see this machine's files.

    Raises
    ------
    EngineError
        Not a number of processes, both given, or no scheduler there.
    """
    if scheduler is not None:
        if jobs is not None:
            raise EngineError("the scheduler knows its workers: leave out either it or the jobs")
        return DaskCrew(scheduler, shares_disk=shares_disk)
    if jobs is not None and jobs < 1:
        raise EngineError(f"there must be at least 1 job, not {jobs}")
    if kind not in ("loky", "processes"):
        raise EngineError(f"the pool is one of loky, processes; not {kind!r}")
    return PoolCrew(jobs or len(os.sched_getaffinity(0)), kind)
