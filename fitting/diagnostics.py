"""How well a fitted model describes the measurement: residuals by size and by angle."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lobefit.fitting.measurement import Measurement
from lobefit.fitting.result import Decade

__all__ = ["decades", "log10_rms", "rmse", "worst_regions"]

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

# Half angles (degrees) that count as the lobe itself.
NEAR_MIRROR = 5.0
NEAR_RETRO = 5.0
KINDS = ("forward", "backward", "sideways", "at the mirror direction", "at retro-reflection")
# Rows at a time, so that a million of them need little memory.
CHUNK = 131_072


def rmse(measured: Array, fitted: Array, used: Mask) -> float:
    """Give the root mean square residual in 1/sr over all channels."""
    squares = 0.0
    for y, f, u in zip(measured, fitted, used, strict=True):  # by channel, to save memory
        squares += float(np.sum((y - f) ** 2, where=u))
    return float(np.sqrt(squares / used.sum()))


def log10_rms(measured: Array, fitted: Array, used: Mask) -> tuple[float | None, int, int]:
    """Give the rms of log10(fitted/measured), how many values it has, how many it lacks."""
    positive = used & (measured > 0.0) & (fitted > 0.0)
    count = int(positive.sum())
    if not count:
        return None, 0, int(used.sum())
    ratio = fitted[positive]
    ratio /= measured[positive]
    np.log10(ratio, out=ratio)
    return float(np.sqrt(np.mean(ratio**2))), count, int(used.sum()) - count


def decades(measured: Array, fitted: Array, used: Mask) -> tuple[Decade, ...]:
    """Summarise relative residuals, measured minus fitted, by decade of the measured value."""
    lowest, bins = -40, 80
    count, mean, square = np.zeros(bins), np.zeros(bins), np.zeros(bins)
    for y, f, u in zip(measured, fitted, used, strict=True):  # by channel, to save memory
        positive = u & (y > 0.0) & (f > 0.0)
        y, f = y[positive], f[positive]
        decade = np.floor(np.log10(y)).astype(np.intp) - lowest
        decade = np.clip(decade, 0, bins - 1)
        # Relative to the larger of the two: bounded, and the same for small residuals.
        relative = (y - f) / np.maximum(y, f)
        count += np.bincount(decade, minlength=bins)
        mean += np.bincount(decade, relative, minlength=bins)
        square += np.bincount(decade, relative**2, minlength=bins)
    return tuple(
        Decade(
            low=10.0 ** (lowest + k),
            high=10.0 ** (lowest + k + 1),
            count=int(count[k]),
            mean_relative=float(mean[k] / count[k]),
            rms_relative=float(np.sqrt(square[k] / count[k])),
        )
        for k in np.flatnonzero(count)
    )


def worst_regions(
    measurement: Measurement, fitted: Array, z: Array, used: Mask, most: int = 3
) -> tuple[str, ...]:
    """Name the angles where the model fails most, in words.

    Parameters
    ----------
    measurement : Measurement
    fitted : ndarray, shape (C, N)
        Model values, 1/sr.
    z : ndarray, shape (C, N)
        Standardised residuals.
    used : ndarray of bool, shape (C, N)
    most : int
        How many regions.

    Returns
    -------
    tuple of str
        Regions by their share of the misfit, largest first.
    """
    regions = 6 * 6 * 5
    share, mean, counted = np.zeros(regions), np.zeros(regions), np.zeros(regions)
    for start in range(0, measurement.n_directions, CHUNK):
        rows = slice(start, start + CHUNK)
        region = _region(measurement, rows)
        z2 = np.where(used[:, rows], np.nan_to_num(z[:, rows]) ** 2, 0.0)
        share += np.bincount(region, z2.sum(axis=0), minlength=regions)
        y, f = measurement.values[:, rows], fitted[:, rows]
        larger = np.fmax(np.abs(y), np.abs(f))
        signed = np.where(used[:, rows], (f - y) / np.where(larger > 0.0, larger, 1.0), 0.0)
        mean += np.bincount(region, signed.sum(axis=0), minlength=regions)
        counted += np.bincount(region, used[:, rows].sum(axis=0), minlength=regions)
    mean /= np.maximum(counted, 1.0)
    total = share.sum()
    texts = []
    for k in np.argsort(-share, kind="stable")[:most]:
        if not total > 0.0 or share[k] < 0.05 * total:
            break
        i, o, how = k // 30, k // 5 % 6, KINDS[k % 5]
        direction = "low" if mean[k] < 0.0 else "high"
        texts.append(
            f"theta_i {15 * i}-{15 * i + 15}°, theta_o {15 * o}-{15 * o + 15}°, {how}: model "
            f"{100 * abs(mean[k]):.0f} % too {direction} ({100 * share[k] / total:.0f} % of the misfit)"
        )
    return tuple(texts)


def _region(m: Measurement, rows: slice) -> NDArray[np.intp]:
    """Give the number of each row's region: incidence and observation in steps of 15 degrees, and where to."""
    theta_i, theta_o = m.theta_i[rows], m.theta_o[rows]
    delta = np.cos(m.phi_o[rows] - m.phi_i[rows])
    cos_o, cos_i = np.cos(theta_o), np.cos(theta_i)
    sines = np.sin(theta_i) * np.sin(theta_o)
    cos_io = cos_i * cos_o + sines * delta
    cos_r = cos_i * cos_o - sines * delta
    near = cos_r > np.cos(np.radians(2.0 * NEAR_MIRROR))
    retro = cos_io > np.cos(np.radians(NEAR_RETRO))
    side = np.where(delta < -0.7, 0, np.where(delta > 0.7, 1, 2))
    kind = np.where(near, 3, np.where(retro, 4, side))
    bin_i = np.minimum((theta_i * (12.0 / np.pi)).astype(np.intp), 5)
    bin_o = np.minimum((theta_o * (12.0 / np.pi)).astype(np.intp), 5)
    region: NDArray[np.intp] = (bin_i * 6 + bin_o) * 5 + kind
    return region
