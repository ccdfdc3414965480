"""The SQLite database of the data folder: its tables, its connections, its errors."""

from __future__ import annotations

import sqlite3
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from lobefit.service.rows import StoreError, StoreFull

__all__ = ["LAYOUTS", "Database", "boot_id", "monotonic", "store_error"]

# Seconds that a writer waits for another's transaction; each takes milliseconds.
BUSY = 20.0

FIRST = """
CREATE TABLE measurements (
    seq INTEGER PRIMARY KEY AUTOINCREMENT,
    id TEXT NOT NULL UNIQUE,          -- SHA-256 of the content
    name TEXT NOT NULL,
    bytes INTEGER NOT NULL,
    created REAL NOT NULL,            -- seconds since the epoch, as all times that people see
    summary TEXT NOT NULL
);
CREATE TABLE jobs (
    seq INTEGER PRIMARY KEY AUTOINCREMENT,
    id TEXT NOT NULL UNIQUE,
    kind TEXT NOT NULL,
    state TEXT NOT NULL CHECK (state IN ('queued', 'running', 'done', 'failed', 'cancelled')),
    request TEXT NOT NULL,
    measurement TEXT,
    owner TEXT NOT NULL,
    rank REAL NOT NULL,               -- lower ranks go first
    created REAL NOT NULL,
    started REAL,
    ended REAL,
    attempts INTEGER NOT NULL DEFAULT 0,
    fence INTEGER NOT NULL DEFAULT 0, -- grows with each claim; a write names the one it holds
    worker TEXT,
    boot TEXT,                        -- the lease counts in this boot only
    lease REAL,                       -- CLOCK_MONOTONIC at which it ends
    cancelling INTEGER NOT NULL DEFAULT 0,
    progress TEXT,
    problem TEXT,
    result TEXT
);
CREATE INDEX jobs_waiting ON jobs (kind, rank, seq) WHERE state = 'queued';
CREATE INDEX jobs_running ON jobs (kind, lease) WHERE state = 'running';
CREATE INDEX jobs_listed ON jobs (kind, seq);
CREATE INDEX jobs_measurement ON jobs (measurement) WHERE measurement IS NOT NULL;
CREATE TABLE keys (
    owner TEXT NOT NULL,
    key TEXT NOT NULL,
    job TEXT NOT NULL REFERENCES jobs (id) ON DELETE CASCADE,
    digest TEXT NOT NULL,             -- of the request
    PRIMARY KEY (owner, key)
) WITHOUT ROWID;
CREATE INDEX keys_job ON keys (job);
CREATE TABLE events (
    seq INTEGER PRIMARY KEY AUTOINCREMENT,
    job TEXT NOT NULL REFERENCES jobs (id) ON DELETE CASCADE,
    type TEXT NOT NULL,
    data TEXT NOT NULL
);
CREATE INDEX events_job ON events (job, seq);
CREATE TABLE artefacts (
    job TEXT NOT NULL REFERENCES jobs (id) ON DELETE CASCADE,
    name TEXT NOT NULL,
    fence INTEGER NOT NULL,           -- of the attempt in whose folder it lies
    bytes INTEGER NOT NULL,
    sha256 TEXT NOT NULL,
    media_type TEXT NOT NULL,
    PRIMARY KEY (job, name)
) WITHOUT ROWID;
CREATE TABLE processes (
    name TEXT PRIMARY KEY,
    pid INTEGER NOT NULL,
    kinds TEXT NOT NULL,
    device TEXT NOT NULL,
    state TEXT NOT NULL,
    boot TEXT NOT NULL,
    beat REAL NOT NULL,               -- CLOCK_MONOTONIC
    rss INTEGER NOT NULL
) WITHOUT ROWID;
CREATE TABLE probe (id INTEGER PRIMARY KEY CHECK (id = 1), at REAL NOT NULL);
"""
BATCHES = """
CREATE TABLE batches (
    seq INTEGER PRIMARY KEY AUTOINCREMENT,
    id TEXT NOT NULL UNIQUE,
    name TEXT,
    owner TEXT NOT NULL,
    created REAL NOT NULL,
    cancelled INTEGER NOT NULL DEFAULT 0
);
ALTER TABLE jobs ADD COLUMN batch TEXT REFERENCES batches (id) ON DELETE CASCADE;
CREATE INDEX jobs_batch ON jobs (batch, state, started, ended) WHERE batch IS NOT NULL;
DROP INDEX keys_job;
ALTER TABLE keys RENAME TO keys_of_jobs;
CREATE TABLE keys (
    owner TEXT NOT NULL,
    key TEXT NOT NULL,
    made TEXT NOT NULL,               -- the job or the batch
    digest TEXT NOT NULL,             -- of the request
    PRIMARY KEY (owner, key)
) WITHOUT ROWID;
INSERT INTO keys SELECT owner, key, job, digest FROM keys_of_jobs;
DROP TABLE keys_of_jobs;
CREATE INDEX keys_made ON keys (made);
"""
LAYOUTS = (FIRST, BATCHES)
"""What makes each layout of the one before; a database says how many of them it has behind it."""


def monotonic() -> float:
    """Give CLOCK_MONOTONIC in seconds, the same in all processes of one boot."""
    return time.clock_gettime(time.CLOCK_MONOTONIC)


def boot_id() -> str:
    """Name the boot in which CLOCK_MONOTONIC counts."""
    try:
        return Path("/proc/sys/kernel/random/boot_id").read_text(encoding="ascii").strip()
    except OSError as error:
        raise StoreError(f"the service needs Linux with /proc: {error}") from error


def store_error(error: OSError | sqlite3.Error, what: str) -> StoreError:
    """Turn an error of the system or of SQLite into ours."""
    code = getattr(error, "sqlite_errorcode", None)
    if isinstance(error, OSError):
        import errno

        full = error.errno in (errno.ENOSPC, errno.EDQUOT)
        reason = error.strerror or str(error)
    else:
        full = code == sqlite3.SQLITE_FULL
        reason = str(error)
    if full:
        return StoreFull(f"{what}: no space is left in the data folder; free some")
    return StoreError(f"{what}: {reason}")


class Database:
    """A connection to read and one to write, each for any thread.

    Parameters
    ----------
    path : Path
        The file; made, with its tables, where it does not exist, and brought to the layout of
        today where it has an earlier one.
    durable : bool
        True: a committed write outlives a power cut. False (for heartbeats, which are
        worth nothing afterwards): it outlives the process, and no order is lost.

    Raises
    ------
    StoreFull
        No space to make it.
    StoreError
        The file cannot be opened, or is of another version.
    """

    def __init__(self, path: Path, *, durable: bool = True) -> None:
        self.path = path
        self._locks = (threading.RLock(), threading.RLock())
        self._reader: sqlite3.Connection | None = None
        self._writer: sqlite3.Connection | None = None
        try:
            self._writer = _connect(path, "FULL" if durable else "NORMAL")
            self._prepare(self._writer)
            self._reader = _connect(path, "NORMAL")
            self._reader.execute("PRAGMA query_only = ON")
        except sqlite3.Error as error:
            self.close()
            raise store_error(error, f"cannot open {path}") from error

    def _prepare(self, writer: sqlite3.Connection) -> None:
        (found,) = writer.execute("PRAGMA user_version").fetchone()
        if found < len(LAYOUTS):
            writer.execute("BEGIN EXCLUSIVE")
            try:
                # Another process may have been quicker.
                (found,) = writer.execute("PRAGMA user_version").fetchone()
                for layout in LAYOUTS[found:]:
                    for statement in filter(str.strip, layout.split(";\n")):
                        writer.execute(statement)
                found = max(found, len(LAYOUTS))
                writer.execute(f"PRAGMA user_version = {found}")
                writer.execute("COMMIT")
            except BaseException:
                _rollback(writer)
                raise
        if found != len(LAYOUTS):
            raise StoreError(
                f"{self.path} has the layout {found}; this version of Lobefit reads "
                f"{len(LAYOUTS)}: give another --data-dir"
            )

    @contextmanager
    def write(self) -> Iterator[sqlite3.Connection]:
        """Open a transaction that no other writer can come between; committed at the end.

        Raises
        ------
        StoreFull, StoreError
            Nothing was written.
        """
        with self._locks[1]:
            writer = self._open(self._writer)
            try:
                writer.execute("BEGIN IMMEDIATE")
                yield writer
                writer.execute("COMMIT")
            except sqlite3.Error as error:
                _rollback(writer)
                raise store_error(error, "cannot write to the store") from error
            except BaseException:
                _rollback(writer)
                raise

    def read(self, query: str, values: Sequence[Any] = ()) -> list[sqlite3.Row]:
        """Give all rows of a query, as of the last commit."""
        with self._locks[0]:
            try:
                return self._open(self._reader).execute(query, values).fetchall()
            except sqlite3.Error as error:
                raise store_error(error, "cannot read the store") from error

    def one(self, query: str, values: Sequence[Any] = ()) -> sqlite3.Row | None:
        """Give the first row of a query, or None."""
        rows = self.read(query, values)
        return rows[0] if rows else None

    def close(self) -> None:
        """Close both connections; later calls raise `StoreError`."""
        for lock, name in zip(self._locks, ("_reader", "_writer"), strict=True):
            with lock:
                connection = getattr(self, name)
                setattr(self, name, None)
                if connection is not None:
                    with suppress(sqlite3.Error):  # nothing is open then either
                        connection.close()

    def _open(self, connection: sqlite3.Connection | None) -> sqlite3.Connection:
        if connection is None:
            raise StoreError("the store is closed")
        return connection


def _connect(path: Path, synchronous: str) -> sqlite3.Connection:
    made = sqlite3.connect(path, timeout=BUSY, isolation_level=None, check_same_thread=False)
    made.row_factory = sqlite3.Row
    made.execute("PRAGMA journal_mode = WAL")
    made.execute(f"PRAGMA synchronous = {synchronous}")
    made.execute("PRAGMA foreign_keys = ON")
    made.execute(f"PRAGMA journal_size_limit = {4 << 20}")
    with suppress(OSError):
        path.chmod(0o600)
    return made


def _rollback(connection: sqlite3.Connection) -> None:
    # SQLite has rolled back by itself after some errors.
    with suppress(sqlite3.Error):
        if connection.in_transaction:
            connection.execute("ROLLBACK")
