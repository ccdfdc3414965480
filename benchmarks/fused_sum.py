"""Weighted sums of squared residuals of many parameter sets: the inner loop of every fit.

64 GGX parameter sets over 16,384 directions, one channel: 1,048,576 evaluations a call. Numpy in
double and single precision, on one core and on two, against Lobefit's fused kernel (single
precision terms, double accumulators) on all cores, and against the same kernel compiled one
element wide.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager, suppress
from multiprocessing import get_context
from multiprocessing.connection import Connection
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from benchmarks.numpy_models import Geometry, GgxSums, GgxSumsTextbook, ggx_lobe
from benchmarks.timing import cores, interleave, ratio
from lobefit.kernels import Device, get_device, get_model
from lobefit.kernels.geometry import Directions
from lobefit.kernels.program import model_program
from lobefit.kernels.sums import Observations, chi_square

__all__ = ["lobefit_chi_square", "run", "table"]

Array = NDArray[np.float64]
Four = tuple[Array, Array, Array, Array]
Sums = Callable[[], Array]

SETS = 64
DIRECTIONS = 16384
CORES = 2  # that numpy uses where it shares the sets out

LOBEFIT = "lobefit, single"
SCALAR = "lobefit, single, vector width 1"


def problem() -> tuple[Four, Array, Array, Four]:
    """Angles [N], values [N], weights [N] and the parameter sets k_d, k_s, F0, alpha [S] each.

    Directions are uniform in solid angle down to 80 degrees; the values are those of one parameter
    set with 1 % noise, so that the sums span "almost right" to "far off".
    """
    rng = np.random.default_rng(20)
    lowest = np.cos(np.radians(80))
    theta_i, theta_o = np.arccos(rng.uniform(lowest, 1, (2, DIRECTIONS)))
    phi_i, phi_o = rng.uniform(0, 2 * np.pi, (2, DIRECTIONS))
    angles = (theta_i, phi_i, theta_o, phi_o)
    sets = (
        rng.uniform(0.05, 0.6, SETS),
        rng.uniform(0.2, 1.0, SETS),
        rng.uniform(0.03, 0.9, SETS),
        np.geomspace(0.05, 0.8, SETS),
    )
    g = Geometry.of(*angles)
    f = sets[0][20] / np.pi + sets[1][20] * ggx_lobe(g, sets[3][20]) * (
        sets[2][20] + (1 - sets[2][20]) * g.schlick
    )
    values = f * (1 + 0.01 * rng.standard_normal(DIRECTIONS))
    return angles, values, 1 / (0.01 * f), sets


def reference(angles: Four, values: Array, weights: Array, sets: Four) -> Array:
    """Return the sums from the papers' formula in double precision, one set at a time."""
    g = Geometry.of(*angles)
    return np.array(
        [
            np.sum(
                (weights * (d / np.pi + s * ggx_lobe(g, a) * (f + (1 - f) * g.schlick) - values))
                ** 2
            )
            for d, s, f, a in zip(*sets, strict=True)
        ]
    )


def numpy_sums(kind: type[GgxSums | GgxSumsTextbook], dtype: DTypeLike) -> Sums:
    """Give a call that returns the sums by numpy in this thread."""
    angles, values, weights, sets = problem()
    worker = kind(Geometry.of(*angles), values, weights, dtype)
    return lambda: worker.chi_square(*sets)


def numpy_in_threads(pool: ThreadPoolExecutor, dtype: DTypeLike) -> Sums:
    """Give a call that shares the sets out over threads; between numpy calls only one runs."""
    angles, values, weights, sets = problem()
    g = Geometry.of(*angles)
    # Buffers of their own, and longer calls than one thread needs: less waiting.
    workers = [GgxSums(g, values, weights, dtype, sets=SETS // CORES) for _ in range(CORES)]
    shares = [[part[k::CORES] for part in sets] for k in range(CORES)]

    def together() -> Array:
        total = np.empty(SETS)
        jobs = [pool.submit(w.chi_square, *s) for w, s in zip(workers, shares, strict=True)]
        for k, job in enumerate(jobs):
            total[k::CORES] = job.result()
        return total

    return together


def _serve(pipe: Connection, dtype: str, share: int) -> None:
    """Worker process: keep geometry and buffers, answer each request with the sums of its share."""
    angles, values, weights, sets = problem()
    worker = GgxSums(Geometry.of(*angles), values, weights, dtype)
    part = [p[share::CORES] for p in sets]
    with suppress(EOFError):  # the parent is gone
        while pipe.recv():
            pipe.send(worker.chi_square(*part))


@contextmanager
def numpy_in_processes(dtype: str) -> Iterator[Sums]:
    """Give a call that shares the sets out over processes; only the sums travel."""
    context = get_context("spawn")  # a fork would copy the OpenCL driver's locks
    pipes = []
    for share in range(CORES):
        ours, theirs = context.Pipe()
        context.Process(target=_serve, args=(theirs, dtype, share), daemon=True).start()
        pipes.append(ours)

    def together() -> Array:
        total = np.empty(SETS)
        for pipe in pipes:
            pipe.send(True)
        for k, pipe in enumerate(pipes):
            total[k::CORES] = pipe.recv()
        return total

    try:
        yield together
    finally:
        for pipe in pipes:
            pipe.send(False)


class _OneLane(Device):
    """An open device on which kernels are compiled without vector types."""

    def __init__(self, device: Device) -> None:
        self.__dict__.update(device.__dict__)  # the same context, queue and compiled programs

    def width(self, precision: str) -> int:
        return 1


def lobefit_chi_square(*, scalar: bool = False) -> Sums:
    """Give a call that returns the same sums by Lobefit's fused kernel in single precision.

    Parameters
    ----------
    scalar : bool
        Compile with vectors of width 1 instead of the device's own.
    """
    angles, values, weights, (k_d, k_s, F0, alpha) = problem()
    device = _OneLane(get_device()) if scalar else get_device()
    directions = Directions(device, *angles, "single")
    observations = Observations(directions, values[None], weights[None] ** 2)
    program = model_program(get_model("ggx"))
    x = alpha[:, None]
    coefficients = np.stack([k_d, k_s * F0, k_s], axis=-1)[:, None]
    return lambda: chi_square(program, observations, x, coefficients)[:, 0]


def run() -> dict[str, Any]:
    """Time every variant; returns a JSON-able record."""
    expected = reference(*problem())
    tasks: dict[str, Sums] = {}
    used: dict[str, int] = {}
    with ExitStack() as stack:
        threads = stack.enter_context(ThreadPoolExecutor(CORES))
        for dtype, precision in (("f8", "double"), ("f4", "single")):
            tasks[f"numpy textbook, {precision}"] = numpy_sums(GgxSumsTextbook, dtype)
            tasks[f"numpy rearranged, {precision}"] = numpy_sums(GgxSums, dtype)
            both = f"numpy rearranged, {precision}, {CORES}"
            tasks[f"{both} threads"] = numpy_in_threads(threads, dtype)
            tasks[f"{both} processes"] = stack.enter_context(numpy_in_processes(dtype))
            used |= {f"{both} threads": CORES, f"{both} processes": CORES}
        for name, scalar in ((LOBEFIT, False), (SCALAR, True)):
            tasks[name] = lobefit_chi_square(scalar=scalar)
            used[name] = cores()
        differences = {
            name: float(np.max(np.abs(task() / expected - 1))) for name, task in tasks.items()
        }
        timings = interleave(tasks, rounds=11, warmup=3, least_s=0.04)
    rows = [
        {
            "name": name,
            "cores": used.get(name, 1),
            "mevals_per_s": SETS * DIRECTIONS / timing.median / 1e6,
            "relative_difference": differences[name],
            "lobefit_faster": ratio(timing, timings[LOBEFIT]),
            **timing.to_dict(),
        }
        for name, timing in timings.items()
    ]
    return {
        "device": str(get_device().info),
        "sets": SETS,
        "directions": DIRECTIONS,
        "rows": rows,
    }


def table(result: dict[str, Any]) -> str:
    """Lay out the result of `run` for reading."""
    lines = [
        f"{result['sets']} GGX parameter sets x {result['directions']} directions, 1 channel",
        f"OpenCL device: {result['device']}",
        "difference: largest relative one of the sums from the papers' formula in double",
        f"{'':<38}{'cores':>6}{'ms':>9}{'Mevals/s':>10}{'lobefit is':>12}{'difference':>12}",
    ]
    for row in result["rows"]:
        lines.append(
            f"{row['name']:<38}{row['cores']:>6}{row['median_s'] * 1e3:>9.2f}"
            f"{row['mevals_per_s']:>10.0f}{row['lobefit_faster']:>10.1f} x{row['relative_difference']:>12.1e}"
        )
    return "\n".join(lines)
