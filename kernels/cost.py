"""What a model costs: nanoseconds per direction, measured on a device."""

from __future__ import annotations

import statistics
import time
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lobefit.kernels.device import Device, get_device
from lobefit.kernels.geometry import Directions, Precision
from lobefit.kernels.library import Parameter
from lobefit.kernels.parameters import coefficients_of, complete
from lobefit.kernels.program import model_program
from lobefit.kernels.registry import Model, get_model
from lobefit.kernels.sums import Observations, chi_square

__all__ = ["Cost", "Workload", "model_cost"]

Array = NDArray[np.float64]

DIRECTIONS = 16384
SETS = 64
ROUNDS = 7
LEAST_S = 0.01  # a round repeats the launch for so long


@dataclass(frozen=True, slots=True)
class Cost:
    """What one evaluation of a model takes within the sum of weighted squared residuals.

    Attributes
    ----------
    ns : float
        Nanoseconds per direction and set of parameters: the median of the rounds.
    fastest, slowest : float
        The same of the extreme rounds.
    device : str
        What it was measured on, for people.
    """

    ns: float
    fastest: float
    slowest: float
    device: str


def _spread(p: Parameter, share: Array) -> Array:
    """Place values in a range, shares of 0 to 1, on the scale that the parameter is searched on."""
    low, high = p.bounds
    if p.scale == "log":
        return np.asarray(low * (high / low) ** share)
    return np.asarray(low + (high - low) * share)


class Workload:
    """The inner loop of a fit: 64 parameter sets of a model over 16,384 directions, one channel.

    Directions are uniform in solid angle down to 80 degrees. The nonlinear parameters spread over
    the middle half of their ranges, the linear ones have their defaults, and every measured value
    is `VALUE` with weight 1. Calling it sums the squared residuals.

    Parameters
    ----------
    model : str or Model
        A registered model or a sum.
    options : mapping of str to str, optional
        Choices that it is compiled with.
    device : str, Device or None
        See `lobefit.kernels.get_device`.
    precision : {"single", "double"}
        Of the terms.

    Attributes
    ----------
    angles : tuple of ndarray, shape (16384,)
        theta_i, phi_i, theta_o, phi_o in radians.
    x : ndarray, shape (64, n_x)
        The nonlinear parameters.
    evaluations : int
        Of the model per call: sets times directions.
    device : str
        Where it runs, for people.
    """

    VALUE = 0.1

    def __init__(
        self,
        model: str | Model,
        *,
        options: Mapping[str, str] | None = None,
        device: str | Device | None = None,
        precision: Precision = "single",
    ) -> None:
        self.model = (model if isinstance(model, Model) else get_model(model)).choose(options)
        rng = np.random.default_rng(20)
        theta_i, theta_o = np.arccos(rng.uniform(np.cos(np.radians(80.0)), 1.0, (2, DIRECTIONS)))
        phi_i, phi_o = rng.uniform(0.0, 2.0 * np.pi, (2, DIRECTIONS))
        self.angles = (theta_i, phi_i, theta_o, phi_o)
        shares = [0.25 + 0.5 * (rng.permutation(SETS) + 0.5) / SETS for _ in self.model.nonlinear]
        columns = [_spread(p, s) for p, s in zip(self.model.nonlinear, shares, strict=True)]
        self.x = np.stack(columns, axis=-1) if columns else np.zeros((SETS, 0))
        self.evaluations = SETS * DIRECTIONS
        defaults = coefficients_of(self.model, complete(self.model, {}))
        self._coefficients = np.broadcast_to(defaults, (SETS, *defaults.shape))
        self._program = model_program(self.model)
        opened = get_device(device)
        self.device = str(opened.info)
        self._directions = Directions(opened, *self.angles, precision)
        try:
            values = np.full((1, DIRECTIONS), self.VALUE)
            self._observations = Observations(self._directions, values, np.ones_like(values))
        except Exception:
            self._directions.release()
            raise

    def __call__(self) -> Array:
        """Sum the squared residuals of each set, shape (64,)."""
        return chi_square(self._program, self._observations, self.x, self._coefficients)[:, 0]

    def release(self) -> None:
        """Free the device's memory."""
        self._observations.release()
        self._directions.release()


def model_cost(
    model: str | Model,
    *,
    options: Mapping[str, str] | None = None,
    device: str | Device | None = None,
    rounds: int = ROUNDS,
) -> Cost:
    """Measure what one evaluation of a model takes: the `Workload`, divided by its evaluations.

    Parameters
    ----------
    model : str or Model
        A registered model, such as "ggx", or a sum, such as "ggx+ggx".
    options : mapping of str to str, optional
        Choices that it is compiled with, such as ``{"masking": "smith_separable"}``.
    device : str, Device or None
        See `lobefit.kernels.get_device`.
    rounds : int
        Timed rounds, of some 10 ms each; compilation and the first launches are not timed.

    Returns
    -------
    Cost
        In nanoseconds, on all cores of the device; weight, square and sum included.

    Raises
    ------
    ModelError
        Unknown model or option.
    DeviceError
        No usable OpenCL device.
    """
    work = Workload(model, options=options, device=device)
    try:
        work()
        work()
        times = []
        for _ in range(rounds):
            calls, start, elapsed = 0, time.perf_counter(), 0.0
            while elapsed < LEAST_S:
                work()
                calls += 1
                elapsed = time.perf_counter() - start
            times.append(1e9 * elapsed / (calls * work.evaluations))
    finally:
        work.release()
    return Cost(statistics.median(times), min(times), max(times), work.device)
