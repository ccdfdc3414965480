"""Runs of hours: processes that keep to a core each, and rows kept as they come."""

from __future__ import annotations

import json
import multiprocessing
import os
from collections.abc import Iterable, Mapping
from concurrent.futures import ProcessPoolExecutor
from contextlib import suppress
from pathlib import Path
from typing import Any

__all__ = ["KeptRows", "single_core_processes"]

Row = dict[str, Any]


def single_core_processes(count: int) -> ProcessPoolExecutor:
    """Give processes that fit, each on one core; the runtime of OpenCL survives no fork."""
    os.environ.setdefault("POCL_MAX_PTHREAD_COUNT", "1")
    return ProcessPoolExecutor(count, multiprocessing.get_context("spawn"))


class KeptRows:
    """A file of rows that a run can go on from if it is ended.

    Parameters
    ----------
    path : Path
        One row a line, as JSON.
    settings : mapping
        What the run was asked for; rows of other settings are dropped.
    resume : bool
        Whether to go on from what is there.

    Attributes
    ----------
    before : list of dict
        The rows of earlier runs.
    """

    def __init__(self, path: Path, settings: Mapping[str, Any], *, resume: bool) -> None:
        self._path, self._settings = path, dict(settings)
        self.before = self._read() if resume and path.exists() else []
        self._write("w", self.before)

    def _read(self) -> list[Row]:
        rows = []
        for text in self._path.read_text(encoding="utf-8").splitlines():
            with suppress(json.JSONDecodeError):  # the last line may be torn
                row = json.loads(text)
                if {key: row.pop(key, None) for key in self._settings} == self._settings:
                    rows.append(row)
        return rows

    def _write(self, mode: str, rows: Iterable[Row]) -> None:
        with self._path.open(mode, encoding="utf-8") as file:
            file.writelines(json.dumps({**row, **self._settings}) + "\n" for row in rows)

    def add(self, row: Row) -> None:
        """Keep one more."""
        self._write("a", [row])

    def finish(self, others: Iterable[Row] = ()) -> None:
        """Keep only rows that are still to be used, if there are any."""
        self._write("w", others)
        if not self._path.stat().st_size:
            self._path.unlink()
