"""Pictures for others to read: every OpenEXR file that Lobefit writes is written here.

Channels are 32-bit floats, compressed without loss. What a picture is, is told in its header:
attributes ``lobefit:NAME`` are text, which every version of OpenEXR keeps, and ``comments`` says
it to people.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from lobefit.kernels.errors import LobefitError

__all__ = ["SRGB", "exr_header", "exr_name", "write_exr"]

SRGB = (0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.3290)
"""Attribute ``chromaticities``: x and y of red, green, blue and white (ITU-R BT.709, D65)."""


def exr_name(name: str) -> str:
    """Write decimals with a comma, as spectral OpenEXR does: a dot would open a layer."""
    return name.replace(".", ",")


def exr_header(schema: str, document: str | None, about: Mapping[str, str]) -> dict[str, str]:
    """Give the attributes of a picture's header.

    Parameters
    ----------
    schema : str
        Name and version of the layout.
    document : str or None
        Docstring of the module that knows the layout: all but its first line are the comment.
    about : mapping of str to str
        More, by names without ``lobefit:``.
    """
    return {
        "lobefit:schema": schema,
        **{f"lobefit:{name}": text for name, text in about.items()},
        "comments": (document or "").partition("\n\n")[2].strip(),
    }


def write_exr(
    path: Path,
    planes: Mapping[str, ArrayLike],
    attributes: Mapping[str, str | tuple[float, ...]],
) -> None:
    """Write planes as 32-bit floats and make sure that the file holds them.

    Parameters
    ----------
    path : Path
        An ``.exr`` file; replaced if it exists.
    planes : mapping of str to array_like, shape (height, width)
        By the channel's name.
    attributes : mapping of str to str or tuple of float
        For the header.

    Raises
    ------
    LobefitError
        The file cannot be written, or does not hold what was written.
    """
    import OpenEXR

    # Strided arrays are stored wrongly without an error (AcademySoftwareFoundation/openexr#1929).
    pixels = {name: np.ascontiguousarray(p, dtype=np.float32) for name, p in planes.items()}
    header = {
        "compression": OpenEXR.ZIP_COMPRESSION,  # lossless, unlike PXR24, B44 and DWA
        "type": OpenEXR.scanlineimage,
        **attributes,
    }
    try:
        OpenEXR.File(header, dict(pixels)).write(str(path))
        with OpenEXR.File(str(path), separate_channels=True) as file:
            stored = {name: channel.pixels for name, channel in file.channels().items()}
    except (RuntimeError, OSError) as error:
        raise LobefitError(f"{path.name} cannot be written: {error}") from error
    same = stored.keys() == pixels.keys() and all(
        np.array_equal(stored[name], values, equal_nan=True) for name, values in pixels.items()
    )
    if not same:
        raise LobefitError(f"{path.name} does not read back as it was written; is the disk full?")
