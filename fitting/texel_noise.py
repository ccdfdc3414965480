"""How the readings of a texel are weighed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lobefit.kernels import FitError

__all__ = ["TexelNoise", "texel_noise"]

Array = NDArray[np.float64]

# Part of a channel's mean reading that a relative noise does not fall below: a dark reading
# would count for everything otherwise.
FLOOR = 0.01
# A channel that is dark altogether is held against the brightest one; as in texel_refine.cl.
DARK_CHANNEL = 1e-4


@dataclass(frozen=True, slots=True)
class TexelNoise:
    """Variance ``(relative f)^2 + additive^2 + (floor mean)^2`` with f the model's value.

    Attributes
    ----------
    relative : float
        Part that is proportional to the value.
    additive : float
        In 1/sr.
    floor : float
        Times the mean of a texel's readings in the channel.
    """

    relative: float
    additive: float
    floor: float

    @property
    def constant(self) -> bool:
        """Whether all readings of a texel count alike."""
        return self.relative == 0.0

    def weights(self, f: Array, values: Array, used: NDArray[np.bool_]) -> Array:
        """Give the weights of one texel's readings, as the kernels do.

        Parameters
        ----------
        f, values : ndarray, shape (N, C)
            Model and readings, 1/sr.
        used : ndarray of bool, shape (N, C)
            Readings that are there; the others get 0.
        """
        if self.constant:
            return used.astype(np.float64)
        count = np.maximum(used.sum(axis=0), 1)
        mean2 = (np.where(used, np.abs(values), 0.0).sum(axis=0) / count) ** 2
        level = mean2 + DARK_CHANNEL * mean2.max()
        variance = (self.relative * f) ** 2 + self.additive**2 + self.floor**2 * level
        weights: Array = np.where(used, 1.0 / variance, 0.0)
        return weights


def texel_noise(noise: str | tuple[float, float]) -> TexelNoise:
    """Read a noise: "constant", "relative", or a pair (relative, additive).

    Raises
    ------
    FitError
        Anything else, or a noise that is negative, infinite or nothing at all.
    """
    if noise == "constant":
        return TexelNoise(0.0, 1.0, 0.0)
    if noise == "relative":
        return TexelNoise(1.0, 0.0, FLOOR)
    try:
        relative, additive = (float(part) for part in noise)
    except (TypeError, ValueError):
        relative = additive = np.nan
    sizes = (relative, additive)
    if not (all(0.0 <= s < np.inf for s in sizes) and any(sizes)):
        raise FitError(
            f'noise is "relative", "constant" or a pair (relative, additive in 1/sr), not {noise!r}'
        )
    return TexelNoise(relative, additive, FLOOR * relative if additive == 0.0 else 0.0)
