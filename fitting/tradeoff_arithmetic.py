"""Evaluations against each other: precision, width of vectors, cheaper exp and log."""

from __future__ import annotations

from dataclasses import asdict

import numpy as np
from numpy.typing import NDArray

from lobefit.fitting.tradeoff_points import Panel, Point, Spread
from lobefit.fitting.tradeoff_timing import Clock, interleaved
from lobefit.kernels import Device, DeviceError, Model, get_model
from lobefit.kernels.arithmetic import Arithmetic, ArithmeticDevice, arithmetics
from lobefit.kernels.cost import Workload
from lobefit.kernels.evaluate import basis_values
from lobefit.kernels.geometry import Directions
from lobefit.kernels.program import model_program

__all__ = ["arithmetic_panel", "calls_exp_or_log"]

Array = NDArray[np.float64]

# A model whose lobe is an exponential, where none of those that lead has one.
EXPONENTIAL = "beckmann"
# Calls in a turn: a launch takes a millisecond or two.
CALLS = 5
SETS = 4
# Smaller values than this share of the largest are black.
BLACK = 1e-6
# Not told apart from none.
LEAST = 2.0**-53


def _values(device: Device, model: Model, work: Workload, precision: str) -> Array:
    """Evaluate every basis function, shape (SETS, K, N)."""
    where = Directions(device, *work.angles, "double" if precision == "double" else "single")
    try:
        return basis_values(model_program(model), where, work.x[:SETS])
    finally:
        where.release()


def calls_exp_or_log(model: Model, device: Device) -> bool:
    """Tell whether a model's values change where exp and log do."""
    work = Workload(model, device=device)
    try:
        usual = Arithmetic("double", device.width("double"))
        other = Arithmetic("double", usual.width, "polynomial")
        values = [
            _values(ArithmeticDevice(device, a), model, work, "double") for a in (usual, other)
        ]
    except DeviceError:  # its double-only parts have no cheaper functions
        return False
    finally:
        work.release()
    return not np.array_equal(values[0], values[1])


def arithmetic_panel(leaders: list[str], device: Device, *, repeats: int, clock: Clock) -> Panel:
    """Measure a model's evaluation in every arithmetic.

    Parameters
    ----------
    leaders : list of str
        Models that matter here; the first of them that computes an exp or a log is taken.
    device : Device
    repeats : int
    clock : callable

    Returns
    -------
    Panel
    """
    known = [get_model(name.partition(":")[0]) for name in leaders]
    model = next((m for m in known if calls_exp_or_log(m, device)), None)
    notes = []
    if model is None:
        model = get_model(EXPONENTIAL)
        names = " and ".join(dict.fromkeys(m.name for m in known))
        notes.append(
            f"{names} compute neither exp nor log, which cannot be cheaper there: "
            f"measured with {EXPONENTIAL}"
        )
    found: list[tuple[Arithmetic, Workload, float]] = []
    failed: dict[str, str] = {}
    reference: Array | None = None
    works: list[Workload] = []
    try:
        for a in arithmetics(device):
            try:
                other = ArithmeticDevice(device, a)
                work = Workload(model, device=other, precision=a.precision)
                works.append(work)
                values = _values(other, model, work, a.precision)
                work()
            except DeviceError as error:
                failed[str(a)] = str(error).splitlines()[0]
                continue
            reference = values if reference is None else reference
            found.append((a, work, _error(values, reference)))
        times = interleaved([work for _, work, _ in found], repeats, clock, CALLS)
    finally:
        for work in works:
            work.release()
    millions = works[0].evaluations / 1e6
    return Panel(
        name="evaluation",
        title=f"How to evaluate {model.name}",
        seconds_label="time of a million evaluations [s]",
        error_label="error relative to double precision",
        points=tuple(
            Point(
                label=str(a),
                group="functions" if a.functions != "usual" else a.precision,
                seconds=Spread(tuple(t / millions for t in ran)),
                error=Spread((error,)),
                settings={"model": model.name, **asdict(a)},
                detail={"evaluations": works[0].evaluations},
                usual=a == found[0][0],
            )
            for (a, _, error), ran in zip(found, times, strict=True)
        ),
        notes=(
            *notes,
            (
                f"error: root mean square of the relative errors of {SETS} sets of parameters in "
                f"{works[0].angles[0].size:,} directions, where a value is above a millionth of the "
                "largest; equal values are drawn at 1e-16"
            ),
            "time: the sum of squared residuals, which is the inner loop of a fit",
        ),
        failed=failed,
    )


def _error(values: Array, reference: Array) -> float:
    bright = np.abs(reference) > BLACK * np.abs(reference).max(axis=2, keepdims=True)
    relative = (values[bright] - reference[bright]) / reference[bright]
    return max(float(np.sqrt(np.mean(relative * relative))), LEAST)
