"""Tables of a batch, read back from CSV."""

from __future__ import annotations

import csv
import io
from typing import Any

from lobefit.service.client.errors import ServiceError

__all__ = ["read_table"]


def read_table(name: str, text: str) -> list[dict[str, Any]]:
    """Read what `lobefit.fitting.batch_table` wrote.

    Parameters
    ----------
    name : {"table.csv", "parameters.csv"}
    text : str
        Its content. Columns that this version does not know are left as text.

    Returns
    -------
    list of dict
        By column; None where there is no value.

    Raises
    ------
    ServiceError
        It is no such table.
    """
    from lobefit.fitting.batch_table import ITEM_COLUMNS, PARAMETER_COLUMNS  # needs no numpy

    kinds = ITEM_COLUMNS if name == "table.csv" else PARAMETER_COLUMNS
    try:
        return [
            {column: _value(cell, kinds.get(column, str)) for column, cell in row.items()}
            for row in csv.DictReader(io.StringIO(text, newline=""), strict=True)
        ]
    except (KeyError, TypeError, ValueError, csv.Error) as error:
        raise ServiceError(f"the service's {name} is not understood: {error}") from error


def _value(cell: str, kind: type) -> Any:
    if cell == "":
        return None
    if kind is bool:
        return {"yes": True, "no": False}[cell]
    # A text that a spreadsheet would take for a formula was written behind a quote.
    return kind(cell[1:] if cell[0] == "'" and cell[1:2] in set("=+-@") else cell)
