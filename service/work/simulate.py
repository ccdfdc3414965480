"""The CSV that an instrument would have measured of a model surface."""

from __future__ import annotations

from lobefit.fitting import simulate, write_measurement
from lobefit.fitting.scan_patterns import pattern
from lobefit.kernels.errors import MeasurementError
from lobefit.service.task import Outcome, Refused, Task, file_answer

__all__ = ["check_geometry", "perform"]

MOST_DIRECTIONS = 400_000


def check_geometry(geometry: str) -> None:
    """Raise `Refused` for a geometry that is none, or of too many directions."""
    try:
        # Before any are made; anisotropic models have the sample turned in four steps.
        count = 4 * pattern(geometry).at_most
    except MeasurementError as error:
        raise Refused("invalid-request", str(error)) from error
    if count > MOST_DIRECTIONS:
        raise Refused(
            "invalid-request",
            f"the geometry may have {count:,.0f} directions, {MOST_DIRECTIONS:,} are the most here; "
            "take larger steps",
        )


def perform(task: Task) -> Outcome:
    """Simulate and write a CSV."""
    wanted = task.request
    geometry = wanted.get("geometry", "in-plane")
    check_geometry(geometry)
    relative, additive = wanted.get("noise", (0.02, 0.001))
    measurement = simulate(
        wanted["model"],
        wanted.get("params") or {},
        geometry=geometry,
        noise=(relative, additive),
        seed=wanted.get("seed", 0),
        options=wanted.get("options") or None,
        sigma=wanted.get("sigma", False),
    )
    path = task.folder / "simulated.csv"
    write_measurement(measurement, path)
    return file_answer(path, "text/csv")
