"""From blocks of text to numbers: a fast path that is sure, and a strict one that explains.

Every CSV parser accepts something it must not: ``1_000``, Arabic digits, a short row, a
decimal comma that shifts the columns. So the bytes of a block are checked before
`numpy.loadtxt` sees them: only bytes that numbers are made of, and every line with exactly
the right separators. A block that fails is read again cell by cell against a grammar, and the
cells that break it are reported.
"""

from __future__ import annotations

import io
import math
import re
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

__all__ = ["MAX_DEFECTS", "BlockParser", "Defect", "Rows"]

MAX_DEFECTS = 20
"""After so many defects the rest of a file is not looked at."""

_NUMBER = re.compile(rb"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?")
_MISSING = re.compile(rb"[+-]?nan", re.IGNORECASE)
_LETTERS = b"0123456789+-.eEnNaA,\n "


@dataclass(frozen=True, slots=True)
class Defect:
    """A cell or row that cannot be read.

    Parameters
    ----------
    line : int
        Number of the line.
    column : str or None
        Name of the column; None where the whole row is wrong.
    text : str
        What stands there.
    problem, expected : str
        What is wrong, and what should stand there.
    """

    line: int
    column: str | None
    text: str
    problem: str
    expected: str


@dataclass(slots=True)
class Rows:
    """What a block held.

    Parameters
    ----------
    cells : array, shape [rows, columns]
        Numbers as written; NaN where missing.
    lines : array, shape [rows]
        Line number of each row.
    blank : list of int
        Lines that hold nothing.
    defects : list of Defect
        What could not be read; the block must not be used if there is any.
    """

    cells: NDArray[np.float64]
    lines: NDArray[np.uint32]
    blank: list[int] = field(default_factory=list)
    defects: list[Defect] = field(default_factory=list)


class BlockParser:
    """Reads the blocks of one file.

    Parameters
    ----------
    names : tuple of str
        Column names.
    required : tuple of int
        Columns in which a cell must not be empty.
    separator : bytes
        Comma, semicolon or tab. With the last two the decimal mark may be a comma; the first
        mark met decides for the whole file.
    """

    def __init__(self, names: tuple[str, ...], required: tuple[int, ...], separator: bytes) -> None:
        self._names = names
        self._required = required
        self._separator = separator
        self._decimal: bytes | None = b"." if separator == b"," else None
        self._space = b" " if separator == b"\t" else b" \t"

    def parse(self, block: bytes, line: int) -> Rows:
        r"""Read one block.

        Parameters
        ----------
        block : bytes
            Whole lines, the last ended by ``\n``.
        line : int
            Number of the first.

        Returns
        -------
        Rows
            Its numbers, or its defects.
        """
        if b"\r" in block:
            block = block.replace(b"\r\n", b"\n")
        canonical = self._canonical(block)
        cells = None if canonical is None else self._fast(canonical)
        if cells is None:
            return self._strict(block, line)
        return Rows(cells, np.arange(line, line + len(cells), dtype=np.uint32))

    def _canonical(self, block: bytes) -> bytes | None:
        """Rewrite with comma separators and decimal points; None where that is ambiguous."""
        if self._separator == b",":
            return block
        comma, point = b"," in block, b"." in block
        if comma and point:
            return None
        if self._decimal is None and (comma or point):
            self._decimal = b"," if comma else b"."
        if (comma and self._decimal == b".") or (point and self._decimal == b","):
            return None
        return block.translate(bytes.maketrans(b"," + self._separator, b".,"))

    def _fast(self, block: bytes) -> NDArray[np.float64] | None:
        """Read a block without blemish; None sends it to the strict path."""
        if block.translate(None, _LETTERS + b"\t" if b"\t" in self._space else _LETTERS):
            return None
        letters = np.frombuffer(block, dtype=np.uint8)
        ends = np.flatnonzero((letters == 10) | (letters == 44))
        columns = len(self._names)
        if ends.size % columns:
            return None
        newline = (letters[ends] == 10).reshape(-1, columns)
        if newline[:, :-1].any() or not newline[:, -1].all():
            return None
        empty = np.diff(ends, prepend=-1) == 1
        if empty.any():
            rows = empty.reshape(-1, columns)
            if rows[:, self._required].any() or rows.all(axis=1).any():
                return None
            block = _filled(block)
        try:
            cells = np.loadtxt(io.StringIO(block.decode()), delimiter=",", comments=None, ndmin=2)
        except ValueError:
            return None
        if cells.shape != newline.shape or np.isinf(cells).any():
            return None
        return cells

    def _strict(self, block: bytes, line: int) -> Rows:
        """Read cell by cell against the grammar."""
        found = Rows(np.empty((0, len(self._names))), np.empty(0, dtype=np.uint32))
        cells: list[list[float]] = []
        lines: list[int] = []
        for number, raw in enumerate(block.split(b"\n")[:-1], start=line):
            parts = [part.strip(self._space) for part in raw.split(self._separator)]
            if not any(parts):
                found.blank.append(number)
            elif len(parts) != len(self._names):
                found.defects.append(self._ragged(raw, parts, number))
            else:
                row = [self._cell(part, k, number, found.defects) for k, part in enumerate(parts)]
                cells.append(row)
                lines.append(number)
            if len(found.defects) >= MAX_DEFECTS:
                del found.defects[MAX_DEFECTS:]
                break
        if cells:
            found.cells = np.array(cells)
            found.lines = np.array(lines, dtype=np.uint32)
        return found

    def _cell(self, text: bytes, k: int, line: int, defects: list[Defect]) -> float:
        if not text:
            if k in self._required:
                defects.append(
                    Defect(line, self._names[k], "", "the cell is empty", "an angle in every row")
                )
            return math.nan
        if _MISSING.fullmatch(text):
            return math.nan
        number = text
        if self._separator != b",":
            for mark in text:
                if self._decimal is None and mark in b",.":
                    self._decimal = bytes([mark])
            if self._decimal == b"," and b"." not in text:
                number = text.replace(b",", b".")
        if (self._decimal != b"," or b"." not in text) and _NUMBER.fullmatch(number):
            value = float(number)
            if math.isfinite(value):
                return value
            problem, expected = f"{_show(text)} is too large for a number", "a finite number"
        else:
            problem, expected = _diagnose(text, self._decimal or b".", self._separator)
            if _decode(text) == self._names[k]:
                problem, expected = "the header row a second time", "one table per file"
        defects.append(Defect(line, self._names[k], _decode(text), problem, expected))
        return math.nan

    def _ragged(self, raw: bytes, parts: list[bytes], line: int) -> Defect:
        count, wanted = len(parts), len(self._names)
        problem = f"the row has {count} cell{'s' * (count != 1)}, the header row {wanted}"
        names = {b",": "commas", b";": "semicolons", b"\t": "tabs"}
        other = [mark for mark in names if mark != self._separator and mark in raw]
        if raw.lstrip().startswith(b"#"):
            problem = "a comment after the header row"
            expected = "metadata lines before the header row only"
        elif b"\0" in raw:
            problem, expected = "a NUL byte: the file is damaged or binary", "text"
        elif b"\r" in raw:
            problem, expected = "a lone carriage return within the line", "line ends LF or CRLF"
        elif count == wanted + 1 and not parts[-1]:
            problem, expected = f"{problem}: it ends in a separator", f"{wanted} cells"
        elif count > wanted and self._separator == b",":
            expected = f"{wanted} cells; numbers with decimal commas need semicolons between cells"
        elif count < wanted and other and (self._separator == b"," or count == 1):
            problem = f"{problem}: it has {names[other[0]]}"
            expected = f"{names[self._separator]} between cells, as in the header row"
        else:
            expected = f"{wanted} cells"
        return Defect(line, None, _decode(raw), problem, expected)


def _filled(block: bytes) -> bytes:
    """Write nan into empty cells."""
    block = b"\n" + block
    for _ in range(2):  # neighbours overlap
        block = block.replace(b",,", b",nan,")
    return block.replace(b",\n", b",nan\n").replace(b"\n,", b"\nnan,")[1:]


def _decode(text: bytes) -> str:
    shown = text.decode("utf-8", "backslashreplace")
    return shown if len(shown) <= 80 else shown[:77] + "..."


def _show(text: bytes) -> str:
    return repr(_decode(text)[:40])


def _diagnose(text: bytes, decimal: bytes, separator: bytes) -> tuple[str, str]:
    """Say why a cell is no number, and what to write."""
    shown, word = _show(text), text.lower().lstrip(b"+-")
    plain = "a number such as 0.0125 or 1.25e-2"
    if word in (b"inf", b"infinity", b"1.#inf"):
        return f"{shown} is not a finite number", "a finite number, or nan where it is missing"
    if word in (b"na", b"n/a", b"null", b"none", b"-", b"--", b"1.#qnan", b"missing"):
        return f"{shown} is not a number", "nan or an empty cell where a reading is missing"
    for mark, problem, expected in (
        (b"\0", "contains a NUL byte", "text; the file is damaged or binary"),
        (b"\r", "contains a lone carriage return", "line ends LF or CRLF"),
        (b'"', "is in quotes", "numbers without quotes"),
        (b"'", "is in quotes", "numbers without quotes"),
    ):
        if mark in text:
            return f"{shown} {problem}", expected
    if re.fullmatch(rb"[+-]?[0-9]+(_[0-9]+)+.*", text):
        return f"{shown} groups digits by underscores", "digits only, e.g. 1000"
    if word.startswith(b"0x"):
        return f"{shown} is hexadecimal", plain
    if b"," in text and b"." in text:
        return f"{shown} groups digits or mixes decimal marks", "digits only, e.g. 1234.5"
    if separator != b"," and (b"," in text or b"." in text):
        used = {b",": "comma", b".": "point"}
        if text.count(b",") + text.count(b".") > 1:
            return f"{shown} groups digits", "digits only, e.g. 1234.5"
        if (b"," if decimal == b"." else b".") in text:
            return (
                f"{shown} has a decimal {used[b',' if decimal == b'.' else b'.']}",
                f"a decimal {used[decimal]}, as earlier in the file",
            )
    if separator == b"," and b";" in text:
        return f"{shown} contains a semicolon", "commas between cells, as in the header row"
    if re.fullmatch(rb"[+-]?[0-9.]+[dD][+-]?[0-9]+", text):
        return f"{shown} has Fortran's exponent", "e instead of d, e.g. 1.25e-2"
    if any(letter.isdigit() and not letter.isascii() for letter in text.decode("utf-8", "ignore")):
        return f"{shown} is not written in the digits 0 to 9", plain
    return f"{shown} is not a number", plain
