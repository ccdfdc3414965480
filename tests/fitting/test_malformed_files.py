"""Malformed files, each with what the user is told: place, problem, expectation."""

from __future__ import annotations

import gzip
from pathlib import Path

import pytest

from lobefit.fitting.readers import csv as csv_reader
from lobefit.fitting.readers import read_measurement, source
from lobefit.kernels.errors import MeasurementError

HEAD = "theta_i,phi_i,theta_o,phi_o,brdf"
ROWS = (
    "10,0,10,180,0.31",
    "10,0,20,180,0.28",
    "10,0,30,180,0.26",
    "45,0,10,180,0.25",
    "45,0,45,180,0.35",
    "45,0,60,180,0.24",
)


def table(*rows: str, head: str = HEAD, meta: str = "", end: str = "\n") -> bytes:
    """A file of the given rows."""
    return (meta + end.join([head, *rows]) + end).encode()


def cell(text: str) -> bytes:
    """Six rows with one cell replaced: the value in line 4."""
    return table(*ROWS[:2], f"10,0,30,180,{text}", *ROWS[3:])


def semicolons(*cells: str) -> bytes:
    """A semicolon file with decimal commas in which the values are replaced."""
    rows = [f"10;0;{10 * k};180;{text}" for k, text in enumerate(cells, start=1)]
    return table(*rows, head=HEAD.replace(",", ";"))


def sigmas(text: str) -> bytes:
    """Six rows with an uncertainty, the one in line 3 replaced."""
    rows = [f"{row},0.01" for row in ROWS]
    rows[1] = f"{ROWS[1]},{text}"
    return table(*rows, head=HEAD + ",sigma_brdf")


# (what, file, line, column, message after the place)
# fmt: off
FILES: list[tuple[str, bytes, int | None, str | None, str]] = [
    ("empty file", b"", None, None, "the file is empty (expected a header row and rows of numbers)"),
    ("only metadata", b"# material: steel\n", 1, None, "there is no header row (expected theta_i,phi_i,theta_o,phi_o and one column per channel)"),
    ("header only", table(), 1, None, "there are no rows below the header row (expected one row of numbers per direction)"),
    ("header only, blank lines", table("", "", ""), 1, None, "there are no rows below the header row (expected one row of numbers per direction)"),
    ("no header", table(*ROWS[1:], head=ROWS[0]), 1, None, "the header row is missing: the first row is numbers (expected theta_i,phi_i,theta_o,phi_o and one column per channel)"),
    ("misspelt column", table(*ROWS, head="thetai,phi_i,theta_o,phi_o,brdf"), 1, "theta_i", "the column is missing; 'thetai' looks like it: rename that column (expected theta_i,phi_i,theta_o,phi_o and one column per channel)"),
    ("reflected for outgoing", table(*ROWS, head="theta_i,phi_i,theta_r,phi_r,brdf"), 1, "theta_o", "the column is missing; 'theta_r' looks like it: rename that column (expected theta_i,phi_i,theta_o,phi_o and one column per channel)"),
    ("capital letters", table(*ROWS, head="Theta_i,phi_i,theta_o,phi_o,brdf"), 1, "theta_i", "the column is missing; 'Theta_i' looks like it: rename that column (expected theta_i,phi_i,theta_o,phi_o and one column per channel)"),
    ("missing column", table(*[row[3:] for row in ROWS], head="phi_i,theta_o,phi_o,brdf"), 1, "theta_i", "the column is missing (expected theta_i,phi_i,theta_o,phi_o and one column per channel)"),
    ("half-angle columns", table(*ROWS, head="theta_h,phi_h,theta_d,phi_d,brdf"), 1, "theta_i", "the column is missing (expected theta_i,phi_i,theta_o,phi_o and one column per channel)"),
    ("column twice", table(*[row + ",1" for row in ROWS], head=HEAD + ",brdf"), 1, "brdf", "the column stands twice, as columns 5 and 6 (expected every column once)"),
    ("direction twice", table(*[row + ",1" for row in ROWS], head=HEAD + ",phi_o"), 1, "phi_o", "the column stands twice, as columns 4 and 6 (expected every column once)"),
    ("sigma without channel", table(*[row + ",0.1" for row in ROWS], head=HEAD + ",sigma_bdrf"), 1, "sigma_bdrf", "there is no channel 'bdrf'; did you mean sigma_brdf? (expected sigma_<channel> beside a column of that channel)"),
    ("sigma for one channel of two", table(*[row + ",0.1,0.1" for row in ROWS], head=HEAD + ",R,sigma_R"), 1, "brdf", "the channel has no sigma_brdf, but others have an uncertainty (expected sigma_<channel> for every channel or for none)"),
    ("uncertainty under another name", table(*[row + ",0.1" for row in ROWS], head=HEAD + ",std_brdf"), 1, "std_brdf", "looks like the uncertainty of 'brdf' (expected sigma_brdf)"),
    ("no channel", table(*["10,0,20,180"] * 6, head="theta_i,phi_i,theta_o,phi_o"), 1, None, "there is no channel column, only directions (expected one column per channel after the directions, e.g. brdf or R,G,B)"),
    ("wavelength as a column", table(*[row + ",550" for row in ROWS], head=HEAD + ",wavelength"), 1, "wavelength", "not a channel: give every wavelength a column of its own, e.g. 400nm,410nm"),
    ("fifth angle", table(*[row + ",550" for row in ROWS], head=HEAD + ",theta_h"), 1, "theta_h", "an angle, but not one of the four (expected theta_i,phi_i,theta_o,phi_o and channels; remove other angles)"),
    ("header ends in a separator", table(*[row + "," for row in ROWS], head=HEAD + ","), 1, None, "column 6 has no name: the header row ends in a separator (expected a column name)"),
    ("name of a column missing", table(*[row + ",1" for row in ROWS], head="theta_i,phi_i,theta_o,phi_o,,brdf"), 1, None, "column 5 has no name (expected a column name)"),
    ("stray quote in the header", table(*ROWS, head=HEAD.replace("brdf", '"brdf')), 1, '"brdf', "column 5 is named '\"brdf' (expected a name without quotes, separators and control characters)"),
    ("header mixes separators", table(*ROWS, head=HEAD.replace(",", ";", 2)), 1, None, "the header row mixes commas and semicolons (expected one separator throughout: commas, semicolons or tabs)"),
    ("columns separated by spaces", table(*ROWS, head=HEAD.replace(",", " ")), 1, None, "the columns are separated by spaces (expected one separator throughout: commas, semicolons or tabs)"),
    ("one column", table("1", "2", head="brdf"), 1, None, "the header row has one column: 'brdf' (expected one separator throughout: commas, semicolons or tabs)"),
    ("short row", table(*ROWS[:3], "45,0,10,180", *ROWS[4:]), 5, None, "the row has 4 cells, the header row 5 (expected 5 cells)"),
    ("long row", table(*ROWS[:3], "45,0,10,180,0.25,0.1", *ROWS[4:]), 5, None, "the row has 6 cells, the header row 5 (expected 5 cells; numbers with decimal commas need semicolons between cells)"),
    ("short row, long row", table(ROWS[0], "10,0,20,180", "10,0,30,180,0.3,0.2", *ROWS[3:]), 3, None, "the row has 4 cells, the header row 5; 1 more defect, line 4 (expected 5 cells)"),
    ("row ends in a separator", table(*ROWS[:3], ROWS[3] + ",", *ROWS[4:]), 5, None, "the row has 6 cells, the header row 5: it ends in a separator (expected 5 cells)"),
    ("decimal commas between commas", table(*[row.replace("0.", "0,") for row in ROWS]), 2, None, "the row has 6 cells, the header row 5; 5 more defects, lines 3, 4, 5, 6, 7 (expected 5 cells; numbers with decimal commas need semicolons between cells)"),
    ("another separator in a row", table(*ROWS[:3], ROWS[3].replace(",", ";"), *ROWS[4:]), 5, None, "the row has 1 cell, the header row 5: it has semicolons (expected commas between cells, as in the header row)"),
    ("one semicolon", table(*ROWS[:3], "45,0,10;180,0.25", *ROWS[4:]), 5, None, "the row has 4 cells, the header row 5: it has semicolons (expected commas between cells, as in the header row)"),
    ("NUL in a cell", cell("0.2\0006"), 4, None, "NUL bytes: the file is binary or in UTF-16 (expected CSV as UTF-8 text)"),
    ("angle empty", table(*ROWS[:3], ",0,10,180,0.25", *ROWS[4:]), 5, "theta_i", "the cell is empty (expected an angle in every row)"),
    ("angle with a degree sign", table(*ROWS[:3], "45°,0,10,180,0.25", *ROWS[4:]), 5, "theta_i", "'45°' is not a number (expected a number such as 0.0125 or 1.25e-2)"),
    ("comment after the header", table(*ROWS[:3], "# second scan", *ROWS[3:]), 5, None, "a comment after the header row (expected metadata lines before the header row only)"),
    ("metadata after the header", table("# angle_unit: rad", *ROWS), 2, None, "a comment after the header row (expected metadata lines before the header row only)"),
    ("second header", table(*ROWS, HEAD, *ROWS), 8, "theta_i", "the header row a second time; 4 more defects, line 8 (expected one table per file)"),
    ("three bad cells", table("10,0,x,180,0.3", *ROWS[:2], "10,0,30,y,z", *ROWS[3:]), 2, "theta_o", "'x' is not a number; 2 more defects, line 5 (expected a number such as 0.0125 or 1.25e-2)"),
    ("every cell bad", table(*["a,b,c,d,e"] * 30), 2, "theta_i", "'a' is not a number; at least 19 more defects, lines 2, 3, 4, 5 (expected a number such as 0.0125 or 1.25e-2)"),
    ("thousands after decimal commas", semicolons("0,31", "1.234,5", "0,26", "0,25", "0,24"), 3, "brdf", "'1.234,5' groups digits or mixes decimal marks (expected digits only, e.g. 1234.5)"),
    ("thousands", semicolons("0,31", "1,234,567", "0,26", "0,25", "0,24"), 3, "brdf", "'1,234,567' groups digits (expected digits only, e.g. 1234.5)"),
    ("both decimal marks", semicolons("0,31", "0,28", "0.26", "0,25", "0,24"), 4, "brdf", "'0.26' has a decimal point (expected a decimal comma, as earlier in the file)"),
    ("decimal comma after points", semicolons("0.31", "0.28", "0,26", "0.25", "0.24"), 4, "brdf", "'0,26' has a decimal comma (expected a decimal point, as earlier in the file)"),
    ("lone carriage returns", table(*ROWS, end="\r"), 1, None, "lines end in a lone carriage return (old Mac) (expected line ends LF or CRLF)"),
    ("one lone carriage return", table(ROWS[0] + "\r" + ROWS[1], *ROWS[2:]), 2, None, "a lone carriage return within the line (expected line ends LF or CRLF)"),
    ("UTF-16", table(*ROWS).decode().encode("utf-16"), None, None, "the file is text in UTF-16, not CSV (expected the text saved as UTF-8)"),
    ("UTF-16 without mark", table(*ROWS).decode().encode("utf-16-le"), 1, None, "NUL bytes: the file is binary or in UTF-16 (expected CSV as UTF-8 text)"),
    ("Latin-1", table(*ROWS, meta="# material: Stahl\n# note: poliert, R\u00fcckseite\n").decode().encode("latin-1"), 2, None, "byte 0xfc is not UTF-8; the file seems to be in another encoding (expected text saved as UTF-8)"),
    ("Latin-1 in the header", table(*ROWS, head=HEAD.replace("brdf", "gr\u00fcn")).decode().encode("latin-1"), 1, None, "byte 0xfc is not UTF-8; the file seems to be in another encoding (expected text saved as UTF-8)"),
    ("Latin-1 in a cell", cell("0.26\u00b0").decode().encode("latin-1"), 4, "brdf", "'0.26\\\\xb0' is not a number (expected a number such as 0.0125 or 1.25e-2)"),
    ("NUL bytes in the head", b"theta_i,phi_i\0\0" + table(*ROWS), 1, None, "NUL bytes: the file is binary or in UTF-16 (expected CSV as UTF-8 text)"),
    ("NUL bytes in a row", table(*ROWS * 600) + b"\0" * 40 + b"\n", 3602, None, "a NUL byte: the file is damaged or binary (expected text)"),
    ("picture", b"\x89PNG\r\n\x1a\n" + bytes(range(1, 200)), None, None, "the file is a picture, not CSV (expected the table as CSV)"),
    ("workbook", b"PK\x03\x04" + bytes(200), None, None, "the file is a zip archive or an Excel workbook, not CSV (expected the sheet exported as CSV)"),
    ("bzip2", b"BZh91AY&SY" + bytes(200), None, None, "the file is compressed with bzip2, not CSV (expected the file unpacked, or compressed with gzip)"),
    ("JSON", b'{"theta_i": [10], "brdf": [0.3]}\n', 1, None, "the file looks like JSON, XML or HTML, not CSV (expected a header row: theta_i,phi_i,theta_o,phi_o and one column per channel)"),
    ("endless line", b"1" * (2**20 + 2**19), 1, None, "no header row within the first 1048576 bytes"),
    ("endless row", table(*ROWS) + b"1" * (2**21 + 5), 8, None, "the line is longer than 1048576 bytes (expected one row of a table per line, ended by LF or CRLF)"),
    ("truncated gzip", gzip.compress(table(*ROWS * 50), mtime=0)[:-20], None, None, "the gzip stream is damaged or cut short (Compressed file ended before the end-of-stream marker was reached) (expected a complete .csv.gz; copy the file again)"),
    ("damaged gzip", gzip.compress(table(*ROWS), mtime=0)[:-8] + b"\1\2\3\4\5\6\7\0", None, None, "the gzip stream is damaged or cut short (CRC check failed 0x4030201 != 0x6ee37413) (expected a complete .csv.gz; copy the file again)"),
    ("gzip of gzip", gzip.compress(gzip.compress(table(*ROWS), mtime=0), mtime=0), 1, None, "the control byte 0x08: the file is binary or in UTF-16 (expected CSV as UTF-8 text)"),
    ("empty gzip", gzip.compress(b"", mtime=0), None, None, "the file is empty (expected a header row and rows of numbers)"),
    ("unknown angle unit", table(*ROWS, meta="# angle_unit: gon\n"), 1, None, "unknown angle_unit 'gon' (expected deg or rad)"),
    ("misspelt key", table(*ROWS, meta="# material: steel\n# angel_unit: rad\n"), 2, None, "unknown key 'angel_unit'; did you mean 'angle_unit'? (expected # angle_unit: ...)"),
    ("unit under another key", table(*ROWS, meta="# units: radians\n"), 1, None, "unknown key 'units'; did you mean 'angle_unit'? (expected # angle_unit: ...)"),
    ("unit given twice", table(*ROWS, meta="# angle_unit: deg\n# angle_unit: rad\n"), 2, None, "angle_unit is given twice: 'deg' in line 1, then 'rad'"),
    ("unknown quantity", table(*ROWS, meta="# quantity: BTDF\n"), 1, None, "unknown quantity 'BTDF' (expected brdf [1/sr], cosine-weighted brdf or radiance factor)"),
    ("misspelt quantity", table(*ROWS, meta="# quantitiy: radiance factor\n"), 1, None, "unknown key 'quantitiy'; did you mean 'quantity'? (expected # quantity: ...)"),
    ("unknown assertion", table(*ROWS, meta="# small_angles: maybe\n"), 1, None, "unknown small_angles 'maybe' (expected yes or no)"),
    ("degrees declared as radians", table(*ROWS, meta="# angle_unit: rad\n"), 3, "theta_i", "10 is no angle in radians, as angle_unit declares; the file seems to be in degrees (6 such rows) (expected # angle_unit: deg, or angles in radians)"),
    ("azimuth in degrees, radians declared", table("0.2,180,0.3,0,0.3", "0.2,0,0.3,0,0.3", meta="# angle_unit: rad\n"), 3, "phi_i", "180 is no angle in radians, as angle_unit declares; the file seems to be in degrees (expected # angle_unit: deg, or angles in radians)"),
    ("radians, nothing declared", table(*[f"0.7854,0,{0.1 * k:.4f},3.1416,0.3" for k in range(1, 8)]), 2, "theta_i", "the angles look like radians but are read as degrees: the largest polar angle is 0.7854, the largest azimuth 3.1416 (expected # angle_unit: rad, or # small_angles: yes if these are degrees)"),
    ("radians declared as degrees", table(*[f"0.7854,0,{0.1 * k:.4f},3.1416,0.3" for k in range(1, 8)], meta="# angle_unit: deg\n"), 3, "theta_i", "the angles look like radians but are read as degrees: the largest polar angle is 0.7854, the largest azimuth 3.1416 (expected # angle_unit: rad, or # small_angles: yes if these are degrees)"),
    ("polar angle negative", table(*ROWS, "45,0,-10,180,0.2", "45,0,-20,180,0.1"), 8, "theta_o", "the polar angle -10 is negative (2 such rows) (expected the angle from the normal: write theta_o = |theta_o| and phi_o + 180)"),
    ("polar angle negative, radians", table("0.2,0,0.1,0,0.3", "0.2,0,-0.1,0,0.3", meta="# angle_unit: radians\n"), 4, "theta_o", "the polar angle -0.1 is negative (expected the angle from the normal: write theta_o = |theta_o| and phi_o + pi)"),
    ("polar angle beyond 180", table(*ROWS, "45,0,190,180,0.2"), 8, "theta_o", "190 is no angle in degrees (expected 0 to 90 degrees)"),
    ("azimuth beyond a turn", table(*ROWS, "45,0,20,540,0.2"), 8, "phi_o", "540 is no angle in degrees (expected -360 to 360 degrees)"),
    ("angle a fill value", table(*ROWS, "-999,0,20,180,0.2"), 8, "theta_i", "-999 is no angle in degrees (expected 0 to 90 degrees)"),
    ("uncertainty zero", sigmas("0"), 3, "sigma_brdf", "the uncertainty of a value is 0 (expected a positive number wherever the channel has a value)"),
    ("uncertainty negative", sigmas("-0.01"), 3, "sigma_brdf", "the uncertainty of a value is -0.01 (expected a positive number wherever the channel has a value)"),
    ("uncertainty missing", sigmas(""), 3, "sigma_brdf", "the uncertainty of a value is nan (expected a positive number wherever the channel has a value)"),
    ("uncertainty infinite", sigmas("inf"), 3, "sigma_brdf", "'inf' is not a finite number (expected a finite number, or nan where it is missing)"),
    ("channel of zeros", table(*[row + ",0" for row in ROWS], head=HEAD + ",G"), 2, "G", "the channel is zero in every row (expected a BRDF in 1/sr, positive somewhere; remove the column otherwise)"),
    ("channel without values", table(*[row + "," for row in ROWS], head=HEAD + ",G"), None, "G", "the channel has no value in any of 6 usable rows (expected a number in most rows; remove the column if it was not measured)"),
    ("channel of fill values", table(*[row + ",-999" for row in ROWS], head=HEAD + ",G"), None, "G", "the channel has no value in any of 6 usable rows (channel G: 6 cells with the fill value -999 taken as missing (lines 2, 3, 4, 5, 6 and 1 more)) (expected a number in most rows; remove the column if it was not measured)"),
    ("channel never positive", table(*[row + f",-0.{k}1" for k, row in enumerate(ROWS)], head=HEAD + ",G"), 2, "G", "the channel has no positive value (expected a BRDF in 1/sr, positive somewhere; remove the column otherwise)"),
    ("four directions", table(*ROWS[:4]), 2, None, "only 4 distinct directions (expected at least 5, and more than a model has parameters)"),
    ("four directions, the others below the horizon", table(*ROWS[:4], "10,0,95,180,0.1"), 2, None, "only 4 distinct directions (left out: 1 row at or below the horizon) (expected at least 5, and more than a model has parameters)"),
    ("one direction many times", table(*ROWS[:1] * 20), 2, None, "only 1 distinct direction (expected at least 5, and more than a model has parameters)"),
    ("pole only", table(*[f"0,0,0,{10 * k},0.3" for k in range(20)]), 2, None, "only 1 distinct direction (expected at least 5, and more than a model has parameters)"),
    ("all below the horizon", table(*["95,0,20,180,0.1", "10,0,90,180,0.2"] * 4), 2, None, "no row is left: 8 rows at or below the horizon"),
    ("all rows dropped", table("nan,0,20,180,0.1", "10,0,95,180,0.2", "10,0,20,180,nan", "10,0,30,180,0.2", "10,0,80,180,", head=HEAD).replace(b"180,0.2\n10,0,80", b"180,nan\n10,0,80"), None, "brdf", "the channel has no value in any of 3 usable rows (expected a number in most rows; remove the column if it was not measured)"),
]

# One cell replaced, the value in line 4: (text, message after the place)
CELLS = [
    ("1.2abc", "'1.2abc' is not a number (expected a number such as 0.0125 or 1.25e-2)"),
    ("bad", "'bad' is not a number (expected a number such as 0.0125 or 1.25e-2)"),
    ("inf", "'inf' is not a finite number (expected a finite number, or nan where it is missing)"),
    ("-Infinity", "'-Infinity' is not a finite number (expected a finite number, or nan where it is missing)"),
    ("1e999", "'1e999' is too large for a number (expected a finite number)"),
    ("1_000", "'1_000' groups digits by underscores (expected digits only, e.g. 1000)"),
    ("٠.٥", "'٠.٥' is not written in the digits 0 to 9 (expected a number such as 0.0125 or 1.25e-2)"),
    ("０.５", "'０.５' is not written in the digits 0 to 9 (expected a number such as 0.0125 or 1.25e-2)"),
    ("0x1p-2", "'0x1p-2' is hexadecimal (expected a number such as 0.0125 or 1.25e-2)"),
    ("2.6d-1", "'2.6d-1' has Fortran's exponent (expected e instead of d, e.g. 1.25e-2)"),
    ("\"0.26\"", "'\"0.26\"' is in quotes (expected numbers without quotes)"),
    ("NA", "'NA' is not a number (expected nan or an empty cell where a reading is missing)"),
    ("null", "'null' is not a number (expected nan or an empty cell where a reading is missing)"),
    ("True", "'True' is not a number (expected a number such as 0.0125 or 1.25e-2)"),
    ("0.2.6", "'0.2.6' is not a number (expected a number such as 0.0125 or 1.25e-2)"),
    ("--0.26", "'--0.26' is not a number (expected a number such as 0.0125 or 1.25e-2)"),
    ("1e", "'1e' is not a number (expected a number such as 0.0125 or 1.25e-2)"),
    ("-", "'-' is not a number (expected a number such as 0.0125 or 1.25e-2)"),
    (".", "'.' is not a number (expected a number such as 0.0125 or 1.25e-2)"),
    ("0. 26", "'0. 26' is not a number (expected a number such as 0.0125 or 1.25e-2)"),
    ("0.26\u00a0", "'0.26\\xa0' is not a number (expected a number such as 0.0125 or 1.25e-2)"),
    ("0.26/sr", "'0.26/sr' is not a number (expected a number such as 0.0125 or 1.25e-2)"),
    ("26%", "'26%' is not a number (expected a number such as 0.0125 or 1.25e-2)"),
    ("#DIV/0!", "'#DIV/0!' is not a number (expected a number such as 0.0125 or 1.25e-2)"),
    ("=A1*2", "'=A1*2' is not a number (expected a number such as 0.0125 or 1.25e-2)"),
    ("−0.26", "'−0.26' is not a number (expected a number such as 0.0125 or 1.25e-2)"),
    ("0.26+0j", "'0.26+0j' is not a number (expected a number such as 0.0125 or 1.25e-2)"),
    ("2024-05-01", "'2024-05-01' is not a number (expected a number such as 0.0125 or 1.25e-2)"),
    ("0.26\rx", "'0.26\\rx' contains a lone carriage return (expected line ends LF or CRLF)"),
]
# fmt: on


def refusal(path: Path) -> MeasurementError:
    with pytest.raises(MeasurementError) as caught:
        read_measurement(path)
    return caught.value


@pytest.mark.parametrize(
    ("content", "row", "column", "message"),
    [pytest.param(*case[1:], id=case[0]) for case in FILES],
)
def test_a_malformed_file_is_refused_with_the_place_and_the_reason(
    tmp_path: Path, content: bytes, row: int | None, column: str | None, message: str
) -> None:
    path = tmp_path / "sample.csv"
    path.write_bytes(content)
    error = refusal(path)
    assert (error.file, error.row, error.column) == ("sample.csv", row, column)
    place = (
        "sample.csv" + (f", line {row}" if row else "") + (f", column {column}" if column else "")
    )
    assert str(error) == f"{place}: {message}"


@pytest.mark.parametrize(("text", "message"), CELLS, ids=[repr(case[0]) for case in CELLS])
def test_a_malformed_cell_is_refused_with_its_text(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "sample.csv"
    path.write_bytes(cell(text))
    error = refusal(path)
    assert (error.file, error.row, error.column) == ("sample.csv", 4, "brdf")
    assert str(error) == f"sample.csv, line 4, column brdf: {message}"
    if text.isascii():
        assert error.text == text


def test_the_unchanged_file_is_accepted(tmp_path: Path) -> None:
    """Else the tables above would prove nothing."""
    path = tmp_path / "sample.csv"
    path.write_bytes(table(*ROWS))
    assert read_measurement(path).n_directions == len(ROWS)


def test_a_missing_file(tmp_path: Path) -> None:
    path = tmp_path / "none.csv"
    assert str(refusal(path)) == f"{path}: there is no such file"


def test_a_folder(tmp_path: Path) -> None:
    expected = f"{tmp_path}: is a folder (expected a CSV file, such as one inside it)"
    assert str(refusal(tmp_path)) == expected


def test_a_file_without_permission(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Simulated, since root reads everything."""

    def refuse(path: Path, mode: str) -> None:
        raise PermissionError(13, "Permission denied", str(path))

    monkeypatch.setattr(Path, "open", refuse)
    path = tmp_path / "sample.csv"
    assert str(refusal(path)) == f"{path}: cannot be read: Permission denied"


def test_a_path_with_a_nul() -> None:
    assert str(refusal(Path("a\0b.csv"))) == "the path contains a NUL character"


def test_a_gzip_bomb_ends_early(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A megabyte of blank lines unpacks from a kilobyte; the bound is lowered to meet it."""
    monkeypatch.setattr(source, "MAX_TEXT_BYTES", 2**19)
    path = tmp_path / "sample.csv.gz"
    path.write_bytes(gzip.compress(table(*ROWS) + b"\n" * 2**20))
    assert str(refusal(path)) == (
        "sample.csv.gz: the text is longer than 0.000488281 GiB after unpacking "
        "(expected a smaller file: thin the measurement out, or split it)"
    )


def test_a_table_too_large_for_memory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(csv_reader, "MAX_CELLS", 29)
    path = tmp_path / "sample.csv"
    path.write_bytes(table(*ROWS))
    assert str(refusal(path)) == (
        "sample.csv, line 7: the table has more than 29 cells "
        "(expected a smaller file: thin the measurement out, or split it)"
    )


def test_a_defect_far_down_is_found_in_its_line(tmp_path: Path) -> None:
    """Blocks are read apart: line numbers must go on across them."""
    rows = [f"{k % 80},0,{k % 70}.5,{k % 360},0.25" for k in range(150_000)]
    rows[140_000] = "45,0,10,180,0.2x"
    path = tmp_path / "sample.csv"
    path.write_bytes(table(*rows))
    assert path.stat().st_size > 2 * source.BLOCK_BYTES
    error = refusal(path)
    assert (error.row, error.column, error.text) == (140_002, "brdf", "0.2x")
