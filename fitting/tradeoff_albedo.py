"""Quadrature grids of the directional albedo against each other: nodes, and what they miss."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from lobefit.fitting.result import FitResult
from lobefit.fitting.tradeoff_points import Panel, Point, Spread
from lobefit.fitting.tradeoff_timing import Clock, interleaved
from lobefit.kernels import Device, candidate
from lobefit.kernels.albedo import azimuth_refinement, model_albedo
from lobefit.kernels.parameters import complete, nonlinear_of

__all__ = ["albedo_panel"]

Array = NDArray[np.float64]

ORDERS = (2, 3, 4, 6, 8)
AZIMUTHS = (16, 32, 64, 128, 256)
# What the coarse grid of reports and `directional_albedo` take.
COARSE, USUAL = (4, 64), (8, 256)
FINE = (12, 512)
INCIDENCES = np.radians([0.0, 40.0, 75.0])
LEAST = 2.0**-53


def albedo_panel(result: FitResult, device: Device, *, repeats: int, clock: Clock) -> Panel:
    """Measure the albedo of a fitted model on every grid.

    Parameters
    ----------
    result : FitResult
        Whose model is integrated.
    device : Device
    repeats : int
    clock : callable

    Returns
    -------
    Panel
    """
    model = candidate(result.candidate, result.options).model
    full = complete(model, result.params)
    refined = azimuth_refinement(model, nonlinear_of(model, full)[0])

    def albedo(order: int, azimuths: int) -> Array:
        return model_albedo(model, full, INCIDENCES, 0.0, device, order, refined * azimuths)

    def task(order: int, azimuths: int) -> Callable[[], Array]:
        return lambda: albedo(order, azimuths)

    reference = albedo(*FINE)
    grids = [(order, azimuths) for order in ORDERS for azimuths in AZIMUTHS]
    errors = [float(np.max(np.abs(albedo(*g) / reference - 1.0))) for g in grids]
    times = interleaved([task(*g) for g in grids], repeats, clock)
    return Panel(
        name="albedo",
        title=f"How to integrate {result.candidate}",
        seconds_label="time of one incidence [s]",
        error_label="largest relative error",
        points=tuple(
            Point(
                label=f"order {order} x {azimuths} azimuths"
                + {COARSE: " (reports)", USUAL: " (usual)"}.get((order, azimuths), ""),
                group=f"order {order}",
                seconds=Spread(tuple(t / len(INCIDENCES) for t in ran)),
                error=Spread((max(error, LEAST),)),
                settings={
                    "candidate": result.candidate,
                    "options": dict(result.options),
                    "params": result.params,
                    "order": order,
                    "azimuths": refined * azimuths,
                    "theta_i_deg": np.degrees(INCIDENCES).round(6).tolist(),
                },
                usual=(order, azimuths) == USUAL,
            )
            for (order, azimuths), ran, error in zip(grids, times, errors, strict=True)
        ),
        notes=(
            (
                f"error: of the directional albedo at 0, 40 and 75 degrees, against order {FINE[0]} x "
                f"{refined * FINE[1]} azimuths; time: making the grid and evaluating the model on it"
            ),
        ),
    )
