"""F13 to F15, F39, F40: single precision, OpenCL and processes."""

from __future__ import annotations

from tests.stability.modes import Mode

__all__ = ["ROWS"]

HERE = "tests/stability/test_devices.py::"
PROCESSES = "tests/kernels/test_processes.py::"
PHYSICS = "tests/kernels/test_physics.py::"

ROWS = [
    Mode(
        id="F13",
        title="single precision from the cosine of the half angle",
        naive="GGX's D from n·h in float32 is wrong by up to {a001:.0%} at alpha 0.001, "
        "{a005:.1g} at "
        "0.005, {a02:.0e} at 0.02, {a1:.0e} at 0.1.",
        how="numpy float32 against float64, 20,000 directions within 20 widths of the mirror "
        "direction",
        figures={"a001": 0.1241, "a005": 0.00677, "a02": 3.97e-4, "a1": 2.29e-5},
        lobefit="The kernels get tan² of the half angle from h itself, with 1 - cos kept exactly: "
        "below 1e-5 at every alpha.",
        status="handled",
        tests=(
            f"{HERE}test_single_precision",
            "tests/kernels/test_near_mirror.py::test_single_precision_ggx",
            "tests/kernels/test_near_mirror.py::test_single_precision_of_exponentials",
            f"{PHYSICS}test_single_agrees_with_double",
        ),
    ),
    Mode(
        id="F14",
        title="tan² at the horizon",
        naive="Beckmann's D as printed, exp(-tan²/a²)/(pi a² cos⁴), at n·h = 0: {nan:.0f} of 2 "
        "are NaN "
        "(float32, float64), and the NaN goes on into every sum.",
        how="numpy, light and view both at 90 degrees on one side",
        figures={"nan": 2},
        lobefit="A direction at the horizon is 0 in the kernels and refused in a measurement; up "
        "to "
        "89.9999 degrees every model is finite in both precisions, at every bound of its "
        "parameters.",
        status="handled",
        tests=(
            f"{HERE}test_horizon",
            f"{PHYSICS}test_finite_and_not_negative",
            f"{PHYSICS}test_zero_below_the_horizon",
        ),
    ),
    Mode(
        id="F15",
        title="pow and its relatives in OpenCL",
        naive="powr(0, 0) and powr(-0.5, 2) are NaN ({nan:.0f} of 2), where pow gives 1 and "
        "0.25; some "
        "builds of PoCL compute pown wrongly by millions of units in the last place "
        "(pocl/pocl#2307).",
        how="an OpenCL kernel of one line on the default device",
        figures={"nan": 2},
        lobefit="No formula calls pow, powr, pown or rootn: exp2(y log2 x) of a guarded x. Every "
        "function that formulas call is held against numpy when a device is opened; a wrong one "
        "is a "
        "DeviceError with its name.",
        status="handled",
        tests=(
            f"{HERE}test_powers",
            "tests/kernels/test_self_test.py::test_every_function_that_the_formulas_call_is_tried",
            "tests/kernels/test_self_test.py::test_a_wrong_function_is_named",
        ),
    ),
    Mode(
        id="F39",
        title="PoCL after fork",
        naive="A child forked after the first launch hangs in its own: killed after {waited:.0f} s "
        "(multiprocessing's default on Linux before Python 3.14).",
        how="os.fork, then a launch through pyopencl under signal.alarm; PoCL 3.0",
        figures={"waited": 4},
        lobefit="The child gets a DeviceError that names spawn; spawned workers, and children "
        "forked "
        "before the first use, work.",
        status="handled",
        tests=(
            f"{HERE}test_fork",
            f"{PROCESSES}test_a_forked_child_is_told_instead_of_hanging",
            f"{PROCESSES}test_spawned_workers_agree",
        ),
    ),
    Mode(
        id="F40",
        title="one kernel object in several threads",
        naive="Setting arguments is not thread-safe by pyopencl's manual. Not reproduced: "
        "{wrong:.0f} of "
        "800 launches were wrong.",
        how="4 threads, 200 launches each of one cl.Kernel with arguments of their own",
        figures={"wrong": 0},
        lobefit="Kernels are made once per thread, programs once per device: threads give the "
        "values of "
        "one thread to the bit.",
        status="handled",
        tests=(
            f"{HERE}test_kernels_in_threads",
            f"{PROCESSES}test_threads_with_one_model_and_different_parameters",
            f"{PROCESSES}test_threads_with_different_models",
            f"{PROCESSES}test_fits_in_threads",
        ),
    ),
]
