"""Fits that are sent in together: all enter the queue or none does, and they are counted."""

from __future__ import annotations

import secrets
import sqlite3
import time
from collections.abc import Sequence
from typing import Any, get_args

from lobefit.service.codec import cursor_after, first, job_row, seq_before, to_text
from lobefit.service.ledger import Ledger, cancel_jobs
from lobefit.service.rows import ENDED, FIT, BatchRow, InUse, JobRow, NotFound, State

__all__ = ["Batches"]

# Each fit of a batch counts as sent in so many seconds after the one before it, so that a fit
# of somebody else need not wait for the whole batch.
ITEM_LATER = 1.0


class Batches(Ledger):
    """The table of batches; see `lobefit.service.store.Store`."""

    def submit_batch(
        self,
        name: str | None,
        requests: Sequence[dict[str, Any]],
        *,
        owner: str = "",
        key: str | None = None,
    ) -> tuple[BatchRow, bool]:
        """Put many fits into the queue, all or none; once this returns none will be lost.

        Parameters
        ----------
        name : str or None
            What people call the batch.
        requests : sequence of dict
            Of fits, JSON-ready, each with its "measurement".
        owner, key
            As for `Ledger.submit`.

        Returns
        -------
        BatchRow
        bool
            False where the key was known and the batch is the earlier one.

        Raises
        ------
        QueueFull, StoreFull, KeyConflict, NotFound
            As `Ledger.submit`; nothing was queued.
        """

        def make(write: sqlite3.Connection, ticket: str) -> None:
            self._admit(write, FIT, owner, len(requests))
            write.execute(
                "INSERT INTO batches (id, name, owner, created) VALUES (?, ?, ?, ?)",
                (ticket, name, owner, time.time()),
            )
            for k, request in enumerate(requests):
                self._enter(
                    write,
                    secrets.token_hex(10),
                    FIT,
                    request,
                    owner=owner,
                    measurement=request["measurement"],
                    batch=ticket,
                    later=k * ITEM_LATER,
                )

        about = {"name": name, "items": list(requests)}
        ticket, new = self._once(owner, key, ("batch", None), about, make)
        return self.batch(ticket), new

    def batch(self, id: str) -> BatchRow:
        """Give a batch, or raise `NotFound`."""
        rows = self.database.read("SELECT * FROM batches WHERE id = ?", (id,))
        if not rows:
            raise NotFound("there is no such batch")
        return self._counted(rows)[0]

    def batches(self, limit: int, cursor: str | None = None) -> tuple[list[BatchRow], str | None]:
        """List batches, the newest first, with the cursor of the next page or None."""
        rows = self.database.read(
            "SELECT * FROM batches WHERE seq < ? ORDER BY seq DESC LIMIT ?",
            (seq_before(cursor), limit + 1),
        )
        return self._counted(rows[:limit]), cursor_after(rows, limit)

    def _counted(self, rows: Sequence[sqlite3.Row]) -> list[BatchRow]:
        found: dict[str, list[sqlite3.Row]] = {row["id"]: [] for row in rows}
        for counted in self.database.read(
            "SELECT batch, state, count(*) AS n, min(started) AS started, max(ended) AS ended "
            "FROM jobs WHERE batch IN (SELECT value FROM json_each(?)) GROUP BY batch, state",
            (to_text(list(found)),),
        ):
            found[counted["batch"]].append(counted)
        return [_batch_row(row, found[row["id"]]) for row in rows]

    def batch_jobs(self, id: str) -> list[JobRow]:
        """Give the fits of a batch in the order of its items."""
        rows = self.database.read("SELECT * FROM jobs WHERE batch = ? ORDER BY seq", (id,))
        return [job_row(row) for row in rows]

    def cancel_batch(self, id: str) -> BatchRow:
        """Cancel whatever of a batch has not ended; the rest of it stays.

        One whose fits have all ended was not cancelled, even if it was asked for a moment before.
        """
        with self.database.write() as write:
            query = "SELECT id, state, attempts FROM jobs WHERE batch = ?"
            rows = write.execute(query, (id,)).fetchall()
            if any(row["state"] not in ENDED for row in rows):
                write.execute("UPDATE batches SET cancelled = 1 WHERE id = ?", (id,))
                cancel_jobs(write, rows)
        return self.batch(id)

    def delete_batch(self, id: str) -> None:
        """Delete a batch whose fits have all ended, with them; raises `NotFound` or `InUse`."""
        with self.database.write() as write:
            if first(write, "SELECT 1 FROM batches WHERE id = ?", (id,)) is None:
                raise NotFound("there is no such batch")
            rows = write.execute("SELECT id, state FROM jobs WHERE batch = ?", (id,)).fetchall()
            if any(row["state"] not in ENDED for row in rows):
                raise InUse("fits of the batch have not ended; cancel it first")
            write.execute("DELETE FROM batches WHERE id = ?", (id,))
            write.execute("DELETE FROM keys WHERE made = ?", (id,))
        for row in rows:
            self.files.remove_job(row["id"])


def _batch_row(row: sqlite3.Row, counted: Sequence[sqlite3.Row]) -> BatchRow:
    counts: dict[State, int] = dict.fromkeys(get_args(State), 0)
    counts |= {c["state"]: c["n"] for c in counted}
    started = [c["started"] for c in counted if c["started"] is not None]
    # Once its last fit is deleted, a batch has been over all along.
    ended = max((c["ended"] for c in counted if c["ended"] is not None), default=row["created"])
    return BatchRow(
        id=row["id"],
        name=row["name"],
        created=row["created"],
        cancelled=bool(row["cancelled"]),
        counts=counts,
        started=min(started, default=None),
        ended=None if counts["queued"] or counts["running"] else ended,
    )
