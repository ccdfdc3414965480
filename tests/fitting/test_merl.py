"""MERL tables: the file's layout read independently, the thinning, and what is refused."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

from lobefit.fitting import fit, read_measurement
from lobefit.fitting.merl import CHANNELS, SHAPE, cell_directions, write_merl
from lobefit.fitting.readers.merl import STRIDE, read_merl
from lobefit.kernels import MeasurementError, evaluate

Array = npt.NDArray[np.float64]

TRUTH: dict[str, float | list[float]] = {
    "k_d": [0.3, 0.2, 0.1],
    "k_s": 0.2,
    "F0": [0.9, 0.8, 0.7],
    "alpha": 0.3,
}
BYTES = 12 + 3 * 8 * 90 * 90 * 180


def cells() -> tuple[Array, Array, Array]:
    theta_i, theta_o, phi_o = cell_directions(*np.ix_(*(np.arange(n) for n in SHAPE)))
    return theta_i, theta_o, phi_o


def vectors(theta: Array, phi: Array) -> Array:
    return np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)])


def half_and_difference(i: Array, o: Array) -> tuple[Array, Array, Array]:
    """Rotate the half vector onto the normal, as the database's description says."""
    h = i + o
    h = h / np.sqrt((h**2).sum(axis=0))
    theta_h, phi_h = np.arctan2(np.hypot(h[0], h[1]), h[2]), np.arctan2(h[1], h[0])
    x = i[0] * np.cos(phi_h) + i[1] * np.sin(phi_h)
    y = -i[0] * np.sin(phi_h) + i[1] * np.cos(phi_h)
    z = i[2]
    x, z = x * np.cos(theta_h) - z * np.sin(theta_h), x * np.sin(theta_h) + z * np.cos(theta_h)
    return theta_h, np.arctan2(np.hypot(x, y), z), np.arctan2(y, x)


def looked_up(planes: Array, i: Array, o: Array) -> Array:
    """Give the value of the cell that a pair of directions falls into, shape (3, N)."""
    theta_h, theta_d, phi_d = half_and_difference(i, o)
    h = np.minimum(np.sqrt(theta_h / (np.pi / 2) * 90 * 90).astype(int), 89)
    d = np.minimum((theta_d / (np.pi / 2) * 90).astype(int), 89)
    p = np.minimum((np.where(phi_d < 0, phi_d + np.pi, phi_d) / np.pi * 180).astype(int), 179)
    scales = np.array([1 / 1500, 1.15 / 1500, 1.66 / 1500])
    return np.asarray(planes[:, p + d * 180 + h * 180 * 90] * scales[:, None])


@pytest.fixture(scope="module")
def copper(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """Give a table of a known model, evaluated at the centres of its cells."""
    theta_i, theta_o, phi_o = (a.ravel() for a in cells())
    above = np.maximum(theta_i, theta_o) < np.pi / 2
    table = np.full((3, above.size), np.nan)
    table[:, above] = evaluate("ggx", TRUTH, theta_i[above], 0.0, theta_o[above], phi_o[above])
    path = tmp_path_factory.mktemp("merl") / "copper.binary"
    write_merl(path, table.reshape(3, *SHAPE))
    yield path
    path.unlink()


def test_cells_tile_the_angles_by_the_published_rule() -> None:
    theta_i, theta_o, phi_o = cells()
    above = np.maximum(theta_i, theta_o) < np.pi / 2
    # Three quarters of the cells have both directions above the horizon.
    assert above.sum() == 1_096_216
    number = np.arange(above.size).reshape(SHAPE)[above]
    planes = np.tile(np.arange(float(above.size)), (3, 1))
    i, o = vectors(theta_i[above], np.zeros(number.size)), vectors(theta_o[above], phi_o[above])
    np.testing.assert_allclose(looked_up(planes, i, o)[0] * 1500, number, rtol=1e-12)
    # Swapped, the azimuth of difference is turned by pi: the same cell.
    np.testing.assert_allclose(looked_up(planes, o, i)[0] * 1500, number, rtol=1e-12)


def test_the_file_is_laid_out_as_published(copper: Path) -> None:
    assert copper.stat().st_size == BYTES
    assert np.fromfile(copper, dtype="<i4", count=3).tolist() == [90, 90, 180]
    planes = np.fromfile(copper, dtype="<f8", offset=12).reshape(3, -1)
    assert np.isfinite(planes).all()
    m = read_measurement(copper)
    i, o = vectors(m.theta_i, m.phi_i), vectors(m.theta_o, m.phi_o)
    np.testing.assert_allclose(m.values, looked_up(planes, i, o), rtol=1e-14)
    truth = evaluate("ggx", TRUTH, m.theta_i, m.phi_i, m.theta_o, m.phi_o)
    np.testing.assert_allclose(m.values, truth, rtol=1e-12)


def test_what_is_left_out_is_counted(copper: Path) -> None:
    m = read_measurement(copper)
    assert m.channels == CHANNELS
    assert m.rows_read == 1_458_000
    assert m.n_merged == 0
    assert m.n_directions == m.rows_read - m.n_dropped == 5069
    assert [entry.count for entry in m.dropped] == [1_451_250, 1681]
    assert m.metadata["material"] == "copper"
    assert m.metadata["merl_stride"] == "2,6,18"
    assert m.notes[0].startswith(
        "MERL table: every 2nd cell of theta_h, every 6th cell of theta_d, every 18th cell of phi_d"
    )
    kept = m.within(np.radians(80.0))
    assert kept.rows_read == m.rows_read
    assert kept.n_merged == 0


def test_thinning_can_be_chosen(copper: Path) -> None:
    whole = read_merl(copper, (1, 1, 1))
    assert whole.n_directions > 1_090_000
    assert "every cell" in whole.notes[0]
    fine = read_merl(copper, (1, 23, 60))
    assert fine.notes[0].startswith("MERL table: every 23rd cell of theta_d, every 60th")
    assert np.unique(np.round(fine.values[0], 9)).size <= 90 * 4 * 3
    for stride in ((0, 6, 18), (2, 91, 18)):
        with pytest.raises(MeasurementError, match=r"stride of .* \(expected three numbers"):
            read_merl(copper, stride)


def test_the_default_thinning_keeps_the_mirror_direction_and_the_grazing_ones(
    copper: Path,
) -> None:
    m = read_measurement(copper)
    i, o = vectors(m.theta_i, m.phi_i), vectors(m.theta_o, m.phi_o)
    theta_h, theta_d, _ = np.degrees(half_and_difference(i, o))
    assert STRIDE[0] == 2
    assert theta_h.min() < 0.003
    assert theta_d.max() > 85
    assert np.degrees(m.theta_i).max() > 85


def test_a_table_is_told_by_content(copper: Path, tmp_path: Path) -> None:
    (tmp_path / "nameless").symlink_to(copper)
    assert read_measurement(tmp_path / "nameless").channels == CHANNELS


def test_negative_values_are_missing(copper: Path, tmp_path: Path) -> None:
    table = np.fromfile(copper, dtype="<f8", offset=12).reshape(3, *SHAPE)
    table[1, :10] = -0.5
    table[:, 50:60] = np.nan
    write_merl(tmp_path / "holes.binary", table)
    m = read_measurement(tmp_path / "holes.binary")
    assert "without a value" in m.dropped[2].rule
    assert m.dropped[2].count > 100
    assert "channel G:" in m.notes[1]
    assert np.isnan(m.values[1]).sum() > 100
    assert not np.isnan(m.values[[0, 2]]).any()
    table[2] = 0.0
    write_merl(tmp_path / "holes.binary", table)
    with pytest.raises(MeasurementError, match=r"holes.binary, column B: .*no positive value"):
        read_measurement(tmp_path / "holes.binary")


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"\x5a\0\0\0\x5a\0\0\0\xb4\0\0\0" + bytes(800), r"cut short: 812 bytes .*34992012 bytes"),
        (b"\x5a\0\0\0\x5a\0\0\0\x5a\0\0\0" + bytes(800), r"no MERL table: .*\[90, 90, 90\]"),
        (b"theta_i,phi_i,theta_o,phi_o,R\n", r"no MERL table: .*rename it to \.csv"),
        (b"Z", r"begins with less than 12 bytes"),
    ],
)
def test_damaged_files_are_refused(tmp_path: Path, content: bytes, message: str) -> None:
    path = tmp_path / "bad.binary"
    path.write_bytes(content)
    with pytest.raises(MeasurementError, match=message) as caught:
        read_measurement(path)
    assert caught.value.file == "bad.binary"
    assert caught.value.expected


def test_a_longer_file_is_refused(copper: Path, tmp_path: Path) -> None:
    path = tmp_path / "long.binary"
    path.write_bytes(copper.read_bytes() + b"\0")
    with pytest.raises(MeasurementError, match="is too long: 34992013 bytes"):
        read_measurement(path)


def test_other_files_go_to_the_csv_reader(tmp_path: Path) -> None:
    (tmp_path / "empty.binary").touch()
    for path in (tmp_path / "absent.binary", tmp_path / "empty.binary", tmp_path):
        with pytest.raises(MeasurementError, match=r"no such file|is empty|is a folder"):
            read_measurement(path)
    with pytest.raises(MeasurementError, match="no such file"):
        read_merl(tmp_path / "absent.binary")
    with pytest.raises(MeasurementError, match="cannot be read"):
        read_merl(tmp_path)


def test_only_a_whole_table_is_written(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"shape \(3, 90, 90, 180\), not \(3, 2\)"):
        write_merl(tmp_path / "no.binary", np.ones((3, 2)))
    assert not list(tmp_path.iterdir())


def test_a_fit_finds_the_truth(copper: Path) -> None:
    report = fit(read_measurement(copper), models="ggx,lambert")
    assert report.best.candidate == "ggx"
    found = report.best.params
    assert found["alpha"] == pytest.approx(0.3, rel=1e-6)
    assert found["k_d"] == pytest.approx(TRUTH["k_d"], rel=1e-5)


def test_the_command_line_reads_a_table(copper: Path) -> None:
    program = "from lobefit.service.cli import main; main()"
    command = [sys.executable, "-c", program, "fit", str(copper), "--models", "lambert"]
    done = subprocess.run(
        [*command, "--max-theta", "80"], capture_output=True, text=True, timeout=60, check=False
    )
    assert done.returncode == 0, done.stderr
    assert "1458000 rows read" in done.stdout
    assert "theta above 80" in done.stdout
