"""`lobefit models --bench`: a cost of every model, in the table, on the page and as JSON."""

from __future__ import annotations

import os
import pty
import subprocess
import sys

import pytest
from typer.testing import CliRunner, Result

from lobefit.kernels import DeviceError, ModelError, get_device, get_model, models
from lobefit.kernels.cost import Cost, Workload, model_cost
from lobefit.service.cli import app
from tests.fitting.reports import strict

# No machine evaluates a model in less than a picosecond, nor any in more than 0.1 ms.
SMALLEST, LARGEST = 1e-3, 1e5


def call(*arguments: str) -> Result:
    return CliRunner().invoke(app, list(arguments))


def plausible(cost: Cost) -> bool:
    return SMALLEST < cost.fastest <= cost.ns <= cost.slowest < LARGEST


def test_a_cost_is_measured() -> None:
    cost = model_cost("ggx", rounds=3)
    assert plausible(cost)
    assert cost.device == str(get_device().info)
    assert plausible(model_cost("ggx", options={"masking": "smith_separable"}, rounds=1))


def test_bad_calls_are_refused() -> None:
    with pytest.raises(ModelError, match="gxx"):
        model_cost("gxx")
    with pytest.raises(ModelError, match="masking"):
        model_cost("ggx", options={"masking": "no such"})
    with pytest.raises(DeviceError, match="no such"):
        model_cost("ggx", device="no such")


@pytest.mark.parametrize("name", list(models()))
def test_the_workload_is_legal_for_every_model(name: str) -> None:
    work = Workload(name)
    try:
        assert work().shape == (len(work.x),)
        assert (work() >= 0.0).all()  # also that none of them is NaN
    finally:
        work.release()
    for p, values in zip(get_model(name).nonlinear, work.x.T, strict=True):
        assert p.bounds[0] < values.min() < values.max() < p.bounds[1]


def test_the_table_has_a_column_of_costs() -> None:
    answer = call("models", "--bench")
    assert answer.exit_code == 0, answer.stderr
    head, *lines = answer.stdout.splitlines()
    assert head.split()[:3] == ["model", "ns", "sets"]
    costs = {line.split()[0]: line.split()[1] for line in lines[: len(models())]}
    assert list(costs) == list(models())
    assert all(0.0 < float(ns) < LARGEST for ns in costs.values())
    assert "ns: per direction" in answer.stdout
    assert answer.stderr == ""  # nobody watches


def test_json_is_one_document_on_stdout() -> None:
    answer = call("models", "--bench", "--json")
    assert answer.exit_code == 0, answer.stderr
    listed = strict(answer.stdout)["models"]
    assert [m["name"] for m in listed] == list(models())
    for m in listed:
        assert m["cost"]["unit"] == "ns per direction"
        assert m["cost"]["device"] == str(get_device().info)
        assert 0.0 < m["cost"]["fastest"] <= m["cost"]["ns"] <= m["cost"]["slowest"]


def test_without_bench_nothing_is_measured() -> None:
    assert "cost" not in strict(call("models", "ggx", "--json").stdout)["models"][0]
    assert " ns " not in call("models").stdout.splitlines()[0]
    assert "Cost" not in call("models", "ggx").stdout


def test_one_model_alone() -> None:
    page = call("models", "--bench", "ggx:k_s=1").stdout
    assert page.startswith(get_model("ggx").page)
    lines = page.splitlines()
    value = lines[lines.index("Cost") + 2]
    assert 0.0 < float(value.split()[0]) < LARGEST
    assert value.split()[1] == "ns"


def test_a_missing_device_is_status_2() -> None:
    answer = call("models", "--bench", "--device", "no such")
    assert answer.exit_code == 2
    assert answer.stdout == ""
    assert "no such" in answer.stderr


def test_a_terminal_sees_the_progress_on_standard_error() -> None:
    ours, theirs = pty.openpty()
    with subprocess.Popen(
        [
            sys.executable,
            "-c",
            "from lobefit.service.cli import main; main()",
            *("models", "--bench", "ggx", "--json"),
        ],
        env={**os.environ, "TERM": "xterm"},
        stdout=subprocess.PIPE,
        stderr=theirs,
    ) as process:
        os.close(theirs)
        assert process.stdout is not None
        out = process.stdout.read()
    shown = os.read(ours, 65536)
    os.close(ours)
    assert process.returncode == 0
    assert b"ggx" in shown
    assert strict(out.decode())["models"][0]["name"] == "ggx"
