"""How well a fitted model describes the measurement: residuals by size and by angle."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lobefit.fitting.measurement import Measurement
from lobefit.fitting.result import Decade, Outliers
from lobefit.kernels.geometry import Directions

__all__ = ["CORRELATED", "BySize", "by_size", "outliers", "regions", "rmse", "worst_regions"]

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

# Half angles (degrees) that count as the lobe itself.
NEAR_MIRROR = 5.0
NEAR_RETRO = 5.0
# Robust standard deviations from the model: no noise reaches them.
OUTLYING = 8.0
# Values per channel that determine the scatter well enough.
ENOUGH = 16_384
# Regions of 15 degrees from the normal to the horizon.
SIDE = 7
# Residuals correlated over more values than this are misfit, which more values do not average out.
CORRELATED = 2.0
KINDS = ("forward", "backward", "sideways", "at the mirror direction", "at retro-reflection")


def rmse(measured: Array, fitted: Array, used: Mask) -> float:
    """Give the root mean square residual in 1/sr over all channels."""
    squares = 0.0
    for y, f, u in zip(measured, fitted, used, strict=True):  # by channel, to save memory
        squares += float(np.sum((y - f) ** 2, where=u))
    return float(np.sqrt(squares / used.sum()))


@dataclass(frozen=True, slots=True)
class BySize:
    """Residuals of positive values against positive fitted ones.

    Attributes
    ----------
    log10_rms : float or None
        Root mean square of log10(fitted/measured); None without such values.
    count, excluded : int
        Values in it, and values where one of the two is not positive.
    decades : tuple of Decade
        Relative residuals, measured minus fitted, by decade of the measured value.
    """

    log10_rms: float | None
    count: int
    excluded: int
    decades: tuple[Decade, ...]


def by_size(measured: Array, fitted: Array, present: Mask) -> BySize:
    """Summarise residuals on the scale of the logarithm.

    Parameters
    ----------
    measured, fitted : ndarray, shape (C, N)
        1/sr.
    present : ndarray of bool, shape (C, N)
        Values that are there.
    """
    lowest, bins = -40, 80
    count, mean, square = np.zeros(bins), np.zeros(bins), np.zeros(bins)
    squares = 0.0
    for y, f, u in zip(measured, fitted, present, strict=True):  # by channel, to save memory
        positive = u & (y > 0.0) & (f > 0.0)
        y, f = y[positive], f[positive]
        ratio = np.log10(f / y)
        squares += float(ratio @ ratio)
        decade = np.floor(np.log10(y)).astype(np.intp) - lowest
        decade = np.clip(decade, 0, bins - 1)
        # Relative to the larger of the two: bounded, and the same for small residuals.
        relative = (y - f) / np.maximum(y, f)
        count += np.bincount(decade, minlength=bins)
        mean += np.bincount(decade, relative, minlength=bins)
        square += np.bincount(decade, relative * relative, minlength=bins)
    total = int(count.sum())
    return BySize(
        log10_rms=float(np.sqrt(squares / total)) if total else None,
        count=total,
        excluded=int(present.sum()) - total,
        decades=tuple(
            Decade(
                low=10.0 ** (lowest + k),
                high=10.0 ** (lowest + k + 1),
                count=int(count[k]),
                mean_relative=float(mean[k] / count[k]),
                rms_relative=float(np.sqrt(square[k] / count[k])),
            )
            for k in np.flatnonzero(count)
        ),
    )


def worst_regions(
    region: NDArray[np.intp],
    measured: Array,
    fitted: Array,
    z: Array,
    used: Mask,
    most: int = 3,
) -> tuple[str, ...]:
    """Name the angles where the model fails most, in words.

    Parameters
    ----------
    region : ndarray, shape (N,)
        From `regions`.
    measured, fitted : ndarray, shape (C, N)
        1/sr.
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
    share, mean, square, counted = (np.zeros(SIDE * SIDE * len(KINDS)) for _ in range(4))
    for y, f, z_c, u in zip(measured, fitted, z, used, strict=True):  # to save memory
        size = len(share)
        share += np.bincount(region, np.where(u, z_c * z_c, 0.0), minlength=size)
        larger = np.fmax(np.abs(y), np.abs(f))
        signed = np.where(u, (f - y) / np.where(larger > 0.0, larger, 1.0), 0.0)
        mean += np.bincount(region, signed, minlength=size)
        square += np.bincount(region, signed * signed, minlength=size)
        counted += np.bincount(region, u, minlength=size)
    mean /= np.maximum(counted, 1.0)
    rms = np.sqrt(square / np.maximum(counted, 1.0))
    total = share.sum()
    texts = []
    for k in np.argsort(-share, kind="stable")[:most]:
        if not total > 0.0 or share[k] < 0.05 * total:
            break
        where, how = k // len(KINDS), KINDS[k % len(KINDS)]
        off = f"model off by {100 * rms[k]:.0f} %"
        if abs(mean[k]) > 0.7 * rms[k]:
            direction = "low" if mean[k] < 0.0 else "high"
            off = f"model {100 * abs(mean[k]):.0f} % too {direction}"
        texts.append(
            f"theta_i about {15 * (where // SIDE)}°, theta_o about {15 * (where % SIDE)}°, {how}: "
            f"{off} ({100 * share[k] / total:.0f} % of the misfit)"
        )
    return tuple(texts)


def outliers(measurement: Measurement, z: Array, fitted: Array, most: int = 3) -> Outliers:
    """Find values that lie far outside the scatter of the others.

    Parameters
    ----------
    measurement : Measurement
    z : ndarray, shape (C, N)
        Standardised residuals; NaN where not used.
    fitted : ndarray, shape (C, N)
        Model values, 1/sr.
    most : int
        How many examples to give.
    """
    size = np.abs(z)
    few = size[:, :: -(-size.shape[1] // ENOUGH)]
    scatter = 1.4826 * float(np.nanmedian(few))
    far = size > OUTLYING * scatter
    count = int(far.sum())
    if not count or not scatter > 0.0:
        return Outliers(0, ())
    m = measurement
    channel, row = np.nonzero(far)
    worst = np.argsort(-size[channel, row], kind="stable")[:most]
    examples = tuple(
        f"{m.channels[c]} at theta_i {np.degrees(m.theta_i[k]):.4g}°, "
        f"theta_o {np.degrees(m.theta_o[k]):.4g}°, phi_o {np.degrees(m.phi_o[k]):.4g}°: "
        f"{m.values[c, k]:.3g} 1/sr where the model has {fitted[c, k]:.3g}"
        for c, k in zip(channel[worst], row[worst], strict=True)
    )
    return Outliers(count, examples)


def regions(measurement: Measurement, directions: Directions) -> NDArray[np.intp]:
    """Give the region of each row: incidence, observation, and where to.

    Parameters
    ----------
    measurement : Measurement
    directions : Directions
        Its directions on the device, whose numbers are read back.

    Returns
    -------
    ndarray, shape (N,)
    """
    read = directions.plane
    across = read("i_x") * read("o_x") + read("i_y") * read("o_y")
    size = np.sin(measurement.theta_i) * np.sin(measurement.theta_o)
    kind = np.where(across < -0.7 * size, 0, np.where(across > 0.7 * size, 1, 2))
    retro = 2.0 * (1.0 - read("one_minus_cos_d")) ** 2 - 1.0
    kind[retro > np.cos(np.radians(NEAR_RETRO))] = 4
    kind[read("log2_cos_r") > np.log2(np.cos(np.radians(2.0 * NEAR_MIRROR)))] = 3
    # Regions are centred on multiples of 15 degrees, where incidences usually are.
    bin_i = (measurement.theta_i * (12.0 / np.pi) + 0.5).astype(np.intp)
    bin_o = (measurement.theta_o * (12.0 / np.pi) + 0.5).astype(np.intp)
    numbers: NDArray[np.intp] = (bin_i * SIDE + bin_o) * len(KINDS) + kind
    return numbers
