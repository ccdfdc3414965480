"""The table of a batch: a row per item, and a row per parameter; CSV, and Parquet if it can be."""

from __future__ import annotations

import csv
from collections.abc import Callable, Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any

__all__ = ["ITEM_COLUMNS", "PARAMETER_COLUMNS", "REPORT", "item_row", "table_makers"]

REPORT = "report.json"
"""The file of an item that its row is made of."""

ITEM_COLUMNS: Mapping[str, type] = {
    "name": str,
    "file": str,
    "status": str,
    "model": str,
    "described": bool,
    "typical_error": float,
    "log10_rms": float,
    "rmse": float,
    "reduced_chi_square": float,
    "misfit": str,
    "metric": str,
    "directions": int,
    "incidences": int,
    "channels": int,
    "candidates": int,
    "not_fitted": int,
    "seconds": float,
    "verdict": str,
    "reason": str,
}
"""Columns of ``table.csv``; rmse in 1/sr, log10_rms in decades, typical_error relative, all of the
best model."""
PARAMETER_COLUMNS: Mapping[str, type] = {
    "name": str,
    "model": str,
    "parameter": str,
    "channel": str,
    "value": float,
    "standard_error": float,
    "status": str,
    "unit": str,
}
"""Columns of ``parameters.csv``: the best model's."""

_OF_ESTIMATE = ("channel", "value", "standard_error", "status", "unit")

Rows = Sequence[Mapping[str, Any]]


def item_row(report: Mapping[str, Any]) -> dict[str, Any]:
    """Give what the table says of an item that was fitted.

    Parameters
    ----------
    report : mapping
        The document of report.json.

    Returns
    -------
    dict
        Its columns of the table but for name, file, status and reason, and "parameters", a list
        of dicts.
    """
    best, measured = report["results"][0], report["measurement"]
    diagnostics = best["diagnostics"]
    return {
        "model": best["candidate"],
        "described": report["described"],
        "typical_error": _typical_error(diagnostics["decades"]),
        "log10_rms": diagnostics["log10_rms"],
        "rmse": best["rmse"],
        "reduced_chi_square": diagnostics["reduced_chi_square"],
        "misfit": diagnostics["misfit_reason"],
        "metric": report["metric"],
        "directions": measured["rows"]["used"],
        "incidences": measured["incidences"],
        "channels": len(measured["channels"]),
        "candidates": len(report["results"]),
        "not_fitted": len(report["failed"]),
        "seconds": report["seconds"],
        "verdict": report["verdict"],
        "parameters": [
            {"parameter": e["name"], **{key: e[key] for key in _OF_ESTIMATE}}
            for e in best["estimates"]
        ],
    }


def _typical_error(decades: Sequence[Mapping[str, Any]]) -> float | None:
    """Give the relative error (rms) of readings of the median's decade.

    Of all readings it would be the error of the darkest ones, which may be noise alone.
    """
    left = sum(d["count"] for d in decades) / 2.0
    for d in decades:
        left -= d["count"]
        if left <= 0.0:
            return float(d["rms_relative"])
    return None


def table_makers(rows: Rows) -> dict[str, Callable[[Path], object]]:
    """Give what writes each file, by name, for `lobefit.fitting.artefacts.write_together`.

    Parameters
    ----------
    rows : sequence of mapping
        Of items, with "parameters".
    """
    parameters = [
        {"name": row["name"], "model": row["model"], **entry}
        for row in rows
        for entry in row.get("parameters") or ()
    ]
    tables = {"table": (ITEM_COLUMNS, rows), "parameters": (PARAMETER_COLUMNS, parameters)}
    makers: dict[str, Callable[[Path], object]] = {}
    for name, (columns, table) in tables.items():
        makers[f"{name}.csv"] = _writer(_write_csv, columns, table)
        if find_spec("pyarrow"):
            makers[f"{name}.parquet"] = _writer(_write_parquet, columns, table)
    return makers


def _writer(
    write: Callable[[Path, Mapping[str, type], Rows], None], columns: Mapping[str, type], rows: Rows
) -> Callable[[Path], None]:
    return lambda path: write(path, columns, rows)


def _write_csv(path: Path, columns: Mapping[str, type], rows: Rows) -> None:
    with path.open("w", encoding="utf-8", newline="") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(columns)
        writer.writerows([_cell(row.get(name)) for name in columns] for row in rows)


def _cell(value: Any) -> str:
    if value is None:
        return ""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return repr(value)
    text = str(value)
    # A spreadsheet would run a text that begins so as a formula.
    return f"'{text}" if isinstance(value, str) and text.startswith(("=", "+", "-", "@")) else text


def _write_parquet(path: Path, columns: Mapping[str, type], rows: Rows) -> None:
    import pyarrow
    from pyarrow import parquet

    kinds = {
        str: pyarrow.string(),
        bool: pyarrow.bool_(),
        int: pyarrow.int64(),
        float: pyarrow.float64(),
    }
    schema = pyarrow.schema([(name, kinds[kind]) for name, kind in columns.items()])
    listed = [{name: row.get(name) for name in columns} for row in rows]
    parquet.write_table(pyarrow.Table.from_pylist(listed, schema=schema), path)
