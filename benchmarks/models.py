"""Every model's speed: Lobefit's fused sum beside numpy with the same formula.

Both sum the squared residuals of the same parameter sets over 16,384 directions, one channel,
in single precision: Lobefit with its fused kernel on all cores, 64 sets a launch; numpy on one
core, set after set, with the transcriptions that the tests hold the kernels against.

Only the formula is timed. A transcription starts from angles, but it is handed a geometry that was
made beforehand and keeps whatever is asked of it (vectors, half vector, tangents, cosines) in
single precision. Where a formula turns to double precision by an array of its own, it stays so
and is marked. Run as ``python -m benchmarks.models``, it prints and writes nothing.
"""

from __future__ import annotations

import importlib
import statistics
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.timing import Timing, cores, interleave, machine, ratio
from lobefit.kernels import get_device, models
from lobefit.kernels.cost import Workload
from tests.kernels.transcriptions import Geometry, geometry, load

__all__ = ["PreparedGeometry", "handed", "numpy_sums", "run", "table"]

Array = NDArray[np.float64]
Single = NDArray[np.float32]

TIMES = 5.0  # models less than so many times faster than numpy are named
STEP = 8  # numpy takes every 8th set; it needs no more to be timed


class PreparedGeometry:
    """A geometry in single precision that keeps every quantity that was asked of it."""

    def __init__(self, exact: Geometry) -> None:
        self._exact = exact

    def __getattr__(self, name: str) -> Any:
        value = getattr(self._exact, name)
        if isinstance(value, np.ndarray) and np.issubdtype(value.dtype, np.floating):
            value = np.ascontiguousarray(value, dtype=np.float32)
        setattr(self, name, value)
        return value

    def where_lit(self, values: Single) -> Single:
        """All directions are above the horizon here."""
        return values


def _column(value: float | list[float]) -> Single:
    return np.atleast_1d(np.asarray(value, dtype=np.float32))[:, np.newaxis]


@contextmanager
def handed(name: str, ready: PreparedGeometry) -> Iterator[None]:
    """Let a transcription take its geometry and its channels' values from here."""
    replaced = {"geometry": lambda *_angles: ready, "per_channel": _column}
    modules: list[Any] = [
        importlib.import_module(f"tests.kernels.transcriptions.{part}")
        for part in (name, "microfacet")
    ]
    kept = [{key: value for key, value in vars(m).items() if key in replaced} for m in modules]
    try:
        for module, known in zip(modules, kept, strict=True):
            vars(module).update({key: replaced[key] for key in known})
        yield
    finally:
        for module, known in zip(modules, kept, strict=True):
            vars(module).update(known)


def numpy_sums(work: Workload) -> Callable[[], tuple[Array, bool]]:
    """Give a call that returns the sums of every `STEP`-th set, and whether they stayed single.

    Parameters
    ----------
    work : Workload
        The same that Lobefit is timed with.
    """
    name = work.model.name
    formula = load(name)
    ready = PreparedGeometry(geometry(*work.angles))
    angles = [a.astype(np.float32) for a in work.angles]
    defaults = {p.name: p.default for p in work.model.linear}
    searched = [p.name for p in work.model.nonlinear]
    sets = [defaults | dict(zip(searched, map(float, x), strict=True)) for x in work.x[::STEP]]
    values = np.full(angles[0].size, work.VALUE, dtype=np.float32)
    weights = np.ones_like(values)

    def sums() -> tuple[Array, bool]:
        total, stayed = np.empty(len(sets)), True
        with handed(name, ready), np.errstate(all="ignore"):  # tails underflow
            for k, params in enumerate(sets):
                f = formula(*angles, **params)[0]
                residual = f - values
                total[k] = np.einsum("n,n->", weights * residual, residual)
                stayed = stayed and f.dtype == np.float32
        return total, stayed

    return sums


def _cpu(timing: Timing) -> float:
    """Median CPU seconds of all threads, which a busy neighbour hardly changes."""
    return statistics.median(timing.cpu)


def _measured(name: str) -> dict[str, Any]:
    """Time one model both ways, in turns."""
    work = Workload(name)
    try:
        theirs = numpy_sums(work)
        expected, stayed = theirs()
        difference = float(np.max(np.abs(work()[::STEP] / expected - 1)))
        tasks: dict[str, Callable[[], object]] = {"lobefit": work, "numpy": theirs}
        timings = interleave(tasks, rounds=7, least_s=0.02)
    finally:
        work.release()
    share = len(expected) / len(work.x)  # of Lobefit's sets that numpy was given
    return {
        "name": name,
        "lobefit_mevals_per_s": work.evaluations / timings["lobefit"].median / 1e6,
        "numpy_mevals_per_s": share * work.evaluations / timings["numpy"].median / 1e6,
        "lobefit_faster": ratio(timings["numpy"], timings["lobefit"]) / share,
        "lobefit_cheaper": _cpu(timings["numpy"]) / _cpu(timings["lobefit"]) / share,
        "numpy_single": stayed,
        "relative_difference": difference,
        "timings": {key: timing.to_dict() for key, timing in timings.items()},
    }


def run() -> dict[str, Any]:
    """Time every model; returns a JSON-able record."""
    return {
        "device": str(get_device().info),
        "cores": cores(),
        "rows": [_measured(name) for name in models()],
    }


def table(result: dict[str, Any]) -> str:
    """Lay out the result of `run` for reading."""
    rows = result["rows"]
    width = 2 + max(len(row["name"]) for row in rows)
    lines = [
        f"OpenCL device: {result['device']}, {result['cores']} cores; numpy on one core",
        "Mevals/s in single precision, sum of squares included; * where numpy's formula turns",
        "to double; CPU: ratio of CPU seconds on all cores, for a machine with neighbours;",
        "difference: largest relative one of the sums",
        f"{'':<{width}}{'lobefit':>9}{'numpy':>9}{'lobefit is':>13}{'CPU':>8}{'difference':>12}",
    ]
    for row in rows:
        mark = " " if row["numpy_single"] else "*"
        lines.append(
            f"{row['name']:<{width}}{row['lobefit_mevals_per_s']:>9.0f}"
            f"{row['numpy_mevals_per_s']:>8.1f}{mark}{row['lobefit_faster']:>11.1f} x"
            f"{row['lobefit_cheaper']:>6.1f} x{row['relative_difference']:>12.1e}"
        )
    slow = [row["name"] for row in rows if row["lobefit_faster"] < TIMES]
    lines.append(f"less than {TIMES:g} times faster: {', '.join(slow) or 'none'}")
    return "\n".join(lines)


def main() -> None:
    """Print the machine and the table."""
    print("; ".join(f"{key} {value}" for key, value in machine().items()))
    print(table(run()))


if __name__ == "__main__":
    main()
