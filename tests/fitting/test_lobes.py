"""lobes.exr: reads back, and every reading is where its angles say."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR
import pytest
from numpy.typing import NDArray

from lobefit.fitting.lobes import LAYERS, MAX_INCIDENCES, MAX_NUMBERS, make_grid, write_lobes
from lobefit.fitting.measurement import Measurement
from lobefit.fitting.simulate import simulate
from lobefit.kernels.errors import LobefitError
from tests.fitting.reports import (
    GLOSSY,
    SCANS,
    hand_made_result,
    simulated,
)


def read_exr(path: Path) -> tuple[dict[str, NDArray[np.float32]], dict[str, Any]]:
    with OpenEXR.File(str(path), separate_channels=True) as file:
        return {name: c.pixels for name, c in file.channels().items()}, dict(file.header())


@pytest.mark.parametrize("channels", [["brdf"], ["R", "G", "B"], ["450.5nm", "550nm"]])
@pytest.mark.parametrize("scan", list(SCANS))
def test_lobes_hold_the_measurement_and_the_model(
    tmp_path: Path, scan: str, channels: list[str]
) -> None:
    m = simulated(scan, channels)
    result = hand_made_result(m, "ggx", GLOSSY)
    write_lobes(tmp_path / "lobes.exr", result, m)
    pixels, header = read_exr(tmp_path / "lobes.exr")

    names = [name.replace(".", ",") for name in channels]
    assert set(pixels) == {f"{layer}.{name}" for layer in LAYERS for name in names}
    assert all(p.dtype == np.float32 for p in pixels.values())

    # Decode the axes from the file alone, as its reader has to.
    theta = np.array(json.loads(header["lobefit:theta_o_deg"]))
    phi = np.array(json.loads(header["lobefit:phi_deg"]))
    incidences = np.array(json.loads(header["lobefit:incidences_deg"]))
    assert header["lobefit:layout"] == ("in-plane" if scan == "in-plane" else "tiles")
    assert pixels[f"fitted.{names[0]}"].shape == (len(incidences) * len(phi), len(theta))
    i, p, t = np.meshgrid(range(len(incidences)), phi, theta, indexing="ij")
    theta_i, phi_i = incidences[i.ravel()].T
    turn = p.ravel() + np.where(t.ravel() < 0, 180.0, 0.0)
    directions = np.deg2rad([theta_i, phi_i, np.abs(t.ravel()), phi_i + turn])
    expected = result.predict(*directions)
    for c, name in enumerate(names):
        # A float32 has 6e-8 of relative precision; the axes are written to 1e-9 degrees.
        np.testing.assert_allclose(pixels[f"fitted.{name}"].ravel(), expected[c], rtol=1e-6)

    # The scan's steps are those of the grid: every reading has a cell of its own.
    for c, name in enumerate(names):
        measured = pixels[f"measured.{name}"]
        assert np.count_nonzero(~np.isnan(measured)) == m.n_directions
        stored = np.sort(measured[~np.isnan(measured)])
        np.testing.assert_array_equal(stored, np.sort(m.values[c].astype(np.float32)))
        left = measured - pixels[f"fitted.{name}"]
        largest = float(np.nanmax(np.abs(measured)))
        np.testing.assert_allclose(pixels[f"residual.{name}"], left, atol=1e-6 * largest)


def test_a_reading_is_where_its_angles_say(tmp_path: Path) -> None:
    m = simulated("in-plane", ["brdf"])
    write_lobes(tmp_path / "lobes.exr", hand_made_result(m, "ggx", GLOSSY), m)
    pixels, header = read_exr(tmp_path / "lobes.exr")
    theta = json.loads(header["lobefit:theta_o_deg"])
    rows = json.loads(header["lobefit:incidences_deg"])
    degrees = np.rad2deg([m.theta_i, m.theta_o, m.phi_o - m.phi_i])
    at = int(np.flatnonzero(np.all(np.isclose(degrees.T, [60, 40, 180]), axis=1))[0])
    row = int(np.argmin([abs(incidence[0] - 60) for incidence in rows]))
    mirror_side = pixels["measured.brdf"][row, int(np.argmin(np.abs(np.array(theta) - 40)))]
    assert mirror_side == np.float32(m.values[0, at])


def test_normal_incidence_on_a_turned_sample_has_a_row_for_each_plane() -> None:
    m = simulate("ward", {"alpha_x": 0.3, "alpha_y": 0.1}, "in-plane incidences=0,40 step=10")
    grid = make_grid(m)
    assert grid.layout == "in-plane"
    degrees = [(round(math.degrees(t)), round(math.degrees(p))) for t, p in grid.incidences]
    assert degrees == [(t, p) for t in (0, 40) for p in (0, 45, 90, 135)]
    # No two views of one plane share a cell.
    assert len(np.unique(grid.cell)) == m.n_directions


def test_a_file_that_reads_back_differently_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    m = simulated("in-plane", ["brdf"])
    honest = OpenEXR.File

    def forgetful(*arguments: Any, **settings: Any) -> Any:
        if len(arguments) == 2:  # writing: header and channels
            header, channels = arguments
            # What the library does with strided arrays.
            arguments = header, {n: np.zeros_like(c) + c.flat[0] for n, c in channels.items()}
        return honest(*arguments, **settings)

    monkeypatch.setattr(OpenEXR, "File", forgetful)
    with pytest.raises(LobefitError, match="does not read back"):
        write_lobes(tmp_path / "lobes.exr", hand_made_result(m, "ggx", GLOSSY), m)


def test_missing_readings_are_nan_and_shared_cells_are_averaged(tmp_path: Path) -> None:
    theta_o = np.deg2rad([40.0, 40.001, 50.0])
    fixed = [np.full(3, np.deg2rad(angle)) for angle in (30.0, 0.0, 180.0)]
    values = np.array([[1.0, 3.0, np.nan], [5.0, np.nan, 7.0]])
    m = Measurement(fixed[0], fixed[1], theta_o, fixed[2], values, channels=("a", "b"))
    write_lobes(tmp_path / "lobes.exr", hand_made_result(m, "lambert", {"k_d": 0.0}), m)
    pixels, _ = read_exr(tmp_path / "lobes.exr")
    assert pixels["measured.a"][~np.isnan(pixels["measured.a"])].tolist() == [2.0]
    assert pixels["residual.b"][~np.isnan(pixels["residual.b"])].tolist() == [5.0, 7.0]
    assert not np.isnan(pixels["fitted.a"]).any()


def test_a_picture_of_scattered_directions_stays_small() -> None:
    generator = np.random.default_rng(5)
    count = 5000
    theta_i, phi_i, theta_o, phi_o = generator.uniform(0, [1.5, 6.2, 1.5, 6.2], (count, 4)).T
    m = Measurement(theta_i, phi_i, theta_o, phi_o, np.ones((2, count)), channels=("a", "b"))
    grid = make_grid(m)
    assert len(grid.incidences) == MAX_INCIDENCES
    assert grid.n_incidences > 4900
    assert grid.shape[0] * grid.shape[1] * 3 * 2 <= MAX_NUMBERS
    assert grid.cell.max() < grid.shape[0] * grid.shape[1]
