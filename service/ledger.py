"""The jobs as those see them who send them in: submit, look, cancel, delete."""

from __future__ import annotations

import hashlib
import json
import secrets
import sqlite3
import time
from typing import Any

from lobefit.service.codec import add_event, cursor_after, first, job_row, seq_before, to_text
from lobefit.service.rows import (
    ENDED,
    FIT,
    EventRow,
    InUse,
    JobRow,
    KeyConflict,
    NotFound,
    QueueFull,
)
from lobefit.service.shelf import Shelf
from lobefit.service.wake import wake_all

__all__ = ["Ledger"]

# A fit with a posterior takes minutes: one counts as sent in so many seconds later, so
# that quick ones go first but none waits for ever.
POSTERIOR_LATER = 60.0


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
            "fit", or one of the quick kinds.
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
        body = to_text(request)
        same = json.dumps(request, sort_keys=True)  # keys in another order are the same request
        digest = hashlib.sha256(f"{kind}\n{measurement}\n{same}".encode()).hexdigest()
        now, ticket = time.time(), secrets.token_hex(10)
        earlier: str | None = None
        with self.database.write() as write:
            if key is not None:
                row = first(
                    write, "SELECT job, digest FROM keys WHERE owner = ? AND key = ?", (owner, key)
                )
                if row is not None and row["digest"] != digest:
                    raise KeyConflict("this Idempotency-Key came with another request before")
                earlier = None if row is None else row["job"]
            if earlier is None:
                self.room()
                self._admit(write, kind, owner)
                if measurement is not None and not first(
                    write, "SELECT 1 FROM measurements WHERE id = ?", (measurement,)
                ):
                    raise NotFound("there is no such measurement")
                later = (
                    POSTERIOR_LATER if kind == FIT and request.get("posterior") is not None else 0.0
                )
                write.execute(
                    "INSERT INTO jobs (id, kind, state, request, measurement, owner, rank, created)"
                    " VALUES (?, ?, 'queued', ?, ?, ?, ?, ?)",
                    (ticket, kind, body, measurement, owner, now + later, now),
                )
                if key is not None:
                    write.execute(
                        "INSERT INTO keys VALUES (?, ?, ?, ?)", (owner, key, ticket, digest)
                    )
                add_event(write, ticket, "state", {"state": "queued", "attempts": 0})
        wake_all(self.files.wake)
        return self.job(earlier or ticket), earlier is None

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
    ) -> tuple[list[JobRow], str | None]:
        """List jobs of a kind, the newest first, with the cursor of the next page or None."""
        where, values = ["kind = ?", "seq < ?"], [kind, seq_before(cursor)]
        for column, value in (("measurement", measurement), ("state", state)):
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
            row = first(write, "SELECT state, attempts FROM jobs WHERE id = ?", (id,))
            if row is None:
                raise NotFound("there is no such job")
            if row["state"] == "queued":
                write.execute(
                    "UPDATE jobs SET state = 'cancelled', ended = ? WHERE id = ?",
                    (time.time(), id),
                )
                data = {"state": "cancelled", "attempts": row["attempts"]}
                add_event(write, id, "state", data)
            elif row["state"] == "running":
                write.execute("UPDATE jobs SET cancelling = 1 WHERE id = ?", (id,))
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
        self.files.remove_job(id)

    def events(self, id: str, after: int, limit: int = 100) -> list[EventRow]:
        """Give what happened to a job after the event with a number, 0 for all."""
        rows = self.database.read(
            "SELECT seq, type, data FROM events WHERE job = ? AND seq > ? ORDER BY seq LIMIT ?",
            (id, after, limit),
        )
        return [EventRow(seq=r["seq"], type=r["type"], data=json.loads(r["data"])) for r in rows]

    def position(self, id: str) -> int | None:
        """Give how many jobs go before this one, counted from 1; None unless it waits."""
        row = self.database.one(
            "SELECT (SELECT count(*) FROM jobs o WHERE o.state = 'queued' AND o.kind = j.kind "
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

    def _admit(self, write: sqlite3.Connection, kind: str, owner: str) -> None:
        """Raise `QueueFull` where too many jobs wait."""
        query = "SELECT count(*) FROM jobs WHERE state = 'queued' AND kind "
        if kind != FIT:
            (waiting,) = write.execute(f"{query} <> ?", (FIT,)).fetchone()
            if waiting >= self.limits.quick:
                raise QueueFull(f"{waiting} requests wait already; try again in a moment")
            return
        (waiting,) = write.execute(f"{query} = ?", (FIT,)).fetchone()
        if waiting >= self.limits.queue:
            raise QueueFull(f"{waiting} fits wait already; try again later")
        if waiting >= self.limits.queue_per_owner:
            (own,) = write.execute(f"{query} = ? AND owner = ?", (FIT, owner)).fetchone()
            if own >= self.limits.queue_per_owner:
                raise QueueFull(f"{own} fits of yours wait already; try again later")
