"""Where texels come from: arrays in memory or on disk, read chunk by chunk."""

from __future__ import annotations

import os
import zipfile
from abc import ABC, abstractmethod
from collections.abc import Iterator
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from lobefit.fitting.measurement import DIRECTION_COLUMNS
from lobefit.kernels import LobefitError, MeasurementError

__all__ = ["CHUNK", "ArraySource", "TexelSource", "open_texels"]

Numbers = NDArray[Any]

# Texels read at a time: 64 samples of 3 channels are 50 MB then.
CHUNK = 65_536


class TexelSource(ABC):
    """Readings of T texels in N directions and C channels.

    Attributes
    ----------
    shape : tuple of int
        (T, N, C).
    directions : ndarray, shape (4, N), or None
        theta_i, phi_i, theta_o, phi_o in radians, where they are stored beside the values.
    image : tuple of int, or None
        Height and width, where the texels are a picture, row by row from the top.
    seekable : bool
        Whether chunks can start anywhere at no cost.
    block : int
        Texels that are stored as one.
    """

    shape: tuple[int, int, int]
    directions: NDArray[np.float64] | None = None
    image: tuple[int, int] | None = None
    seekable: bool = True
    block: int = 1

    @abstractmethod
    def chunks(
        self, size: int, start: int = 0, stop: int | None = None
    ) -> Iterator[tuple[int, Numbers]]:
        """Give (first texel, readings of shape (t, N, C)) in order.

        Parameters
        ----------
        size : int
            Texels at a time.
        start, stop : int
            Which texels; all where left out.
        """


def _shape(shape: tuple[int, ...], what: str, kind: str) -> tuple[int, int, int]:
    """Check the shape and type of values; two axes are one channel."""
    if kind not in "fiu":
        raise MeasurementError(f"{what} does not hold numbers", expected="BRDF values in 1/sr")
    if len(shape) == 2:
        shape = (*shape, 1)
    if len(shape) != 3:
        raise MeasurementError(
            f"{what} has shape {shape}", expected="shape (texels, directions, channels)"
        )
    return (shape[0], shape[1], shape[2])


class ArraySource(TexelSource):
    """Anything that is cut like an array: NumPy in memory or memory-mapped, Zarr, HDF5.

    Parameters
    ----------
    values : array_like, shape (T, N, C) or (T, N)
        Readings.
    directions : array_like, shape (4, N), optional
        In radians.
    """

    def __init__(self, values: Any, directions: Any = None) -> None:
        if not (hasattr(values, "shape") and hasattr(values, "dtype")):
            values = np.asarray(values)
        self.values = values
        self.shape = _shape(tuple(values.shape), "the array of values", np.dtype(values.dtype).kind)
        self.directions = None if directions is None else np.asarray(directions, np.float64)

    def chunks(
        self, size: int, start: int = 0, stop: int | None = None
    ) -> Iterator[tuple[int, Numbers]]:
        """Cut the array."""
        end = self.shape[0] if stop is None else min(stop, self.shape[0])
        for first in range(start, end, size):
            cut = np.asarray(self.values[first : min(first + size, end)])
            yield first, cut.reshape(len(cut), *self.shape[1:])


class _StreamSource(TexelSource):
    """A ``.npy`` file, or one inside a ``.npz``, read as a stream: never mapped, never whole."""

    def __init__(self, path: Path, member: str | None, directions: Any = None) -> None:
        self.path, self.member = path, member
        self.seekable = member is None
        self.directions = directions
        with self._open() as stream:
            shape, fortran, self.dtype = _header(stream, path)
        if fortran:
            raise MeasurementError(
                "the values are stored in Fortran order, which cannot be read texel by texel",
                file=path.name,
                expected="C order: numpy.ascontiguousarray before saving",
            )
        self.shape = _shape(shape, f"{member or 'the array'}", self.dtype.kind)

    def _open(self) -> IO[bytes]:
        if self.member is None:
            return self.path.open("rb")
        return zipfile.ZipFile(self.path).open(f"{self.member}.npy")

    def chunks(
        self, size: int, start: int = 0, stop: int | None = None
    ) -> Iterator[tuple[int, Numbers]]:
        """Read on and on."""
        end = self.shape[0] if stop is None else min(stop, self.shape[0])
        texel = self.shape[1] * self.shape[2] * self.dtype.itemsize
        with self._open() as stream:
            _header(stream, self.path)
            stream.seek(stream.tell() + start * texel)
            for first in range(start, end, size):
                count = min(size, end - first)
                data = stream.read(count * texel)
                if len(data) < count * texel:
                    raise MeasurementError(
                        f"the file ends within texel {first + len(data) // texel}",
                        file=self.path.name,
                        expected=f"{self.shape[0]} texels",
                    )
                yield first, np.frombuffer(data, self.dtype).reshape(count, *self.shape[1:])


def _header(stream: IO[bytes], path: Path) -> tuple[tuple[int, ...], bool, np.dtype[Any]]:
    try:
        version = np.lib.format.read_magic(stream)
        read = np.lib.format.read_array_header_1_0
        if version != (1, 0):
            read = np.lib.format.read_array_header_2_0
        return read(stream)
    except ValueError as error:
        raise MeasurementError(f"is no NumPy array: {error}", file=path.name) from error


def open_texels(path: str | os.PathLike[str], values: str = "values") -> TexelSource:
    """Open readings on disk.

    Parameters
    ----------
    path : path-like
        A ``.npy`` array, a ``.npz`` or a Zarr group (a folder; needs `lobefit[zarr]`) with the
        array `values` and, beside it, `directions` of shape (4, N) or theta_i, phi_i, theta_o,
        phi_o, in radians. Or an ``.exr`` file with a part for each pair of directions, or a
        folder of such files, each with one or more (needs `lobefit[exr]`); what is in them is
        told in `lobefit.fitting.texel_exr`.
    values : str
        Name of the array of readings, shape (T, N, C).

    Returns
    -------
    TexelSource
        Its chunks are read when they are asked for. A compressed ``.npz`` is unpacked on
        the way; to start in its middle means to unpack what comes before.

    Raises
    ------
    MeasurementError
        No such file or array, or one of another shape.
    """
    place = Path(path)
    if not place.exists():
        raise MeasurementError("there is no such file", file=str(path))
    pictures = sorted(place.glob("*.exr")) if place.is_dir() else [place]
    if pictures and pictures[0].suffix.lower() == ".exr":
        from lobefit.fitting.texel_exr import ExrSource

        return ExrSource(pictures)
    if place.is_dir():
        return _open_zarr(place, values)
    if place.suffix == ".npy":
        return _StreamSource(place, None)
    if not zipfile.is_zipfile(place):
        raise MeasurementError(
            "is neither .npy, .npz, .exr nor a folder of Zarr or OpenEXR",
            file=place.name,
            expected="an array of values",
        )
    with zipfile.ZipFile(place) as archive:
        names = [name.removesuffix(".npy") for name in archive.namelist()]
    _need(values, names, place)
    with np.load(place, allow_pickle=False) as stored:
        directions = _stored_directions(stored, names)
    return _StreamSource(place, values, directions)


def _need(values: str, names: list[str], place: Path) -> None:
    if values not in names:
        raise MeasurementError(
            f"has no array {values!r}; there are: {', '.join(names) or 'none'}", file=place.name
        )


def _stored_directions(stored: Any, names: list[str]) -> NDArray[np.float64] | None:
    if "directions" in names:
        return np.asarray(stored["directions"], np.float64)
    if set(DIRECTION_COLUMNS) <= set(names):
        return np.array([np.asarray(stored[name], np.float64) for name in DIRECTION_COLUMNS])
    return None


def _open_zarr(place: Path, values: str) -> TexelSource:
    try:
        import zarr
    except ImportError as error:
        raise LobefitError(
            f"reading the folder {place.name} needs Zarr; install it with `pip install lobefit[zarr]`"
        ) from error
    try:
        group = zarr.open(str(place), mode="r")
    except (FileNotFoundError, ValueError) as error:
        raise MeasurementError(f"is no Zarr folder: {error}", file=place.name) from error
    if isinstance(group, zarr.Array):
        return ArraySource(group)
    names = sorted(group.array_keys())
    _need(values, names, place)
    return ArraySource(group[values], _stored_directions(group, names))
