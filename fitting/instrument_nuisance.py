"""What a tilt and a gain that are not known do to the errors of everything else.

With P the covariance of the parameters at a known instrument, X the products of their columns
with those of the tilt, and S the tilt's own information with the parameters eliminated, the
parameters' covariance grows by ``P X S^-1 X^T P`` (the inverse of a matrix in blocks). A gain is
not fitted: what an error of it does to the estimates is propagated, as an uncertainty of a
calibration is.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["MOUNTING", "Nuisance"]

Array = NDArray[np.float64]

MOUNTING = math.radians(2.0)
"""Standard deviation of the tilts' prior: what a mounting by hand leaves, in radians."""


@dataclass(frozen=True, slots=True)
class Nuisance:
    """The instrument's unknowns beside a candidate's parameters (t, d), m of them in all.

    Attributes
    ----------
    tilt : ndarray, shape (q,)
        Radians; q is 2, or 0 where the tilt is not fitted.
    cross : ndarray, shape (m, q)
        Weighted products of the columns of the parameters with those of the tilt.
    inner : ndarray, shape (q, q)
        Of the tilt's columns with themselves, the prior's precision included.
    gain : float
        Relative standard uncertainty of each channel's calibration; 0 for none.
    gain_cross, gain_tilt : ndarray, shape (m, C) and (q, C)
        Products of the columns with the model's values in each channel.
    """

    tilt: Array
    cross: Array
    inner: Array
    gain: float
    gain_cross: Array
    gain_tilt: Array

    def covariance(self, known: Array) -> Array:
        """Give the tilt's covariance (q, q), given the parameters' at a known tilt (m, m)."""
        return np.asarray(np.linalg.inv(self.inner - self.cross.T @ known @ self.cross))

    def widened(self, known: Array, variance_scale: float) -> Array:
        """Give the parameters' covariance with tilt and gain unknown.

        Parameters
        ----------
        known : ndarray, shape (m, m)
            Their covariance with both known, in units of the residuals' variance.
        variance_scale : float
            What it is multiplied with in the end; a gain's part is not.
        """
        own = self.covariance(known)
        lever = known @ self.cross
        full: Array = known + lever @ own @ lever.T
        if self.gain and variance_scale > 0.0:
            moved = full @ self.gain_cross - lever @ own @ self.gain_tilt
            full = full + (self.gain**2 / variance_scale) * moved @ moved.T
        return full

    def tilt_covariance(self, known: Array, variance_scale: float) -> Array:
        """Give the tilt's covariance (q, q) in radians squared, the gain unknown."""
        own = self.covariance(known)
        found: Array = variance_scale * own
        if self.gain:
            moved = own @ (self.gain_tilt - self.cross.T @ known @ self.gain_cross)
            found = found + self.gain**2 * moved @ moved.T
        return found
