"""Readers: from a file to a `Measurement`, or to an error that names the place."""

from __future__ import annotations

import os
from pathlib import Path

from lobefit.fitting.measurement import Measurement
from lobefit.fitting.readers import csv
from lobefit.fitting.readers.merl import looks_like_merl, read_merl

__all__ = ["read_measurement", "read_merl"]


def read_measurement(path: str | os.PathLike[str]) -> Measurement:
    """Read a measurement: a CSV, plain or gzip, or a MERL table.

    Parameters
    ----------
    path : path-like
        The file; what it is, is told by its content. A MERL table is thinned, see
        `lobefit.fitting.readers.merl.read_merl`.

    Returns
    -------
    Measurement
        Directions in radians, BRDF in 1/sr. `dropped` and `notes` tell of everything in the
        file that is not used as it stands there.

    Raises
    ------
    MeasurementError
        If the file cannot be read or understood.
    """
    return read_merl(path) if looks_like_merl(Path(path)) else csv.read_measurement(path)
