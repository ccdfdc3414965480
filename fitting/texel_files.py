"""Fits of texels on disk: OpenEXR maps, one ``.npz``, or a folder that grows chunk by chunk.

In the maps a pixel is a texel, rows from the top. Channels are ``LAYER.CHANNEL`` in 32-bit floating
point; the channel is R, G, B of three channels, ``c1``, ``c2``... of two or four, and Y for what a
texel has once:

``NAME``
    A parameter; NaN where the texel's model does not have it or its fit failed.
``error.NAME``
    Its first-order standard error; NaN also where the parameter is on its bound.
``model``
    Index of the chosen model in the attribute ``lobefit:models``; -1 where the fit failed.
``rmse``, ``scatter``, ``status``, ``reason``
    See `lobefit.fitting.texel_result.TexelFit`; the attributes ``lobefit:status`` and
    ``lobefit:reason`` say what the numbers mean.
"""

from __future__ import annotations

import json
import os
import zipfile
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lobefit.fitting.exr import exr_header, write_exr
from lobefit.fitting.texel_result import Reason, Status, TexelFit
from lobefit.kernels import LobefitError, MeasurementError

__all__ = [
    "SCHEMA",
    "TexelFolder",
    "check_picture",
    "load_texels",
    "save_chunks",
    "save_exr",
    "save_npz",
]

SCHEMA = "lobefit.texels/1"
PLAIN = ("model", "rmse", "scatter", "bic", "status", "reason")
ABOUT = "about"
# In a folder: what says that all is there, and the same while chunks are missing.
WHOLE, PART = "about.json", "about.part"
# Of texels without a result; everything else is NaN.
BLANK: Mapping[str, int] = {
    "model": -1,
    "status": int(Status.FAILED),
    "reason": int(Reason.CRASHED),
}


def _arrays(fit: TexelFit) -> dict[str, NDArray[Any]]:
    """Name every array of a fit as it is stored."""
    found = {name: getattr(fit, name) for name in PLAIN}
    found |= {f"params.{name}": rows for name, rows in fit.params.items()}
    found |= {f"errors.{name}": rows for name, rows in fit.errors.items()}
    return found


def _about(fit: TexelFit) -> dict[str, Any]:
    return {
        "schema": SCHEMA,
        "models": list(fit.models),
        "channels": fit.channels,
        "parameters": list(fit.params),
        "held": {name: dict(held) for name, held in fit.held.items()},
        "settings": dict(fit.settings),
        "status": {flag.name: flag.value for flag in Status},
        "reason": {reason.name: reason.value for reason in Reason},
    }


def _assemble(about: Mapping[str, Any], arrays: Mapping[str, NDArray[Any]]) -> TexelFit:
    if about.get("schema") != SCHEMA:
        raise MeasurementError(f"these are no fits of texels: schema {about.get('schema')!r}")

    def named(kind: str) -> dict[str, NDArray[np.float32]]:
        return {name: arrays[f"{kind}.{name}"] for name in about["parameters"]}

    return TexelFit(
        models=tuple(about["models"]),
        channels=about["channels"],
        params=named("params"),
        errors=named("errors"),
        held=about["held"],
        seconds={},
        settings=about["settings"],
        **{name: arrays[name] for name in PLAIN},
    )


def save_npz(fit: TexelFit, path: str | os.PathLike[str]) -> None:
    """Write all arrays and a JSON text ``about`` into one compressed ``.npz``.

    Parameters
    ----------
    fit : TexelFit
    path : path-like
        Times of the run are left out: the same fit gives the same bytes.

    Raises
    ------
    LobefitError
        The file cannot be written.
    """
    about = np.array(json.dumps(_about(fit), sort_keys=True))
    try:
        with zipfile.ZipFile(path, "w") as archive:
            for name, rows in (_arrays(fit) | {ABOUT: about}).items():
                # Made by hand: numpy.savez stamps the time on every member.
                member = zipfile.ZipInfo(f"{name}.npy")
                member.compress_type = zipfile.ZIP_DEFLATED
                with archive.open(member, "w", force_zip64=True) as stream:
                    np.lib.format.write_array(stream, np.asarray(rows), allow_pickle=False)
    except OSError as error:
        raise LobefitError(f"cannot write {path}: {error.strerror or error}") from error


class TexelFolder:
    """Fits of texels on disk: a ``.npy`` for each array, filled in place in any order.

    Parameters
    ----------
    folder : path-like
        Made if it does not exist; what an earlier run filled stays.
    total : int
        Texels in all.
    """

    def __init__(self, folder: str | os.PathLike[str], total: int) -> None:
        self.place, self.total = Path(folder), total

    def write(self, first: int, part: TexelFit) -> None:
        """Fill in a chunk; writing it again changes nothing.

        Parameters
        ----------
        first : int
            The chunk's first texel.
        part : TexelFit
            Its results.

        Raises
        ------
        LobefitError
            The folder cannot be written to.
        """
        with self._telling():
            self.place.mkdir(parents=True, exist_ok=True)
            if (self.place / WHOLE).exists():
                (self.place / WHOLE).replace(self.place / PART)
            for name, rows in _arrays(part).items():
                stored = self._array(name, rows)
                stored[first : first + len(rows)] = rows
                # Unmapped at once, so that memory does not grow with what is written.
                del stored
            if not (self.place / PART).exists():
                text = json.dumps(_about(part), indent=2, sort_keys=True) + "\n"
                _replace(self.place / PART, text)

    def sync(self) -> None:
        """Wait until what was written is on the disk."""
        with self._telling():
            for path in (*self.place.glob("*.npy"), *self.place.glob("about.*")):
                with path.open("rb") as file:
                    os.fsync(file.fileno())

    def blank(self, texels: Iterable[int]) -> None:
        """Mark texels that no chunk came back with as failed; needs one that did."""
        with self._telling():
            for path in self.place.glob("*.npy"):
                stored = np.load(path, mmap_mode="r+")
                for texel in texels:
                    stored[texel] = BLANK.get(path.stem, np.nan)
                stored.flush()
                del stored

    def finish(self) -> None:
        """Say that all is there: `load_texels` reads the folder from now on."""
        with self._telling():
            if not (self.place / WHOLE).exists():
                (self.place / PART).replace(self.place / WHOLE)

    def _array(self, name: str, rows: NDArray[Any]) -> np.memmap[Any, Any]:
        path = self.place / f"{name}.npy"
        shape = (self.total, *rows.shape[1:])
        if path.exists():
            stored: np.memmap[Any, Any] = np.load(path, mmap_mode="r+")
            if stored.shape == shape and stored.dtype == rows.dtype:
                return stored
        # An array appears under its name when it has its size.
        new: np.memmap[Any, Any] = np.lib.format.open_memmap(
            path.with_suffix(".new"), "w+", rows.dtype, shape
        )
        path.with_suffix(".new").replace(path)
        return new

    @contextmanager
    def _telling(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            reason = error.strerror or error
            raise LobefitError(f"cannot write to {self.place}: {reason}") from error


def _replace(path: Path, text: str) -> None:
    path.with_suffix(".new").write_text(text, encoding="utf-8")
    path.with_suffix(".new").replace(path)


def save_chunks(
    chunks: Iterable[tuple[int, TexelFit]], total: int, folder: str | os.PathLike[str]
) -> Path:
    """Write chunks as they finish: a ``.npy`` for each array, filled in place.

    Parameters
    ----------
    chunks : iterable of (int, TexelFit)
        First texel and results, as `lobefit.fitting.texels.fit_texel_chunks` gives them.
    total : int
        Texels in all.
    folder : path-like
        Made if it does not exist; ``about.json`` comes last and says that all is there.

    Returns
    -------
    Path
        The folder, for `load_texels`.

    Raises
    ------
    LobefitError
        The folder cannot be written to, or chunks are missing at the end.
    """
    stored = TexelFolder(folder, total)
    for name in (WHOLE, PART):
        (stored.place / name).unlink(missing_ok=True)
    done = 0
    for first, part in chunks:
        stored.write(first, part)
        done += len(part)
    if done != total:
        raise LobefitError(f"{done} of {total} texels came; {stored.place} is not complete")
    stored.finish()
    return stored.place


def load_texels(path: str | os.PathLike[str]) -> TexelFit:
    """Read what `save_npz` or `save_chunks` wrote; a folder's arrays are memory-mapped.

    Raises
    ------
    MeasurementError
        No such file, or not one of these.
    """
    place = Path(path)
    try:
        if place.is_dir():
            about = json.loads((place / WHOLE).read_text(encoding="utf-8"))
            found = {p.stem: np.load(p, mmap_mode="r") for p in sorted(place.glob("*.npy"))}
            return _assemble(about, found)
        with np.load(place, allow_pickle=False) as stored:
            arrays = dict(stored)
        return _assemble(json.loads(str(arrays.pop(ABOUT))), arrays)
    except (OSError, ValueError, KeyError) as error:
        raise MeasurementError(f"holds no fits of texels: {error}", file=place.name) from error


def _channel_names(channels: int) -> tuple[str, ...]:
    if channels == 3:
        return ("R", "G", "B")
    return ("Y",) if channels == 1 else tuple(f"c{k + 1}" for k in range(channels))


def check_picture(texels: int, height: int, width: int) -> None:
    """Refuse a height and width that are not of so many texels.

    Raises
    ------
    LobefitError
        Another number of texels.
    """
    if height * width != texels or height < 1:
        raise LobefitError(f"{texels} texels are no picture of {height} x {width}")


def save_exr(fit: TexelFit, path: str | os.PathLike[str], height: int, width: int) -> None:
    """Write maps of all parameters, their errors, the model and the status.

    Parameters
    ----------
    fit : TexelFit
        Of ``height * width`` texels, row by row from the top.
    path : path-like
        An ``.exr`` file, replaced if it exists; its layers are in this module's docstring.
    height, width : int
        Of the picture.

    Raises
    ------
    LobefitError
        Another number of texels, or the file cannot be written.
    """
    check_picture(len(fit), height, width)
    names = _channel_names(fit.channels)
    planes: dict[str, NDArray[Any]] = {}

    def add(layer: str, rows: NDArray[Any]) -> None:
        columns = rows[:, None] if rows.ndim == 1 else rows
        for channel, column in zip(names if rows.ndim == 2 else ("Y",), columns.T, strict=True):
            planes[f"{layer}.{channel}"] = column.reshape(height, width)

    for name, rows in fit.params.items():
        add(name, rows)
        add(f"error.{name}", fit.errors[name])
    for name in ("model", "rmse", "scatter", "status", "reason"):
        add(name, getattr(fit, name))
    about = _about(fit)
    told = {key: json.dumps(about[key]) for key in about if key != "schema"}
    write_exr(Path(path), planes, exr_header(SCHEMA, __doc__, told))
