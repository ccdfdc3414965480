"""What is kept: the data folder with its measurements."""

from __future__ import annotations

import time
from collections.abc import Collection
from pathlib import Path
from typing import Any

from lobefit.service.codec import cursor_after, first, measurement_row, seq_before, to_text
from lobefit.service.database import Database
from lobefit.service.files import Files, Upload
from lobefit.service.rows import MEBIBYTE, InUse, Limits, MeasurementRow, NotFound, StoreFull

__all__ = ["Shelf"]


class Shelf:
    """The data folder and the measurements in it; see `lobefit.service.store.Store`."""

    def __init__(self, data_dir: Path, limits: Limits = Limits()) -> None:  # noqa: B008
        self.limits = limits
        self.files = Files(Path(data_dir))
        self.database = Database(self.files.root / "store.sqlite")

    def close(self) -> None:
        """Close the database."""
        self.database.close()

    def room(self) -> None:
        """Raise `StoreFull` where only the reserve is left."""
        free, total = self.files.free()
        reserve = self.limits.reserve
        if reserve is None:
            reserve = max(2 * MEBIBYTE, min(64 * MEBIBYTE, total // 50))
        if free < reserve:
            raise StoreFull(
                f"only {free >> 20} MiB are free in the data folder, which running fits need; "
                "delete fits and measurements, or free some space"
            )

    def upload(self) -> Upload:
        """Begin to take in a file; use it in a ``with``.

        Raises
        ------
        StoreFull
            The disk is full but for the reserve.
        """
        self.room()
        return Upload(self.files.tmp)

    def adopt(
        self, upload: Upload, name: str, summary: dict[str, Any]
    ) -> tuple[MeasurementRow, bool]:
        """Keep a finished upload under the digest of its content.

        Parameters
        ----------
        upload : Upload
            Finished.
        name : str
            What people call it.
        summary : dict
            What was understood of it, JSON-ready.

        Returns
        -------
        MeasurementRow
        bool
            False where the same content was there already; its name and summary stay.
        """
        digest = upload.sha256
        with self.database.write() as write:
            found = first(write, "SELECT * FROM measurements WHERE id = ?", (digest,))
            if found is None:
                # Within the transaction, so that nobody deletes this content meanwhile.
                self.files.place(upload.path, digest)
                write.execute(
                    "INSERT INTO measurements (id, name, bytes, created, summary) "
                    "VALUES (?, ?, ?, ?, ?)",
                    (digest, name, upload.bytes, time.time(), to_text(summary)),
                )
        return self.measurement(digest), found is None

    def measurement(self, id: str) -> MeasurementRow:
        """Give a measurement, or raise `NotFound`."""
        row = self.database.one("SELECT * FROM measurements WHERE id = ?", (id,))
        if row is None:
            raise NotFound("there is no such measurement")
        return measurement_row(row)

    def missing(self, ids: Collection[str]) -> set[str]:
        """Say which of many measurements there are not."""
        rows = self.database.read(
            "SELECT value FROM json_each(?) WHERE value NOT IN (SELECT id FROM measurements)",
            (to_text(sorted(ids)),),
        )
        return {row["value"] for row in rows}

    def measurements(
        self, limit: int, cursor: str | None = None
    ) -> tuple[list[MeasurementRow], str | None]:
        """List measurements, the newest first, with the cursor of the next page or None."""
        rows = self.database.read(
            "SELECT * FROM measurements WHERE seq < ? ORDER BY seq DESC LIMIT ?",
            (seq_before(cursor), limit + 1),
        )
        return [measurement_row(row) for row in rows[:limit]], cursor_after(rows, limit)

    def delete_measurement(self, id: str) -> None:
        """Delete a measurement; fits of it keep the samples they used.

        Raises
        ------
        NotFound
        InUse
            A job of it waits or runs.
        """
        with self.database.write() as write:
            if write.execute(
                "SELECT 1 FROM jobs WHERE measurement = ? AND state IN ('queued', 'running')", (id,)
            ).fetchone():
                raise InUse("a fit or a chart of this measurement waits or runs; cancel it first")
            if not write.execute("DELETE FROM measurements WHERE id = ?", (id,)).rowcount:
                raise NotFound("there is no such measurement")
        with self.database.write() as write:
            # Unless the same content was uploaded again in between.
            if first(write, "SELECT 1 FROM measurements WHERE id = ?", (id,)) is None:
                self.files.remove_measurement(id)

    def data_path(self, id: str) -> Path:
        """Say where the content of a measurement lies, or raise `NotFound`."""
        return self.files.measurement(self.measurement(id).id)
