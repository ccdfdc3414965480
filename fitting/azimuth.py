"""Counting distinct axes among azimuths."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["count_axes"]


def count_axes(azimuths: NDArray[np.float64], tolerance: float) -> int:
    """Count azimuths that are distinct modulo a half turn.

    A surface looks the same from both ends of an axis (a groove has no head or tail), so an
    azimuth and its opposite count once.

    Parameters
    ----------
    azimuths : array, shape [N]
        Radians, any range.
    tolerance : float
        Radians; azimuths no further apart than this count once.

    Returns
    -------
    int
        Number of distinct axes.
    """
    axes = np.unique(np.mod(azimuths, np.pi))
    if axes.size == 0:
        return 0
    count, last = 1, axes[0]
    for axis in axes[1:].tolist():
        # The last comparison closes the circle: 179.9 degrees is near 0.
        if axis - last > tolerance and axes[0] + np.pi - axis > tolerance:
            count, last = count + 1, axis
    return count
