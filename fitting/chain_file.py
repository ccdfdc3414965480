"""The chain of a posterior in an HDF5 file, from which a run that was ended goes on.

It is a backend of emcee that keeps the chain in memory too and writes a few steps at once: a step
at a time would cost more than making it. The file has its full size from the start, so that
writing changes no structure of it, and what says how far the chain goes is written last, in
turn to one of two places: a process may be killed at any point and loses the steps of the last
second.
"""

from __future__ import annotations

import json
import os
import time
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from emcee.backends import Backend
from numpy.typing import NDArray

from lobefit.kernels import FitError

__all__ = ["ChainFile"]

Array = NDArray[np.float64]

# Steps, or seconds, after which what is in memory goes to the file.
EVERY_STEPS = 50
EVERY_SECONDS = 1.0
FORMAT = "lobefit.chain/1"
# Numbers of the Mersenne Twister's state.
KEYS = 624


class ChainFile(Backend):  # type: ignore[misc]
    """A chain in memory and, where a path is given, in a file.

    Parameters
    ----------
    path : Path or None
        The file; None keeps the chain in memory only.
    settings : mapping of str to str
        What the chain belongs to; a file with other settings is refused.
    walkers, size : int
        Of all ensembles, and coordinates.
    steps : int
        How many there may become.
    resume : bool
        Go on with the file's chain if there is one; else it is replaced.

    Raises
    ------
    FitError
        The file is no chain, belongs to another run, or cannot be read or written.
    """

    def __init__(
        self,
        path: Path | None,
        settings: Mapping[str, str],
        walkers: int,
        size: int,
        steps: int,
        *,
        resume: bool = True,
    ) -> None:
        super().__init__()
        self.path, self._settings = path, dict(settings)
        self.reset(walkers, size)
        self._written = self._turn = 0
        self._last = time.monotonic()
        if path is None:
            return
        room = 0
        if resume and path.exists() and path.stat().st_size:
            room = self._read(path)
        if room < steps:
            self._create(path, steps)

    def _create(self, path: Path, steps: int) -> None:
        """Make the file in its full size and put what there is of the chain into it."""
        import h5py

        walkers, size = self.shape
        temporary = path.with_name(path.name + ".new")
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            with h5py.File(temporary, "w") as file:
                file.attrs["format"] = FORMAT
                file.attrs["settings"] = json.dumps(self._settings)
                for name, shape in (
                    ("chain", (steps, walkers, size)),
                    ("log_prob", (steps, walkers)),
                    ("state", (2, KEYS + walkers + 5)),
                ):
                    # Space is taken at once, and zeros stand for what was never written.
                    properties = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
                    properties.set_alloc_time(h5py.h5d.ALLOC_TIME_EARLY)
                    properties.set_fill_time(h5py.h5d.FILL_TIME_NEVER)
                    h5py.h5d.create(
                        file.id,
                        name.encode(),
                        h5py.h5t.IEEE_F64LE,
                        h5py.h5s.create_simple(shape),
                        dcpl=properties,
                    )
                file["chain"].attrs["dimensions"] = "step, walker, coordinate"
                file["state"][:] = 0.0
            self._written = 0
            final, self.path = path, temporary
            self.flush()
            temporary.replace(final)
            self.path = final
        except OSError as error:
            raise FitError(f"the chain file {path} cannot be written: {error}") from error

    def _read(self, path: Path) -> int:
        """Read a chain; returns how many steps the file has room for."""
        import h5py

        try:
            with h5py.File(path, "r") as file:
                if file.attrs.get("format") != FORMAT:
                    raise FitError(f"{path} is no chain file of lobefit; name another file")
                self._compare(path, json.loads(file.attrs["settings"]))
                good = [record for record in file["state"][:] if _sound(record)]
                if good:
                    self._restore(max(good, key=lambda record: float(record[0])))
                    self.chain = file["chain"][: self.iteration]
                    self.log_prob = file["log_prob"][: self.iteration]
                room = int(file["chain"].shape[0])
        except (OSError, KeyError, ValueError) as error:
            raise FitError(
                f"the chain file {path} cannot be read ({error}); delete it to start anew"
            ) from error
        self._written = self.iteration
        return room

    def _compare(self, path: Path, there: Mapping[str, str]) -> None:
        for key, value in self._settings.items():
            if there.get(key) != value:
                raise FitError(
                    f"the chain in {path} belongs to another run: its {key} is "
                    f"{there.get(key)!r}, not {value!r}; delete the file or name another"
                )

    def _restore(self, record: Array) -> None:
        self.iteration = int(record[0])
        keys = record[4 : 4 + KEYS].astype(np.uint32)
        self.random_state = ("MT19937", keys, int(record[1]), int(record[2]), float(record[3]))
        self.accepted = record[4 + KEYS : -1].copy()

    def _record(self) -> Array:
        _, keys, position, has_gauss, gauss = self.random_state
        head = [self.iteration, position, has_gauss, gauss]
        record = np.concatenate([head, keys, self.accepted, [0.0]])
        record[-1] = _checksum(record)
        return record

    def save_step(self, state: Any, accepted: Any) -> None:
        """Keep a step; emcee's interface."""
        super().save_step(state, accepted)
        due = self.iteration - self._written >= EVERY_STEPS
        if due or time.monotonic() - self._last > EVERY_SECONDS:
            self.flush()

    def flush(self) -> None:
        """Write what is only in memory."""
        if self.path is None or self.iteration == self._written:
            return
        import h5py

        new = slice(self._written, self.iteration)
        try:
            with h5py.File(self.path, "r+") as file:
                file["chain"][new] = self.chain[new]
                file["log_prob"][new] = self.log_prob[new]
                file.flush()
                file["state"][self._turn] = self._record()
        except OSError as error:
            raise FitError(f"the chain file {self.path} cannot be written: {error}") from error
        self._turn = 1 - self._turn
        self._written = self.iteration
        self._last = time.monotonic()

    def trim(self) -> None:
        """Give back the room that the chain did not need."""
        if self.path is not None:
            self._create(self.path, self.iteration)

    def sync(self) -> None:
        """Write what is only in memory, and have the disk keep it."""
        self.flush()
        if self.path is not None:
            with self.path.open("rb") as stream:
                os.fsync(stream.fileno())


def _checksum(record: Array) -> float:
    return float(zlib.crc32(np.ascontiguousarray(record[:-1]).tobytes()))


def _sound(record: Array) -> bool:
    return bool(record[0] > 0 and record[-1] == _checksum(record))
