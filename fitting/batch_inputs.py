"""What a batch is to fit: files, patterns and manifests, turned into items with settings."""

from __future__ import annotations

import csv
import glob
import hashlib
import json
import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from lobefit import __version__
from lobefit.fitting.asked import check_known
from lobefit.kernels import LobefitError, MeasurementError, candidates

__all__ = ["COLUMNS", "Input", "Item", "items_of"]

Input = str | os.PathLike[str] | Mapping[str, Any]
ENDINGS = (".gz", ".csv", ".binary", ".txt")


@dataclass(frozen=True, slots=True, kw_only=True)
class Item:
    """One measurement of a batch and how it is fitted.

    Attributes
    ----------
    file : str
        Path of the measurement.
    name : str
        Of its folder and its row in the table.
    models, metric, options, tolerance, student
        As for `lobefit.fitting.fit`; options as pairs.
    max_theta : float or None
        Rows with theta_i or theta_o above this are left out, in degrees.
    digest : str
        SHA-256 of the file's bytes; empty where it cannot be read.
    """

    file: str = ""
    name: str = ""
    models: str = "standard"
    metric: str = "auto"
    options: tuple[tuple[str, str], ...] = ()
    tolerance: float | None = None
    student: bool = False
    max_theta: float | None = None
    digest: str = ""

    @property
    def key(self) -> str:
        """Tell fits apart: the bytes of the file, the settings, the version of Lobefit."""
        fields = {**asdict(self), "lobefit": __version__}
        del fields["file"], fields["name"]
        fields["called"] = Path(self.file).name  # the report says it
        return hashlib.sha256(json.dumps(fields, sort_keys=True).encode()).hexdigest()

    def check(self) -> None:
        """Raise a `LobefitError` for settings that no measurement can be fitted with."""
        candidates(self.models)
        check_known(self.metric)


def _yes(text: str) -> bool:
    found = {"yes": True, "true": True, "1": True, "no": False, "false": False, "0": False}
    if text.casefold() not in found:
        raise ValueError(f"{text!r} is neither yes nor no")
    return found[text.casefold()]


def _options(text: str) -> tuple[tuple[str, str], ...]:
    pairs = [part.partition("=") for part in text.replace(";", ",").split(",")]
    if not all(key and equals and value for key, equals, value in pairs):
        raise ValueError(f"{text!r} is not NAME=VALUE")
    return tuple(sorted((key.strip(), value.strip()) for key, _, value in pairs))


COLUMNS: Mapping[str, Callable[[str], Any]] = {
    "file": str,
    "name": str,
    "models": lambda text: text.replace(";", ","),
    "metric": str,
    "options": _options,
    "tolerance": float,
    "student": _yes,
    "max_theta": float,
}
"""Columns of a manifest; an empty cell takes what the call says."""


def items_of(inputs: Input | Iterable[Input], defaults: Item) -> list[Item]:
    """Find the items.

    Parameters
    ----------
    inputs : path-like, mapping, or an iterable of them
        Measurements, patterns such as ``scans/*.csv``, manifests (CSVs with a column ``file``; see
        `COLUMNS`; files are relative to the manifest), or mappings with the same keys.
    defaults : Item
        Settings where an input has none.

    Returns
    -------
    list of Item
        In order, each file with each set of settings once, names made unique.

    Raises
    ------
    MeasurementError
        Nothing there, or a manifest that cannot be understood: with line and column.
    ModelError, FitError
        Settings that cannot be.
    """
    defaults.check()
    found: list[Item] = []
    for one in _each(inputs):
        if isinstance(one, Mapping):
            found.append(_item(one, defaults, None, None))
            continue
        for path in _paths(os.fspath(one)):
            if _is_manifest(path):
                found += _manifest(path, defaults)
            else:
                found.append(replace(defaults, file=str(path)))
    if not found:
        raise MeasurementError("there is nothing to fit", expected="at least one measurement")
    unique = dict.fromkeys(replace(item, digest=_digest(Path(item.file))) for item in found)
    return _named(unique)


def _each(inputs: Input | Iterable[Input]) -> Iterator[Input]:
    if isinstance(inputs, str | os.PathLike | Mapping):
        yield inputs
    else:
        yield from inputs


def _paths(text: str) -> list[Path]:
    if Path(text).is_file():
        return [Path(text)]
    if Path(text).is_dir():
        raise MeasurementError(
            "is a folder", file=text, expected=f"files, such as {Path(text) / '*.csv'}"
        )
    found = sorted(Path(p) for p in glob.glob(text, recursive=True) if Path(p).is_file())  # noqa: PTH207
    if not found:
        said = "matches no file" if glob.has_magic(text) else "there is no such file"
        raise MeasurementError(said, file=text)
    return found


def _is_manifest(path: Path) -> bool:
    """Tell a manifest by its header: a column named file."""
    try:
        with path.open(encoding="utf-8", newline="") as stream:
            head = stream.readline(4096)
    except (OSError, UnicodeDecodeError):
        return False  # whoever reads it says what is wrong
    return "file" in [cell.strip().strip('"') for cell in head.lstrip("\ufeff").split(",")]


def _manifest(path: Path, defaults: Item) -> Iterator[Item]:
    with path.open(encoding="utf-8-sig", newline="") as stream:
        reader = csv.DictReader(stream, skipinitialspace=True, restkey="")
        try:
            for cells in reader:
                if "" in cells:
                    raise MeasurementError(
                        "has more cells than the header", file=path.name, row=reader.line_num
                    )
                yield _item(cells, defaults, path, reader.line_num)
        except (csv.Error, UnicodeDecodeError) as error:
            raise MeasurementError(
                f"cannot be read: {error}", file=path.name, row=reader.line_num
            ) from error


def _item(
    cells: Mapping[str, Any], defaults: Item, manifest: Path | None, line: int | None
) -> Item:
    where: dict[str, Any] = {"file": manifest.name if manifest else None, "row": line}
    fields: dict[str, Any] = {}
    for column, cell in cells.items():
        column = column.strip()
        if column not in COLUMNS:
            raise MeasurementError(
                f"unknown column {column!r}", **where, expected=", ".join(COLUMNS)
            )
        if cell is None or (isinstance(cell, str) and not cell.strip()):
            continue
        text = isinstance(cell, str)
        try:
            fields[column] = COLUMNS[column](cell.strip()) if text else _plain(column, cell)
        except ValueError as error:
            raise MeasurementError(str(error), **where, column=column) from error
    if "file" not in fields:
        raise MeasurementError("names no file", **where, column="file")
    if manifest is not None:
        fields["file"] = str(manifest.parent / fields["file"])
    item = replace(defaults, **fields)
    try:
        item.check()
    except LobefitError as error:
        raise MeasurementError(str(error), **where) from error
    return item


def _plain(column: str, value: Any) -> Any:
    """Take what a mapping in Python may hold instead of text."""
    if column == "options":
        return tuple(sorted(dict(value).items()))
    if column == "models" and not isinstance(value, str):
        return ",".join(value)
    return os.fspath(value) if column == "file" else value


def _digest(path: Path) -> str:
    try:
        with path.open("rb") as stream:
            return hashlib.file_digest(stream, "sha256").hexdigest()
    except OSError:
        return ""  # the fit of this item says why


def _stem(path: Path) -> str:
    while path.suffix.casefold() in ENDINGS:
        path = path.with_suffix("")
    return path.name


def _named(items: Iterable[Item]) -> list[Item]:
    """Give every item a name that can be a folder's; the first of a name keeps it."""
    taken: set[str] = set()
    named = []
    for item in items:
        path = Path(item.file)
        wished = item.name or _stem(path)
        wished = "".join(c if c.isalnum() or c in "-_.+=, " else "_" for c in wished).strip(" .")
        wished = wished[:120] or "item"
        name = wished
        if name.casefold() in taken and not item.name:
            name = wished = f"{path.absolute().parent.name}_{wished}"
        count = 2
        while name.casefold() in taken:
            name, count = f"{wished}_{count}", count + 1
        taken.add(name.casefold())
        named.append(replace(item, name=name))
    return named
