"""A device is held against numpy before its first use: a broken compiler must not be believed.

Some builds of OpenCL runtimes compute single functions wrongly by many digits (PoCL's
``pown`` was wrong by 2,074,140 units in the last place in one of them). Every function that
the formulas call is tried at once, in both precisions and with the options they use.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from lobefit.kernels.device import Device, opencl_errors
from lobefit.kernels.errors import DeviceError
from lobefit.kernels.program import build_options, shared_text

__all__ = ["self_test"]

Array = NDArray[np.float64]


def _each(function: Callable[[float], float]) -> Callable[[Array], Array]:
    return lambda x: np.array([function(v) for v in x.tolist()])


# OpenCL text of a function of x > 0, and the same in numpy.
FUNCTIONS: dict[str, Callable[[Array], Array]] = {
    "exp(-x)": lambda x: np.exp(-x),
    "exp2(x)": np.exp2,
    "expm1(-x)": lambda x: np.expm1(-x),
    "log(x)": np.log,
    "log2(x)": np.log2,
    "positive_log2(x)": np.log2,
    "log2_1p(-0.3 * x)": lambda x: np.log1p(-0.3 * x) / np.log(2.0),
    "log1p(x)": np.log1p,
    "sqrt(x)": np.sqrt,
    "rsqrt(x)": lambda x: 1.0 / np.sqrt(x),
    "sin(x)": np.sin,
    "cos(x)": np.cos,
    "asin(0.3 * x)": lambda x: np.arcsin(0.3 * x),
    "atan(x)": np.arctan,
    "atan2(x, (real)(2.0))": lambda x: np.arctan2(x, 2.0),
    "erf(x)": _each(math.erf),
    "erfc(x)": _each(math.erfc),
    "fmin(x, 1.0)": lambda x: np.minimum(x, 1.0),
    "fmax(x, 1.0)": lambda x: np.maximum(x, 1.0),
    "fabs(x - 1.0)": lambda x: np.abs(x - 1.0),
    "clamp(x, (real)(0.5), (real)(1.0))": lambda x: np.clip(x, 0.5, 1.0),
    "(x < 1.0 ? x : 2.0 * x)": lambda x: np.where(x < 1.0, x, 2.0 * x),
}
# Largest difference, relative to max(|value|, 0.1): relaxed mathematics in single
# precision may cost a few units in the last place, a wrong function costs far more.
TOLERANCE = {"double": 1e-13, "single": 1e-5}
SAMPLES = 128


def self_test(device: Device) -> None:
    """Try every function that the formulas call.

    Parameters
    ----------
    device : Device
        What is tried.

    Raises
    ------
    DeviceError
        A function is wrong; the message names it, the device and what to do.
    """
    import pyopencl as cl

    for precision in ("double", "single"):
        dtype = np.dtype(np.float64 if precision == "double" else np.float32)
        width = device.width(precision)
        n = SAMPLES // width
        lines = [f"out[{k} * n + v] = {text};" for k, text in enumerate(FUNCTIONS)]
        source = "\n".join(
            [
                shared_text("types.h"),
                "kernel void self_test(global const real *in, const int n, global real *out) {",
                "const int v = get_global_id(0); const real x = in[v];",
                *lines,
                "}",
            ]
        )
        kernel = device.kernel(source, "self_test", build_options(width, precision))
        x = np.geomspace(0.01, 3.0, SAMPLES).astype(dtype)
        found = np.empty((len(FUNCTIONS), SAMPLES), dtype)
        flags = cl.mem_flags
        with opencl_errors("trying the device"):
            given = cl.Buffer(device.context, flags.READ_ONLY | flags.COPY_HOST_PTR, hostbuf=x)
            result = cl.Buffer(device.context, flags.WRITE_ONLY, found.nbytes)
            kernel(device.queue, (n,), None, given, np.int32(n), result)
            cl.enqueue_copy(device.queue, found, result)
            given.release()
            result.release()
        for (text, function), values in zip(FUNCTIONS.items(), found, strict=True):
            expected = function(x.astype(np.float64))
            error = np.abs(values - expected) / np.maximum(np.abs(expected), 0.1)
            worst = int(np.argmax(np.where(np.isfinite(error), error, np.inf)))
            if not error[worst] <= TOLERANCE[precision]:
                raise DeviceError(
                    f"{device.info} computes {text} wrongly in {precision} precision: "
                    f"{values[worst]:.9g} instead of {expected[worst]:.9g} at x = {x[worst]:.9g}; "
                    "its compiler is broken: update the runtime or choose another device "
                    "(LOBEFIT_DEVICE, or device=)"
                )
