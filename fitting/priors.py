"""Priors: what is held of a parameter before the data, declared on its physical scale.

===========================  ==========================================  =======================
parameter                    prior                                       sampled coordinate q
===========================  ==========================================  =======================
linear, bounded below        `Lomax`, median 1 (k_d, k_s, ...): half of  log(theta - low); of a scale
                             it below 1, no bound above                  with a ratio, see below
linear, bounded on both      `Uniform` (F0, base_color)                  logit of the share of
sides                                                                    the range
nonlinear, scale "log"       `LogUniform` over the record's bounds       logit of the share of
                             (alpha, n, eta)                             the range's logarithm
nonlinear, other scales      `Uniform` over the record's bounds          logit of the share of
                                                                         the range
angle of a period            `Uniform` over the period                   the angle itself, within
                                                                         half a period of the fit
noise_relative               `Lomax`, median 0.05                        log(theta)
noise_additive               `Lomax`, median 0.01 1/sr                   log(theta)
sigma_scale                  `LogNormal`, median 1, a factor 10 is two   log(theta)
                             standard deviations
nu (Student's t)             `LogNormal`, median 10, a factor 10 is two  log(theta)
                             standard deviations
===========================  ==========================================  =======================

All are weakly informative: over any range that the data leave open they are nearly flat, their
tails are heavy, and none depends on the data. The physical parameters (k_d, k_s, F0) are
what priors are declared for, not products of them such as k_s F0. No coordinate has an edge, and
a Lomax, Uniform or LogUniform prior becomes a logistic density in q, log-concave with
exponential tails.

A scale with a ratio (k_s with F0) is sampled as log(a k_s F0 + b k_s), the combination of the two
coefficients that the data know best (the first eigenvector of their information at the point fit).
At small angles of incidence that is k_s F0, whose ridge is 2 % wide and bent by a factor 25 in
(log k_s, logit F0); it is straight in these coordinates. At a given F0 it is log(k_s) but for a
shift, so the Jacobian is still the product of d theta / d q, a coordinate at a time.

The two scales of a channel's noise are sampled as log(v)/2, v = additive^2 + (relative level)^2 at
the median level of the channel, and the logit of additive^2 / v, with the Jacobian of the pair:
where all readings are of about one level, only v is known.

Another prior takes its place by name: ``priors={"alpha": LogNormal(0.2, 0.5), "k_s": ...}``. Any
object with ``support``, ``log_density`` and ``draw`` will do; it need not be normalised.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from lobefit.kernels import Parameter

__all__ = [
    "NOISE_PRIORS",
    "HalfNormal",
    "LogNormal",
    "LogUniform",
    "Lomax",
    "Normal",
    "Prior",
    "Uniform",
    "default_prior",
]

Array = NDArray[np.float64]


@runtime_checkable
class Prior(Protocol):
    """What a prior can do; theta is on the physical scale."""

    @property
    def support(self) -> tuple[float, float]:
        """Between which values the density is positive."""

    def log_density(self, theta: Array) -> Array:
        """Give the logarithm of the density, up to a constant, within the support."""

    def draw(self, rng: np.random.Generator, size: int) -> Array:
        """Draw values."""


@dataclass(frozen=True, slots=True)
class _Between:
    low: float
    high: float

    @property
    def support(self) -> tuple[float, float]:
        """From low to high."""
        return self.low, self.high


@dataclass(frozen=True, slots=True)
class Uniform(_Between):
    """The same density from `low` to `high`."""

    def log_density(self, theta: Array) -> Array:
        """Give -log(high - low)."""
        return np.asarray(np.zeros_like(theta) - np.log(self.high - self.low))

    def draw(self, rng: np.random.Generator, size: int) -> Array:
        """Draw values."""
        return np.asarray(rng.uniform(self.low, self.high, size))


@dataclass(frozen=True, slots=True)
class LogUniform(_Between):
    """The same density of log(theta) from `low` to `high`, both positive."""

    def log_density(self, theta: Array) -> Array:
        """Give -log(theta log(high / low))."""
        density: Array = -np.log(theta) - np.log(np.log(self.high / self.low))
        return density

    def draw(self, rng: np.random.Generator, size: int) -> Array:
        """Draw values."""
        drawn: Array = np.exp(rng.uniform(np.log(self.low), np.log(self.high), size))
        return drawn


@dataclass(frozen=True, slots=True)
class Lomax:
    """Density scale / (scale + theta - low)^2 above `low`: median low + scale, a heavy tail."""

    scale: float
    low: float = 0.0

    @property
    def support(self) -> tuple[float, float]:
        """Above low."""
        return self.low, np.inf

    def log_density(self, theta: Array) -> Array:
        """Give log(scale) - 2 log(scale + theta - low)."""
        density: Array = np.log(self.scale) - 2.0 * np.log(self.scale + (theta - self.low))
        return density

    def draw(self, rng: np.random.Generator, size: int) -> Array:
        """Draw values."""
        share = rng.uniform(size=size)
        drawn: Array = self.low + self.scale * share / (1.0 - share)
        return drawn


@dataclass(frozen=True, slots=True)
class LogNormal:
    """A normal distribution of log(theta) about log(`median`), with standard deviation `sd`."""

    median: float
    sd: float

    @property
    def support(self) -> tuple[float, float]:
        """Above 0."""
        return 0.0, np.inf

    def log_density(self, theta: Array) -> Array:
        """Give the density of theta, that of its logarithm over theta."""
        log = np.log(theta)
        z = (log - np.log(self.median)) / self.sd
        density: Array = -0.5 * z * z - log - np.log(self.sd * np.sqrt(2.0 * np.pi))
        return density

    def draw(self, rng: np.random.Generator, size: int) -> Array:
        """Draw values."""
        drawn: Array = self.median * np.exp(self.sd * rng.standard_normal(size))
        return drawn


@dataclass(frozen=True, slots=True)
class Normal:
    """A normal distribution; the parameter's bounds cut it off."""

    mean: float
    sd: float

    @property
    def support(self) -> tuple[float, float]:
        """Everywhere."""
        return -np.inf, np.inf

    def log_density(self, theta: Array) -> Array:
        """Give the density of the whole distribution."""
        z = (theta - self.mean) / self.sd
        density: Array = -0.5 * z * z - np.log(self.sd * np.sqrt(2.0 * np.pi))
        return density

    def draw(self, rng: np.random.Generator, size: int) -> Array:
        """Draw values."""
        return rng.normal(self.mean, self.sd, size)


@dataclass(frozen=True, slots=True)
class HalfNormal:
    """The upper half of a normal distribution about 0 with standard deviation `scale`."""

    scale: float

    @property
    def support(self) -> tuple[float, float]:
        """Above 0."""
        return 0.0, np.inf

    def log_density(self, theta: Array) -> Array:
        """Give the density, twice that of the whole distribution."""
        z = theta / self.scale
        density: Array = -0.5 * z * z - np.log(self.scale * np.sqrt(0.5 * np.pi))
        return density

    def draw(self, rng: np.random.Generator, size: int) -> Array:
        """Draw values."""
        drawn: Array = self.scale * np.abs(rng.standard_normal(size))
        return drawn


NOISE_PRIORS: dict[str, Prior] = {
    "noise_relative": Lomax(0.05),
    "noise_additive": Lomax(0.01),
    "sigma_scale": LogNormal(1.0, 0.5 * np.log(10.0)),
    "nu": LogNormal(10.0, 0.5 * np.log(10.0)),
}


def default_prior(parameter: Parameter) -> Prior:
    """Give the prior of a model's parameter, after the table of this module."""
    low, high = parameter.bounds
    if np.isfinite(high) and np.isfinite(low):
        return LogUniform(low, high) if parameter.scale == "log" else Uniform(low, high)
    return Lomax(1.0, low)
