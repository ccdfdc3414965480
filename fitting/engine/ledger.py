"""The ledger: which units are done, in SQLite. What it does not say done is done again."""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple, Self

from lobefit.fitting.engine.errors import EngineError
from lobefit.fitting.engine.ranges import Range, without

__all__ = ["Ledger", "Row"]

SCHEMA = "lobefit.ledger/1"
TABLES = """
CREATE TABLE IF NOT EXISTS about (name TEXT PRIMARY KEY, value TEXT NOT NULL);
CREATE TABLE IF NOT EXISTS chunks (
    first INTEGER PRIMARY KEY,
    stop INTEGER NOT NULL CHECK (stop > first),
    state TEXT NOT NULL CHECK (state IN ('done', 'failed')),
    seconds REAL NOT NULL,
    worker TEXT NOT NULL,
    reason TEXT NOT NULL,
    record TEXT NOT NULL
);
CREATE TABLE IF NOT EXISTS items (
    unit INTEGER PRIMARY KEY,
    name TEXT NOT NULL UNIQUE,
    key TEXT NOT NULL
);
"""


class Row(NamedTuple):
    """Units that are settled.

    Attributes
    ----------
    first, stop : int
        Which.
    record : Any
        JSON-ready values to keep with them.
    reason : str
        Why they failed; empty where they did not.
    seconds, worker
        How long they took, and whom.
    """

    first: int
    stop: int
    record: Any = None
    reason: str = ""
    seconds: float = 0.0
    worker: str = ""


class Ledger:
    """A file that says which units are done, for one driver at a time.

    Every change is a transaction that is on the disk when the call returns; a driver that is
    killed at any moment leaves a ledger that can be read.

    Parameters
    ----------
    path : Path
        Made with its folder if it does not exist.
    about : mapping of str to str, optional
        What the units are; a ledger that says otherwise is refused.

    Raises
    ------
    EngineError
        It cannot be opened, belongs to other work, or another driver has it.
    """

    def __init__(self, path: Path, about: Mapping[str, str] | None = None) -> None:
        self.path = path
        with self._telling():
            path.parent.mkdir(parents=True, exist_ok=True)
            # Transactions are begun by hand. One driver at a time: the lock is kept.
            self._db = sqlite3.connect(path, isolation_level=None, timeout=1.0)
        try:
            with self._telling():
                self._db.execute("PRAGMA locking_mode = EXCLUSIVE")
                self._db.execute("PRAGMA synchronous = FULL")
                with self._transaction():
                    for statement in filter(str.strip, TABLES.split(";")):
                        self._db.execute(statement)
                    self._agree({"schema": SCHEMA, **(about or {})})
        except BaseException:
            self._db.close()
            raise

    def __enter__(self) -> Self:
        """Give itself."""
        return self

    def __exit__(self, *error: object) -> None:
        """Close the file."""
        self._db.close()

    @contextmanager
    def _telling(self) -> Iterator[None]:
        try:
            yield
        except (sqlite3.Error, OSError) as error:
            if "locked" in str(error):
                raise EngineError(
                    f"another run is writing to {self.path.parent}; wait for it, or stop it"
                ) from error
            raise EngineError(f"cannot use the ledger {self.path}: {error}") from error

    @contextmanager
    def _transaction(self) -> Iterator[None]:
        self._db.execute("BEGIN IMMEDIATE")
        try:
            yield
        except BaseException:
            self._db.execute("ROLLBACK")
            raise
        self._db.execute("COMMIT")

    def _agree(self, about: Mapping[str, str]) -> None:
        stored = dict(self._db.execute("SELECT name, value FROM about"))
        for name, value in about.items():
            if stored.setdefault(name, value) != value:
                # A digest says nothing to a reader.
                other = (
                    "its input or settings were others"
                    if name == "key"
                    else f"{name}: {stored[name]}, now {value}"
                )
                raise EngineError(
                    f"{self.path.parent} holds other work ({other}); choose another folder, or "
                    "remove this one"
                )
            self._db.execute("INSERT OR IGNORE INTO about VALUES (?, ?)", (name, value))

    def settle(self, rows: Iterable[Row]) -> int:
        """Mark units as done or failed, all rows or none.

        Parameters
        ----------
        rows : iterable of Row
            What is settled; where it overlaps with what is settled already it is left out.

        Returns
        -------
        int
            Units that were not settled before.
        """
        new = 0
        with self._telling(), self._transaction():
            for r in rows:
                overlap = self._db.execute(
                    "SELECT 1 FROM chunks WHERE first < ? AND stop > ?", (r.stop, r.first)
                ).fetchone()
                if overlap:
                    continue
                state = "failed" if r.reason else "done"
                self._db.execute(
                    "INSERT INTO chunks VALUES (?, ?, ?, ?, ?, ?, ?)",
                    (r.first, r.stop, state, r.seconds, r.worker, r.reason, json.dumps(r.record)),
                )
                new += r.stop - r.first
        return new

    def forget(self, units: Iterable[int]) -> None:
        """Take back what was settled of single units."""
        with self._telling(), self._transaction():
            self._db.executemany(
                "DELETE FROM chunks WHERE first = ? AND stop = first + 1", [(u,) for u in units]
            )

    def missing(self, wanted: Iterable[Range]) -> list[Range]:
        """Give the ranges that are not settled."""
        with self._telling():
            settled = self._db.execute("SELECT first, stop FROM chunks ORDER BY first").fetchall()
        return without(wanted, settled)

    def rows(self, state: str | None = None) -> list[Row]:
        """Give what is settled, in order: "done", "failed" or all."""
        with self._telling():
            found = self._db.execute(
                "SELECT first, stop, record, reason FROM chunks WHERE ?1 IS NULL OR state = ?1 "
                "ORDER BY first",
                (state,),
            ).fetchall()
        return [Row(first, stop, json.loads(record), why) for first, stop, record, why in found]

    def seconds(self) -> float:
        """Give the time that workers took for what is done."""
        with self._telling():
            total: float | None = self._db.execute("SELECT sum(seconds) FROM chunks").fetchone()[0]
        return total or 0.0

    def chunk_count(self) -> int:
        """Count the rows."""
        with self._telling():
            count: int = self._db.execute("SELECT count(*) FROM chunks").fetchone()[0]
        return count

    def number(self, items: Iterable[tuple[str, str]]) -> list[int]:
        """Give named items their numbers, which stay.

        Parameters
        ----------
        items : iterable of (str, str)
            (name, key): an item whose key is another than before is to be done again.
        """
        units = []
        with self._telling(), self._transaction():
            for name, key in items:
                found = self._db.execute(
                    "SELECT unit, key FROM items WHERE name = ?", (name,)
                ).fetchone()
                if found is None:
                    cursor = self._db.execute(
                        "INSERT INTO items (name, key) VALUES (?, ?)", (name, key)
                    )
                    unit = int(cursor.lastrowid or 0)
                elif found[1] != key:
                    unit = int(found[0])
                    self._db.execute("DELETE FROM chunks WHERE first = ?", (unit,))
                    self._db.execute("UPDATE items SET key = ? WHERE unit = ?", (key, unit))
                else:
                    unit = int(found[0])
                units.append(unit)
        return units
