"""Which device is used, and what the user is told when there is none that can be."""

from __future__ import annotations

import itertools
import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from typing import Any

import pyopencl as cl
import pytest

from lobefit.kernels import (
    DeviceError,
    DeviceInfo,
    LobefitError,
    device,
    devices,
    evaluate,
    get_device,
)
from lobefit.kernels.device import opencl_errors
from tests.kernels.strategies import directions

SOME = directions(500, seed=11)


def info(id_: str, name: str, version: str, kind: str = "cpu", double: bool = True) -> DeviceInfo:
    return DeviceInfo(id_, name, "a platform", version, kind, double)


POCL_3 = info("0:0", "a CPU", "OpenCL 3.0 PoCL 3.0-rc2  Linux, LLVM 14.0.6")
POCL_31 = info("1:0", "a CPU", "OpenCL 3.0 PoCL 3.1+debian  Linux, LLVM 15")
POCL_100 = info("5:0", "a CPU", "OpenCL 3.0 PoCL 10.0  Linux, LLVM 30")
OTHER_CPU = info("2:0", "a CPU", "OpenCL 3.0 LINUX")
GPU = info("3:0", "a GPU", "OpenCL 3.0 CUDA", kind="gpu")
SMALL_GPU = info("4:0", "a small GPU", "OpenCL 1.2", kind="gpu", double=False)


class Opened:
    """In the place of `Device`: what would have been opened."""

    def __init__(self, info: DeviceInfo, _device: object) -> None:
        self.info = info

    def check_process(self) -> None:
        pass


@pytest.fixture
def choose(monkeypatch: pytest.MonkeyPatch) -> Callable[..., str]:
    """Give the id that would be opened if the machine had these devices."""
    monkeypatch.setattr(device, "Device", Opened)
    monkeypatch.setattr(device, "_tried", lambda opened: opened)
    monkeypatch.setattr(shutil, "which", lambda _name: "/usr/bin/ld")
    monkeypatch.delenv(device.ENVIRONMENT_VARIABLE, raising=False)

    def choose(found: tuple[DeviceInfo, ...], spec: str | None = None) -> str:
        monkeypatch.setattr(device, "_open", {})
        monkeypatch.setattr(device, "_all_devices", lambda: [(one, None) for one in found])
        return get_device(spec).info.id

    return choose


def python(script: str, **environment: str) -> str:
    """Run a script in a new process and give its output."""
    done = subprocess.run(
        [sys.executable, "-c", script],
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


# The rule


@pytest.mark.parametrize(
    ("found", "expected"),
    [
        ((POCL_3, POCL_31, OTHER_CPU, GPU, SMALL_GPU), POCL_31),  # the newest PoCL
        ((POCL_3, POCL_31, POCL_100), POCL_100),  # 10 is newer than 3, though "10" < "3"
        ((OTHER_CPU, GPU), OTHER_CPU),  # a CPU before others
        ((GPU, SMALL_GPU), GPU),  # double precision is needed
    ],
)
def test_the_rule_does_not_depend_on_the_order(
    choose: Callable[..., str], found: tuple[DeviceInfo, ...], expected: DeviceInfo
) -> None:
    for order in itertools.permutations(found):
        assert choose(order) == expected.id


@pytest.mark.parametrize(
    ("spec", "expected"),
    [("3:0", GPU), ("gpu", GPU), ("GPU", GPU), ("2:0", OTHER_CPU), ("debian", POCL_31)],
)
def test_a_device_is_chosen_by_id_kind_or_name(
    choose: Callable[..., str],
    monkeypatch: pytest.MonkeyPatch,
    spec: str,
    expected: DeviceInfo,
) -> None:
    found = (POCL_3, POCL_31, OTHER_CPU, GPU)
    assert choose(found) != expected.id or spec == "debian"
    assert choose(found, spec) == expected.id
    monkeypatch.setenv(device.ENVIRONMENT_VARIABLE, spec)
    assert choose(found) == expected.id
    assert choose(found, "0:0") == "0:0"  # the argument goes before the variable


def test_an_unknown_device_lists_what_there_is(choose: Callable[..., str]) -> None:
    with pytest.raises(DeviceError) as caught:
        choose((POCL_3, GPU), "cuda9")
    message = str(caught.value)
    assert "'cuda9'" in message
    for one in (POCL_3, GPU):
        assert one.id in message
        assert one.name in message


def test_no_double_precision(choose: Callable[..., str]) -> None:
    with pytest.raises(DeviceError, match=r"double precision.*4:0 = a small GPU"):
        choose((SMALL_GPU,))
    with pytest.raises(DeviceError, match=r"a small GPU.* no double precision.*0:0"):
        choose((POCL_3, SMALL_GPU), "4:0")


def test_no_device_at_all(choose: Callable[..., str], monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(DeviceError, match="pip install pocl-binary-distribution"):
        choose(())

    def none() -> list[Any]:
        raise cl.LogicError("clGetPlatformIDs failed: PLATFORM_NOT_FOUND_KHR")

    monkeypatch.undo()
    monkeypatch.setattr(device, "_open", {})
    monkeypatch.setattr(cl, "get_platforms", none)
    for ask in (devices, get_device):
        with pytest.raises(DeviceError, match=r"no OpenCL platform.*pip install pocl-binary"):
            ask()


def test_no_linker(choose: Callable[..., str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shutil, "which", lambda _name: None)
    with pytest.raises(DeviceError, match=r"`ld`.*apt-get install binutils"):
        choose((POCL_3,))
    assert choose((OTHER_CPU,)) == "2:0"  # only PoCL needs it


def test_no_linker_on_the_path_of_a_new_process() -> None:
    if "PoCL" not in get_device().info.version:
        pytest.skip("the device is not PoCL, which alone needs a linker")
    script = (
        "from lobefit.kernels import DeviceError, evaluate\n"
        "try:\n    evaluate('lambert', {}, 0.1, 0.0, 0.2, 0.0)\n"
        "except DeviceError as error:\n    print(error)\n"
    )
    assert "apt-get install binutils" in python(script, PATH="/nonexistent")


def test_no_pyopencl(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(device, "_open", {})
    monkeypatch.setitem(sys.modules, "pyopencl", None)
    with pytest.raises(DeviceError, match="pip install pyopencl"):
        get_device()


# The real device


def test_the_real_device_is_opened_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(device.ENVIRONMENT_VARIABLE, raising=False)
    opened = get_device()
    assert opened.info in devices()
    for spec in (None, "", opened.info.id, opened.info.name, opened):
        assert get_device(spec) is opened
    monkeypatch.setenv(device.ENVIRONMENT_VARIABLE, opened.info.id)
    assert get_device() is opened
    monkeypatch.setenv(device.ENVIRONMENT_VARIABLE, "no such device")
    assert get_device(opened.info.id) is opened
    with pytest.raises(DeviceError, match=r"no such device.*there are: 0:0 = "):
        evaluate("lambert", {}, 0.1, 0.0, 0.2, 0.0)
    with pytest.raises(DeviceError, match="another"):
        evaluate("lambert", {}, 0.1, 0.0, 0.2, 0.0, device="another")


def test_a_program_that_does_not_build_shows_the_compilers_log() -> None:
    opened = get_device()
    for _ in range(2):  # a failure is not remembered as a program
        with pytest.raises(DeviceError) as caught:
            opened.kernel("kernel void broken() { not_declared = 1; }", "broken")
        assert "does not build" in str(caught.value)
        assert "not_declared" in str(caught.value)
        assert opened.info.name in str(caught.value)
    with pytest.raises(DeviceError, match="another_name"):
        opened.kernel("kernel void a_name(global int *x) { x[0] = 1; }", "another_name")


def opencl_error_classes(base: type[Exception]) -> Iterator[type[Exception]]:
    yield base
    for kind in base.__subclasses__():
        yield from opencl_error_classes(kind)


def test_every_opencl_error_is_mapped() -> None:
    kinds = list(opencl_error_classes(cl.Error))
    assert {cl.Error, cl.LogicError, cl.MemoryError, cl.RuntimeError} <= set(kinds)
    for kind in kinds:
        expected = pytest.raises(DeviceError, match="while testing")
        with expected as caught, opencl_errors("testing"):
            raise kind("what went wrong")
        assert "what went wrong" in str(caught.value)
        assert isinstance(caught.value.__cause__, kind)
        assert isinstance(caught.value, LobefitError)
    with pytest.raises(DeviceError, match=r"out of memory.*fewer rows"), opencl_errors("testing"):
        raise cl.MemoryError("MEM_OBJECT_ALLOCATION_FAILURE")
    with pytest.raises(ZeroDivisionError), opencl_errors("testing"):  # anything else passes
        raise ZeroDivisionError


def test_an_error_of_the_runtime_is_mapped(monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_arguments: object, **_keywords: object) -> None:
        raise cl.MemoryError("clCreateBuffer failed: MEM_OBJECT_ALLOCATION_FAILURE")

    monkeypatch.setattr(cl, "Buffer", full)
    with pytest.raises(DeviceError, match="out of memory while uploading"):
        evaluate("ggx", {}, *SOME)
