"""F41 to F43: what OpenEXR does to plain arrays and with bad files, and what Lobefit writes."""

from __future__ import annotations

import struct
import subprocess
import sys
from pathlib import Path

import numpy as np
import numpy.typing as npt
import OpenEXR
import pytest

from lobefit.fitting import read_measurement
from lobefit.fitting.exr import write_exr
from lobefit.kernels import MeasurementError
from tests.fitting.test_lobes import read_exr
from tests.stability.modes import measured

Plane = npt.NDArray[np.float32] | npt.NDArray[np.float16]


def write(path: Path, plane: Plane, compression: str = "ZIP") -> None:
    """Write a picture as OpenEXR's manual does."""
    header = {
        "compression": getattr(OpenEXR, f"{compression}_COMPRESSION"),
        "type": OpenEXR.scanlineimage,
    }
    OpenEXR.File(header, {"R": plane}).write(str(path))


def test_strided(tmp_path: Path) -> None:
    path = tmp_path / "plane.exr"
    plane = np.arange(48, dtype=np.float32).reshape(4, 12)[:, ::3]
    write(path, plane)
    measured("F41", wrong=int(np.count_nonzero(read_exr(path)[0]["R"] != plane)))
    write_exr(path, {"brdf": plane}, {})
    np.testing.assert_array_equal(read_exr(path)[0]["brdf"], plane)


OPEN = """
import sys, OpenEXR
print(len(OpenEXR.File(sys.argv[1], separate_channels=True).parts))
"""


def test_forged(tmp_path: Path) -> None:
    path = tmp_path / "forged.exr"
    write(path, np.ones((4, 4), np.float32))
    data = bytearray(path.read_bytes())
    for name in (b"dataWindow\0box2i\0", b"displayWindow\0box2i\0"):
        at = data.index(name) + len(name) + 4
        data[at : at + 16] = struct.pack("<4i", 0, 0, 2**20 - 1, 2**20 - 1)
    path.write_bytes(data)
    done = subprocess.run(
        [sys.executable, "-c", OPEN, str(path)],
        capture_output=True,
        text=True,
        timeout=60,
        check=True,
    )
    warning, parts = done.stdout.splitlines()
    assert "MemoryError: Unable to allocate 4.00 TiB" in warning
    measured("F42", rel=0.01, bytes=len(data), parts=int(parts))

    cut = tmp_path / "cut.exr"
    cut.write_bytes(data[: len(data) // 2])
    with pytest.raises(RuntimeError, match="Unable to open"):
        OpenEXR.File(str(cut))
    for picture in (path, cut):
        with pytest.raises(MeasurementError, match="an OpenEXR picture, not CSV"):
            read_measurement(picture)


def test_half(tmp_path: Path) -> None:
    path = tmp_path / "plane.exr"
    with np.errstate(over="ignore"):
        peak, dark = np.array([7e4, 1e-8]).astype(np.float16)
    values = np.linspace(0.01, 7.0, 2048, dtype=np.float32).reshape(32, 64)
    write(path, values, "DWAA")
    measured(
        "F43",
        peak=float(peak),
        dark=float(dark),
        loss=float(np.abs(values.astype(np.float16) / values - 1).max()),
        dwaa=float(np.abs(read_exr(path)[0]["R"] / values - 1).max()),
    )
    extreme = np.array([[7e4, 1e-8], [1e-30, 3e38]], np.float32)
    write_exr(path, {"brdf": extreme}, {})
    found = read_exr(path)[0]["brdf"]
    assert found.dtype == np.float32
    np.testing.assert_array_equal(found, extreme)
