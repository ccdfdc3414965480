"""A file of texels fitted on many processes, its maps filled in chunk by chunk; resumable."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lobefit import __version__
from lobefit.fitting.engine import Ledger, Progress, Row, Runner, Work, open_crew, run
from lobefit.fitting.texel_exr import REMEDY
from lobefit.fitting.texel_files import TexelFolder, check_picture, load_texels
from lobefit.fitting.texel_noise import texel_noise
from lobefit.fitting.texel_result import TexelFit
from lobefit.fitting.texel_source import CHUNK, TexelSource, open_texels
from lobefit.fitting.texels import check_shapes, chunk_fitter, direction_angles, eligible
from lobefit.kernels.errors import LobefitError, MeasurementError
from lobefit.kernels.geometry import Precision

__all__ = ["TexelBatch", "fit_texel_file"]

LEDGER = "texels.sqlite"
UNPACKED = "readings"
ARRAY = "an array directions of shape (4, N), in radians"
# Seconds of a chunk, its fewest texels, and the most bytes of readings in memory and on a wire.
SECONDS, FEWEST = 3.0, 2048
READ_BYTES, SENT_BYTES = 64 << 20, 8 << 20
# Bytes of a large file that tell it from others, at each end.
ENDS = 1 << 20


@dataclass(frozen=True, slots=True)
class TexelBatch:
    """What came of a file of texels.

    Attributes
    ----------
    folder : Path
        With a ``.npy`` for each array of the fit, for `lobefit.fitting.texel_files.load_texels`.
    failed : dict of int to str
        Texels that no chunk came back with, and why; those that cannot be fitted for their
        readings are in `fit.failures`.
    worked : float
        Seconds that all workers took together, without what is done once in each.
    chunks : int
        How many there were.
    image : tuple of int, or None
        Height and width, where the texels are a picture's.
    """

    folder: Path
    failed: Mapping[int, str]
    worked: float
    chunks: int
    image: tuple[int, int] | None = None

    @property
    def fit(self) -> TexelFit:
        """The results, memory-mapped."""
        return load_texels(self.folder)


@dataclass(frozen=True, slots=True)
class OpenTexels:
    """Opens the device of a worker and the file, if workers read it themselves."""

    path: str | None
    array: str
    angles: bytes
    channels: int
    models: str | tuple[str, ...]
    noise: str | tuple[float, float]
    options: tuple[tuple[str, str], ...]
    precision: Precision
    device: str | None

    @contextmanager
    def __call__(self) -> Iterator[Runner]:
        """Compile the kernels once."""
        angles = np.frombuffer(self.angles).reshape(4, -1)
        models = self.models if isinstance(self.models, str) else list(self.models)
        wanted = eligible(models, self.channels, dict(self.options))
        settings = {
            "models": models,
            "noise": self.noise if isinstance(self.noise, str) else list(self.noise),
            "options": dict(self.options),
            "precision": self.precision,
        }
        source = None if self.path is None else open_texels(self.path, self.array)
        with chunk_fitter(
            angles, wanted, self.channels, self.noise, self.precision, self.device, settings
        ) as fitter:

            def fit(first: int, stop: int, sent: NDArray[Any] | None) -> TexelFit:
                if source is not None:
                    sent = _read(source, first, stop)
                return fitter.fit(sent)  # type: ignore[arg-type]

            yield fit


def _read(source: TexelSource, first: int, stop: int) -> NDArray[Any]:
    return next(source.chunks(stop - first, first, stop))[1]


def fit_texel_file(
    source: str | os.PathLike[str],
    out: str | os.PathLike[str],
    models: str | Sequence[str] = "quick",
    *,
    array: str = "values",
    directions: Any = None,
    noise: str | tuple[float, float] = "relative",
    options: Mapping[str, str] | None = None,
    precision: Precision = "single",
    jobs: int | None = None,
    scheduler: str | None = None,
    pool: str = "loky",
    shares_disk: bool = False,
    retry: bool = False,
    device: str | None = None,
    patience: float = 120.0,
    image: tuple[int, int] | None = None,
    progress: Progress | None = None,
) -> TexelBatch:
    """Fit the texels of a file as `lobefit.fitting.fit_texels` would, on many processes.

    Results are filled into ``.npy`` files as chunks finish, and then noted in
    ``out/texels.sqlite``. The same call after any interruption does the rest. The files' bytes do not
    depend on how many processes there are, nor on how texels are cut into chunks.

    Parameters
    ----------
    source : path-like
        See `lobefit.fitting.texel_source.open_texels`. What a ``.npz`` or OpenEXR files hold is
        unpacked into `out` while it is fitted, since a chunk cannot start in its middle; that
        takes as much disk as the readings do, and little memory.
    out : path-like
        Folder, made if it does not exist.
    models, noise, options, precision, device
        As for `lobefit.fitting.fit_texels`.
    array : str
        Name of the readings in the file.
    directions : array_like, shape (4, N), optional
        In radians, where the file has none.
    jobs : int, optional
        Processes on this machine; as many as cores where left out.
    scheduler : str, optional
        Address of a Dask scheduler, whose workers are taken instead and sent the readings.
    pool : {"loky", "processes"}
        Which local pool.
    shares_disk : bool
        Whether the scheduler's workers see the file under the same path: they read it
        themselves, and only results travel.
    retry : bool
        Whether texels that no chunk came back with are tried again.
    patience : float
        Seconds to wait for workers when there is none.
    image : tuple of int, optional
        Height and width of the picture that the texels are, where the file does not say.
    progress : callable, optional
        Called with a `lobefit.fitting.engine.Status`.

    Raises
    ------
    MeasurementError, ModelError, FitError
        A file, directions or models that cannot be, before anything is fitted.
    LobefitError
        No workers (`lobefit.fitting.engine.EngineError`), or a folder that cannot be written to.
    """
    path, folder = Path(source).absolute(), Path(out).absolute()
    if folder.exists() and not folder.is_dir():
        raise LobefitError(f"{folder} is a file; name a folder")
    opened = open_texels(path, array)
    given = opened.directions if directions is None else directions
    if given is None:
        raise MeasurementError(
            "holds no directions",
            file=path.name,
            expected=f"{REMEDY if opened.image else ARRAY}, or directions of your own: --directions",
        )
    angles = direction_angles(given)
    check_shapes(angles, opened.shape)
    texel_noise(noise)
    total, samples, channels = opened.shape
    image = image or opened.image
    if image is not None:
        check_picture(total, *image)
    named = models if isinstance(models, str) else tuple(models)
    eligible(models, channels, options)
    opener = OpenTexels(
        path=None,
        array=array,
        angles=angles.tobytes(),
        channels=channels,
        models=named,
        noise=noise,
        options=tuple(sorted((options or {}).items())),
        precision=precision,
        device=device,
    )
    key = _key(path, opener)
    with Ledger(folder / LEDGER, {"kind": "texels", "key": key}) as ledger:
        if retry:
            ledger.forget(row.first for row in ledger.rows("failed"))
        stored = TexelFolder(folder, total)
        if ledger.missing([(0, total)]):
            if not opened.seekable:
                path = _unpacked(opened, folder / f"{UNPACKED}.{key[:16]}.npy")
                opened, array = open_texels(path), ""
            crew = open_crew(jobs, scheduler, pool, shares_disk=shares_disk)
            most = READ_BYTES if crew.shares_disk else SENT_BYTES
            if crew.shares_disk:
                opener = OpenTexels(**{**asdict(opener), "path": str(path), "array": array})
            texel_bytes = samples * channels * 8
            work = Work(
                key=key,
                opener=opener,
                keep=lambda first, stop, part: _keep(stored, first, stop, part),
                sync=stored.sync,
                wanted=((0, total),),
                sent=lambda first, stop: None if crew.shares_disk else _read(opened, first, stop),
                name=lambda unit: f"texel {unit}",
                seconds=SECONDS,
                smallest=min(FEWEST, max(most // texel_bytes, 1)),
                largest=min(CHUNK, max(most // texel_bytes, 1)),
            )
            run(work, ledger, crew, progress=progress, patience=patience)
        failed = {row.first: row.reason for row in ledger.rows("failed")}
        if len(failed) == total:
            raise LobefitError(f"no texel was fitted: {next(iter(failed.values()))}")
        if failed:
            stored.blank(failed)
        stored.finish()
        with suppress(FileNotFoundError):
            (folder / f"{UNPACKED}.tmp").unlink()
        for made in folder.glob(f"{UNPACKED}.*.npy"):
            made.unlink()
        return TexelBatch(folder, failed, ledger.seconds(), ledger.chunk_count(), image)


def _keep(stored: TexelFolder, first: int, stop: int, part: TexelFit) -> list[Row]:
    if len(part) != stop - first:
        raise LobefitError(f"texels {first} to {stop - 1}: {len(part)} came back")
    stored.write(first, part)
    return [Row(first, stop)]


def _unpacked(source: TexelSource, place: Path) -> Path:
    """Copy readings to where chunks can start anywhere, whole or not at all."""
    if place.exists():
        return place
    temporary = place.parent / f"{UNPACKED}.tmp"
    _, samples, channels = source.shape
    most = max(READ_BYTES // (samples * channels * 4), 1)
    if most > source.block:
        most -= most % source.block
    try:
        with temporary.open("wb") as plain:
            for first, values in source.chunks(most):
                if not first:
                    about = {"descr": values.dtype.str, "fortran_order": False}
                    np.lib.format.write_array_header_1_0(plain, {**about, "shape": source.shape})
                plain.write(np.ascontiguousarray(values).data)
        temporary.replace(place)
    except OSError as error:
        raise LobefitError(f"cannot unpack the readings into {place.parent}: {error}") from error
    return place


def _key(path: Path, opener: OpenTexels) -> str:
    """Tell this fit from others: settings, and the file by its size, time and ends.

    Reading all of a large file would take as long as a good part of the fit.
    """
    digest = hashlib.sha256(__version__.encode())
    fields = {k: v for k, v in asdict(opener).items() if k not in ("path", "angles")}
    digest.update(json.dumps(fields, sort_keys=True, default=str).encode())
    digest.update(opener.angles)
    files = sorted(p for p in path.rglob("*") if p.is_file()) if path.is_dir() else [path]
    for file in files:
        stat = file.stat()
        digest.update(f"{file.relative_to(path.parent)} {stat.st_size} {stat.st_mtime_ns}".encode())
        with file.open("rb") as stream:
            digest.update(stream.read(ENDS))
            stream.seek(max(stat.st_size - ENDS, 0), os.SEEK_SET)
            digest.update(stream.read(ENDS) if path.is_file() else b"")
    return digest.hexdigest()
