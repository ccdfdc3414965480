"""Between the tables' rows and the store's records: JSON, cursors, rows."""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Sequence
from typing import Any

from lobefit.service.rows import JobRow, MeasurementRow, StoreError

__all__ = [
    "add_event",
    "cursor_after",
    "first",
    "from_json",
    "job_row",
    "measurement_row",
    "seq_before",
    "to_text",
]


def to_text(value: Any) -> str:
    """Write JSON for a column; raises `StoreError` for what JSON has not."""
    try:
        return json.dumps(value, allow_nan=False, separators=(",", ":"))
    except ValueError as error:
        raise StoreError(f"not a value that JSON has: {error}") from error


def from_json(text: str | None) -> Any:
    """Read a column that may be empty."""
    return None if text is None else json.loads(text)


def first(write: sqlite3.Connection, query: str, values: Sequence[Any]) -> sqlite3.Row | None:
    """Give the first row of a query within a transaction, or None."""
    row: sqlite3.Row | None = write.execute(query, values).fetchone()
    return row


def seq_before(cursor: str | None) -> int:
    """Read a cursor; one that is none of ours begins at the top."""
    return (
        int(cursor)
        if cursor and cursor.isascii() and cursor.isdigit() and len(cursor) < 19
        else 2**62
    )


def cursor_after(rows: Sequence[sqlite3.Row], limit: int) -> str | None:
    """Give the cursor of the page after these rows, one more than were wanted, or None."""
    return str(rows[limit - 1]["seq"]) if len(rows) > limit else None


def add_event(write: sqlite3.Connection, job: str, type: str, data: dict[str, Any]) -> None:
    """Note what happened to a job, in the transaction in which it happens."""
    write.execute(
        "INSERT INTO events (job, type, data) VALUES (?, ?, ?)", (job, type, to_text(data))
    )


def job_row(row: sqlite3.Row) -> JobRow:
    """Make a record of a row of the table."""
    return JobRow(
        id=row["id"],
        kind=row["kind"],
        request=json.loads(row["request"]),
        state=row["state"],
        created=row["created"],
        started=row["started"],
        ended=row["ended"],
        attempts=row["attempts"],
        progress=from_json(row["progress"]),
        # Of a job that will be tried again it tells how the last worker was lost.
        problem=from_json(row["problem"]) if row["state"] == "failed" else None,
        result=from_json(row["result"]),
        measurement=row["measurement"],
        owner=row["owner"],
        cancelling=bool(row["cancelling"]) and row["state"] == "running",
        batch=row["batch"],
    )


def measurement_row(row: sqlite3.Row) -> MeasurementRow:
    """Make a record of a row of the table."""
    return MeasurementRow(
        id=row["id"],
        name=row["name"],
        bytes=row["bytes"],
        created=row["created"],
        summary=json.loads(row["summary"]),
    )
