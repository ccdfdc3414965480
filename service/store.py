"""The store: measurements, jobs, their events and files, in one folder.

The database is the truth; a file without a row is an orphan and swept at the next start, a row
without a file does not come about, since files are brought to the disk first.
Importable without numpy: the web process reads and writes this, workers do the work
(`lobefit.service.jobs`).
"""

from __future__ import annotations

import time
from pathlib import Path

from lobefit.service.batches import Batches
from lobefit.service.codec import to_text
from lobefit.service.database import boot_id, monotonic
from lobefit.service.rows import ENDED, ArtefactRow, JobRow, NotFound, ProcessRow

__all__ = ["Store"]


class Store(Batches):
    """The data folder.

    Parameters
    ----------
    data_dir : Path
        Made, readable for its owner only, where it does not exist. On a local disk.
    limits : Limits, optional
        How much it takes.

    Raises
    ------
    StoreFull
        No space is left.
    StoreError
        The folder or the database in it cannot be used.
    """

    def artefacts(self, id: str) -> list[ArtefactRow]:
        """List the files of a job by name."""
        rows = self.database.read(
            "SELECT name, bytes, sha256, media_type FROM artefacts WHERE job = ? ORDER BY name",
            (id,),
        )
        return [ArtefactRow(**dict(r)) for r in rows]

    def artefact_path(self, id: str, name: str) -> Path:
        """Say where a file of a job lies, or raise `NotFound`."""
        row = self.database.one(
            "SELECT fence FROM artefacts WHERE job = ? AND name = ?", (id, name)
        )
        if row is None:
            raise NotFound("there is no such artefact")
        return self.files.artefact(id, row["fence"], name)

    def answer(self, job: JobRow) -> tuple[bytes, str]:
        """Give the whole answer of a quick job that is done, and its media type.

        Small answers are in the row, large and binary ones in a file.
        """
        result = job.result or {}
        if "file" in result:
            try:
                return self.artefact_path(job.id, result["file"]).read_bytes(), result["media_type"]
            except FileNotFoundError as error:
                raise NotFound("the answer is kept no longer; ask again") from error
        return to_text(result).encode(), "application/json"

    def processes(self) -> list[ProcessRow]:
        """List the worker processes that were last heard of."""
        boot, now = boot_id(), monotonic()
        return [
            ProcessRow(
                name=r["name"],
                pid=r["pid"],
                kinds=tuple(r["kinds"].split(",")),
                device=r["device"],
                state=r["state"],
                age=max(0.0, now - r["beat"]) if r["boot"] == boot else None,
                rss=r["rss"],
            )
            for r in self.database.read("SELECT * FROM processes ORDER BY name")
        ]

    def free_bytes(self) -> int:
        """Give the free space of the disk in bytes."""
        return self.files.free()[0]

    def check(self) -> None:
        """Write something; raises `StoreFull` or `StoreError`."""
        self.room()
        with self.database.write() as write:
            write.execute("INSERT OR REPLACE INTO probe VALUES (1, ?)", (time.time(),))

    def sweep(self) -> int:
        """Remove files that belong to nothing; only before anything else uses the folder.

        Returns
        -------
        int
            How many measurements, uploads and folders of jobs were removed.
        """
        rows = self.database.read("SELECT id FROM measurements")
        jobs = self.database.read("SELECT id, state FROM jobs")
        for row in jobs:
            if row["state"] in ENDED:
                self.prune(row["id"])
        return self.files.sweep({r["id"] for r in rows}, {r["id"] for r in jobs})

    def prune(self, id: str, fence: int | None = None) -> None:
        """Remove files of a job's attempts, or of one of them, that are no artefacts."""
        rows = self.database.read("SELECT fence, name FROM artefacts WHERE job = ?", (id,))
        self.files.prune(id, {(r["fence"], r["name"]) for r in rows}, fence)
