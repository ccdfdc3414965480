"""The queue as workers see it: claim a job, keep it by heartbeats, end it once.

A claim is a lease that ends by CLOCK_MONOTONIC within one boot, so that no change of the clock
takes or keeps a job. Every claim gets the next fence; each write names the fence it holds, so a
worker that lost its lease, and does not know it yet, can write nothing. Files of an attempt lie
in a folder of its own and count only when the row that names them is committed.
"""

from __future__ import annotations

import os
import sqlite3
import time
from collections.abc import Sequence
from pathlib import Path

from lobefit.service.claim import Claim, end, lease_end, state_data
from lobefit.service.codec import add_event, first, from_json, job_row, to_text
from lobefit.service.database import Database, boot_id, monotonic
from lobefit.service.ledger import IN_QUEUE
from lobefit.service.rows import ENDED
from lobefit.service.store import Store
from lobefit.service.wake import wake_all

__all__ = ["Queue", "identity", "is_alive"]


def identity(name: str) -> str:
    """Name this process so that no other is ever taken for it."""
    pid = os.getpid()
    return f"{name}:{pid}:{_born(pid)}"


def is_alive(worker: str) -> bool:
    """Tell whether the process of an `identity` of this boot still runs."""
    _, pid, born = worker.rsplit(":", 2)
    return _born(int(pid)) == born


def _born(pid: int) -> str:
    """Give when a process began, in ticks since the boot; empty if it is no more."""
    try:
        text = Path(f"/proc/{pid}/stat").read_text(encoding="utf-8", errors="replace")
    except OSError:
        return ""
    after_name = text.rpartition(")")[2].split()
    return "" if after_name[0] in "ZX" else after_name[19]


class Queue:
    """The jobs of some kinds, for one worker.

    Parameters
    ----------
    store : Store
        Where they are.
    worker : str
        The `identity` of the process.
    kinds : sequence of str
        Which it does.
    """

    def __init__(self, store: Store, worker: str, kinds: Sequence[str]) -> None:
        self.store = store
        self.worker = worker
        self.kinds = tuple(kinds)
        self._boot = boot_id()
        self._marks = ", ".join("?" * len(self.kinds))
        # Claims and heartbeats need not outlive a power cut.
        self._light = Database(store.database.path, durable=False)

    def close(self) -> None:
        """Close the connection of its own."""
        self._light.close()

    def claim(self) -> Claim | None:
        """Take the job that is next, or give None where none waits.

        Jobs whose lease has ended go back into the queue first, or have failed where that was
        their last attempt.
        """
        now = monotonic()
        waiting = f"SELECT 1 FROM jobs WHERE state = 'queued' AND kind IN ({self._marks})"
        stale = "SELECT * FROM jobs WHERE state = 'running' AND (boot IS NOT ? OR lease < ?)"
        # A look costs less than a transaction, and an idle worker looks often.
        if not self._light.read(
            f"{waiting} UNION ALL SELECT 1 FROM ({stale}) LIMIT 1",
            (*self.kinds, self._boot, now),
        ):
            return None
        with self._light.write() as write:
            for row in write.execute(stale, (self._boot, now)).fetchall():
                self._recover(write, row)
            row = first(
                write,
                "UPDATE jobs SET state = 'running', fence = fence + 1, attempts = attempts + 1, "
                "started = coalesce(started, ?), worker = ?, boot = ?, lease = ? "
                "WHERE seq = (SELECT seq FROM jobs WHERE state = 'queued' "
                f"AND kind IN ({self._marks}) ORDER BY rank, seq LIMIT 1) RETURNING *",
                (time.time(), self.worker, self._boot, lease_end(self.store), *self.kinds),
            )
            if row is None:
                return None
            add_event(write, row["id"], "state", state_data("running", row["attempts"]))
        return Claim(self.store, self._light, job_row(row), row["fence"])

    def announce(self, device: str, state: str, rss: int) -> None:
        """Say that this process is there and what it does."""
        name, pid, _ = self.worker.rsplit(":", 2)
        with self._light.write() as write:
            write.execute(
                "INSERT OR REPLACE INTO processes VALUES (?, ?, ?, ?, ?, ?, ?, ?)",
                (name, int(pid), ",".join(self.kinds), device, state, self._boot, monotonic(), rss),
            )

    def leave(self) -> None:
        """Say that this process ends."""
        name, pid, _ = self.worker.rsplit(":", 2)
        with self._light.write() as write:
            write.execute("DELETE FROM processes WHERE name = ? AND pid = ?", (name, int(pid)))

    def bury(self, name: str, pid: int, reason: str) -> None:
        """End the leases of a process that is known to be dead.

        Parameters
        ----------
        name, pid : str, int
            Of the process.
        reason : str
            How it died, told where its job fails because of it.
        """
        pattern = f"{name}:{pid}:*"
        with self.store.database.write() as write:
            write.execute("DELETE FROM processes WHERE name = ? AND pid = ?", (name, pid))
            held = write.execute(
                "UPDATE jobs SET lease = 0, problem = ? WHERE state = 'running' AND worker GLOB ?",
                (to_text({"detail": reason}), pattern),
            ).rowcount
        if held:
            wake_all(self.store.files.wake)

    def bury_strangers(self) -> None:
        """End the leases of all processes that do not run any more."""
        rows = self.store.database.read(
            "SELECT DISTINCT worker FROM jobs WHERE state = 'running' AND boot = ?", (self._boot,)
        )
        for row in rows:
            if not is_alive(row["worker"]):
                name, pid, _ = row["worker"].rsplit(":", 2)
                self.bury(name, int(pid), "its worker was killed together with the service")

    def tidy(self) -> int:
        """Remove quick jobs whose answers have been kept long enough; give how many."""
        ended = ", ".join(f"'{state}'" for state in ENDED)
        rows = self.store.database.read(
            f"SELECT id FROM jobs WHERE NOT {IN_QUEUE} AND state IN ({ended}) AND ended < ? "
            "LIMIT 500",
            (time.time() - self.store.limits.answers,),
        )
        for row in rows:
            self.store.delete_job(row["id"])
        return len(rows)

    def _recover(self, write: sqlite3.Connection, row: sqlite3.Row) -> None:
        """Decide on a job whose worker was lost."""
        id, attempts = row["id"], row["attempts"]
        if row["cancelling"]:
            end(write, id, "cancelled", attempts)
        elif attempts >= self.store.limits.attempts:
            last = (from_json(row["problem"]) or {}).get("detail", "its worker was not heard of")
            problem = {
                "slug": "internal",
                "detail": f"the job was begun {attempts} times and its worker was lost each time; "
                f"the last time {last}",
            }
            end(write, id, "failed", attempts, problem=problem)
        else:
            write.execute(
                "UPDATE jobs SET state = 'queued', lease = NULL, worker = NULL WHERE id = ?", (id,)
            )
            add_event(write, id, "state", state_data("queued", attempts))
