"""Many measurements: one report each, a table, a picture; resumable, on any number of processes."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lobefit.fitting.artefacts import write_together
from lobefit.fitting.batch_figure import write_batch_figure
from lobefit.fitting.batch_inputs import Input, Item, items_of
from lobefit.fitting.batch_item import Fitted, OpenBatch
from lobefit.fitting.batch_table import REPORT, table_makers
from lobefit.fitting.engine import Ledger, Progress, Row, Work, open_crew, run
from lobefit.kernels.errors import LobefitError

__all__ = ["Batch", "fit_many"]

LEDGER = "batch.sqlite"
# Seconds of a chunk: fits of a second go one by one, quick ones together.
CHUNK_SECONDS, MOST_ITEMS = 1.0, 64


@dataclass(frozen=True, slots=True)
class Batch:
    """What came of many measurements.

    Attributes
    ----------
    folder : Path
        With ``NAME/report.json`` and its companions for each item, ``table.csv``,
        ``parameters.csv`` (both ``.parquet`` too where pyarrow is installed) and
        ``summary.png``.
    rows : tuple of dict
        The table, an entry for each item in the order of the inputs.
    """

    folder: Path
    rows: tuple[dict[str, Any], ...]

    @property
    def failed(self) -> dict[str, str]:
        """Items without a report, by name, and why."""
        return {row["name"]: row["reason"] for row in self.rows if row["reason"]}

    def report(self, name: str) -> Path:
        """Give the path of an item's report."""
        return self.folder / name / REPORT

    def __len__(self) -> int:
        """Count the items."""
        return len(self.rows)


def fit_many(
    inputs: Input | Iterable[Input],
    out: str | os.PathLike[str],
    models: str | Iterable[str] = "standard",
    *,
    metric: str = "auto",
    options: Mapping[str, str] | None = None,
    tolerance: float | None = None,
    student: bool = False,
    max_theta: float | None = None,
    jobs: int | None = None,
    scheduler: str | None = None,
    pool: str = "loky",
    retry: bool = False,
    device: str | None = None,
    patience: float = 120.0,
    progress: Progress | None = None,
) -> Batch:
    """Fit every measurement as `lobefit.fitting.fit` would, and write one report for each.

    What is done is noted in ``out/batch.sqlite`` by the digest of file and settings. The same call
    after any interruption does the rest; items whose file or settings changed are fitted
    again. Reports do not depend on how many processes there are, nor on which.

    Parameters
    ----------
    inputs : path-like, mapping, or an iterable of them
        Files, patterns, manifests; see `lobefit.fitting.batch_inputs.items_of`.
    out : path-like
        Folder, made if it does not exist.
    models, metric, options, tolerance, student
        As for `lobefit.fitting.fit`; a manifest may say otherwise item by item.
    max_theta : float, optional
        Rows with theta_i or theta_o above this are left out, in degrees.
    jobs : int, optional
        Processes on this machine; as many as cores where left out.
    scheduler : str, optional
        Address of a Dask scheduler, as ``tcp://host:8786``: its workers are taken instead,
        and are sent the files' bytes.
    pool : {"loky", "processes"}
        Which local pool.
    retry : bool
        Whether items that failed before are tried again.
    device : str, optional
        Of every worker; see `lobefit.kernels.get_device`.
    patience : float
        Seconds to wait for workers when there is none.
    progress : callable, optional
        Called with a `lobefit.fitting.engine.Status`.

    Returns
    -------
    Batch
        Items that failed are listed in it; they raise nothing.

    Raises
    ------
    MeasurementError, ModelError, FitError
        Inputs or settings that cannot be, before anything is fitted.
    LobefitError
        No workers (`lobefit.fitting.engine.EngineError`), or a folder that cannot be written to.

    Examples
    --------
    >>> from lobefit.fitting import fit_many
    >>> batch = fit_many("scans/*.csv", "fitted")  # doctest: +SKIP
    >>> batch.failed  # doctest: +SKIP
    {}
    """
    named = models if isinstance(models, str) else ",".join(models)
    defaults = Item(
        models=named,
        metric=metric,
        options=tuple(sorted((options or {}).items())),
        tolerance=tolerance,
        student=student,
        max_theta=max_theta,
    )
    items = items_of(inputs, defaults)
    folder = Path(out)
    if folder.exists() and not folder.is_dir():
        raise LobefitError(f"{folder} is a file; name a folder")
    with Ledger(folder / LEDGER, {"kind": "batch"}) as ledger:
        units = ledger.number((item.name, item.key) for item in items)
        by_unit = dict(zip(units, items, strict=True))
        _forget(ledger, by_unit, folder, retry)
        wanted = tuple((unit, unit + 1) for unit in sorted(units))
        if ledger.missing(wanted):
            crew = open_crew(jobs, scheduler, pool)
            work = _work(by_unit, wanted, folder, device, send=not crew.shares_disk)
            run(work, ledger, crew, progress=progress, patience=patience)
        settled = {row.first: row for row in ledger.rows()}
    rows = tuple(_table_row(item, settled[unit]) for unit, item in by_unit.items())
    write_together(
        folder,
        {**table_makers(rows), "summary.png": lambda path: write_batch_figure(path, rows)},
    )
    return Batch(folder, rows)


def _forget(ledger: Ledger, items: Mapping[int, Item], folder: Path, retry: bool) -> None:
    """Take back what is marked but not there, and failures that are to be tried again."""
    again = []
    for row in ledger.rows():
        item = items.get(row.first)
        if item is None:
            continue
        if (retry and row.reason) or (
            not row.reason and not (folder / item.name / REPORT).is_file()
        ):
            again.append(row.first)
    ledger.forget(again)


def _work(
    items: Mapping[int, Item],
    wanted: tuple[tuple[int, int], ...],
    folder: Path,
    device: str | None,
    *,
    send: bool,
) -> Work:
    def sent(first: int, stop: int) -> list[tuple[Item, bytes | None]]:
        return [(items[unit], _bytes(items[unit]) if send else None) for unit in range(first, stop)]

    def keep(first: int, stop: int, result: list[Fitted]) -> list[Row]:
        rows = []
        for unit, fitted in zip(range(first, stop), result, strict=True):
            if fitted.files:
                makers = {name: _writer(data) for name, data in fitted.files.items()}
                write_together(folder / items[unit].name, makers)
            rows.append(Row(unit, unit + 1, fitted.row, fitted.reason))
        return rows

    return Work(
        key=f"batch on {device}",
        opener=OpenBatch(device),
        keep=keep,
        wanted=wanted,
        sent=sent,
        name=lambda unit: items[unit].name,
        seconds=CHUNK_SECONDS,
        largest=MOST_ITEMS,
    )


def _bytes(item: Item) -> bytes | None:
    try:
        return Path(item.file).read_bytes()
    except OSError:
        return None  # the worker will not find it either, and says so


def _writer(data: bytes) -> Any:
    return lambda path: path.write_bytes(data)


def _table_row(item: Item, row: Row) -> dict[str, Any]:
    return {
        "name": item.name,
        "file": item.file,
        "status": "failed" if row.reason else "fitted",
        "model": None,
        **(row.record or {}),
        "reason": row.reason,
    }
