"""How well a fitted model describes the measurement: residuals by size and by angle."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lobefit.fitting.measurement import Measurement
from lobefit.fitting.result import Decade

__all__ = ["decades", "log10_rms", "worst_regions"]

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

# Half angles (degrees) that count as the lobe itself.
NEAR_MIRROR = 5.0
NEAR_RETRO = 5.0


def log10_rms(measured: Array, fitted: Array, used: Mask) -> tuple[float | None, int, int]:
    """Give the rms of log10(fitted/measured), how many values it has, how many it lacks."""
    positive = used & (measured > 0.0) & (fitted > 0.0)
    count = int(positive.sum())
    if not count:
        return None, 0, int(used.sum())
    ratio = np.log10(fitted[positive] / measured[positive])
    return float(np.sqrt(np.mean(ratio**2))), count, int(used.sum()) - count


def decades(measured: Array, fitted: Array, used: Mask) -> tuple[Decade, ...]:
    """Summarise relative residuals (measured - fitted)/fitted by decade of the measured value."""
    positive = used & (measured > 0.0) & (fitted > 0.0)
    if not positive.any():
        return ()
    y, f = measured[positive], fitted[positive]
    decade = np.floor(np.log10(y)).astype(int)
    # Relative to the larger of the two: bounded, and the same for small residuals.
    relative = (y - f) / np.maximum(y, f)
    first = int(decade.min())
    count = np.bincount(decade - first)
    mean = np.bincount(decade - first, relative)
    square = np.bincount(decade - first, relative**2)
    return tuple(
        Decade(
            low=10.0 ** (first + k),
            high=10.0 ** (first + k + 1),
            count=int(count[k]),
            mean_relative=float(mean[k] / count[k]),
            rms_relative=float(np.sqrt(square[k] / count[k])),
        )
        for k in range(len(count))
        if count[k]
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
    m = measurement
    delta = np.cos(m.phi_o - m.phi_i)
    cos_o, cos_i = np.cos(m.theta_o), np.cos(m.theta_i)
    sines = np.sin(m.theta_i) * np.sin(m.theta_o)
    cos_io = cos_i * cos_o + sines * delta
    cos_r = cos_i * cos_o - sines * delta
    near = np.degrees(0.5 * np.arccos(np.clip(cos_r, -1.0, 1.0))) < NEAR_MIRROR
    retro = np.degrees(np.arccos(np.clip(cos_io, -1.0, 1.0))) < NEAR_RETRO
    side = np.where(delta < -0.7, 0, np.where(delta > 0.7, 1, 2))
    kind = np.where(near, 3, np.where(retro, 4, side))
    names = ("forward", "backward", "sideways", "at the mirror direction", "at retro-reflection")
    bin_i = np.minimum(np.degrees(m.theta_i) // 15, 5).astype(int)
    bin_o = np.minimum(np.degrees(m.theta_o) // 15, 5).astype(int)
    region = (bin_i * 6 + bin_o) * 5 + kind
    z2 = np.where(used, np.nan_to_num(z) ** 2, 0.0)
    share = np.bincount(region, z2.sum(axis=0), minlength=180)
    larger = np.maximum(np.abs(m.values), np.abs(fitted))
    signed = np.where(used, (fitted - m.values) / np.where(larger > 0.0, larger, 1.0), 0.0)
    signed = np.nan_to_num(signed)
    counted = np.bincount(region, used.sum(axis=0), minlength=180)
    mean = np.bincount(region, signed.sum(axis=0), minlength=180) / np.maximum(counted, 1)
    total = share.sum()
    texts = []
    for k in np.argsort(-share, kind="stable")[:most]:
        if not total > 0.0 or share[k] < 0.05 * total:
            break
        i, o, how = k // 30, k // 5 % 6, names[k % 5]
        direction = "low" if mean[k] < 0.0 else "high"
        texts.append(
            f"theta_i {15 * i}-{15 * i + 15}°, theta_o {15 * o}-{15 * o + 15}°, {how}: model "
            f"{100 * abs(mean[k]):.0f} % too {direction} ({100 * share[k] / total:.0f} % of the misfit)"
        )
    return tuple(texts)
