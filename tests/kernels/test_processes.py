"""One device in processes and threads: told or right, never hanging, compiled once."""

from __future__ import annotations

import multiprocessing
import os
import threading
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt
import pyopencl as cl
import pytest

from lobefit.fitting import fit, simulate
from lobefit.kernels import Device, device, devices, evaluate, get_device, models
from tests.kernels.strategies import directions
from tests.kernels.test_device import python

SOME = directions(500, seed=11)


@pytest.fixture
def fresh(monkeypatch: pytest.MonkeyPatch) -> None:
    """Forget the opened devices, so that programs are built again."""
    monkeypatch.setattr(device, "_open", {})


FORK = """
import os, signal
from lobefit.kernels import DeviceError, devices, evaluate, get_device
{before}
child = os.fork()
if child == 0:
    signal.alarm(10)  # a child that hangs is killed, and answers with this signal
    try:
        evaluate("lambert", {{}}, 0.1, 0.0, 0.2, 0.0, device={device})
    except DeviceError as error:
        os._exit(7 if "spawn" in str(error) else 1)
    os._exit(2)
print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
print(evaluate("lambert", {{"k_d": 0.5}}, 0.1, 0.0, 0.2, 0.0).item())
"""

FORK_FIRST = """
import os
import lobefit.fitting
from lobefit.kernels import evaluate, models
models()
child = os.fork()
if child == 0:
    f = evaluate("lambert", {"k_d": 0.5}, 0.1, 0.0, 0.2, 0.0).item()
    os._exit(7 if abs(f - 0.15915494) < 1e-8 else 1)
print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
"""


@pytest.mark.skipif(not hasattr(os, "fork"), reason="this system does not fork")
@pytest.mark.parametrize(
    ("before", "device"),
    [
        ("get_device()", "None"),
        ("evaluate('ggx', {}, 0.1, 0.0, 0.2, 0.0)", "None"),
        ("here = get_device()", "here.info.id"),
        ("here = get_device()", "here"),
        ("devices()", "None"),
    ],
    ids=["opened", "used", "by id", "by object", "listed"],
)
def test_a_forked_child_is_told_instead_of_hanging(before: str, device: str) -> None:
    """PoCL hangs for ever there: the time limit is the test, the work takes a second."""
    answer = python(FORK.format(before=before, device=device)).split()
    assert answer[0] == "7"
    assert float(answer[1]) == pytest.approx(0.5 / np.pi, rel=1e-12)  # the parent goes on


@pytest.mark.skipif(not hasattr(os, "fork"), reason="this system does not fork")
def test_a_child_forked_before_the_first_use_works() -> None:
    assert python(FORK_FIRST).split() == ["7"]


def in_a_worker(name: str) -> list[float]:
    values: list[float] = evaluate(name, {}, *SOME)[0].tolist()
    return values


def test_spawned_workers_agree() -> None:
    names = ["ggx", "ward"]
    with multiprocessing.get_context("spawn").Pool(2) as pool:
        answers = pool.map_async(in_a_worker, names).get(timeout=60)
    assert answers == [in_a_worker(name) for name in names]


def in_threads(tasks: list[Callable[[], Any]]) -> list[Any]:
    """Run tasks at once, starting together, and give their results."""
    results: list[Any] = [None] * len(tasks)
    barrier = threading.Barrier(len(tasks))

    def work(k: int) -> None:
        try:
            barrier.wait(timeout=30)
            results[k] = tasks[k]()
        except Exception as error:  # noqa: BLE001 - shown by the assertions
            results[k] = error

    threads = [threading.Thread(target=work, args=(k,)) for k in range(len(tasks))]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(timeout=120)
        assert not thread.is_alive()
    return results


def test_threads_with_different_models(fresh: None) -> None:
    """Each sets its own arguments, launch after launch, on one queue."""
    names = ["ggx", "ward", "cook_torrance", "blinn_phong"]
    scales = np.linspace(0.1, 2.0, 50)

    def task(name: str) -> npt.NDArray[np.float64]:
        return np.stack([evaluate(name, {"k_s": k, "k_d": 0.0}, *SOME)[0] for k in scales])

    found = in_threads([partial(task, name) for name in names])
    for name, values in zip(names, found, strict=True):
        one = evaluate(name, {"k_s": 1.0, "k_d": 0.0}, *SOME)[0]
        # The coefficient multiplies on the host: only its rounding differs, and below
        # 1e-300 the digits of denormal numbers.
        np.testing.assert_allclose(values, np.outer(scales, one), rtol=1e-14, atol=1e-300)


def test_threads_with_one_model_and_different_parameters(fresh: None) -> None:
    widths = [0.05, 0.1, 0.2, 0.4]
    repeats = 50

    def task(alpha: float) -> list[bytes]:
        return [evaluate("ggx", {"alpha": alpha}, *SOME).tobytes() for _ in range(repeats)]

    found = in_threads([partial(task, alpha) for alpha in widths])
    for alpha, values in zip(widths, found, strict=True):
        assert values == task(alpha)


def test_fits_in_threads(fresh: None) -> None:
    scan = "in-plane incidences=20,60 step=10"
    surfaces = [simulate("ggx", {"alpha": alpha}, scan, seed=1) for alpha in (0.1, 0.2, 0.4)]
    found = in_threads([partial(fit, m, ["ggx", "lambert"]) for m in surfaces])
    for m, report in zip(surfaces, found, strict=True):
        assert report.best.params == fit(m, ["ggx", "lambert"]).best.params


# Compiling


@pytest.fixture
def built(monkeypatch: pytest.MonkeyPatch) -> list[tuple[str, tuple[str, ...]]]:
    """Record every program that is built, on a device that has none yet."""
    monkeypatch.setattr(device, "_open", {})
    record: list[tuple[str, tuple[str, ...]]] = []
    program = cl.Program

    class Recorded:
        def __init__(self, context: Any, source: str) -> None:
            self.source, self.program = source, program(context, source)

        def build(self, options: list[str]) -> Any:
            record.append((self.source, tuple(options)))
            return self.program.build(options)

    monkeypatch.setattr(cl, "Program", Recorded)
    return record


def test_kernels_are_compiled_once(built: list[tuple[str, tuple[str, ...]]]) -> None:
    first = simulate("ggx", {"alpha": 0.2}, "in-plane step=10", seed=1)
    second = simulate("ward:isotropic", {"alpha_x": 0.3}, "in-plane step=7", seed=2)
    fit(first, ["ggx", "ward:isotropic"])
    so_far = len(built)
    assert so_far > 0
    fit(second, ["ggx", "ward:isotropic"])
    assert len(built) == so_far
    assert len(set(built)) == so_far  # and none of them twice


def test_threads_compile_once_between_them(built: list[tuple[str, tuple[str, ...]]]) -> None:
    in_threads([lambda: evaluate("ggx", {}, *SOME)] * 4)
    ours = [program for program in built if "self_test" not in program[0]]
    assert len(ours) == 2  # the geometry and the model
    assert len(set(built)) == len(built)


def test_every_model_builds_on_every_device_here() -> None:
    """With PoCL and nothing else installed this is the one that all tests use."""
    for one in devices():
        if not one.double:
            continue
        opened: Device = get_device(one.id)
        for name in models():
            for precision in ("single", "double"):
                f = evaluate(name, {}, *SOME, precision=precision, device=opened)
                assert np.isfinite(f).all()
