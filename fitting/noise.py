"""The noise of a measurement, estimated from the residuals where no sigma is given.

``sigma^2 = additive^2 + (relative h)^2`` with h the *model's* value f: weights from
the measured value would favour low readings and bias the scale. Only for gross
misfits, beyond what noise can be, h is at least half the measured value: otherwise
a model that misses a peak by decades would be pulled up until everything else is
wrong.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["GROSS", "estimate_noise", "gaussian_deviance", "level", "variance"]

Array = NDArray[np.float64]

# A relative scale above this is no instrument's noise but a model that does not fit.
GROSS = 0.25
# Differences of -2 ln L below this decide nothing.
EQUAL = 4.0
# Ratios additive^2 / relative^2 that are tried, in units of the largest f^2:
# from "all relative" to "all additive".
RATIOS = np.geomspace(1e-14, 1e2, 49)
# Enough values for two scales; more would only cost time.
ENOUGH = 4096
# Fewer readings than this in a channel do not give it two scales of its own.
FEW = 30
# Readings of up to so many times the scatter of the darker half may be noise alone.
SCATTER = 5.0


def level(f: Array, measured: Array, *, gross: bool) -> Array:
    """Give the level h that relative noise refers to.

    Parameters
    ----------
    f, measured : ndarray, shape (C, N)
        Model and measured values, 1/sr.
    gross : bool
        Take the measured value into account where it is far above the model's, but
        not where negative readings show that it may be additive noise.

    Returns
    -------
    ndarray, shape (C, N)
        1/sr.
    """
    if not gross:
        return f
    h: Array = np.abs(measured)
    h *= 0.5
    for f_c, y_c, h_c in zip(f, measured, h, strict=True):
        stride = -(-f_c.size // ENOUGH)
        few_f, few_y = f_c[::stride], y_c[::stride]
        dark = (few_f <= np.median(few_f)) & np.isfinite(few_y)
        if (few_y < 0.0).any():
            scatter = 1.4826 * np.median(np.abs(few_y - few_f)[dark])
            h_c[h_c < 0.5 * SCATTER * scatter] = 0.0
    return np.fmax(f, h, out=h)


def variance(h: Array, additive: Array, relative: Array) -> Array:
    """Give sigma^2, shape (C, N), of levels h (C, N) and scales (C,)."""
    v: Array = h * h
    v *= (relative**2)[:, None]
    v += (additive**2)[:, None]
    return v


def gaussian_deviance(residuals: Array, v: Array, used: NDArray[np.bool_]) -> float:
    """Give -2 ln L of residuals with variances v, the log sigma terms included."""
    total = 0.0
    for r, v_c, u in zip(residuals, v, used, strict=True):  # by channel, to save memory
        total += float(np.sum(r * r / v_c + np.log(2.0 * np.pi * v_c), where=u))
    return total


def estimate_noise(
    residuals: Array, h: Array, used: NDArray[np.bool_], n_parameters: int, *, relative: bool = True
) -> tuple[Array, Array]:
    """Estimate the two scales of the noise of each channel by maximum likelihood.

    Parameters
    ----------
    residuals : ndarray, shape (C, N)
        Measured minus model, 1/sr.
    h : ndarray, shape (C, N)
        Levels that relative noise refers to, 1/sr.
    used : ndarray of bool, shape (C, N)
        Which values count.
    n_parameters : int
        Free parameters of the fit, for the degrees of freedom.
    relative : bool
        False holds the relative scale at 0 (constant noise).

    Returns
    -------
    additive, relative : ndarray, shape (C,)
        Scales in 1/sr and 1.
    """
    channels = len(h)
    additive, proportional = np.zeros(channels), np.zeros(channels)
    counts = used.sum(axis=1)
    # The parameters are shared out over the channels: their own ones, and a part of the rest.
    freedom = np.maximum(counts - n_parameters / channels, 0.5) / np.maximum(counts, 1)
    for c in np.flatnonzero(counts >= FEW):
        r2, h2 = residuals[c, used[c]] ** 2, h[c, used[c]] ** 2
        additive[c], proportional[c] = _scales(r2, h2, freedom[c], relative=relative)
    few = np.flatnonzero(counts < FEW)
    if few.size:  # too few readings for two scales of their own: those of all channels
        size = np.array(
            [np.median(np.abs(h[c, used[c]])) if counts[c] else 0.0 for c in range(channels)]
        )
        size = np.where(size > 0.0, size, 1.0)
        every = [c for c in range(channels) if counts[c]]
        if not every:
            return np.ones(channels), proportional
        r2, h2 = (
            np.concatenate([(a[c, used[c]] / size[c]) ** 2 for c in every]) for a in (residuals, h)
        )
        pooled = max(counts.sum() - n_parameters, 0.5) / counts.sum()
        scales = _scales(r2, h2, pooled, relative=relative)
        additive[few], proportional[few] = scales[0] * size[few], scales[1]
    # Exact data have no noise; a scale far below any datum keeps the weights finite.
    largest = np.where(used, np.abs(h), 0.0).max(axis=1)
    negligible = (additive == 0.0) | ~np.isfinite(additive)
    additive = np.where(negligible, 1e-12 * largest + 1e-150, additive)
    return additive, proportional


def _scales(r2: Array, h2: Array, freedom: float, *, relative: bool) -> tuple[float, float]:
    """Give both scales from squared residuals and levels."""
    if not relative or not (h2.max() > 0.0):
        return float(np.sqrt(r2.mean() / freedom)), 0.0
    stride = -(-r2.size // ENOUGH)
    ratio = _best_ratio(r2[::stride], h2[::stride])
    scale2 = float(np.mean(r2 / (ratio + h2))) / freedom
    return float(np.sqrt(scale2 * ratio)), float(np.sqrt(scale2))


def _best_ratio(r2: Array, h2: Array) -> float:
    """Profile likelihood over the ratio of the two variances, refined twice."""
    grid = np.log(RATIOS * h2.max())
    for _ in range(3):
        shape = np.exp(grid)[:, None] + h2
        relative2 = np.mean(r2 / shape, axis=1)
        cost = r2.size * np.log(relative2 + 1e-300) + np.log(shape).sum(axis=1)
        k = int(np.argmin(cost))
        # A nearly constant model cannot tell the two scales apart; then additive noise is
        # the explanation that needs no gross relative one.
        modest = np.flatnonzero((relative2 <= GROSS**2) & (cost <= cost[k] + EQUAL))
        if relative2[k] > GROSS**2 and modest.size:
            return float(np.exp(grid[modest[-1]]))
        low, high = grid[max(k - 1, 0)], grid[min(k + 1, len(grid) - 1)]
        best = float(grid[k])
        grid = np.linspace(low, high, 15)
    return float(np.exp(best))
