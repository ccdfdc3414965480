"""OpenEXR as it is written: what the file holds is what was given, and it says what it is."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import OpenEXR
import pytest

from lobefit.fitting.exr import SRGB, exr_header, exr_name, write_exr
from lobefit.kernels.errors import LobefitError


def test_strided_planes_are_stored_in_order(tmp_path: Path) -> None:
    """OpenEXR itself stores [0, 3, 6, 9] of a strided array as [0, 1, 2, 3], without an error."""
    numbers = np.arange(36, dtype=np.float32).reshape(3, 12)
    planes = {
        "a": numbers[:, ::3],
        "b": numbers[:, :4].T,
        "c": np.broadcast_to(numbers[:1], (3, 12)),
    }
    for name, plane in planes.items():
        write_exr(tmp_path / "planes.exr", {name: plane}, {})
        with OpenEXR.File(str(tmp_path / "planes.exr"), separate_channels=True) as file:
            np.testing.assert_array_equal(file.channels()[name].pixels, plane)


def test_a_header_says_what_the_picture_is(tmp_path: Path) -> None:
    about = exr_header("lobefit.some/1", "A first line.\n\nRows are angles.\n", {"unit": "1/sr"})
    plane = np.array([[1e-30, 7e4], [np.nan, -1.0]])
    names = {exr_name("450.5nm"): plane}
    write_exr(tmp_path / "some.exr", names, {**about, "chromaticities": SRGB})
    with OpenEXR.File(str(tmp_path / "some.exr"), separate_channels=True) as file:
        header = dict(file.header())
        pixels = file.channels()["450,5nm"].pixels
    assert header["lobefit:schema"] == "lobefit.some/1"
    assert header["lobefit:unit"] == "1/sr"
    assert header["comments"] == "Rows are angles."
    np.testing.assert_allclose(header["chromaticities"], SRGB, rtol=1e-7)
    assert pixels.dtype == np.float32
    np.testing.assert_array_equal(pixels, plane.astype(np.float32))


def test_a_place_that_cannot_be_written_to_is_named(tmp_path: Path) -> None:
    with pytest.raises(LobefitError, match=r"some\.exr cannot be written"):
        write_exr(tmp_path / "missing" / "some.exr", {"Y": np.ones((2, 2))}, {})
