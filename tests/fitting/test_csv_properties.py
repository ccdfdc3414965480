"""Random tables against a strict reference: nothing wrong accepted, no value wrong.

Every CSV parser tried accepts some cells that it must not, or shifts columns; that goes
unnoticed into a fit. The reference below is slow and plain: split the bytes, match each cell
against a grammar, and refuse the file at the first cell that does not.
"""

from __future__ import annotations

import gzip
import math
import random
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from lobefit.fitting.readers import read_measurement
from lobefit.fitting.readers.cells import BlockParser
from lobefit.kernels.errors import MeasurementError

CASES = 8_000
ANGLES = ("theta_i", "phi_i", "theta_o", "phi_o")
NUMBER = re.compile(r"[+-]?(\d+(\.\d*)?|\.\d+)([eE][+-]?\d+)?", re.ASCII)

# Numbers in unusual dress, which must be read right.
ODD_NUMBERS = (
    "1e-2", "1E+1", "+.5", "5.", "007", " 7", "7 ", "0.25e0", "1e-400", "3.0000000000000001",
    "0.1000000000000000055511151231257827", "123456789012345678901234567890e-29", "\t2",
)  # fmt: skip
MISSING = ("", "  ", "nan", "NaN", "NAN", "-nan", "+nan")
WEIRD = (
    "inf", "-inf", "Infinity", "1e999", "-1e999", "9" * 400, "1_000", "1_0.5", "0x10", "0x1p3",
    "0b1", "1e", "1e+", "e5", "E", ".", "-", "+", "--1", "+-1", "1.2.3", "1 2", "1\t2", "- 1",
    "1e5.5", "1e1_0", "1d5", "1.5D+2", "1.2abc", "abc", "nana", "na", "an", "nan1", "1nan",
    "NA", "N/A", "null", "None", "True", "#1", "1#", "'1'", '"1"', '"1', "1j", "1%", "$1",
    "1,5", "1;5", "1,000.5", "1.000,5", "٣", "１", "1\u00a0", "\u20091", "−1", "\ufeff1", "½",
    "1\x00", "1\x0b", "1\x0c", "1\r", "\r1", "1\x1a", "\\N", "=1+1", "(1)", "1..2", "nan(1)",
)  # fmt: skip


@dataclass
class Reference:
    """What a file means: rows of numbers, or the first line that is wrong."""

    rows: list[list[float]]
    bad_line: int | None = None


def reference(text: bytes, separator: str, columns: int) -> Reference:
    """Read the lines after the header row, strictly."""
    rows: list[list[float]] = []
    marks: set[str] = set()
    spaces = " " if separator == "\t" else " \t"
    for number, line in enumerate(text.decode().removesuffix("\n").split("\n"), start=2):
        cells = [cell.strip(spaces) for cell in line.removesuffix("\r").split(separator)]
        if not any(cells):
            continue
        if len(cells) != columns:
            return Reference([], number)
        row = []
        for k, cell in enumerate(cells):
            plain = cell.replace(",", ".") if separator != "," else cell
            if cell.lower() in ("nan", "+nan", "-nan") or (not cell and k >= len(ANGLES)):
                row.append(math.nan)
            elif NUMBER.fullmatch(plain) and math.isfinite(float(plain)):
                marks |= set(cell) & set(".,")
                row.append(float(plain))
            else:
                return Reference([], number)
        if len(marks) > 1:
            return Reference([], number)
        rows.append(row)
    return Reference(rows)


def random_table(rng: random.Random, separator: str, channels: int) -> list[list[str]]:
    """Distinct directions and positive values, as text."""
    rows = []
    for k in range(rng.randint(8, 12)):
        value = [f"{rng.uniform(0.01, 3):.{rng.randint(1, 9)}g}" for _ in range(channels)]
        rows.append([f"{10 + k}.5", str(rng.randint(0, 359)), f"{rng.randint(1, 89)}", "180"])
        rows[-1] += value
    if separator != "," and rng.random() < 0.6:
        rows = [[cell.replace(".", ",") for cell in row] for row in rows]
    return rows


def mutated(rng: random.Random, rows: list[list[str]], separator: str, first: int) -> bytes:
    """Change some cells from column `first` on, or whole lines; write."""
    for _ in range(rng.choice((0, 1, 1, 1, 2, 3))):
        row = rng.choice(rows)
        pool = rng.choice((ODD_NUMBERS, MISSING, WEIRD, WEIRD))
        if len(row) > first:
            row[rng.randrange(first, len(row))] = rng.choice(pool)
    lines = [separator.join(row) for row in rows]
    for _ in range(rng.choice((0, 0, 0, 1, 2))):
        at = rng.randrange(len(lines))
        change = rng.randrange(9)
        if change == 0:
            lines[at] += separator
        elif change == 1:
            lines[at] = separator + lines[at]
        elif change == 2:
            lines[at] = lines[at].rsplit(separator, 1)[0]
        elif change == 3:
            lines.insert(at, rng.choice(("", "  ", separator * 2, "# comment", "\t")))
        elif change == 4:
            lines[at] = lines[at].replace(separator, rng.choice(",;\t |"), 1)
        elif change == 5:
            lines[at] = lines[at] + rng.choice(("\r", "\x00", " ", "\ufeff"))
        elif change == 6:  # a cell moves from one row to the next: the total stays right
            other = lines[at - 1].split(separator)
            lines[at - 1] = separator.join(other[:-1])
            lines[at] = separator.join([other[-1], lines[at]])
        elif change == 7:
            lines[at] = lines[at].replace(separator, "\n", 1)
        else:
            lines[at] = f'"{lines[at]}"'
    end = rng.choice(("\n", "\n", "\r\n"))
    return (end.join(lines) + rng.choice((end, end, "", end * 2))).encode()


def test_the_block_parser_reads_what_the_reference_reads() -> None:
    """Cells of all columns changed; accepted exactly where the reference accepts."""
    rng = random.Random(20240611)
    accepted = refused = 0
    for case in range(CASES):
        separator = rng.choice((",", ",", ",", ";", "\t"))
        channels = rng.randint(1, 3)
        names = (*ANGLES, *(f"c{k}" for k in range(channels)))
        text = mutated(rng, random_table(rng, separator, channels), separator, 0)
        truth = reference(text, separator, len(names))
        block = text if text.endswith(b"\n") else text + b"\n"
        found = BlockParser(names, (0, 1, 2, 3), separator.encode()).parse(block, 2)
        if truth.bad_line is not None:
            refused += 1
            assert found.defects, (case, text)
            assert all(d.problem and d.expected for d in found.defects), (case, text)
            if separator == ",":  # elsewhere the first decimal mark may be the wrong one
                assert found.defects[0].line == truth.bad_line, (case, text)
        else:
            accepted += 1
            assert not found.defects, (case, text, found.defects)
            # To the last bit, nan included: both convert text to the nearest double.
            assert np.array_equal(found.cells, truth.rows, equal_nan=True), (case, text)
    assert min(accepted, refused) > CASES // 5


def test_a_file_is_read_right_or_refused_with_a_cause(tmp_path: Path) -> None:
    """The whole reader; cells of the channels changed, so that no rule but 'missing' applies."""
    rng = random.Random(7)
    path = tmp_path / "case.csv"
    accepted = refused = 0
    for case in range(CASES):
        separator = rng.choice((",", ",", ",", ";", "\t"))
        channels = rng.randint(1, 3)
        names = (*ANGLES, *(f"c{k}" for k in range(channels)))
        text = mutated(rng, random_table(rng, separator, channels), separator, len(ANGLES))
        truth = reference(text, separator, len(names))
        path.write_bytes(separator.join(names).encode() + b"\n" + text)
        try:
            measurement = read_measurement(path)
        except MeasurementError as error:
            refused += 1
            assert truth.bad_line is not None, (case, text, error)
            assert error.message and error.row is not None, (case, text)
            if separator == "," and b"\0" not in text:  # NUL is found before any row is read
                assert error.row == truth.bad_line, (case, text, error)
            continue
        accepted += 1
        assert truth.bad_line is None, (case, text)
        rows = np.array(truth.rows)
        rows = rows[~np.isnan(rows[:, 4:]).all(axis=1)]
        assert np.array_equal(measurement.values.T, rows[:, 4:], equal_nan=True), (case, text)
        angles = np.stack([getattr(measurement, name) for name in ANGLES], axis=1)
        # One rounding in the conversion to radians.
        np.testing.assert_allclose(angles, np.deg2rad(rows[:, :4]), rtol=1e-15, atol=0)
        missing = int(np.isnan(np.array(truth.rows)).any(axis=1).sum())
        assert (missing > 0) == any("missing" in note for note in measurement.notes), (case, text)
    assert min(accepted, refused) > CASES // 5


@pytest.mark.parametrize("seed", range(20))
def test_damaged_bytes_never_escape_as_another_error(tmp_path: Path, seed: int) -> None:
    """Flip, cut and double bytes of a plain and a gzip file: a measurement or our error."""
    rng = random.Random(seed)
    rows = [f"{10 + k % 60},{k % 7},{k % 80}.25,180,0.{k + 1},0.02" for k in range(40)]
    plain = ("# note: ü\ntheta_i,phi_i,theta_o,phi_o,R,sigma_R\n" + "\n".join(rows)).encode()
    packed = gzip.compress(plain, mtime=0)
    path = tmp_path / "case.csv"
    errors = 0
    for _ in range(60):
        data = bytearray(rng.choice((plain, packed)))
        for _ in range(rng.randint(1, 4)):
            at = rng.randrange(len(data))
            if rng.random() < 0.5:
                data[at] = rng.randrange(256)
            elif rng.random() < 0.5:
                del data[at : at + rng.randint(1, 30)]
            else:
                data[at:at] = data[at : at + rng.randint(1, 30)]
        path.write_bytes(data)
        try:
            read_measurement(path)
        except MeasurementError as error:
            errors += 1
            assert error.message
    assert errors
