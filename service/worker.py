"""A worker process: claims jobs one after the other, does them, keeps its lease meanwhile.

``python -m lobefit.service.worker --data-dir DIR --kinds fit --name fit-1``

The main thread keeps: heartbeats, progress, cancelling, limits of time and memory, signals. The
work is handed to a ``concurrent.futures`` executor, here one thread, so that it can be handed to
another. A job that does not end when it is told to is ended with the process; somebody (see
`lobefit.service.supervisor`) starts the next one.
"""

from __future__ import annotations

import argparse
import os
import signal
import sys
import time
import traceback
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor, wait
from contextlib import suppress
from pathlib import Path

from lobefit.service import work
from lobefit.service.claim import Claim
from lobefit.service.jobs import Queue, identity
from lobefit.service.limits_option import add_limits, limits_of
from lobefit.service.rows import WAITING, LeaseLost, StoreError
from lobefit.service.store import Store
from lobefit.service.task import Outcome, Task, Work, problem_of
from lobefit.service.wake import Sleeper
from lobefit.service.work import QUICK

__all__ = ["Worker", "main"]

# Seconds between two looks at a job that runs, and between two looks for one.
TICK = 0.1
IDLE = 1.0
# Seconds between heartbeats of an idle process, and between two tidyings.
ANNOUNCE = 2.0
TIDY = 60.0
# Seconds that a job gets to end by itself: until it is said to be cancelled, and until the
# process ends with it.
CANCEL = 0.8
GRACE = {"cancel": 30.0, "shutdown": 3.0, "wall": 30.0, "memory": 5.0, "lost": 5.0}
# Seconds for which a job that is done waits for the disk to have space again.
FULL = 60.0

EXIT_STUCK = 70


class Worker:
    """The process's main loop.

    Parameters
    ----------
    store : Store
        Where the jobs are.
    name : str
        Unlike that of any other worker.
    kinds : sequence of str
        Which jobs it does.
    work_of : callable
        Gives the function that does a kind.
    device : callable
        Opens the device and makes the first job fast; gives the device's name.
    """

    def __init__(
        self,
        store: Store,
        name: str,
        kinds: tuple[str, ...],
        work_of: Callable[[str], Work],
        device: Callable[[tuple[str, ...]], str],
    ) -> None:
        self.store, self.kinds = store, kinds
        self.queue = Queue(store, identity(name), kinds)
        self._fits = not {*WAITING}.isdisjoint(kinds)
        self.stopping = False
        self._work_of, self._warm = work_of, device
        self._executor = ThreadPoolExecutor(1, thread_name_prefix="job")
        self._sleeper = Sleeper(store.files.wake, name)
        self._device = ""
        self._announced = self._tidied = 0.0

    def stop(self, *_: object) -> None:
        """End after giving back the job, if there is one; a signal handler."""
        self.stopping = True
        self._sleeper.wake()

    def run(self) -> int:
        """Work until told to stop; gives the exit status."""
        self._announce("starting")
        warm = self._executor.submit(self._warm, self.kinds)
        while not wait([warm], TICK).done:
            self._announce("starting", every=ANNOUNCE)
            if self.stopping:
                return self._leave(hard=True)
        broken = warm.exception()
        if broken is not None:
            traceback.print_exception(broken)
            return self._leave(status=1)
        self._device = warm.result()
        self._announce("idle")
        while not self.stopping:
            claim = self._next()
            if claim is not None:
                self._serve(claim)
                self._announce("idle")
            else:
                self._announce("idle", every=ANNOUNCE)
                self._tidy()
                self._sleeper.sleep(IDLE)
        return self._leave()

    def _next(self) -> Claim | None:
        try:
            return self.queue.claim()
        except StoreError as error:
            _log(f"cannot look for jobs: {error}")
            self._sleeper.sleep(IDLE)
            return None

    def _serve(self, claim: Claim) -> None:
        """Have a job done, and keep it meanwhile."""
        task = Task(self.store, claim)
        future = self._executor.submit(_perform, self._work_of, task)
        self._announce("busy")
        began = beaten = time.monotonic()
        told_to_end = told_cancelled = 0.0
        while not wait([future], TICK).done:
            now = time.monotonic()
            if not told_cancelled:
                beaten = self._beat(claim, task, now, beaten)
            self._announce("busy", every=ANNOUNCE)
            self._judge(task, now - began)
            if not task.reason:
                continue
            told_to_end = told_to_end or now
            if task.reason == "cancel" and not told_cancelled and now - told_to_end > CANCEL:
                # Said at once; what is finished is given out when it is.
                with suppress(StoreError):
                    claim.stop()
                told_cancelled = now
            if now - told_to_end > GRACE[task.reason]:
                self._abandon(claim, task)
        self._settle(claim, task, future)

    def _beat(self, claim: Claim, task: Task, now: float, beaten: float) -> float:
        """Prolong the lease where it is time or there is news; gives when that was."""
        limits = self.store.limits
        due = now - beaten
        try:
            if due < limits.heartbeat:
                if claim.is_cancelled():
                    due = limits.lease  # find out which it is
                else:
                    return beaten
            news = task.news()
            if news is None and due < min(1.0, limits.lease / 4):
                return beaten
            if claim.beat(news):
                task.stop("cancel")
        except LeaseLost:
            task.stop("lost")
        except StoreError as error:
            _log(f"job {claim.job.id}: no heartbeat: {error}")
        return now

    def _judge(self, task: Task, seconds: float) -> None:
        if self.stopping:
            task.stop("shutdown")
        elif seconds > self.store.limits.wall:
            task.stop("wall")
        elif _rss() > self.store.limits.memory:
            task.stop("memory")

    def _settle(self, claim: Claim, task: Task, future: Future[Outcome]) -> None:
        """Write down how a job ended."""
        error = future.exception()
        try:
            if task.reason == "lost":
                claim.tidy(own=True)
                return
            if task.reason == "shutdown" and (error is not None or task.noticed):
                claim.give_back()
                return
            if task.reason == "cancel":
                outcome = Outcome() if error is not None else future.result()
                claim.publish(outcome.made)
                claim.stop(outcome.result)
            elif task.reason in ("wall", "memory"):
                claim.fail(self._exceeded(task.reason))
            elif error is not None:
                claim.fail(_problem(error, claim))
            else:
                self._finish(claim, future.result())
            claim.tidy()
        except LeaseLost as lost:
            _log(str(lost))
            with suppress(StoreError):
                claim.tidy(own=True)
        except StoreError as trouble:
            # The lease ends and the job is done again.
            _log(f"job {claim.job.id}: {trouble}")

    def _finish(self, claim: Claim, outcome: Outcome) -> None:
        """End a job well; where the disk is full, wait a while for space."""
        until = time.monotonic() + FULL
        while True:
            try:
                claim.finish(outcome.result, outcome.made)
                return
            except LeaseLost:
                raise
            except StoreError as error:
                if time.monotonic() > until or self.stopping:
                    raise
                _log(f"job {claim.job.id}: {error}")
                self._sleeper.sleep(IDLE)
                with suppress(StoreError):
                    claim.beat()

    def _exceeded(self, reason: str) -> dict[str, object]:
        limits = self.store.limits
        if reason == "wall":
            detail = f"the job took longer than {limits.wall:g} s; ask for less at once"
            return {"slug": "timeout", "detail": detail}
        mebibytes = limits.memory >> 20
        detail = f"the job needed more than {mebibytes} MiB of memory; fit fewer rows or channels"
        return {"slug": "internal", "detail": detail}

    def _abandon(self, claim: Claim, task: Task) -> None:
        """End the process with a job that does not end."""
        _log(f"job {claim.job.id} does not end ({task.reason}); the process ends with it")
        with suppress(StoreError):
            if task.reason == "shutdown":
                claim.give_back()
            elif task.reason == "cancel":
                claim.stop()
            elif task.reason != "lost":
                claim.fail(self._exceeded(task.reason))
        self._leave(hard=True, status=0 if task.reason == "shutdown" else EXIT_STUCK)

    def _announce(self, state: str, every: float = 0.0) -> None:
        now = time.monotonic()
        if now - self._announced >= every:
            self._announced = now
            with suppress(StoreError):  # told again soon
                self.queue.announce(self._device, state, _rss())

    def _tidy(self) -> None:
        now = time.monotonic()
        if not self._fits and now - self._tidied > TIDY:
            self._tidied = now
            with suppress(StoreError):
                self.queue.tidy()

    def _leave(self, *, hard: bool = False, status: int = 0) -> int:
        with suppress(StoreError):
            self.queue.leave()
        self._sleeper.close()
        self.queue.close()
        self.store.close()
        if hard:
            sys.stderr.flush()
            os._exit(status)  # a thread that does not end keeps the interpreter from ending
        self._executor.shutdown()
        return status


def _perform(work_of: Callable[[str], Work], task: Task) -> Outcome:
    return work_of(task.kind)(task)


def _problem(error: BaseException, claim: Claim) -> dict[str, object]:
    known = problem_of(error)
    if known is not None:
        return {key: value for key, value in known.items() if value is not None}
    _log(f"job {claim.job.id} ({claim.job.kind}) broke:")
    traceback.print_exception(error)
    if isinstance(error, MemoryError):
        return {"slug": "internal", "detail": "the job needed more memory than there is"}
    return {
        "slug": "internal",
        "detail": f"the job broke by a fault of the service ({type(error).__name__}); its log "
        "tells more",
    }


def _rss() -> int:
    """Give the resident bytes of this process."""
    with open("/proc/self/statm", encoding="ascii") as file:  # noqa: PTH123 (ten times a second)
        return int(file.read().split()[1]) * PAGE


PAGE = os.sysconf("SC_PAGE_SIZE")


def _log(text: str) -> None:
    print(f"{time.strftime('%Y-%m-%dT%H:%M:%S')} worker {os.getpid()}: {text}", file=sys.stderr)


def main(
    arguments: list[str] | None = None,
    work_of: Callable[[str], Work] | None = None,
    warm: Callable[[tuple[str, ...]], str] | None = None,
) -> int:
    """Run a worker; the entry point of the process.

    Parameters
    ----------
    arguments : list of str, optional
        Of the command line.
    work_of, warm : callable, optional
        In place of `lobefit.service.work.work_of` and `lobefit.service.work.warm.warm`.
    """
    parser = argparse.ArgumentParser(prog="lobefit.service.worker")
    parser.add_argument("--data-dir", type=Path, required=True)
    parser.add_argument("--kinds", required=True, help="separated by commas, or 'quick'")
    parser.add_argument("--name", required=True)
    add_limits(parser)
    given = parser.parse_args(arguments)
    kinds = QUICK if given.kinds == "quick" else tuple(given.kinds.split(","))
    store = Store(given.data_dir, limits_of(given))
    worker = Worker(store, given.name, kinds, work_of or work.work_of, warm or _warm)
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, worker.stop)
    return worker.run()


def _warm(kinds: tuple[str, ...]) -> str:
    # Within the job's thread, so that the main thread can tell that the process has begun.
    from lobefit.service.work.warm import warm

    return warm(kinds)


if __name__ == "__main__":
    sys.exit(main())
