"""The head of a Lobefit CSV: `# key: value` lines, then the row of column names.

The keys `angle_unit` (``deg`` by default, or ``rad``) and `quantity` (``brdf [1/sr]`` by
default, ``cosine-weighted brdf`` or ``radiance factor``) change what the numbers mean, so a
misspelt one is an error. Every other key is kept as it is.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from difflib import get_close_matches
from typing import BinaryIO

from lobefit.fitting.readers.columns import Columns, assign_columns
from lobefit.fitting.readers.source import MAX_LINE_BYTES
from lobefit.kernels.errors import MeasurementError

__all__ = ["QUANTITIES", "Header", "read_header"]

QUANTITIES = ("brdf [1/sr]", "cosine-weighted brdf", "radiance factor")
"""What the channels may hold; all are converted to the first."""

_UNITS = {
    **dict.fromkeys(("deg", "degree", "degrees", "°"), "deg"),
    **dict.fromkeys(("rad", "radian", "radians"), "rad"),
}
_MEANINGFUL = ("angle_unit", "quantity", "small_angles")
_ALIASES = {"angle_units": "angle_unit", "angleunit": "angle_unit"}
_SI_UNIT = re.compile(r"\s*[\[(]\s*(1/sr|sr\^?-1|1)\s*[\])]$")


@dataclass(frozen=True)
class Header:
    """What the head says.

    Parameters
    ----------
    metadata : dict
        The keys that do not concern units.
    angle_unit : str
        ``deg`` or ``rad``.
    quantity : str
        One of `QUANTITIES`.
    small_angles : bool
        The file asserts that its polar angles really are all below 1.6 degrees.
    columns : Columns
        Which column is what.
    separator : bytes
        Comma, semicolon or tab.
    line : int
        Number of the line with the column names.
    """

    metadata: dict[str, str]
    angle_unit: str
    quantity: str
    small_angles: bool
    columns: Columns
    separator: bytes
    line: int


def read_header(stream: BinaryIO, name: str) -> Header:
    """Read up to and including the row of column names.

    Parameters
    ----------
    stream : binary stream
        The text from its start.
    name : str
        The file, for errors.

    Returns
    -------
    Header
        Its contents.

    Raises
    ------
    MeasurementError
        If metadata or column names are missing, misspelt, repeated or not UTF-8.
    """
    metadata: dict[str, str] = {}
    places: dict[str, int] = {}
    line, size = 0, 0
    while raw := stream.readline(MAX_LINE_BYTES):
        line, size = line + 1, size + len(raw)
        text = _decode(raw, name, line)
        if size >= MAX_LINE_BYTES:
            raise MeasurementError(
                f"no header row within the first {MAX_LINE_BYTES} bytes", file=name, row=line
            )
        if text.startswith("#"):
            _add_metadata(text, metadata, places, name, line)
        elif text.strip(",;\t"):
            separator = _separator(text, name, line)
            columns = assign_columns(text.split(separator), name, line)
            return Header(
                angle_unit=_angle_unit(metadata, places, name),
                quantity=_quantity(metadata, places, name),
                small_angles=_small_angles(metadata, places, name),
                metadata=metadata,
                columns=columns,
                separator=separator.encode(),
                line=line,
            )
    raise MeasurementError(
        "there is no header row",
        file=name,
        row=line,
        expected="theta_i,phi_i,theta_o,phi_o and one column per channel",
    )


def _decode(raw: bytes, name: str, line: int) -> str:
    if b"\r" in raw.removesuffix(b"\n").removesuffix(b"\r"):
        raise MeasurementError(
            "lines end in a lone carriage return (old Mac)",
            file=name,
            row=line + raw[: raw.index(b"\r")].count(b"\n"),
            expected="line ends LF or CRLF",
        )
    try:
        return raw.decode("utf-8").strip(" \r\n")
    except UnicodeDecodeError as error:
        raise MeasurementError(
            f"byte 0x{raw[error.start]:02x} is not UTF-8; the file seems to be in another encoding",
            file=name,
            row=line,
            text=raw.decode("latin-1").strip(),
            expected="text saved as UTF-8",
        ) from None


def _add_metadata(
    text: str, metadata: dict[str, str], places: dict[str, int], name: str, line: int
) -> None:
    # Spreadsheets pad every line with separators; they are not part of a value.
    key, colon, value = text.lstrip("#").strip(" ,;\t").partition(":")
    key, value = (key.strip(), value.strip()) if colon else ("comment", key)
    if not value:
        return
    plain = re.sub(r"[\s-]+", "_", key.lower())
    plain = _ALIASES.get(plain, plain)
    if plain in _MEANINGFUL:
        if plain in metadata and metadata[plain] != value:
            raise MeasurementError(
                f"{plain} is given twice: {metadata[plain]!r} in line {places[plain]}, then "
                f"{value!r}",
                file=name,
                row=line,
                text=text,
            )
        metadata[plain], places[plain] = value, line
        return
    suggestion = get_close_matches(plain, _MEANINGFUL, 1, 0.8)
    if not suggestion and "unit" in plain and value.lower() in _UNITS:
        suggestion = ["angle_unit"]
    if suggestion:
        raise MeasurementError(
            f"unknown key {key!r}; did you mean {suggestion[0]!r}?",
            file=name,
            row=line,
            text=text,
            expected=f"# {suggestion[0]}: ...",
        )
    metadata[key] = f"{metadata[key]}; {value}" if key in metadata else value


def _angle_unit(metadata: dict[str, str], places: dict[str, int], name: str) -> str:
    value = metadata.pop("angle_unit", "deg")
    if value.lower() not in _UNITS:
        raise MeasurementError(
            f"unknown angle_unit {value!r}",
            file=name,
            row=places["angle_unit"],
            text=value,
            expected="deg or rad",
        )
    return _UNITS[value.lower()]


def _quantity(metadata: dict[str, str], places: dict[str, int], name: str) -> str:
    value = metadata.pop("quantity", QUANTITIES[0])
    plain = " ".join(_SI_UNIT.sub("", value.lower()).replace("-", " ").split())
    for quantity in QUANTITIES:
        if plain == _SI_UNIT.sub("", quantity).replace("-", " "):
            return quantity
    raise MeasurementError(
        f"unknown quantity {value!r}",
        file=name,
        row=places["quantity"],
        text=value,
        expected=", ".join(QUANTITIES[:-1]) + f" or {QUANTITIES[-1]}",
    )


def _small_angles(metadata: dict[str, str], places: dict[str, int], name: str) -> bool:
    value = metadata.get("small_angles", "no")
    if value.lower() not in ("yes", "true", "no", "false"):
        raise MeasurementError(
            f"unknown small_angles {value!r}",
            file=name,
            row=places["small_angles"],
            text=value,
            expected="yes or no",
        )
    return value.lower() in ("yes", "true")


def _separator(text: str, name: str, line: int) -> str:
    found = [mark for mark in ",;\t" if mark in text]
    if text[0] in "{[<":
        raise MeasurementError(
            "the file looks like JSON, XML or HTML, not CSV",
            file=name,
            row=line,
            text=text[:80],
            expected="a header row: theta_i,phi_i,theta_o,phi_o and one column per channel",
        )
    if len(found) == 1:
        return found[0]
    if found:
        names = " and ".join({",": "commas", ";": "semicolons", "\t": "tabs"}[m] for m in found)
        problem = f"the header row mixes {names}"
    elif " " in text:
        problem = "the columns are separated by spaces"
    else:
        problem = f"the header row has one column: {text[:80]!r}"
    raise MeasurementError(
        problem,
        file=name,
        row=line,
        text=text,
        expected="one separator throughout: commas, semicolons or tabs",
    )
