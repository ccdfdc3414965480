"""Files that jobs make, by the ending of their names."""

from __future__ import annotations

from pathlib import Path

from lobefit.service.claim import Made

__all__ = ["MEDIA_TYPES", "made_of"]

MEDIA_TYPES = {
    ".json": "application/json",
    ".csv": "text/csv",
    ".png": "image/png",
    ".exr": "image/x-exr",
    ".nc": "application/x-netcdf",
    ".h5": "application/x-hdf5",
}


def made_of(path: Path) -> Made:
    """Give a file with its media type."""
    return Made(path, MEDIA_TYPES[path.suffix])
