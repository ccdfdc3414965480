"""An environment from an OpenEXR file that may be hostile.

OpenEXR's reader believes the header: a forged data window makes it ask for terabytes, and what is
truncated or subsampled has crashed it. So the file is opened in a process of its own that may use
only so much memory and time, its header is judged before any pixel, and the pixels come back
through a pipe.
"""

from __future__ import annotations

import io
import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lobefit.kernels.errors import SceneError
from lobefit.kernels.lights import Environment

__all__ = ["main", "read_environment"]

LARGEST_FILE = 256 << 20  # bytes
LARGEST_ROWS = 2048
MOST_CHANNELS = 16
MEMORY = 3 << 30  # bytes of address space
SECONDS = 60.0


def read_environment(path: Path, channels: tuple[str, ...]) -> Environment:
    """Read radiance in latitude and longitude.

    Parameters
    ----------
    path : Path
        An ``.exr`` file, twice as wide as high, of 2048 rows and 256 MiB at most.
    channels : tuple of str
        Those of the data. Pictures of R, G, B serve data of three channels; a picture of one
        channel serves any; else its channels have the names of the data's.

    Raises
    ------
    SceneError
        No such file, not OpenEXR, too large, truncated, no such channels, or no radiance.
    """
    try:
        size = path.stat().st_size
    except OSError as error:
        raise SceneError(f"{path.name} cannot be read: {error.strerror or error}") from error
    if size > LARGEST_FILE:
        raise SceneError(f"{path.name} has {size >> 20} MiB; {LARGEST_FILE >> 20} are the most")
    command = [sys.executable, "-m", __name__, str(path.resolve()), json.dumps(channels)]
    try:
        done = subprocess.run(command, capture_output=True, timeout=SECONDS, check=False)
    except subprocess.TimeoutExpired:
        raise SceneError(f"{path.name} took more than {SECONDS:g} s to read") from None
    if done.returncode == 3:
        reason = done.stderr.decode("utf-8", "replace").strip().splitlines()[-1]
        raise SceneError(f"{path.name} is no environment that can be used: {reason}")
    if done.returncode:
        raise SceneError(f"{path.name} cannot be read as OpenEXR: it is broken or asks too much")
    picture = np.load(io.BytesIO(done.stdout), allow_pickle=False)
    try:
        return Environment(picture)
    except SceneError as error:
        raise SceneError(f"{path.name}: {error}") from error


def _checked(header: dict[str, Any], wanted: tuple[str, ...]) -> list[str]:
    """Judge a header; give the channels to read."""
    low, high = (np.asarray(corner, dtype=np.int64) for corner in header["dataWindow"])
    width, height = (int(n) for n in high - low + 1)
    if not 2 <= height <= LARGEST_ROWS or width != 2 * height:
        raise SceneError(
            f"it has {width} x {height} pixels; twice as wide as high and {LARGEST_ROWS} rows "
            "at most are expected"
        )
    if len(header["channels"]) > MOST_CHANNELS:
        raise SceneError(f"it has {len(header['channels'])} channels; {MOST_CHANNELS} are the most")
    if any(c.xSampling != 1 or c.ySampling != 1 for c in header["channels"]):
        raise SceneError("it has subsampled channels; write it with one sample a pixel")
    names = [str(c.name) for c in header["channels"]]
    if len(names) == 1:
        return names
    choices = [list(wanted)]
    if len(wanted) == 3:
        choices.append(["R", "G", "B"])
    for choice in choices:
        if set(choice) <= set(names):
            return choice
    raise SceneError(
        f"it has the channels {', '.join(names)}, the data {', '.join(wanted)}; one channel, or "
        "those of the data, are expected"
    )


def main(path: str, wanted: str) -> int:
    """Read a file in this process and write it to standard output as a numpy array.

    Returns
    -------
    int
        0, or 3 for a file that was refused, with the reason on standard error.
    """
    import OpenEXR

    try:
        with OpenEXR.File(path, separate_channels=True, header_only=True) as file:
            names = _checked(dict(file.header()), tuple(json.loads(wanted)))
        with OpenEXR.File(path, separate_channels=True) as file:
            found = file.channels()
            planes = [np.array(found[name].pixels, dtype=np.float32) for name in names]
        picture: NDArray[np.float32] = np.stack(planes, axis=2)
        np.save(sys.stdout.buffer, picture, allow_pickle=False)
    except SceneError as error:
        print(error, file=sys.stderr)
        return 3
    # What its reader is known to stumble over; anything else ends this process as well.
    except (RuntimeError, OSError, ValueError, KeyError, TypeError, MemoryError) as error:
        print(f"it cannot be read as OpenEXR ({error})".replace("\n", " "), file=sys.stderr)
        return 3
    return 0


if __name__ == "__main__":
    import resource

    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    sys.exit(main(*sys.argv[1:]))
