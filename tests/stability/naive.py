"""What one writes without Lobefit: formulas in numpy, plain calls of scipy and NLopt."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.optimize import curve_fit

from lobefit.fitting import Measurement
from tests.kernels.transcriptions import load

__all__ = ["Array", "angles", "beckmann", "errors", "ggx", "ggx_of_scale_1", "least_squares"]

Array = npt.NDArray[np.float64]


def angles(m: Measurement) -> Array:
    """Stack the four angles of a measurement, shape (4, N)."""
    return np.stack([m.theta_i, m.phi_i, m.theta_o, m.phi_o])


def ggx(x: Array, k_d: float, k_s: float, F0: float, alpha: float) -> Array:
    """Evaluate GGX; the sign of alpha is not looked at, so that no bound is needed."""
    values = load("ggx")(*x, k_d=k_d, k_s=k_s, F0=F0, alpha=abs(alpha))
    return np.asarray(values[0], dtype=np.float64)


def ggx_of_scale_1(x: Array, k_d: float, F0: float, alpha: float) -> Array:
    """Evaluate GGX with k_s = 1."""
    return ggx(x, k_d, 1.0, F0, alpha)


def beckmann(x: Array, k_d: float, F0: float, log_alpha: float) -> Array:
    """Evaluate Beckmann's microfacet model with k_s = 1 and the logarithm of its width."""
    alpha = float(np.exp(log_alpha))
    values = load("beckmann")(*x, k_d=k_d, k_s=1.0, F0=F0, alpha=alpha)
    return np.asarray(values[0], dtype=np.float64)


def least_squares(
    model: Callable[..., Array], m: Measurement, start: Sequence[float], **settings: Any
) -> tuple[Array, Array]:
    """Fit by `scipy.optimize.curve_fit`; gives parameters and their covariance."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        found, covariance = curve_fit(model, angles(m), m.values[0], p0=start, **settings)
    return found, covariance


def errors(covariance: Array) -> Array:
    """Give standard errors of a covariance."""
    return np.sqrt(np.diag(covariance))
