"""``lobefit sample`` and ``lobefit fit --posterior`` as people meet them."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from lobefit.fitting import simulate, write_measurement
from lobefit.fitting.sampler import SamplingProgress
from lobefit.service.cli import app
from lobefit.service.sample import progress_text

# A background job of a shell ignores SIGINT and passes that on; the tests may run in one.
PROGRAM = (
    "import signal; signal.signal(signal.SIGINT, signal.default_int_handler);"
    "from lobefit.service.cli import main; main()"
)
PICTURES = {"corner.png", "trace.png", "predictive.png", "posterior.nc", "posterior.json"}


def call(*arguments: str) -> Result:
    return CliRunner().invoke(app, list(arguments))


@pytest.fixture(scope="module")
def sample_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("sample") / "paint.csv"
    m = simulate("lambert", {"k_d": 0.3}, "in-plane incidences=10,50 step=4", (0.02, 1e-3), seed=1)
    write_measurement(m, path)
    return path


def test_a_table_and_files(sample_file: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    result = call("sample", str(sample_file), "--model", "lambert", "--out", str(out))
    assert result.exit_code == 0, result.output
    assert result.stdout.startswith("Posterior of lambert: 4 ensembles of 32 walkers, ")
    assert "\nk_d " in result.stdout
    assert "\nConverged: " in result.stdout
    assert {p.name for p in out.iterdir()} == {*PICTURES, "chain.h5"}
    again = call("sample", str(sample_file), "--model", "lambert", "--out", str(out))
    assert "k_d" in again.stdout and again.exit_code == 0
    # The table is the same; only the seconds differ.
    assert again.stdout.splitlines()[2:] == result.stdout.splitlines()[2:]
    other = call("sample", str(sample_file), "--model", "lambert", "--out", str(out), "--seed=2")
    assert other.exit_code == 2
    assert "its seed is '0', not '2'; delete the file or name another" in other.stderr
    fresh = call(
        "sample", str(sample_file), "--model=lambert", f"--out={out}", "--seed=2", "--fresh"
    )
    assert fresh.exit_code == 0


def test_json_is_one_document(sample_file: Path) -> None:
    result = call("sample", str(sample_file), "--model", "lambert", "--json", "--seed", "3")
    found = json.loads(result.stdout)
    assert found["converged"] is True
    assert found["seed"] == 3
    assert found["summary"]["k_d"]["mean"] == pytest.approx(0.3, rel=0.02)
    assert found["priors"]["k_d"] == "Lomax(scale=1.0, low=0.0)"


def test_a_fit_with_its_posterior(sample_file: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    result = call(
        "fit", str(sample_file), "--models", "lambert", "--posterior", "--json", f"--out={out}"
    )
    assert result.exit_code == 0, result.output
    assert json.loads(result.stdout)["posterior"]["converged"] is True
    assert {*PICTURES, "report.json", "fit.png"} <= {p.name for p in out.iterdir()}


def test_bad_input(sample_file: Path, tmp_path: Path) -> None:
    short = call("sample", str(sample_file), "--model", "lambert", "--steps", "50")
    assert short.exit_code == 2
    assert "within the warm-up" in short.stderr
    assert call("sample", str(sample_file), "--model", "nothing").exit_code == 2
    assert call("sample", str(sample_file), "--option", "masking").exit_code == 2
    (tmp_path / "file").write_text("")
    assert call("sample", str(sample_file), f"--out={tmp_path / 'file'}").exit_code == 2


def test_ctrl_c_keeps_the_chain_and_says_how_to_go_on(tmp_path: Path) -> None:
    path = tmp_path / "long.csv"
    m = simulate("ggx+ggx", {}, "in-plane step=1", (0.05, 1e-3), seed=1)
    write_measurement(m, path)
    out = tmp_path / "out"
    command = [sys.executable, "-c", PROGRAM, "sample", str(path), "--model=ggx+ggx"]
    process = subprocess.Popen(
        [*command, f"--out={out}"],
        stderr=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        env=dict(os.environ),
    )
    end = time.monotonic() + 60
    while not (out / "chain.h5").exists() and time.monotonic() < end:
        time.sleep(0.02)
    time.sleep(0.3)
    process.send_signal(signal.SIGINT)
    _, said = process.communicate(timeout=60)
    assert process.returncode == 130, said
    assert "Interrupted" in said
    assert f"the chain is kept in {out / 'chain.h5'}; the same command goes on from there" in said
    assert "Traceback" not in said


def test_the_progress_line() -> None:
    state = SamplingProgress(
        steps=300,
        max_steps=5000,
        tau=7.25,
        acceptance=0.43,
        ess=5123.0,
        seconds=2.0,
        seconds_left=3.4,
    )
    assert progress_text(state) == (
        "step 300 of at most 5000, tau 7.2, 5123 effective samples, acceptance 0.43, "
        "about 3 s to go"
    )
