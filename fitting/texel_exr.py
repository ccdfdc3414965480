"""Readings of texels from OpenEXR: a light (a pair of directions) for each part or each file.

Every part holds the BRDF in 1/sr of all texels in one pair of directions; texel k is the k-th
pixel, rows from the top. Parts are taken in the file's order, files of a folder by name. The
header of a part says its directions in four attributes, degrees as numbers or as text:
``theta_i_deg``, ``phi_i_deg``, ``theta_o_deg``, ``phi_o_deg``.

All parts have the same data window and channels: R, G, B in this order, others in that of the
file; a prefix that is the part's own name is no difference, and alpha (A) is left out.

OpenEXR's own package only reads a whole file at once, so scan lines are read by OpenImageIO.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from lobefit.fitting.measurement import DIRECTION_COLUMNS
from lobefit.fitting.texel_source import TexelSource
from lobefit.kernels.errors import LobefitError, MeasurementError

if TYPE_CHECKING:
    from OpenImageIO import ImageInput, ImageSpec

__all__ = ["ATTRIBUTES", "ExrSource"]

ATTRIBUTES = tuple(f"{name}_deg" for name in DIRECTION_COLUMNS)
REMEDY = f"the attributes {', '.join(ATTRIBUTES)} in the header of every part"
# Scan lines that are compressed together in most files, where OpenImageIO does not say.
LINES = 16


@dataclass(frozen=True, slots=True)
class _Light:
    """A part: where it is, and what has to be the same in all of them."""

    file: Path
    index: int
    label: str
    window: tuple[int, int, int, int]
    channels: tuple[str, ...]
    half: bool
    lines: int
    degrees: tuple[float, ...] | None


class ExrSource(TexelSource):
    """Parts of OpenEXR files, of which only the scan lines of a chunk are read.

    Parameters
    ----------
    files : iterable of path-like
        In the order of the directions.

    Attributes
    ----------
    image : tuple of int
        Height and width.
    block : int
        Texels that are unpacked together: chunks of a multiple of this are read without waste.
    channels : tuple of str
        Their names.

    Raises
    ------
    MeasurementError
        No OpenEXR file, or parts that do not fit together; the message names file and part.
    LobefitError
        OpenImageIO is not installed.
    """

    seekable = False

    def __init__(self, files: Iterable[str | os.PathLike[str]]) -> None:
        self._lights = tuple(light for file in files for light in _lights(Path(file)))
        first = self._lights[0]
        for light in self._lights[1:]:
            _same(first, light)
        self.image: tuple[int, int] = first.window[3], first.window[2]
        self.block = first.window[2] * max(light.lines for light in self._lights)
        self.channels = first.channels
        self.dtype = np.dtype(np.float16 if all(x.half for x in self._lights) else np.float32)
        self.shape = (self.image[0] * self.image[1], len(self._lights), len(self.channels))
        self.directions = _directions(self._lights)

    def chunks(
        self, size: int, start: int = 0, stop: int | None = None
    ) -> Iterator[tuple[int, NDArray[Any]]]:
        """Read the scan lines that hold the texels, of one part after the other."""
        end = self.shape[0] if stop is None else min(stop, self.shape[0])
        width = self.image[1]
        for first in range(start, end, size):
            last = min(first + size, end)
            top, bottom = first // width, -(-last // width)
            values = np.empty((last - first, *self.shape[1:]), self.dtype)
            inside = slice(first - top * width, last - top * width)
            for k, rows in enumerate(self._rows(top, bottom)):
                values[:, k] = rows.reshape(-1, len(self.channels))[inside]
            yield first, values

    def _rows(self, top: int, bottom: int) -> Iterator[NDArray[Any]]:
        """Read rows of every part; a file stays open while its parts are read."""
        opened: tuple[Path, ImageInput] | None = None
        kind = "half" if self.dtype == np.float16 else "float"
        for light in self._lights:
            if opened is None or opened[0] != light.file:
                opened = light.file, _open(light.file)
            picture, y = opened[1], light.window[1]
            rows = None
            if picture.seek_subimage(light.index, 0):
                rows = picture.read_scanlines(
                    light.index, 0, y + top, y + bottom, 0, 0, len(light.channels), kind
                )
            if rows is None:
                raise MeasurementError(
                    f"rows {top} to {bottom - 1} of {light.label} cannot be read: "
                    f"{_line(picture.geterror())}",
                    file=light.file.name,
                    expected="a whole file; write it again",
                )
            yield rows


def _open(file: Path) -> ImageInput:
    try:
        import OpenImageIO
    except ImportError as error:
        raise LobefitError(
            f"reading texels from {file.name} needs OpenImageIO; "
            "install it with `pip install lobefit[exr]`"
        ) from error
    picture = OpenImageIO.ImageInput.open(str(file))
    if picture is None:
        raise MeasurementError(
            f"cannot be read as OpenEXR: {_line(OpenImageIO.geterror())}", file=file.name
        )
    if picture.format_name() != "openexr":
        raise MeasurementError(f"is no OpenEXR file but {picture.format_name()}", file=file.name)
    return picture


def _line(text: str) -> str:
    """Give the first line of what a library says, which may repeat itself for every part."""
    return text.strip().partition("\n")[0] or "no reason was given"


def _lights(file: Path) -> Iterator[_Light]:
    picture = _open(file)
    index = 0
    while picture.seek_subimage(index, 0):
        yield _light(file, index, picture.spec())
        index += 1
    if not index:
        raise MeasurementError("has no part", file=file.name)


def _light(file: Path, index: int, spec: ImageSpec) -> _Light:
    name = spec.get_string_attribute("name")
    label = f"part {name!r}" if name else f"part {index + 1}"
    if spec.deep or spec.tile_width:
        raise MeasurementError(
            f"{label} has {'deep samples' if spec.deep else 'tiles'}",
            file=file.name,
            expected="scan lines, one value a pixel; write it as a scan-line image",
        )
    channels = tuple(channel.removeprefix(f"{name}.") for channel in spec.channelnames)
    if len(channels) > 1 and channels[-1] == "A":
        channels = channels[:-1]
    formats = {str(t) for t in spec.channelformats or (spec.format,)}
    if not formats <= {"half", "float"}:
        raise MeasurementError(
            f"{label} holds {', '.join(sorted(formats - {'half', 'float'}))} numbers",
            file=file.name,
            expected="BRDF values in 1/sr as HALF or FLOAT",
        )
    return _Light(
        file=file,
        index=index,
        label=label,
        window=(spec.x, spec.y, spec.width, spec.height),
        channels=channels,
        half=formats == {"half"},
        lines=spec.get_int_attribute("oiio:RowsPerChunk", LINES),
        degrees=_degrees(file, label, spec),
    )


def _degrees(file: Path, label: str, spec: ImageSpec) -> tuple[float, ...] | None:
    """Read the directions of a part; None where it says nothing of them."""
    said = {entry.name: entry for entry in spec.extra_attribs}
    missing = [name for name in ATTRIBUTES if name not in said]
    found: list[float] = []
    for name in ATTRIBUTES:
        if name in missing:
            continue
        value: Any = said[name].value
        try:
            # Most writers keep 32 bits: 30.1 was meant by what reads as 30.100000381.
            short = str(said[name].type) == "float"
            found.append(float(str(np.float32(value)) if short else value))
        except (TypeError, ValueError):
            raise MeasurementError(
                f"the attribute {name} of {label} is no number",
                file=file.name,
                text=str(value),
                expected="an angle in degrees",
            ) from None
    if missing and found:
        raise MeasurementError(
            f"{label} lacks {', '.join(missing)}", file=file.name, expected=REMEDY
        )
    return tuple(found) or None


def _same(first: _Light, light: _Light) -> None:
    where = f"{light.label} has"
    than = f"{first.label} of {first.file.name}" if first.file != light.file else first.label
    if light.window != first.window:
        raise MeasurementError(
            f"{where} the data window {_window(light)}, {than} {_window(first)}",
            file=light.file.name,
            expected="the same data window in every part; crop or pad them alike",
        )
    if light.channels != first.channels:
        raise MeasurementError(
            f"{where} the channels {', '.join(light.channels)}, {than} {', '.join(first.channels)}",
            file=light.file.name,
            expected="the same channels in every part",
        )


def _window(light: _Light) -> str:
    x, y, width, height = light.window
    return f"{width} x {height} at ({x}, {y})"


def _directions(lights: Sequence[_Light]) -> NDArray[np.float64] | None:
    """Gather the directions in radians, shape (4, N); None where no part says any."""
    if all(light.degrees is None for light in lights):
        return None
    rows = []
    for light in lights:
        if light.degrees is None:
            raise MeasurementError(
                f"{light.label} does not say its directions", file=light.file.name, expected=REMEDY
            )
        rows.append(light.degrees)
    return np.ascontiguousarray(np.deg2rad(np.array(rows)).T)
