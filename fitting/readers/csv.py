"""Reading a Lobefit CSV, plain or gzip.

Metadata lines ``# key: value``, a header row with ``theta_i``, ``phi_i``, ``theta_o``, ``phi_o``
and one column per channel, optionally ``sigma_<channel>``; then rows of numbers. Separators are
commas, semicolons (then the decimal mark may be a comma) or tabs; cells that hold nothing or
``nan`` are missing values. `lobefit.fitting.readers.rules` states what happens to the rows.
"""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lobefit.fitting.measurement import DIRECTION_COLUMNS, Measurement
from lobefit.fitting.readers.cells import MAX_DEFECTS, BlockParser, Defect
from lobefit.fitting.readers.columns import Columns
from lobefit.fitting.readers.header import read_header
from lobefit.fitting.readers.rules import apply_rules
from lobefit.fitting.readers.source import line_blocks, open_text
from lobefit.fitting.readers.table import Table, count_of, lines_of
from lobefit.kernels.errors import MeasurementError

__all__ = ["MAX_CELLS", "read_measurement"]

MAX_CELLS = 2**27
"""Largest table read, 1 GiB in memory; a gzip file unpacks to more than its size tells."""


def read_measurement(path: str | os.PathLike[str]) -> Measurement:
    """Read a measurement from a CSV file.

    Parameters
    ----------
    path : path-like
        A ``.csv`` or ``.csv.gz``; which of them is told by content.

    Returns
    -------
    Measurement
        Directions in radians, BRDF in 1/sr. `dropped` and `notes` tell of every row that is
        not used as it stands in the file.

    Raises
    ------
    MeasurementError
        If the file cannot be read or understood; file, row, column, text and expectation are
        attributes. Of several bad cells the first is described and the others are located.
    """
    file = Path(path)
    name = file.name or str(file)
    with open_text(file) as stream:
        header = read_header(stream, name)
        columns = header.columns
        parser = BlockParser(columns.names, columns.angles, header.separator)
        store = _Store(columns, name)
        defects: list[Defect] = []
        for line, block in line_blocks(stream, header.line + 1, name):
            rows = parser.parse(block, line)
            defects += rows.defects
            if len(defects) >= MAX_DEFECTS:
                break
            if not defects:
                store.add(rows.cells, rows.lines)
                store.blank += rows.blank
    if defects:
        raise _defect_error(defects, name)
    if not store.size:
        raise MeasurementError(
            "there are no rows below the header row",
            file=name,
            row=header.line,
            expected="one row of numbers per direction",
        )
    rows_read = store.size
    table = store.table()
    apply_rules(table, header)
    values, sigma = _stacked(table.values), _stacked(table.sigmas)
    if values is None:
        raise AssertionError("the header row has a channel")
    return Measurement(
        **{angle: np.deg2rad(table.angles.pop(angle)) for angle in DIRECTION_COLUMNS},
        values=values,
        channels=tuple(columns.names[k] for k in columns.channels),
        sigma=sigma,
        metadata=header.metadata,
        dropped=tuple(table.dropped),
        notes=tuple(table.notes),
        source=name,
        rows_read=rows_read,
    )


class _Store:
    """Columns that grow in place: `resize` of one-dimensional memory needs no second copy."""

    def __init__(self, columns: Columns, name: str) -> None:
        self._columns = columns
        self._name = name
        self._data = [np.empty(0) for _ in columns.names]
        self._lines = np.empty(0, dtype=np.uint32)
        self.size = 0
        self.blank: list[int] = []

    def add(self, cells: NDArray[np.float64], lines: NDArray[np.uint32]) -> None:
        size = self.size + len(lines)
        if size * len(self._data) > MAX_CELLS:
            raise MeasurementError(
                f"the table has more than {MAX_CELLS} cells",
                file=self._name,
                row=int(lines[-1]),
                expected="a smaller file: thin the measurement out, or split it",
            )
        if size > len(self._lines):
            self._resize(max(size, len(self._lines) * 3 // 2))
        for k, column in enumerate(self._data):
            column[self.size : size] = cells[:, k]
        self._lines[self.size : size] = lines
        self.size = size

    def _resize(self, capacity: int) -> None:
        self._lines.resize(capacity, refcheck=False)
        for column in self._data:
            column.resize(capacity, refcheck=False)

    def table(self) -> Table:
        """Hand the columns over."""
        self._resize(self.size)
        data, names, columns = self._data, self._columns.names, self._columns
        channels = [names[k] for k in columns.channels]
        table = Table(
            name=self._name,
            angles=dict(zip(DIRECTION_COLUMNS, (data[k] for k in columns.angles), strict=True)),
            values=dict(zip(channels, (data[k] for k in columns.channels), strict=True)),
            sigmas=dict(zip(channels, (data[k] for k in columns.sigmas), strict=False)),
            lines=self._lines,
        )
        if self.blank:
            table.notes.append(f"blank lines skipped: {lines_of(self.blank)}")
        self._data = []
        return table


def _stacked(columns: dict[str, NDArray[np.float64]]) -> NDArray[np.float64] | None:
    """Put channels into one array [C, N], freeing each on the way."""
    if not columns:
        return None
    names = list(columns)
    stacked = np.empty((len(names), len(columns[names[0]])))
    for k, name in enumerate(names):
        stacked[k] = columns.pop(name)
    return stacked


def _defect_error(defects: list[Defect], name: str) -> MeasurementError:
    first, others = defects[0], len(defects) - 1
    more = ""
    if others:
        least = "at least " if len(defects) == MAX_DEFECTS else ""
        where = lines_of(sorted({defect.line for defect in defects[1:]}))
        more = f"; {least}{count_of(others, 'more defect')}, {where}"
    return MeasurementError(
        first.problem + more,
        file=name,
        row=first.line,
        column=first.column,
        text=first.text,
        expected=first.expected,
    )
