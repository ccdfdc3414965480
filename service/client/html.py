"""HTML for notebooks; every text is escaped."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape

__all__ = ["facts", "heading", "paragraph", "table"]


def heading(text: object) -> str:
    """Set the first line apart."""
    return f"<p><b>{escape(str(text))}</b></p>"


def paragraph(text: object) -> str:
    """Give a text."""
    return f"<p>{escape(str(text))}</p>" if text else ""


def table(head: Sequence[object], rows: Iterable[Sequence[object]]) -> str:
    """Give a table with a row of headings."""
    cells = "".join(f"<th>{escape(str(name))}</th>" for name in head)
    return f"<table><thead><tr>{cells}</tr></thead><tbody>{_rows(rows)}</tbody></table>"


def facts(pairs: Iterable[tuple[str, object]]) -> str:
    """Give names with their values; None is left out."""
    return f"<table><tbody>{_rows(p for p in pairs if p[1] is not None)}</tbody></table>"


def _rows(rows: Iterable[Sequence[object]]) -> str:
    return "".join(
        "<tr>" + "".join(f"<td>{escape(str(entry))}</td>" for entry in row) + "</tr>"
        for row in rows
    )
