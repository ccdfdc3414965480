"""A job that a worker holds: prolong it, give out its files, end it once."""

from __future__ import annotations

import sqlite3
import time
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lobefit.service.codec import add_event, first, to_text
from lobefit.service.database import Database, monotonic, store_error
from lobefit.service.files import digest_of, sync
from lobefit.service.rows import JobRow, LeaseLost, State
from lobefit.service.store import Store
from lobefit.service.wake import wake_all

__all__ = ["Claim", "Made", "end", "lease_end", "state_data"]

# Progress events that are kept of a job.
KEPT_EVENTS = 50


@dataclass(frozen=True, slots=True)
class Made:
    """A file that a job made in the folder of its claim."""

    path: Path
    media_type: str


class Claim:
    """A job that this worker holds.

    Attributes
    ----------
    job : JobRow
        As it was claimed.
    fence : int
        Which claim of the job this is.
    folder : Path
        Where this attempt keeps its files; made.
    """

    def __init__(self, store: Store, light: Database, job: JobRow, fence: int) -> None:
        self._store, self._light = store, light
        self.job, self.fence = job, fence

    @property
    def folder(self) -> Path:
        """The folder of this attempt, made where it does not exist."""
        path = self._store.files.attempt(self.job.id, self.fence)
        try:
            path.mkdir(mode=0o700, parents=True, exist_ok=True)
        except OSError as error:
            raise store_error(error, "cannot keep the files of the job") from error
        return path

    def earlier(self, name: str) -> Path | None:
        """Give a file that an earlier attempt left, of the latest that has it."""
        for fence in range(self.fence - 1, 0, -1):
            path = self._store.files.attempt(self.job.id, fence) / name
            if path.is_file():
                return path
        return None

    def beat(self, progress: dict[str, Any] | None = None) -> bool:
        """Prolong the lease and tell the progress; gives whether the job is to be cancelled.

        Raises
        ------
        LeaseLost
            Somebody else has the job, or it is gone.
        """
        text = None if progress is None else to_text(progress)
        with self._light.write() as write:
            row = first(
                write,
                "UPDATE jobs SET lease = ?, progress = coalesce(?, progress) "
                "WHERE id = ? AND fence = ? AND state = 'running' RETURNING cancelling",
                (lease_end(self._store), text, self.job.id, self.fence),
            )
            if row is None:
                raise _lost(self.job)
            if progress is not None:
                add_event(write, self.job.id, "progress", progress)
                write.execute(
                    "DELETE FROM events WHERE job = ? AND type = 'progress' AND seq <= "
                    "(SELECT seq FROM events WHERE job = ? AND type = 'progress' "
                    "ORDER BY seq DESC LIMIT 1 OFFSET ?)",
                    (self.job.id, self.job.id, KEPT_EVENTS),
                )
        return bool(row["cancelling"])

    def is_cancelled(self) -> bool:
        """Look whether the job is to be cancelled, or not ours any more."""
        row = self._light.one(
            "SELECT 1 FROM jobs WHERE id = ? AND fence = ? AND state = 'running' "
            "AND NOT cancelling",
            (self.job.id, self.fence),
        )
        return row is None

    def publish(self, made: Iterable[Made]) -> None:
        """Give files to everybody before the job has ended, or after it was cancelled."""
        rows = self._kept(made)
        with self._store.database.write() as write:
            self._check(write, "running", "cancelled")
            _note_files(write, self.job.id, self.fence, rows)

    def finish(self, result: dict[str, Any] | None, made: Iterable[Made] = ()) -> None:
        """End the job well: its result and files are there from then on, all or none.

        Raises
        ------
        LeaseLost
            Nothing was written.
        StoreFull, StoreError
            Nothing was written; the job is still held.
        """
        rows = self._kept(made)
        with self._store.database.write() as write:
            self._check(write, "running")
            _note_files(write, self.job.id, self.fence, rows)
            end(write, self.job.id, "done", self.job.attempts, result=result)

    def fail(self, problem: dict[str, Any]) -> None:
        """End the job with what went wrong."""
        with self._store.database.write() as write:
            self._check(write, "running")
            end(write, self.job.id, "failed", self.job.attempts, problem=problem)

    def stop(self, result: dict[str, Any] | None = None) -> None:
        """End the job as cancelled; files may still be published."""
        with self._store.database.write() as write:
            if self._check(write, "running", "cancelled") == "running":
                end(write, self.job.id, "cancelled", self.job.attempts, result=result)
            elif result is not None:
                values = (to_text(result), self.job.id)
                write.execute("UPDATE jobs SET result = ? WHERE id = ?", values)

    def give_back(self) -> None:
        """Put the job back into the queue, as if this attempt had not been."""
        with self._store.database.write() as write:
            self._check(write, "running")
            attempts = max(0, self.job.attempts - 1)
            write.execute(
                "UPDATE jobs SET state = 'queued', attempts = ?, lease = NULL, worker = NULL "
                "WHERE id = ?",
                (attempts, self.job.id),
            )
            add_event(write, self.job.id, "state", state_data("queued", attempts))
        wake_all(self._store.files.wake)

    def tidy(self, *, own: bool = False) -> None:
        """Remove files that are no artefacts: of all attempts, or of this one alone."""
        self._store.prune(self.job.id, self.fence if own else None)

    def _check(self, write: sqlite3.Connection, *states: State) -> State:
        row = first(write, "SELECT state, fence FROM jobs WHERE id = ?", (self.job.id,))
        if row is None or row["fence"] != self.fence or row["state"] not in states:
            raise _lost(self.job)
        found: State = row["state"]
        return found

    def _kept(self, made: Iterable[Made]) -> list[tuple[str, int, str, str]]:
        """Bring files to the disk; give name, size, digest and type of each."""
        rows = []
        try:
            for m in made:
                sync(m.path)
                rows.append((m.path.name, m.path.stat().st_size, digest_of(m.path), m.media_type))
            if rows:
                for folder in (self.folder, self.folder.parent, self.folder.parent.parent):
                    sync(folder)
        except OSError as error:
            raise store_error(error, "cannot keep the files of the job") from error
        return rows


def _note_files(
    write: sqlite3.Connection, id: str, fence: int, rows: list[tuple[str, int, str, str]]
) -> None:
    write.executemany(
        "INSERT OR REPLACE INTO artefacts (job, fence, name, bytes, sha256, media_type) "
        "VALUES (?, ?, ?, ?, ?, ?)",
        [(id, fence, *row) for row in rows],
    )


def end(
    write: sqlite3.Connection,
    id: str,
    state: State,
    attempts: int,
    *,
    result: dict[str, Any] | None = None,
    problem: dict[str, Any] | None = None,
) -> None:
    """Bring a job to a state that stays, in the transaction of the caller."""
    write.execute(
        "UPDATE jobs SET state = ?, ended = ?, result = ?, problem = ?, lease = NULL, "
        "worker = NULL, progress = NULL, cancelling = 0 WHERE id = ?",
        (
            state,
            time.time(),
            None if result is None else to_text(result),
            None if problem is None else to_text(problem),
            id,
        ),
    )
    add_event(write, id, "state", state_data(state, attempts))


def state_data(state: State, attempts: int) -> dict[str, Any]:
    """Give what a "state" event tells."""
    return {"state": state, "attempts": attempts}


def _lost(job: JobRow) -> LeaseLost:
    return LeaseLost(f"job {job.id} is not held by this worker any more")


def lease_end(store: Store) -> float:
    """Give when a lease taken now ends, by `monotonic`."""
    return monotonic() + store.limits.lease
