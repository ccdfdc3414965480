"""Texels from OpenEXR: the same fits as of the same readings in a .npz, and bad files named."""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR
import pytest
from numpy.typing import NDArray

from lobefit.fitting import texel_batch
from lobefit.fitting.texel_batch import fit_texel_file
from lobefit.fitting.texel_exr import ATTRIBUTES
from lobefit.fitting.texel_source import open_texels
from lobefit.fitting.texels import fit_texels
from lobefit.kernels.errors import LobefitError, MeasurementError
from tests.fitting.texel_cases import directions, surfaces

pytest.importorskip("OpenImageIO", reason="the extra lobefit[exr] is not installed")

Array = NDArray[Any]

MODEL = "ggx:k_s=1"
HEIGHT, WIDTH, LIGHTS = 37, 11, 16
DEGREES = np.rad2deg(directions(LIGHTS)).round(1)


@pytest.fixture(scope="module")
def values() -> Array:
    clean, _ = surfaces(MODEL, np.deg2rad(DEGREES), HEIGHT * WIDTH, 3, seed=5)
    noise = np.random.default_rng(6).standard_normal(clean.shape)
    readings: Array = (clean * (1 + 0.01 * noise)).astype(np.float32)
    readings[5, 3, 1] = np.nan
    return readings


def part(values: Array, k: int, channels: Mapping[str, int], **header: Any) -> OpenEXR.Part:
    """Make a light of readings (T, N, C)."""
    planes = {
        name: np.ascontiguousarray(values[:, k, c].reshape(HEIGHT, -1))
        for name, c in channels.items()
    }
    angles = dict(zip(ATTRIBUTES, map(float, DEGREES[:, k]), strict=True))
    usual = {
        "name": f"light{k}",
        "type": OpenEXR.scanlineimage,
        "compression": OpenEXR.ZIP_COMPRESSION,
        # The same in all parts of a file, or it cannot be written.
        "displayWindow": (np.array([0, 0], "i4"), np.array([WIDTH - 1, HEIGHT - 1], "i4")),
        **angles,
    }
    kept = {key: value for key, value in {**usual, **header}.items() if value is not None}
    return OpenEXR.Part(kept, planes)


def parts(values: Array, **header: Any) -> list[OpenEXR.Part]:
    return [part(values, k, {"R": 0, "G": 1, "B": 2}, **header) for k in range(LIGHTS)]


@pytest.fixture(scope="module")
def picture(values: Array, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("lights") / "lights.exr"
    OpenEXR.File(parts(values)).write(str(path))
    return path


def test_a_chunk_has_the_readings_of_its_texels(picture: Path, values: Array) -> None:
    source = open_texels(picture)
    assert source.shape == (HEIGHT * WIDTH, LIGHTS, 3)
    assert source.image == (HEIGHT, WIDTH)
    # Attributes have 32 bits; 30.1 is read as what was meant.
    np.testing.assert_array_equal(source.directions, np.deg2rad(DEGREES))
    chunks = list(source.chunks(100))  # rows of 11 texels: begins and ends inside rows
    assert [first for first, _ in chunks] == [0, 100, 200, 300, 400]
    assert np.concatenate([rows for _, rows in chunks]).tobytes() == values.tobytes()
    ((first, rows),) = source.chunks(30, 155, 180)
    assert first == 155
    assert rows.tobytes() == values[155:180].tobytes()


@pytest.mark.parametrize("compression", ["NO", "ZIPS", "PIZ"])
def test_half_precision_is_read_as_it_is(compression: str, tmp_path: Path, values: Array) -> None:
    half = values.astype(np.float16)
    code = getattr(OpenEXR, f"{compression}_COMPRESSION")
    OpenEXR.File(parts(half, compression=code)).write(str(tmp_path / "half.exr"))
    ((_, rows),) = open_texels(tmp_path / "half.exr").chunks(len(half))
    assert rows.dtype == np.float16
    assert rows.tobytes() == half.tobytes()


def test_fits_are_those_of_the_same_readings_as_npz(
    picture: Path, values: Array, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(texel_batch, "READ_BYTES", 100_000)  # unpacked in several pieces
    np.savez(tmp_path / "lights.npz", values=values, directions=np.deg2rad(DEGREES))
    made = {}
    for source in (picture, tmp_path / "lights.npz"):
        out = tmp_path / source.suffix[1:]
        batch = fit_texel_file(source, out, [MODEL], jobs=1)
        assert batch.image == ((HEIGHT, WIDTH) if source == picture else None)
        made[source] = {p.name: p.read_bytes() for p in out.iterdir() if p.suffix != ".sqlite"}
        assert not any("readings" in name for name in made[source])
    exr, npz = made.values()
    assert len(exr) > 10
    assert exr == npz
    opened = open_texels(picture)
    assert opened.directions is not None
    here = fit_texels(opened.directions, opened, [MODEL])
    assert here.params["alpha"].tobytes() == np.load(tmp_path / "exr/params.alpha.npy").tobytes()


def test_a_folder_of_files_is_read_by_name(tmp_path: Path, values: Array) -> None:
    """Names of channels may begin with the part's own, numbers be text, and alpha be there."""
    for k in range(LIGHTS):
        angles = dict(zip(ATTRIBUTES, map(str, DEGREES[:, k]), strict=True))
        prefix = f"light{k}." if k % 2 else ""
        names = {f"{prefix}{c}": i for i, c in enumerate("RGB")} | {f"{prefix}A": 0}
        OpenEXR.File([part(values, k, names, **angles)]).write(str(tmp_path / f"l{k:02}.exr"))
    source = open_texels(tmp_path)
    ((_, rows),) = source.chunks(len(values))
    assert rows.tobytes() == values.tobytes()
    np.testing.assert_array_equal(source.directions, np.deg2rad(DEGREES))


def test_without_directions_the_attributes_are_named(tmp_path: Path, values: Array) -> None:
    path = tmp_path / "bare.exr"
    OpenEXR.File(parts(values, **dict.fromkeys(ATTRIBUTES))).write(str(path))
    assert open_texels(path).directions is None
    with pytest.raises(MeasurementError, match=r"bare\.exr: holds no directions.*theta_i_deg"):
        fit_texel_file(path, tmp_path / "out", [MODEL])


def odd(values: Array, **header: Any) -> list[OpenEXR.Part]:
    """Give two lights like all, and one with another header."""
    rgb = {"R": 0, "G": 1, "B": 2}
    return [*parts(values)[:2], part(values, 2, rgb, **header)]


def test_parts_that_do_not_fit_together_are_named(tmp_path: Path, values: Array) -> None:
    rgb = {"R": 0, "G": 1, "B": 2}
    wide = np.concatenate([values, values])
    whole = np.nan_to_num(values).astype(np.uint32)
    tiles = OpenEXR.TileDescription()
    tiles.xSize = tiles.ySize = 16
    cases = {
        r"part 'light2' lacks phi_i_deg \(expected the attributes": odd(values, phi_i_deg=None),
        "part 'light2' does not say its directions": odd(values, **dict.fromkeys(ATTRIBUTES)),
        "theta_o_deg of part 'light2' is no number": odd(values, theta_o_deg="steep"),
        r"part 'light2' has the data window 22 x 37 at \(0, 0\), part 'light0' 11 x 37": [
            *parts(values)[:2],
            part(wide, 2, rgb),
        ],
        "part 'light2' has the channels R, G, part 'light0' R, G, B": [
            *parts(values)[:2],
            part(values, 2, {"R": 0, "G": 1}),
        ],
        "part 'light2' holds uint numbers": [*parts(values)[:2], part(whole, 2, rgb)],
        "part 'light2' has tiles": odd(values, type=OpenEXR.tiledimage, tiles=tiles),
    }
    for message, made in cases.items():
        OpenEXR.File(made).write(str(tmp_path / "odd.exr"))
        with pytest.raises(MeasurementError, match=rf"odd\.exr: .*{message}"):
            open_texels(tmp_path / "odd.exr")


def test_hostile_files_are_refused(tmp_path: Path, picture: Path) -> None:
    data = picture.read_bytes()
    bad = tmp_path / "bad.exr"
    for content in (b"", b"no picture", data[:300]):
        bad.write_bytes(content)
        with pytest.raises(MeasurementError, match=r"bad\.exr: cannot be read as OpenEXR"):
            open_texels(bad)
    # A data window of 2^20 x 2^20 asks for terabytes.
    window = np.array([0, 0, WIDTH - 1, HEIGHT - 1], "<i4").tobytes()
    bad.write_bytes(data.replace(window, np.array([0, 0, 2**20 - 1, 2**20 - 1], "<i4").tobytes()))
    with pytest.raises(MeasurementError, match=r"bad\.exr: cannot be read as OpenEXR"):
        open_texels(bad)
    # A file that was cut off: nothing is made of what is left.
    bad.write_bytes(data[: len(data) // 2])
    with pytest.raises(MeasurementError, match=r"bad\.exr: rows .* of part 'light\d+' cannot be"):
        fit_texel_file(bad, tmp_path / "out", [MODEL], jobs=1)
    assert not list((tmp_path / "out").glob("*.npy"))
    shutil.copy(Path(__file__), bad)
    with pytest.raises(LobefitError, match=r"bad\.exr"):
        open_texels(bad)
