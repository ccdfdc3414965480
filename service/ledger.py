"""The jobs as those see them who send them in: submit, look, cancel, delete."""

from __future__ import annotations

import hashlib
import json
import secrets
import sqlite3
import time
from collections.abc import Callable, Iterable
from typing import Any

from lobefit.service.codec import add_event, cursor_after, first, job_row, seq_before, to_text
from lobefit.service.rows import (
    CHART,
    ENDED,
    FIT,
    WAITING,
    EventRow,
    InUse,
    JobRow,
    KeyConflict,
    NotFound,
    QueueFull,
)
from lobefit.service.shelf import Shelf
from lobefit.service.wake import wake_all

__all__ = ["IN_QUEUE", "Ledger", "cancel_jobs"]

# A chart and a fit with a posterior take minutes: one counts as sent in so many seconds later,
# so that quick ones go first but none waits for ever.
LONG_LATER = 60.0

IN_QUEUE = f"kind IN ({', '.join(map(repr, WAITING))})"
"""A condition of SQL: the job waits in the queue, or did."""


class Ledger(Shelf):
    """The table of jobs; see `lobefit.service.store.Store`."""

    def submit(
        self,
        kind: str,
        request: dict[str, Any],
        *,
        owner: str = "",
        key: str | None = None,
        measurement: str | None = None,
    ) -> tuple[JobRow, bool]:
        """Put a job into the queue; once this returns it will not be lost.

        Parameters
        ----------
        kind : str
            "fit" or "chart", or one of the quick kinds.
        request : dict
            What to do, JSON-ready.
        owner : str
            Whose it is, for the share of the queue and the scope of keys.
        key : str, optional
            Idempotency key: with the same one and the same request the job is made once.
        measurement : str, optional
            Which measurement it needs; that cannot be deleted meanwhile.

        Returns
        -------
        JobRow
        bool
            False where the key was known and the job is the earlier one.

        Raises
        ------
        QueueFull, StoreFull
            Try again later.
        KeyConflict
            The key came with another request before.
        NotFound
            There is no such measurement.
        """

        def make(write: sqlite3.Connection, ticket: str) -> None:
            self._admit(write, kind, owner)
            self._enter(write, ticket, kind, request, owner=owner, measurement=measurement)

        ticket, new = self._once(owner, key, (kind, measurement), request, make)
        return self.job(ticket), new

    def job(self, id: str) -> JobRow:
        """Give a job, or raise `NotFound`."""
        row = self.database.one("SELECT * FROM jobs WHERE id = ?", (id,))
        if row is None:
            raise NotFound("there is no such job")
        return job_row(row)

    def jobs(
        self,
        limit: int,
        cursor: str | None = None,
        *,
        kind: str = FIT,
        measurement: str | None = None,
        state: str | None = None,
        batch: str | None = None,
    ) -> tuple[list[JobRow], str | None]:
        """List jobs of a kind, the newest first, with the cursor of the next page or None."""
        # The plus keeps SQLite from looking through all of a kind where it could look up few.
        few = measurement is not None or batch is not None
        where, values = ["+kind = ?" if few else "kind = ?", "seq < ?"], [kind, seq_before(cursor)]
        for column, value in (
            ("measurement", measurement),
            ("state", state),
            ("batch", batch),
        ):
            if value is not None:
                where.append(f"{column} = ?")
                values.append(value)
        rows = self.database.read(
            f"SELECT * FROM jobs WHERE {' AND '.join(where)} ORDER BY seq DESC LIMIT ?",
            (*values, limit + 1),
        )
        return [job_row(row) for row in rows[:limit]], cursor_after(rows, limit)

    def cancel(self, id: str) -> JobRow:
        """Cancel a job: at once where it waits, else its worker is told; an ended one stays."""
        with self.database.write() as write:
            row = first(write, "SELECT id, state, attempts FROM jobs WHERE id = ?", (id,))
            if row is None:
                raise NotFound("there is no such job")
            cancel_jobs(write, [row])
        return self.job(id)

    def delete_job(self, id: str) -> None:
        """Delete an ended job with its files; raises `NotFound` or `InUse`."""
        with self.database.write() as write:
            row = first(write, "SELECT state FROM jobs WHERE id = ?", (id,))
            if row is None:
                raise NotFound("there is no such job")
            if row["state"] not in ENDED:
                raise InUse("the job has not ended; cancel it first")
            write.execute("DELETE FROM jobs WHERE id = ?", (id,))
            write.execute("DELETE FROM keys WHERE made = ?", (id,))
        self.files.remove_job(id)

    def events(self, id: str, after: int, limit: int = 100) -> list[EventRow]:
        """Give what happened to a job after the event with a number, 0 for all."""
        rows = self.database.read(
            "SELECT seq, type, data FROM events WHERE job = ? AND seq > ? ORDER BY seq LIMIT ?",
            (id, after, limit),
        )
        return [EventRow(seq=r["seq"], type=r["type"], data=json.loads(r["data"])) for r in rows]

    def position(self, id: str) -> int | None:
        """Give the place of a fit or a chart in the queue, from 1; None unless it waits."""
        row = self.database.one(
            f"SELECT (SELECT count(*) FROM jobs o WHERE o.state = 'queued' AND o.{IN_QUEUE} "
            "AND (o.rank, o.seq) <= (j.rank, j.seq)) AS place "
            "FROM jobs j WHERE j.id = ? AND j.state = 'queued'",
            (id,),
        )
        return None if row is None else int(row["place"])

    def depth(self, kind: str) -> int:
        """Count the jobs of a kind that wait."""
        row = self.database.one(
            "SELECT count(*) AS n FROM jobs WHERE state = 'queued' AND kind = ?", (kind,)
        )
        return 0 if row is None else int(row["n"])

    def counts(self) -> dict[tuple[str, str], int]:
        """Count the jobs there are by kind and state, for the metrics."""
        rows = self.database.read("SELECT kind, state, count(*) AS n FROM jobs GROUP BY 1, 2")
        return {(r["kind"], r["state"]): r["n"] for r in rows}

    def _once(
        self,
        owner: str,
        key: str | None,
        about: tuple[str, str | None],
        request: Any,
        make: Callable[[sqlite3.Connection, str], None],
    ) -> tuple[str, bool]:
        """Make something for a request, all of it or nothing, or find what its key has made.

        Parameters
        ----------
        owner, key : str, str or None
            The idempotency key and its scope.
        about : (str, str or None)
            Kind and measurement.
        request : JSON-ready
            Requests with their keys in another order are the same.
        make : callable
            Called in the transaction, with the new id.

        Returns
        -------
        str
            The id.
        bool
            False where the key was known.
        """
        kind, measurement = about
        same = json.dumps(request, sort_keys=True)
        digest = hashlib.sha256(f"{kind}\n{measurement}\n{same}".encode()).hexdigest()
        ticket = secrets.token_hex(10)
        with self.database.write() as write:
            if key is not None:
                row = first(
                    write, "SELECT made, digest FROM keys WHERE owner = ? AND key = ?", (owner, key)
                )
                if row is not None and row["digest"] != digest:
                    raise KeyConflict("this Idempotency-Key came with another request before")
                if row is not None:
                    return row["made"], False
            self.room()
            make(write, ticket)
            if key is not None:
                write.execute("INSERT INTO keys VALUES (?, ?, ?, ?)", (owner, key, ticket, digest))
        wake_all(self.files.wake)
        return ticket, True

    def _enter(
        self,
        write: sqlite3.Connection,
        ticket: str,
        kind: str,
        request: dict[str, Any],
        *,
        owner: str,
        measurement: str | None,
        batch: str | None = None,
        later: float = 0.0,
    ) -> None:
        """Add a job that counts as sent in so many seconds later."""
        if measurement is not None and not first(
            write, "SELECT 1 FROM measurements WHERE id = ?", (measurement,)
        ):
            raise NotFound("there is no such measurement")
        if kind == CHART or (kind == FIT and request.get("posterior") is not None):
            later += LONG_LATER
        now = time.time()
        write.execute(
            "INSERT INTO jobs (id, kind, state, request, measurement, owner, rank, created, batch)"
            " VALUES (?, ?, 'queued', ?, ?, ?, ?, ?, ?)",
            (ticket, kind, to_text(request), measurement, owner, now + later, now, batch),
        )
        add_event(write, ticket, "state", {"state": "queued", "attempts": 0})

    def _admit(self, write: sqlite3.Connection, kind: str, owner: str, new: int = 1) -> None:
        """Raise `QueueFull` where too many jobs would wait."""
        query = "SELECT count(*) FROM jobs WHERE state = 'queued' AND"
        limits = self.limits
        if kind not in WAITING:
            (waiting,) = write.execute(f"{query} NOT {IN_QUEUE}").fetchone()
            if waiting + new > limits.quick:
                raise QueueFull(f"{waiting} requests wait already; try again in a moment")
            return
        (waiting,) = write.execute(f"{query} {IN_QUEUE}").fetchone()
        if waiting + new > limits.queue:
            raise QueueFull(
                f"{waiting} of at most {limits.queue} fits and charts wait already; try again later"
            )
        if waiting + new > limits.queue_per_owner:
            (own,) = write.execute(f"{query} {IN_QUEUE} AND owner = ?", (owner,)).fetchone()
            if own + new > limits.queue_per_owner:
                raise QueueFull(
                    f"{own} of at most {limits.queue_per_owner} fits and charts of yours wait already; "
                    "try again later"
                )


def cancel_jobs(write: sqlite3.Connection, rows: Iterable[sqlite3.Row]) -> None:
    """Cancel jobs in the transaction of the caller: rows with id, state and attempts."""
    for row in rows:
        if row["state"] == "queued":
            write.execute(
                "UPDATE jobs SET state = 'cancelled', ended = ? WHERE id = ?",
                (time.time(), row["id"]),
            )
            data = {"state": "cancelled", "attempts": row["attempts"]}
            add_event(write, row["id"], "state", data)
        elif row["state"] == "running":
            write.execute("UPDATE jobs SET cancelling = 1 WHERE id = ?", (row["id"],))
