"""The posterior density of a measurement, for many walkers in one launch."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lobefit.fitting.measurement import Measurement
from lobefit.fitting.space import Space
from lobefit.kernels import Device
from lobefit.kernels.evaluate import basis_values
from lobefit.kernels.geometry import Directions, Precision
from lobefit.kernels.likelihood import Likelihood
from lobefit.kernels.program import model_program

__all__ = ["Censoring", "Density", "model_values"]

Array = NDArray[np.float64]

# Up to here double precision costs little more, and the rounding of single precision shows in
# the log-probability: its error grows with the number of values.
DOUBLE_UP_TO = 8192


@dataclass(frozen=True, slots=True)
class Censoring:
    """Values that are known only to lie beyond a level, in 1/sr.

    Attributes
    ----------
    saturation : float or None
        Readings at or above it were saturated: the surface is at least as bright.
    floor : float or None
        Readings at or below it are below what the instrument detects.
    """

    saturation: float | None = None
    floor: float | None = None

    def apply(self, values: Array) -> tuple[Array, NDArray[np.int_] | None]:
        """Give the values with the levels in place of what lies beyond, and the sides."""
        if self.saturation is None and self.floor is None:
            return values, None
        high = np.inf if self.saturation is None else self.saturation
        low = -np.inf if self.floor is None else self.floor
        sides = (values >= high).astype(np.int_) - (values <= low).astype(np.int_)
        return np.clip(values, low, high), sides


class Density:
    """The logarithm of the posterior density over the coordinates q of a space.

    Parameters
    ----------
    space : Space
        Parameters, priors and coordinates.
    measurement : Measurement
        N directions, C channels.
    device : Device
        Where the likelihood is summed.
    sigma : ndarray, shape (C, N), optional
        Known uncertainties; needed unless the space has the noise's scales.
    power : float
        What the log-likelihood is multiplied with; below 1 where values do not count singly.
    censoring : Censoring
        Which values are known only to lie beyond a level.
    precision : {"single", "double"}, optional
        Of the terms; by the number of directions where left out.

    Attributes
    ----------
    sets : int
        Parameter sets that were asked for.
    not_finite : int
        Sets inside the prior whose log-probability was not finite; they count as -inf.
    """

    def __init__(
        self,
        space: Space,
        measurement: Measurement,
        device: Device,
        *,
        sigma: Array | None = None,
        power: float = 1.0,
        censoring: Censoring | None = None,
        precision: Precision | None = None,
    ) -> None:
        m = measurement
        self.space, self.measurement, self.power = space, m, power
        if precision is None:
            precision = "double" if m.n_directions <= DOUBLE_UP_TO else "single"
        values, sides = (censoring or Censoring()).apply(m.values)
        self.directions = Directions(device, m.theta_i, m.phi_i, m.theta_o, m.phi_o, precision)
        self.likelihood = Likelihood(
            model_program(space.candidate.model),
            self.directions,
            values,
            None if space.noise == "fit" else sigma,
            student=space.student,
            sides=sides,
        )
        self.sets = self.not_finite = 0

    def __call__(self, q: Array) -> Array:
        """Give the log-probabilities of q, shape (W, n), up to a constant: shape (W,)."""
        theta = self.space.transforms.to_parameters(q)
        total = self.space.log_prior(q, theta)
        possible = total > -np.inf
        self.sets += len(q)
        # A whole batch keeps the launch's shape; what cannot be is looked at anyway.
        if not possible.all():
            if not possible.any():
                return total
            theta[~possible] = theta[int(np.argmax(possible))]
        total += self.power * self.log_likelihood(theta)
        bad = possible & ~np.isfinite(total)
        self.not_finite += int(bad.sum())
        total[~possible | bad] = -np.inf
        return total

    def log_likelihood(self, theta: Array) -> Array:
        """Give the log-likelihood of theta, shape (W, n), summed over rows and channels."""
        a = self.space.arguments(theta)
        by_channel = self.likelihood(
            a.x, a.coefficients, a.additive, a.relative, scale=a.scale, nu=a.nu
        )
        return np.asarray(by_channel.sum(axis=1))

    def release(self) -> None:
        """Free the device's memory."""
        self.likelihood.release()
        self.directions.release()


def model_values(space: Space, theta: Array, directions: Directions) -> Array:
    """Give the model's values in 1/sr at theta of shape (W, n): shape (W, C, N)."""
    a = space.arguments(theta)
    program = model_program(space.candidate.model)
    if a.x.ndim == 2:
        basis = basis_values(program, directions, a.x)
        return np.asarray(a.coefficients @ basis)
    basis = basis_values(program, directions, a.x.reshape(-1, a.x.shape[2]))
    basis = basis.reshape(*a.x.shape[:2], *basis.shape[1:])
    return np.asarray((a.coefficients[:, :, None, :] @ basis)[:, :, 0])
