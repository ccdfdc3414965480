"""F13 to F15, F39, F40: what plain OpenCL and float32 do, and what the kernels do instead."""

from __future__ import annotations

import math
import os
import threading

import numpy as np
import pyopencl as cl
import pytest

from lobefit.fitting import Measurement
from lobefit.kernels import MeasurementError, evaluate, get_device
from tests.kernels.test_device import python
from tests.kernels.test_near_mirror import largest_relative_error, near_mirror
from tests.kernels.transcriptions import geometry
from tests.stability.modes import measured
from tests.stability.naive import Array


@pytest.mark.parametrize(
    ("alpha", "figure"), [(0.001, "a001"), (0.005, "a005"), (0.02, "a02"), (0.1, "a1")]
)
def test_single_precision(alpha: float, figure: str) -> None:
    d = near_mirror(alpha)
    g = geometry(*d)
    a = np.float32(alpha)
    # The same alpha in both, so that its own rounding does not count.
    exact = float(a) ** 2 / (math.pi * ((float(a) ** 2 + g.tan2_h) / (1 + g.tan2_h)) ** 2)
    cos_h = (g.H[2] / np.sqrt(g.H2)).astype(np.float32)
    plain = a**2 / (np.float32(np.pi) * (cos_h**2 * (a**2 - 1) + 1) ** 2)
    measured("F13", **{figure: largest_relative_error(plain, exact)})
    params = {"k_d": 0.0, "k_s": 1.0, "F0": 1.0, "alpha": float(a)}
    double = evaluate("ggx", params, *d, precision="double")
    assert largest_relative_error(evaluate("ggx", params, *d, precision="single"), double) < 1e-5


def test_horizon() -> None:
    nan = 0
    for dtype in (np.float32, np.float64):
        cos_h, alpha = dtype(0.0), dtype(0.1)
        with np.errstate(all="ignore"):
            tan2 = (1 - cos_h**2) / cos_h**2
            plain = np.exp(-tan2 / alpha**2) / (np.pi * alpha**2 * cos_h**4)
        nan += int(np.isnan(plain))
    measured("F14", nan=nan)
    theta = np.array([math.pi / 2, np.radians(89.9999)])
    for precision in ("single", "double"):
        f = evaluate("beckmann", {"alpha": 0.1}, theta, 0.0, theta, 0.0, precision=precision)
        assert np.isfinite(f).all()
        assert f[0, 0] == 0.0
    with pytest.raises(MeasurementError, match="polar angles from 0 to below pi/2"):
        Measurement(theta, 0 * theta, theta, 0 * theta, np.ones((1, 2)), channels=("brdf",))


POWERS = """
kernel void powers(global const float *x, global const float *y, global float *out) {
    const int k = get_global_id(0);
    out[2 * k] = powr(x[k], y[k]);
    out[2 * k + 1] = pow(x[k], y[k]);
}
"""


def launch(source: str, name: str, *inputs: Array, size: int) -> Array:
    """Run a kernel plainly on the default device, in single precision."""
    device, flags = get_device(), cl.mem_flags
    kernel = cl.Kernel(cl.Program(device.context, source).build(), name)
    given = [
        cl.Buffer(
            device.context,
            flags.READ_ONLY | flags.COPY_HOST_PTR,
            hostbuf=np.asarray(values, dtype=np.float32),
        )
        for values in inputs
    ]
    out = np.empty(size, np.float32)
    result = cl.Buffer(device.context, flags.WRITE_ONLY, out.nbytes)
    kernel(device.queue, (len(inputs[0]),), None, *given, result)
    cl.enqueue_copy(device.queue, out, result)
    return out.astype(np.float64)


def test_powers() -> None:
    out = launch(POWERS, "powers", np.array([0.0, -0.5]), np.array([0.0, 2.0]), size=4)
    measured("F15", nan=int(np.isnan(out[::2]).sum()))
    np.testing.assert_array_equal(out[1::2], [1.0, 0.25])
    # Where the base is 0: the view at a right angle to Phong's mirror direction, and beyond.
    theta = np.radians([45.0, 80.0])
    f = evaluate("modified_phong", {"k_d": 0.0, "n": 3.0}, theta, 0.0, theta, 0.0)
    assert np.isfinite(f).all()
    assert f.max() < 1e-15


# In the child a launch through pyopencl itself; the alarm ends what would hang for ever.
FORK = """
import os, signal, time
import numpy as np, pyopencl as cl
from lobefit.kernels import DeviceError, evaluate, get_device
device = get_device()
text = "kernel void one(global float *out) { out[get_global_id(0)] = 1.0f; }"
kernel = cl.Kernel(cl.Program(device.context, text).build(), "one")
out = np.zeros(4096, np.float32)
buffer = cl.Buffer(device.context, cl.mem_flags.WRITE_ONLY, out.nbytes)
def launch():
    kernel(device.queue, out.shape, None, buffer)
    cl.enqueue_copy(device.queue, out, buffer)
launch()
began = time.monotonic()
plain = os.fork()
if plain == 0:
    signal.alarm(4)
    launch()
    os._exit(0)
told = os.fork()
if told == 0:
    signal.alarm(4)
    try:
        evaluate("lambert", {}, 0.1, 0.0, 0.2, 0.0)
    except DeviceError as error:
        os._exit(7 if "spawn" in str(error) else 1)
    os._exit(2)
print(os.waitstatus_to_exitcode(os.waitpid(told, 0)[1]))
print(os.waitstatus_to_exitcode(os.waitpid(plain, 0)[1]), time.monotonic() - began)
"""


@pytest.mark.skipif(not hasattr(os, "fork"), reason="this system does not fork")
@pytest.mark.skipif(
    "PoCL" not in get_device().info.version, reason="what other runtimes do differs"
)
def test_fork() -> None:
    told, killed, waited = python(FORK).split()
    assert told == "7"
    assert killed == "-14"  # the alarm
    measured("F39", rel=0.5, waited=float(waited))


SHIFT = """
kernel void shift(const float by, global float *out) {
    out[get_global_id(0)] = by + get_global_id(0);
}
"""


def test_kernels_in_threads() -> None:
    """Whether the race shows is chance, so that a count above 0 is no failure."""
    device = get_device()
    shared = cl.Kernel(cl.Program(device.context, SHIFT).build(), "shift")
    expected = np.arange(64, dtype=np.float32)
    wrong = [0] * 4

    def work(k: int) -> None:
        queue, out = cl.CommandQueue(device.context), np.empty(64, np.float32)
        buffer = cl.Buffer(device.context, cl.mem_flags.WRITE_ONLY, out.nbytes)
        for by in range(200):
            shared(queue, out.shape, None, np.float32(1000 * k + by), buffer)
            cl.enqueue_copy(queue, out, buffer)
            wrong[k] += not np.array_equal(out, expected + np.float32(1000 * k + by))

    threads = [threading.Thread(target=work, args=(k,)) for k in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(timeout=60)
        assert not thread.is_alive()
    if not any(wrong):
        measured("F40", wrong=sum(wrong))

    kernels: dict[str, cl.Kernel] = {}

    def take(name: str) -> None:
        kernels[name] = device.kernel(SHIFT, "shift")

    thread = threading.Thread(target=take, args=("other",))
    thread.start()
    thread.join(timeout=60)
    take("this")
    assert kernels["other"] is not kernels["this"]
    assert device.kernel(SHIFT, "shift") is kernels["this"]
