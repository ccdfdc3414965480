"""Reading a MERL table (``.binary``): an isotropic BRDF over half and difference angles.

`lobefit.fitting.merl` describes the file. The rules, each counted in the measurement:

1. Of the 1 458 000 cells every n-th along each angle is taken (`STRIDE`), from the middle of
   each run of n along theta_d and phi_d, and from the mirror direction along theta_h.
2. A cell whose centre has light or view at or below the horizon is dropped.
3. A negative value, or one that is not finite, is missing; a cell without any value is dropped.

Values stand at the centres of the cells, with phi_i = 0. They are not averaged or interpolated.
"""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lobefit.fitting.measurement import Dropped, Measurement
from lobefit.fitting.merl import (
    CHANNELS,
    FILE_BYTES,
    HEADER,
    SCALES,
    SHAPE,
    cell_directions,
)
from lobefit.kernels.errors import MeasurementError
from lobefit.kernels.geometry import MIN_COSINE

__all__ = ["STRIDE", "looks_like_merl", "read_merl"]

STRIDE = (2, 6, 18)
"""Default thinning of theta_h, theta_d and phi_d: some thousand directions, fitted in seconds."""

_NAMES = ("theta_h", "theta_d", "phi_d")


def looks_like_merl(path: Path) -> bool:
    """Tell a MERL table by its first bytes, or by its name where it is damaged.

    Parameters
    ----------
    path : Path
        A file; anything else, such as a pipe, is not touched.
    """
    try:
        if not path.is_file():
            return False
        with path.open("rb") as stream:
            head = stream.read(len(HEADER))
    except (OSError, ValueError):  # left to the reader that reports it
        return False
    return head == HEADER or (path.suffix.lower() == ".binary" and bool(head))


def read_merl(path: str | os.PathLike[str], stride: tuple[int, int, int] = STRIDE) -> Measurement:
    """Read a MERL table.

    Parameters
    ----------
    path : path-like
        The file.
    stride : tuple of int
        Take every n-th cell of theta_h, theta_d and phi_d; ``(1, 1, 1)`` takes all.

    Returns
    -------
    Measurement
        Channels R, G, B in 1/sr, with phi_i = 0; `dropped` and `notes` say what is left out.

    Raises
    ------
    MeasurementError
        If the file cannot be read, is no MERL table or is cut short.
    """
    file = Path(path)
    name = file.name or str(file)
    if len(stride) != 3 or not all(1 <= n <= size for n, size in zip(stride, SHAPE, strict=True)):
        raise MeasurementError(
            f"a stride of {stride} cannot be taken",
            file=name,
            expected=f"three numbers from 1 to {SHAPE} for {', '.join(_NAMES)}",
        )
    table = _table(file, name)
    starts = (0, stride[1] // 2, stride[2] // 2)
    runs = [np.arange(a, size, n) for a, size, n in zip(starts, SHAPE, stride, strict=True)]
    picked = np.ix_(np.arange(3), *runs)
    values = table[picked].reshape(3, -1) * np.array(SCALES)[:, np.newaxis]
    theta_i, theta_o, phi_o = (a.ravel() for a in cell_directions(*np.ix_(*runs)))
    cells = SHAPE[0] * SHAPE[1] * SHAPE[2]
    dropped = [Dropped("cells left out by thinning", (), cells - theta_i.size)]
    notes = [_thinning(stride)]

    below = np.minimum(np.cos(theta_i), np.cos(theta_o)) <= MIN_COSINE
    dropped.append(Dropped("cells at or below the horizon", (), int(below.sum())))
    values[~(np.isfinite(values) & (values >= 0.0))] = np.nan
    missing = np.isnan(values)
    empty = missing.all(axis=0) & ~below
    dropped.append(Dropped("cells without a value (negative in the file)", (), int(empty.sum())))
    keep = ~below & ~empty
    for channel, plane in zip(CHANNELS, values[:, keep], strict=True):
        if not np.any(plane > 0.0):
            raise MeasurementError(
                "the channel has no positive value in any cell above the horizon",
                file=name,
                column=channel,
                expected="a BRDF in 1/sr; the table may not have been filled",
            )
        if count := int(np.isnan(plane).sum()):
            notes.append(f"channel {channel}: {count} values missing (negative in the file)")
    return Measurement(
        theta_i=theta_i[keep],
        phi_i=np.zeros(int(keep.sum())),
        theta_o=theta_o[keep],
        phi_o=phi_o[keep],
        values=values[:, keep],
        channels=CHANNELS,
        metadata={
            "material": file.stem,
            "format": "MERL table of 90 x 90 x 180 cells in theta_h, theta_d, phi_d",
            "merl_stride": ",".join(map(str, stride)),
        },
        dropped=tuple(entry for entry in dropped if entry.count),
        notes=tuple(notes),
        source=name,
        rows_read=cells,
    )


def _thinning(stride: tuple[int, int, int]) -> str:
    counts = zip(_NAMES, stride, strict=True)
    every = [f"every {_ordinal(n)} cell of {angle}" for angle, n in counts if n > 1]
    taken = ", ".join(every) or "every cell"
    return f"MERL table: {taken}; values stand at the centres of the cells"


def _ordinal(n: int) -> str:
    ending = {1: "st", 2: "nd", 3: "rd"}.get(n % 10 if n // 10 % 10 != 1 else 0, "th")
    return f"{n}{ending}"


def _table(file: Path, name: str) -> NDArray[np.float64]:
    """Map the planes into memory, shape (3, 90, 90, 180), unscaled."""
    remedy = f"a MERL .binary of {FILE_BYTES} bytes that begins with 90, 90, 180"
    try:
        size = file.stat().st_size
        with file.open("rb") as stream:
            head = stream.read(len(HEADER))
        if head != HEADER:
            found = np.frombuffer(head[: len(head) // 4 * 4], dtype="<i4").tolist()
            raise MeasurementError(
                f"is no MERL table: it begins with {found if found else 'less than 12 bytes'}",
                file=name,
                expected=f"{remedy}; a table of text is told by its content, so rename it to .csv",
            )
        if size != FILE_BYTES:
            problem = "is cut short" if size < FILE_BYTES else "is too long"
            raise MeasurementError(
                f"the MERL table {problem}: {size} bytes",
                file=name,
                expected=f"{remedy}; copy the file again",
            )
        return np.memmap(file, dtype="<f8", mode="r", offset=len(HEADER), shape=(3, *SHAPE))
    except FileNotFoundError:
        raise MeasurementError("there is no such file", file=str(file)) from None
    except OSError as error:
        raise MeasurementError(
            f"cannot be read: {error.strerror or error}", file=str(file)
        ) from error
