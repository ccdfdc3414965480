"""The driver: hands out chunks, keeps results, and gets over the death of workers."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, wait
from dataclasses import dataclass

from lobefit.fitting.engine.crew import Crew
from lobefit.fitting.engine.errors import EngineError
from lobefit.fitting.engine.ledger import Ledger, Row
from lobefit.fitting.engine.ranges import Ranges
from lobefit.fitting.engine.sizes import Sizes
from lobefit.fitting.engine.work import Work
from lobefit.fitting.engine.worker import Outcome, run_chunk

__all__ = ["Progress", "Status", "run"]

# So many deaths or failures without one chunk done between them are no unit's fault.
IN_A_ROW = 40
# Seconds without news after which people are told, and again after as many: without
# workers, and with workers that are busy.
QUIET, BUSY = 15.0, 60.0
# Seconds between looks at who is there.
BEAT, LOOK = 1.0, 5.0
# Looks in a row, without an answer between them, after which chunks that nobody knows are lost.
LOST_AFTER = 4


@dataclass(frozen=True, slots=True)
class Status:
    """How far the work is.

    Attributes
    ----------
    done, total : int
        Units, those of earlier runs included.
    failed : int
        Units that were given up in this run.
    elapsed : float
        Seconds of this run.
    left : float or None
        Seconds to the end at the speed so far; None before the first chunk is done.
    workers : int
        Who works, as last seen.
    message : str
        What people should know now; mostly empty.
    """

    done: int
    total: int
    failed: int
    elapsed: float
    left: float | None
    workers: int
    message: str = ""


Progress = Callable[[Status], None]


@dataclass(slots=True)
class _Chunk:
    first: int
    stop: int
    deaths: int = 0

    def __len__(self) -> int:
        return self.stop - self.first

    def halves(self) -> tuple[_Chunk, _Chunk]:
        middle = (self.first + self.stop) // 2
        return _Chunk(self.first, middle), _Chunk(middle, self.stop)


def run(
    work: Work,
    ledger: Ledger,
    crew: Crew,
    *,
    progress: Progress | None = None,
    patience: float = 120.0,
) -> None:
    """Do all units that the ledger does not say are settled.

    A chunk whose worker dies is tried again while nothing else runs, in halves, until the unit
    that kills is alone; after the crew's number of deaths it is settled as failed. Units whose chunk
    raises an error are found in the same way, without waiting for others.

    Parameters
    ----------
    work : Work
        What to do.
    ledger : Ledger
        What is done; results are kept before it says so.
    crew : Crew
        Who does it. Closed at the end, whatever happens.
    progress : callable, optional
        Called with a `Status` after every chunk and whenever there is something to say.
    patience : float
        Seconds to wait for workers when there is none.

    Raises
    ------
    EngineError
        No workers within `patience`, workers that all die, or work that cannot be begun.
    """
    try:
        _Driver(work, ledger, crew, progress, patience).loop()
    except BaseException:
        crew.close(at_once=True)
        raise
    crew.close()


class _Driver:
    def __init__(
        self, work: Work, ledger: Ledger, crew: Crew, progress: Progress | None, patience: float
    ) -> None:
        self.work, self.ledger, self.crew = work, ledger, crew
        self.progress, self.patience = progress, patience
        self.pending = Ranges(ledger.missing(work.wanted))
        self.earlier = work.total - self.pending.count
        self.sizes = Sizes(work.seconds, work.smallest, work.largest)
        self.flying: dict[Future[Outcome], _Chunk] = {}
        self.again: deque[_Chunk] = deque()
        self.suspects: deque[_Chunk] = deque()
        self.kept: list[Row] = []  # with their results in place, and not noted yet
        self.suspect: _Chunk | None = None  # the one that runs alone now
        self.settled = self.failed = self.in_a_row = self.strange = 0
        self.began = self.heard = self.told = self.looked = time.monotonic()
        self.worked: float | None = None  # since when the first chunk is with a worker
        self.workers = crew.workers()

    def loop(self) -> None:
        """Work until nothing is left."""
        self._tell()
        while True:
            self._submit()
            if not (self.flying or self.suspects or self.again or self.pending.count):
                return
            done, _ = wait(self.flying, timeout=BEAT, return_when=FIRST_COMPLETED)
            if done:
                self._take_in(done)
            if not done or time.monotonic() - self.looked > LOOK:
                self._look_around()
            if not (done or self.flying):
                time.sleep(BEAT)

    def _submit(self) -> None:
        if self.suspects:
            if not self.flying and self.workers:
                self.suspect = self.suspects.popleft()
                self._give(self.suspect)
            return
        if self.suspect is not None:
            return
        # One more for each worker, so that none waits for the driver.
        while len(self.flying) < 2 * self.workers and (self.again or self.pending.count):
            if self.again:
                self._give(self.again.popleft())
            else:
                size = self.sizes.next(self.pending.count, self.workers)
                self._give(_Chunk(*self.pending.take(size)))

    def _give(self, chunk: _Chunk) -> None:
        sent = self.work.sent(chunk.first, chunk.stop)
        self.worked = self.worked or time.monotonic()
        future = self.crew.submit(
            run_chunk,
            self.work.key,
            self.work.opener,
            chunk.first,
            chunk.stop,
            sent,
            self.crew.neighbours,
        )
        self.flying[future] = chunk

    def _take_in(self, done: set[Future[Outcome]]) -> None:
        fates = [self._settle(future) for future in done]
        self._note()
        if "died" in fates and self.crew.breaks:
            # The pool is gone and takes everything with it; some may have been done in time.
            wait(self.flying)
            for future in list(self.flying):
                self._settle(future)
            self._note()
            self.crew.reopen()
        if "died" in fates:
            self._count("workers die")
        if all(fate == "" for fate in fates):
            self.heard, self.strange = time.monotonic(), 0
        elif "lost" in fates:
            self._look_around()

    def _settle(self, future: Future[Outcome]) -> str:
        chunk = self.flying.pop(future)
        alone = chunk is self.suspect
        if alone:
            self.suspect = None
        try:
            outcome = future.result()
        except (Exception, CancelledError) as error:
            fate = self.crew.fate(error)
            if fate == "broken":
                raise EngineError(f"a chunk cannot be run: {error!r}") from error
            if fate == "lost":
                self.again.append(chunk)
            else:
                self._died(chunk, alone)
            return fate
        if outcome.in_opening:
            raise EngineError(outcome.error)
        if outcome.error:
            self._went_wrong(chunk, outcome)
            return ""
        for row in self.work.keep(chunk.first, chunk.stop, outcome.result):
            share = outcome.seconds * (row.stop - row.first) / len(chunk)
            self.kept.append(row._replace(seconds=share, worker=outcome.worker))
        self.sizes.saw(len(chunk), outcome.seconds)
        self.in_a_row = 0
        return ""

    def _note(self) -> None:
        """Settle what was kept, all at once: the more comes back, the less a chunk costs."""
        if self.kept:
            self.work.sync()
            self.settled += self.ledger.settle(self.kept)
            self.failed += sum(r.stop - r.first for r in self.kept if r.reason)
            self.kept.clear()
            self._tell()

    def _died(self, chunk: _Chunk, alone: bool) -> None:
        if not alone:
            self.suspects.append(chunk)
        elif len(chunk) > 1:
            # Behind the other suspects: one of the halves will come through.
            self.suspects.extend(chunk.halves())
        else:
            chunk.deaths += 1
            if chunk.deaths < self.crew.alone:
                self.suspects.append(chunk)
            else:
                self._give_up(chunk, "the process that works on it dies every time")

    def _went_wrong(self, chunk: _Chunk, outcome: Outcome) -> None:
        self._count(outcome.error)
        if len(chunk) > 1:
            self.again.extend(chunk.halves())
        else:
            self._give_up(chunk, outcome.error)

    def _give_up(self, chunk: _Chunk, reason: str) -> None:
        self.settled += self.ledger.settle([Row(chunk.first, chunk.stop, None, reason)])
        self.failed += 1
        self._tell(f"{self.work.name(chunk.first)} is left out: {reason}")

    def _count(self, what: str) -> None:
        self.in_a_row += 1
        if self.in_a_row >= IN_A_ROW:
            raise EngineError(
                f"{IN_A_ROW} times in a row nothing came of it: {what}; {self.crew.remedy}"
            )

    def _look_around(self) -> None:
        """Count the workers; say so where nobody is heard of, and give up at last."""
        self.crew.refresh()
        self.workers = self.crew.workers()
        self.looked = now = time.monotonic()
        known = self.crew.known()
        if known is not None and self.workers and known < len(self.flying):
            self.strange += 1
            if self.strange >= LOST_AFTER:
                self._abandon()
        else:
            self.strange = 0
        if self.workers and not self.flying:
            self.heard = now  # somebody is back, and gets work at once
        quiet = now - self.heard
        if not self.workers and quiet > self.patience:
            raise EngineError(
                f"no worker for {quiet:.0f} s; what is done is kept. {self.crew.remedy}"
            )
        often = BUSY if self.workers else QUIET
        if quiet > often and now - self.told > often:
            self.told = now
            self._tell(
                f"nothing heard for {quiet:.0f} s, {self.workers} workers"
                + ("" if self.workers else f"; {self.crew.remedy}")
            )

    def _abandon(self) -> None:
        """Give chunks again that nobody knows of; an answer that comes all the same is ignored."""
        for future, chunk in self.flying.items():
            future.cancel()
            self.again.append(chunk)
        if self.suspect is not None:
            self.again.remove(self.suspect)
            self.suspects.append(self.suspect)
            self.suspect = None
        self.flying.clear()
        self.strange = 0
        self._tell("the scheduler lost chunks; they are given out again")

    def _tell(self, message: str = "") -> None:
        if self.progress is None:
            return
        now, left = time.monotonic(), None
        if self.settled and self.worked is not None:
            rest = self.work.total - self.earlier - self.settled
            left = rest * (now - self.worked) / self.settled
        self.progress(
            Status(
                done=self.earlier + self.settled,
                total=self.work.total,
                failed=self.failed,
                elapsed=now - self.began,
                left=left,
                workers=self.workers,
                message=message,
            )
        )
