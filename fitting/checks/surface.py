"""A fitted model to ask for an albedo where a check was given no result."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from lobefit.fitting.checks.view import View
from lobefit.fitting.dataset import Dataset, thinned
from lobefit.fitting.measurement import Measurement
from lobefit.fitting.noise import gaussian_deviance
from lobefit.fitting.point import fit_point
from lobefit.fitting.uncertainty import estimates
from lobefit.kernels import Device, FitError, MeasurementError, candidates, get_device

__all__ = ["Fitted", "Surface", "fitted_surface"]

# Rows that are enough to know an albedo.
ROWS = 2000


class Fitted(Protocol):
    """What the checks need of a result."""

    @property
    def candidate(self) -> str:
        """Give the form that was fitted."""

    @property
    def model(self) -> str:
        """Give the registered name of the model."""

    @property
    def params(self) -> dict[str, float | list[float]]:
        """Give every parameter."""

    @property
    def options(self) -> Mapping[str, str]:
        """Give the pieces that the model was compiled with."""

    @property
    def channels(self) -> tuple[str, ...]:
        """Give the names of the channels, in the order of the lists in `params`."""


@dataclass(frozen=True)
class Surface:
    """A model fitted to the brightest channel."""

    candidate: str
    model: str
    params: dict[str, float | list[float]]
    options: Mapping[str, str]
    channels: tuple[str, ...]


def fitted_surface(view: View, device: str | Device | None = None) -> Surface | None:
    """Fit the quick candidates to the brightest channel of at most `ROWS` rows.

    Parameters
    ----------
    view : View
        The measurement.
    device : str, Device or None
        See `lobefit.kernels.get_device`.

    Returns
    -------
    Surface or None
        The likeliest; None where nothing could be fitted.
    """
    m = view.m
    mean = np.nan_to_num(m.values).mean(axis=1)
    bright = int(np.argmax(mean))
    if not mean[bright] > 0.0:
        return None
    rows = thinned(view.to_mirror, ROWS)
    rows = rows[np.isfinite(m.values[bright, rows])]
    m = _only(m, rows, bright)
    dataset = Dataset(m, "relative", get_device(device))
    best: tuple[float, Surface] | None = None
    try:
        for candidate in candidates("quick"):
            if not candidate.isotropic:
                continue
            try:
                point = fit_point(candidate, dataset)
            except (FitError, MeasurementError):
                continue
            residuals = dataset.residuals(point.values)
            deviance = gaussian_deviance(residuals, point.sigma**2, dataset.used)
            if best is None or deviance < best[0]:
                found = estimates(point, m.channels, 1.0)
                model = candidate.model
                surface = Surface(
                    candidate.name, model.name, found.params, model.options, m.channels
                )
                best = (deviance, surface)
    finally:
        dataset.release()
    return None if best is None else best[1]


def _only(m: Measurement, rows: NDArray[np.intp], channel: int) -> Measurement:
    return Measurement(
        theta_i=m.theta_i[rows],
        phi_i=m.phi_i[rows],
        theta_o=m.theta_o[rows],
        phi_o=m.phi_o[rows],
        values=m.values[channel : channel + 1, rows],
        channels=(m.channels[channel],),
    )
