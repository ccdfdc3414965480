"""The command line as people and programs meet it: output, exit status, files, interruption."""

from __future__ import annotations

import os
import pty
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner, Result

from lobefit import __version__
from lobefit.fitting import read_measurement, simulate, write_measurement
from lobefit.kernels import get_device, models
from lobefit.service.cli import app
from tests.fitting.reports import strict

# A background job of a shell ignores SIGINT and passes that on; the tests may run in one.
PROGRAM = (
    "import signal; signal.signal(signal.SIGINT, signal.default_int_handler);"
    "from lobefit.service.cli import main; main()"
)
COMMAND = (sys.executable, "-c", PROGRAM)
TRUTH: dict[str, Any] = {"k_d": [0.3, 0.2, 0.1], "F0": [0.5, 0.4, 0.3], "alpha": 0.3}


def call(*arguments: str) -> Result:
    return CliRunner().invoke(app, list(arguments))


def run(*arguments: str, cwd: Path, **environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [*COMMAND, *arguments],
        cwd=cwd,
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """Give a folder with a sample of known truth, and a bad one."""
    place = tmp_path_factory.mktemp("cli")
    m = simulate(
        "ggx:k_s=1",
        TRUTH,
        "in-plane incidences=10,40,65 step=4",
        seed=7,
        metadata={"material": "painted test"},
    )
    write_measurement(m, place / "sample.csv")
    rows = (place / "sample.csv").read_text().splitlines()
    rows[-3] = rows[-3].rpartition(",")[0] + ",0.1x"
    (place / "bad.csv").write_text("\n".join(rows) + "\n")
    yield place


@pytest.fixture(scope="module")
def fitted(folder: Path) -> subprocess.CompletedProcess[str]:
    return run("fit", "sample.csv", "--models", "ggx,lambert", "--out", "out", "--json", cwd=folder)


def test_version() -> None:
    result = call("--version")
    assert (result.exit_code, result.stdout) == (0, f"lobefit {__version__}\n")


def test_help_names_every_command_and_loads_no_solver(folder: Path) -> None:
    watch = (
        "import sys, atexit; from lobefit.service.cli import main;"
        "heavy = {'numpy', 'pyopencl', 'nlopt', 'emcee', 'matplotlib', 'OpenEXR'};"
        "atexit.register(lambda: print('loaded:', heavy & set(sys.modules)));"
        "sys.argv = ['lobefit', '--help']; main()"
    )
    done = subprocess.run(
        [sys.executable, "-c", watch], cwd=folder, capture_output=True, text=True, check=True
    )
    for command in ("fit", "models", "devices", "simulate"):
        assert f"\n  {command} " in done.stdout
    assert "loaded: set()" in done.stdout


def test_importing_the_room_loads_no_solver() -> None:
    watch = (
        "import sys, lobefit.service;"
        "sys.exit(bool({'pyopencl', 'nlopt', 'emcee'} & set(sys.modules)))"
    )
    assert subprocess.run([sys.executable, "-c", watch], check=False).returncode == 0


def test_fit_prints_one_json_document_and_nothing_else(
    fitted: subprocess.CompletedProcess[str], folder: Path
) -> None:
    assert fitted.returncode == 0, fitted.stderr
    document = strict(fitted.stdout)
    assert document["schema"] == "lobefit.report/1"
    assert document["best"].startswith("ggx")
    assert document["measurement"]["file"] == "sample.csv"
    # Nobody watches: no bar, no codes of a terminal, on either stream.
    assert "\x1b" not in fitted.stdout + fitted.stderr
    assert "\r" not in fitted.stdout + fitted.stderr
    report = strict((folder / "out" / "report.json").read_text(encoding="utf-8"))
    assert {**document, "created": None} == {**report, "created": None}


def test_fit_writes_its_files_and_the_digest_of_what_it_read(
    fitted: subprocess.CompletedProcess[str], folder: Path
) -> None:
    names = {path.name for path in (folder / "out").iterdir()}
    assert names == {"report.json", "fit.png", "lobes.exr", "albedo.exr", "samples.csv"}
    digest = subprocess.run(
        ["sha256sum", "sample.csv"], cwd=folder, capture_output=True, text=True, check=True
    )
    assert strict(fitted.stdout)["measurement"]["sha256"] == digest.stdout.split()[0]
    back = read_measurement(folder / "out" / "samples.csv")
    np.testing.assert_array_equal(back.values, read_measurement(folder / "sample.csv").values)


def test_fit_finds_the_truth_and_says_so(folder: Path) -> None:
    result = call("fit", str(folder / "sample.csv"), "--models", "ggx:k_s=1,lambert")
    assert result.exit_code == 0, result.stderr
    text = result.stdout
    assert text.startswith("sample.csv: 123 directions, 3 channels (R, G, B), painted test\n")
    ranking = text[text.index("candidate") :].splitlines()
    assert ranking[1].split()[:2] == ["1", "ggx:k_s=1"]
    assert ranking[2].split()[:2] == ["2", "lambert"]
    alpha = next(line for line in text.splitlines() if line.split()[:1] == ["alpha"])
    value, sign, error = alpha.split()[1:4]
    assert sign == "±"
    assert abs(float(value) - TRUTH["alpha"]) < 4 * float(error)
    assert get_device().info.name in text.replace("\n", " ")
    assert "Written" not in text


def test_fit_tells_what_was_dropped(folder: Path, tmp_path: Path) -> None:
    rows = (folder / "sample.csv").read_text().splitlines()
    (tmp_path / "low.csv").write_text("\n".join([*rows, "30,0,95,0,1,1,1"]) + "\n")
    result = call("fit", str(tmp_path / "low.csv"), "--models", "lambert")
    assert result.exit_code == 0, result.stderr
    assert f"dropped 1: at or below the horizon (lines {len(rows) + 1})" in result.stdout
    assert "124 rows read, 1 dropped" in result.stdout


def test_fit_leaves_out_grazing_angles_when_asked(folder: Path) -> None:
    sample = str(folder / "sample.csv")
    answer = call("fit", sample, "--models", "lambert", "--max-theta", "40")
    assert answer.exit_code == 0
    assert "theta above 40° (asked for)\n" in answer.stdout
    refused = call("fit", sample, "--max-theta", "-1")
    assert refused.exit_code == 2


def test_fit_warns_of_data_that_are_not_what_they_are_declared_to_be(tmp_path: Path) -> None:
    m = simulate("lambert", {"k_d": 0.8}, "in-plane incidences=10,40,65 step=4", seed=7)
    write_measurement(replace(m, values=np.pi * m.values), tmp_path / "factor.csv")
    answer = call("fit", str(tmp_path / "factor.csv"), "--models", "lambert")
    assert answer.exit_code == 0, answer.stderr
    said = " ".join(answer.stdout[answer.stdout.index("\nThe data\n") :].split())
    assert "radiance factor" in said
    answer = call("fit", str(tmp_path / "factor.csv"), "--models", "lambert", "--json")
    document = strict(answer.stdout)
    assert "pi factor" in document["checks"]["suspicious"]
    assert document["results"][0]["checks"]["suspicious"] == ["energy"]


def test_a_tolerance_keeps_the_simpler_model(folder: Path) -> None:
    # A lobe of 0.5 beside a diffuse term changes predictions by far more than 1 %,
    # and by less than a hundred times.
    found = {}
    for tolerance in ("0.01", "100"):
        answer = call(
            *("fit", str(folder / "sample.csv"), "--models", "ggx:k_s=1,lambert"),
            *("--tolerance", tolerance, "--json"),
        )
        assert answer.exit_code == 0, answer.stderr
        document = strict(answer.stdout)
        assert document["settings"]["tolerance"] == float(tolerance)
        found[tolerance] = document["best"]
    assert found == {"0.01": "ggx:k_s=1", "100": "lambert"}
    assert call("fit", str(folder / "sample.csv"), "--tolerance", "-1").exit_code == 2


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["fit", "bad.csv"], ["bad.csv", "line ", "column B", "0.1x"]),
        (["fit", "missing.csv"], ["missing.csv"]),
        (["fit", "sample.csv", "--models", "gxx"], ["'gxx'", "ggx"]),
        (["fit", "sample.csv", "--metric", "chi3"], ["chi3", "chi2"]),
        (["fit", "sample.csv", "--device", "no such"], ["no such"]),
        (["fit", "sample.csv", "--out", "bad.csv"], ["--out bad.csv", "folder"]),
        (["fit", "sample.csv", "--json", "--models", "gxx"], ["'gxx'"]),
        (["models", "phongg"], ["'phongg'"]),
        (["simulate", "ggx", "--out", "x.csv", "--param", "alhpa=0.1"], ["'alhpa'", "'alpha'"]),
        (["simulate", "ggx", "--out", "x.csv", "--param", "alpha"], ["'alpha' is not NAME=VALUE"]),
        (["simulate", "ggx", "--out", "x.csv", "--param", "alpha=big"], ["'big' is not a number"]),
        (["simulate", "ggx", "--out", "x.csv", "--noise", "0.1"], ["RELATIVE,ADDITIVE"]),
        (["simulate", "ggx", "--out", "x.csv", "--geometry", "sphere"], ["'sphere'"]),
        (["simulate", "ggx", "--out", "bad.csv/x.csv"], ["cannot write", "bad.csv"]),
        (["simulate", "ggx"], ["--out"]),
        (["tif", "sample.csv"], ["'tif'"]),
    ],
)
def test_bad_input_is_one_line_and_status_2(
    folder: Path, monkeypatch: pytest.MonkeyPatch, arguments: list[str], said: list[str]
) -> None:
    monkeypatch.chdir(folder)
    before = set(folder.rglob("*"))
    result = call(*arguments)
    assert result.exit_code == 2
    assert result.stdout == ""
    complaint = result.stderr.splitlines()[-1]
    assert complaint.startswith("Error: ")
    for text in said:
        assert text in complaint
    assert "Traceback" not in result.stderr
    assert set(folder.rglob("*")) == before


def test_bad_file_in_a_process_of_its_own(folder: Path) -> None:
    done = run("fit", "bad.csv", "--json", cwd=folder)
    assert (done.returncode, done.stdout) == (2, "")
    assert len(done.stderr.splitlines()) == 1
    assert "column B" in done.stderr


def test_a_terminal_gets_a_bar_on_standard_error(folder: Path) -> None:
    ours, theirs = pty.openpty()
    with subprocess.Popen(
        [*COMMAND, "fit", "sample.csv", "--models", "ggx,lambert", "--json"],
        cwd=folder,
        env={**os.environ, "TERM": "xterm"},
        stdout=subprocess.PIPE,
        stderr=theirs,
    ) as process:
        os.close(theirs)
        assert process.stdout is not None
        shown = b""
        while True:
            try:
                piece = os.read(ours, 4096)
            except OSError:  # the other end is closed
                break
            if not piece:
                break
            shown += piece
        out = process.stdout.read()
    os.close(ours)
    assert process.returncode == 0
    assert b"\x1b[" in shown
    assert strict(out.decode())["best"].startswith("ggx")


def test_interruption_is_status_130_and_leaves_nothing(folder: Path, tmp_path: Path) -> None:
    # Enough rows that the fit is still running, whatever the machine.
    grid = simulate("ggx", {"alpha": 0.1}, "hemisphere theta_step=1 phi_step=1")
    write_measurement(grid, tmp_path / "grid.csv")
    with subprocess.Popen(
        [*COMMAND, "fit", "grid.csv", "--models", "all", "--out", "out"],
        cwd=tmp_path,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    ) as process:
        time.sleep(2.0)
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=60)
    assert process.returncode == 130
    assert out == b""
    assert b"Traceback" not in err
    assert not (tmp_path / "out").exists()


def test_models_lists_every_model_with_its_sets() -> None:
    lines = call("models").stdout.splitlines()
    for name, model in models().items():
        line = next(line for line in lines if line.split()[:1] == [name])
        assert model.title in line
        assert ", ".join(model.sets) in line


@pytest.mark.parametrize("name", list(models()))
def test_models_shows_the_manual_page(name: str) -> None:
    result = call("models", name)
    assert result.exit_code == 0
    model = models()[name]
    assert model.page in result.stdout
    table = result.stdout[result.stdout.index("\nParameters\n") :].splitlines()
    for p in model.parameters:
        row = next(line for line in table if line.split()[:1] == [p.name])
        assert p.meaning in row
        assert f"{p.bounds[0]:g} to {p.bounds[1]:g}" in row
    for variant in model.variants:
        assert f"{name}:{variant.name}" in result.stdout


def test_the_page_says_what_a_choice_brings() -> None:
    page = call("models", "ggx").stdout
    options = page[page.index("\nOptions\n") :]
    assert "  conductor, without F0:\n    eta" in options
    assert "extinction coefficient" in options
    said = strict(call("models", "ggx", "--json").stdout)["models"][0]["options"]["fresnel"]
    assert [p["name"] for p in said["conductor"]] == ["k_d", "k_s", "eta", "k", "alpha"]


def test_models_as_json() -> None:
    listed = strict(call("models", "--json").stdout)["models"]
    assert [m["name"] for m in listed] == list(models())
    page = strict(call("models", "ggx:k_s=1", "--json").stdout)["models"]
    assert [m["name"] for m in page] == ["ggx"]
    k_s = next(p for p in page[0]["parameters"] if p["name"] == "k_s")
    assert (k_s["lower"], k_s["upper"], k_s["per_channel"]) == (0.0, None, True)


def test_devices_marks_the_one_that_is_used() -> None:
    used = get_device().info
    marked = [line for line in call("devices").stdout.splitlines() if line.startswith("* ")]
    assert used.id in marked[0]
    assert str(used) in marked[0]
    listed = strict(call("devices", "--json").stdout)["devices"]
    assert [d["id"] for d in listed if d["used"]] == [used.id]


def test_devices_are_listed_when_the_chosen_one_is_missing(folder: Path) -> None:
    done = run("devices", cwd=folder, LOBEFIT_DEVICE="no such device")
    assert done.returncode == 2
    assert get_device().info.name in done.stdout
    assert "no such device" in done.stderr


def test_simulate_writes_what_the_function_gives(tmp_path: Path) -> None:
    out = tmp_path / "new" / "steel.csv.gz"
    result = call(
        *("simulate", "ggx", "--param", "k_d=0.1,0.2", "--param", "alpha=0.25"),
        *("--geometry", "hemisphere incidences=30", "--noise", "0.05,0.002", "--seed", "11"),
        *("--channels", "450nm,550nm", "--option", "masking=smith_separable"),
        *("--sigma", "--material", "steel", "--out", str(out)),
    )
    assert result.exit_code == 0, result.stderr
    assert [path.name for path in out.parent.iterdir()] == ["steel.csv.gz"]
    expected = simulate(
        "ggx",
        {"k_d": [0.1, 0.2], "alpha": 0.25},
        "hemisphere incidences=30",
        noise=(0.05, 0.002),
        seed=11,
        channels=["450nm", "550nm"],
        options={"masking": "smith_separable"},
        sigma=True,
    )
    back = read_measurement(out)
    assert back.channels == expected.channels
    assert back.metadata["material"] == "steel"
    assert back.metadata["simulated_seed"] == "11"
    # The file holds 7 digits.
    np.testing.assert_allclose(back.values, expected.values, rtol=1e-6)
    assert back.sigma is not None
    assert expected.sigma is not None
    np.testing.assert_allclose(back.sigma, expected.sigma, rtol=1e-6)
    count = expected.n_directions
    assert f"{count} directions, 2 channels (450nm, 550nm)" in result.stdout
