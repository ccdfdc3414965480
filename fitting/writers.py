"""Writing a measurement as a Lobefit CSV."""

from __future__ import annotations

import gzip
import os
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np

from lobefit.fitting.measurement import DIRECTION_COLUMNS, Measurement

__all__ = ["write_measurement"]

_CHUNK = 10_000


def write_measurement(
    measurement: Measurement,
    path: str | os.PathLike[str],
    header: Mapping[str, str] | None = None,
) -> None:
    """Write a CSV that `lobefit.fitting.read_measurement` reads back.

    Parameters
    ----------
    measurement : Measurement
        What to write: angles in degrees to 9 digits, values and uncertainties to 7.
    path : path-like
        Compressed if it ends in ``.gz``.
    header : mapping of str to str, optional
        Further metadata; replaces entries of the measurement's with the same key.
    """
    text = "".join(_lines(measurement, header or {})).encode()
    # No time stamp: the same measurement gives the same bytes.
    packed = gzip.compress(text, mtime=0) if os.fspath(path).endswith(".gz") else text
    Path(path).write_bytes(packed)


def _lines(measurement: Measurement, header: Mapping[str, str]) -> Iterator[str]:
    metadata = {**measurement.metadata, **header}
    metadata |= {"quantity": "brdf [1/sr]", "angle_unit": "deg"}
    thetas = (measurement.theta_i, measurement.theta_o)
    if max(float(angle.max()) for angle in thetas) <= np.deg2rad(1.6):
        metadata["small_angles"] = "yes"
    for key, value in metadata.items():
        yield f"# {' '.join(key.split())}: {' '.join(str(value).split())}\n"
    names = [*DIRECTION_COLUMNS, *measurement.channels]
    columns = [np.rad2deg(getattr(measurement, name)) for name in DIRECTION_COLUMNS]
    columns += list(measurement.values)
    if measurement.sigma is not None:
        names += [f"sigma_{channel}" for channel in measurement.channels]
        columns += list(measurement.sigma)
    yield ",".join(names) + "\n"
    form = ",".join(["%.9g"] * 4 + ["%.7g"] * (len(names) - 4)) + "\n"
    for start in range(0, measurement.n_directions, _CHUNK):
        rows = np.stack([column[start : start + _CHUNK] for column in columns], axis=1)
        yield "".join(form % tuple(row) for row in rows.tolist())
