"""Choice of the OpenCL device, its context, and compiled programs; clear errors.

Nothing touches OpenCL at import. A context and its programs are made once per
process and device; kernels are made once per thread, since setting the
arguments of one kernel object from two threads is a race.
"""

from __future__ import annotations

import os
import re
import shutil
import threading
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from lobefit.kernels.errors import DeviceError

if TYPE_CHECKING:
    import pyopencl as cl

__all__ = ["Device", "DeviceInfo", "devices", "get_device", "opencl_errors"]

ENVIRONMENT_VARIABLE = "LOBEFIT_DEVICE"
# The process that started OpenCL, or none so far.
_started_in: int | None = None
INSTALL_HINT = "install PoCL with `pip install pocl-binary-distribution`, or your vendor's runtime"


@dataclass(frozen=True, slots=True)
class DeviceInfo:
    """What is recorded about a device in every result.

    Attributes
    ----------
    id : str
        ``platform index:device index``, accepted by ``device=``.
    name, platform, version : str
        As the OpenCL runtime gives them; the driver's version where it tells more.
    kind : str
        "cpu", "gpu" or "other".
    double : bool
        Whether it computes in double precision, which Lobefit needs.
    """

    id: str
    name: str
    platform: str
    version: str
    kind: str
    double: bool

    def __str__(self) -> str:
        """One short line for people: device, runtime and its version."""
        runtime = self.version.partition("PoCL ")[2].split(" ")[0]
        version = f"PoCL {runtime}" if runtime else f"{self.platform} {self.version}"
        return f"{self.name} ({version})"


def _opencl() -> Any:
    try:
        import pyopencl
    except ImportError as error:
        raise DeviceError(
            f"pyopencl cannot be imported ({error}); install it with `pip install pyopencl`"
        ) from error
    return pyopencl


@contextmanager
def opencl_errors(doing: str) -> Iterator[None]:
    """Turn every pyopencl error raised inside into a `DeviceError`.

    Parameters
    ----------
    doing : str
        What was being done, for the message.
    """
    cl = _opencl()
    try:
        yield
    except cl.MemoryError as error:
        raise DeviceError(
            f"the OpenCL device ran out of memory while {doing} ({error}); "
            "use fewer rows or another device"
        ) from error
    except cl.Error as error:
        raise DeviceError(f"OpenCL failed while {doing}: {error}") from error


def _describe(platform_index: int, device_index: int, device: cl.Device) -> DeviceInfo:
    cl = _opencl()
    kinds = {cl.device_type.CPU: "cpu", cl.device_type.GPU: "gpu"}
    kind = next((k for flag, k in kinds.items() if device.type & flag), "other")
    version, driver = device.platform.version.strip(), device.driver_version.strip()
    if driver not in version:  # PoCL's platform tells which PoCL it is, others' only the standard
        version = f"{version}, driver {driver}"
    return DeviceInfo(
        id=f"{platform_index}:{device_index}",
        name=device.name.strip(),
        platform=device.platform.name.strip(),
        version=version,
        kind=kind,
        double=bool(device.double_fp_config),
    )


def _check_fork() -> None:
    """Raise a `DeviceError` in a child forked after OpenCL started: it would hang for ever."""
    global _started_in
    _started_in = _started_in or os.getpid()
    if _started_in != os.getpid():
        raise DeviceError(
            "this process was forked after OpenCL had started, and would hang; "
            'start workers with multiprocessing.get_context("spawn")'
        )


def _all_devices() -> list[tuple[DeviceInfo, cl.Device]]:
    cl = _opencl()
    _check_fork()
    try:
        platforms = cl.get_platforms()
    except cl.Error as error:
        raise DeviceError(f"no OpenCL platform was found ({error}); {INSTALL_HINT}") from error
    found = []
    for p, platform in enumerate(platforms):
        try:
            members = platform.get_devices()
        except cl.Error:  # a platform without devices answers with an error
            continue
        found += [(_describe(p, d, device), device) for d, device in enumerate(members)]
    return found


def devices() -> list[DeviceInfo]:
    """List every OpenCL device of this machine.

    Raises
    ------
    DeviceError
        No OpenCL platform at all; the message says what to install.
    """
    return [info for info, _ in _all_devices()]


def _preference(info: DeviceInfo) -> tuple[bool, bool, list[int], str]:
    """Sort key of the default rule: a CPU first, PoCL first, the newest first, then by id."""
    numbers = re.findall(r"\d+", info.version.partition("PoCL")[2].partition(",")[0])
    newest_first = [-int(n) for n in numbers[:3]]
    return (info.kind != "cpu", "PoCL" not in info.version, newest_first, info.id)


def _searchable(info: DeviceInfo) -> str:
    return f"{info.name} {info.platform} {info.version} {info.kind}"


def _select(spec: str | None) -> tuple[DeviceInfo, cl.Device]:
    found = _all_devices()
    if not found:
        raise DeviceError(f"no OpenCL device was found; {INSTALL_HINT}")
    listed = "; ".join(f"{info.id} = {info}" for info, _ in found)
    if spec:
        exact = [pair for pair in found if pair[0].id == spec]
        matches = exact or [
            pair for pair in found if spec.casefold() in _searchable(pair[0]).casefold()
        ]
        if not matches:
            raise DeviceError(f"no OpenCL device matches {spec!r}; there are: {listed}")
    else:
        matches = [pair for pair in found if pair[0].double]
        if not matches:
            raise DeviceError(f"no OpenCL device computes in double precision; found: {listed}")
    info, device = min(matches, key=lambda pair: _preference(pair[0]))
    if not info.double:
        raise DeviceError(
            f"{info} has no double precision, which the sums need; choose another: {listed}"
        )
    if "PoCL" in info.version and info.kind == "cpu" and shutil.which("ld") is None:
        raise DeviceError(
            "PoCL needs the linker `ld` to compile kernels and none is on the PATH; "
            "install it (Debian, Ubuntu: `apt-get install binutils`)"
        )
    return info, device


class Device:
    """An OpenCL device with its context, queue and compiled programs.

    Do not make one; call `get_device`, which keeps one per process and device.

    Attributes
    ----------
    info : DeviceInfo
        What is recorded in results.
    context, queue
        pyopencl objects; the queue is in order and may be shared by threads.
    """

    def __init__(self, info: DeviceInfo, device: cl.Device) -> None:
        cl = _opencl()
        self.info = info
        with opencl_errors(f"opening {info}"):
            self.context = cl.Context([device])
            self.queue = cl.CommandQueue(self.context)
        self._programs: dict[tuple[str, tuple[str, ...]], Any] = {}
        self._lock = threading.Lock()
        self._local = threading.local()

    @property
    def is_cpu(self) -> bool:
        """Whether work is shared out in contiguous chunks of wide vectors."""
        return self.info.kind == "cpu"

    def width(self, precision: str) -> int:
        """Directions per vector: 256 bits on a CPU, 1 elsewhere.

        PoCL vectorises builtins of vector types only. Wider vectors are no faster and
        unsafe: on CPUs with AVX-512, PoCL 3.0 aborts the process on some of their
        builtins, and loses the kernels of such programs from its cache.
        """
        if not self.is_cpu:
            return 1
        return 4 if precision == "double" else 8

    def kernel(self, source: str, name: str, options: tuple[str, ...] = ()) -> cl.Kernel:
        """Give this thread's kernel of that name, compiling the program at first use.

        Parameters
        ----------
        source : str
            Whole OpenCL C text of the program.
        name : str
            The kernel's name.
        options : tuple of str
            Options of the compiler.

        Raises
        ------
        DeviceError
            The program does not build; the message carries the compiler's log.
        """
        _check_fork()
        kernels: dict[tuple[str, str, tuple[str, ...]], cl.Kernel]
        kernels = self._local.__dict__.setdefault("kernels", {})
        key = (source, name, options)
        if key not in kernels:
            program = self._program(source, options)
            cl = _opencl()
            try:
                kernels[key] = cl.Kernel(program, name)
            except cl.Error as error:
                # A process killed while compiling can leave half a program in PoCL's cache.
                raise DeviceError(
                    f"the compiled program has no kernel {name} ({error}); the runtime's cache may "
                    "be damaged: delete ~/.cache/pocl (or POCL_CACHE_DIR) and try again"
                ) from error
        return kernels[key]

    def _program(self, source: str, options: tuple[str, ...]) -> Any:
        cl = _opencl()
        key = (source, options)
        with self._lock:
            if key not in self._programs:
                try:
                    with warnings.catch_warnings():
                        # Some runtimes log every build, and pyopencl warns of every log.
                        warnings.simplefilter("ignore", cl.CompilerWarning)
                        program = cl.Program(self.context, source).build(list(options))
                except cl.Error as error:
                    raise DeviceError(f"a kernel does not build on {self.info}: {error}") from error
                log = program.get_build_info(self.queue.device, cl.program_build_info.LOG)
                if "warning:" in log:
                    warnings.warn(f"a kernel builds on {self.info} with: {log}", stacklevel=2)
                self._programs[key] = program
            return self._programs[key]


def _tried(device: Device) -> Device:
    # It needs the program's text, which needs no device.
    from lobefit.kernels.self_test import self_test

    self_test(device)
    return device


_open: dict[str, Device] = {}
_open_lock = threading.Lock()


def get_device(spec: str | Device | None = None) -> Device:
    """Open a device, once per process.

    Parameters
    ----------
    spec : str, Device or None
        ``"0:0"`` (an id that `devices` gives), part of a device's or platform's
        name, "cpu" or "gpu". None takes the environment variable
        LOBEFIT_DEVICE, else the rule: a CPU before others, PoCL before other
        runtimes, the newest PoCL, the lowest id.

    Raises
    ------
    DeviceError
        Nothing matches, no double precision, no linker, or the device computes
        wrongly (`lobefit.kernels.self_test`); with what to do.
    """
    _check_fork()
    if isinstance(spec, Device):
        return spec
    wanted = spec or os.environ.get(ENVIRONMENT_VARIABLE) or ""
    with _open_lock:
        if wanted not in _open:
            info, device = _select(wanted or None)
            same = next((d for d in _open.values() if d.info == info), None)
            _open[wanted] = same or _tried(Device(info, device))
        opened = _open[wanted]
    return opened
