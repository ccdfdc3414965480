"""``lobefit batch`` and ``lobefit texels``: output, exit status, interruption."""

from __future__ import annotations

import os
import pty
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner, Result

from lobefit.fitting import simulate, write_measurement
from lobefit.service.cli import app
from tests.fitting.texel_cases import directions, surfaces

# A background job of a shell ignores SIGINT and passes that on; the tests may run in one.
PROGRAM = (
    "import signal; signal.signal(signal.SIGINT, signal.default_int_handler);"
    "from lobefit.service.cli import main; main()"
)
SCAN = "in-plane incidences=10,40 step=10"


def call(*arguments: object) -> Result:
    return CliRunner().invoke(app, [str(a) for a in arguments])


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Give a folder with measurements, and one that is none."""
    folder = tmp_path_factory.mktemp("batch")
    for k in range(3):
        m = simulate("lambert", {"k_d": 0.1 * (k + 2)}, SCAN, seed=k)
        write_measurement(m, folder / f"paint{k}.csv")
    (folder / "broken.csv").write_text("theta_i,phi_i,theta_o,phi_o,brdf\n1,2,3,4,0.1x\n")
    return folder


def test_some_failed_is_status_3_and_all_fitted_is_0(place: Path, tmp_path: Path) -> None:
    fixed = ("--out", tmp_path / "out", "--models", "lambert", "--jobs", 1)
    some = call("batch", place / "paint0.csv", place / "broken.csv", *fixed)
    assert some.exit_code == 3, some.output
    assert "1 of 2 fitted" in some.stdout
    assert "broken: " in some.stderr
    assert "line 2" in some.stderr
    assert "\x1b" not in some.output
    both = call("batch", place / "paint*.csv", *fixed)
    assert (both.exit_code, both.stderr) == (0, "")
    assert "3 of 3 fitted; see table.csv and summary.png" in both.stdout


def test_bad_input_is_status_2(place: Path, tmp_path: Path) -> None:
    for arguments in (
        ("batch", place / "none*.csv", "--out", tmp_path / "out"),
        ("batch", place / "paint0.csv", "--out", tmp_path / "out", "--models", "nothing"),
        ("batch", place / "paint0.csv", "--out", tmp_path / "out", "--jobs", 0),
        ("batch", place / "paint0.csv", "--out", tmp_path / "out", "--option", "fresnel"),
        ("texels", place / "none.npz", "--out", tmp_path / "out"),
        ("texels", place / "none.npz", "--out", tmp_path / "out", "--image", "big"),
        ("texels", place / "none.npz", "--out", tmp_path / "out", "--noise", "a,b"),
    ):
        result = call(*arguments)
        assert result.exit_code == 2, result.output
    assert (
        "none*.csv: matches no file"
        in call("batch", place / "none*.csv", "--out", tmp_path / "out").stderr
    )


def test_texels_are_fitted_to_maps(tmp_path: Path) -> None:
    angles = directions(16)
    values, _ = surfaces("lambert", angles, 12, 1, seed=5)
    values *= 1 + 0.01 * np.random.default_rng(2).standard_normal(values.shape)
    values[3] = np.nan
    np.save(tmp_path / "readings.npy", values)
    np.save(tmp_path / "angles.npy", angles)
    for wrong, said in (
        (("angles.npy", "--image", "5x4"), "12 texels are no picture of 5 x 4"),
        (("degrees.npy", "--image", "3x4"), "convert degrees"),
    ):
        np.save(tmp_path / "degrees.npy", np.degrees(angles))
        refused = call(
            "texels", tmp_path / "readings.npy", "--out", tmp_path / "out",
            "--directions", tmp_path / wrong[0], *wrong[1:],
        )  # fmt: skip
        assert (refused.exit_code, said in refused.stderr) == (2, True), refused.output
        assert not (tmp_path / "out").exists()  # before anything is fitted
    result = call(
        "texels", tmp_path / "readings.npy", "--out", tmp_path / "out", "--jobs", 1,
        "--models", "lambert", "--directions", tmp_path / "angles.npy", "--image", "3x4",
    )  # fmt: skip
    assert result.exit_code == 0, result.output
    assert "11 of 12 texels fitted; see *.npy and maps.exr in" in result.stdout
    assert "no result, too few readings: 1" in result.stdout
    assert (tmp_path / "out" / "maps.exr").is_file()
    assert np.load(tmp_path / "out" / "model.npy").tolist() == [0, 0, 0, -1, *8 * [0]]


def test_an_interrupted_batch_says_how_to_go_on_and_leaves_nothing_behind(
    place: Path, tmp_path: Path
) -> None:
    lines = ["file,name"] + [f"{place}/paint{k % 3}.csv,item{k}" for k in range(400)]
    (tmp_path / "many.csv").write_text("\n".join(lines) + "\n")
    command = [sys.executable, "-c", PROGRAM, "batch", "many.csv", "--out", "out"]
    command += ["--models", "lambert", "--jobs", "1"]
    watcher, terminal = pty.openpty()
    process = subprocess.Popen(
        command, cwd=tmp_path, stderr=terminal, stdout=terminal, start_new_session=True
    )
    os.close(terminal)
    try:
        until = time.monotonic() + 90
        while not list((tmp_path / "out").glob("*/report.json")) and time.monotonic() < until:
            time.sleep(0.05)
        os.killpg(process.pid, signal.SIGINT)  # as a terminal does, workers included
        said = b""
        while True:
            try:
                data = os.read(watcher, 4096)
            except OSError:  # the last one closed it: no worker is left
                break
            said += data
        assert process.wait(30) == 130
    finally:
        process.kill()
        process.wait()
        os.close(watcher)
    assert "The same command goes on from there" in said.decode()
    assert "Traceback" not in said.decode()
    assert "items" in said.decode()  # the bar
    done = list((tmp_path / "out").glob("*/report.json"))
    assert 0 < len(done) < 400
    assert not list((tmp_path / "out").glob("*/.lobefit-*"))
