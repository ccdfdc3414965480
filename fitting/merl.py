"""The MERL table of an isotropic BRDF: where its cells are, and writing one.

90 x 90 x 180 cells of half angle theta_h, difference angle theta_d and azimuth of difference
phi_d (S. Rusinkiewicz, 1998; W. Matusik et al., ACM TOG 22(3), 2003). theta_h is warped by a
square root, so that the cells are finest near the mirror direction: cell k covers
``theta_h / 90 degrees`` from ``(k/90)^2`` to ``((k+1)/90)^2``. A programme that looks a direction
up takes the value of the cell that it falls into; here that value stands at the cell's centre,
taken between its edges in the warped coordinate. phi_d runs over half a turn only, since
phi_d + pi swaps light and view: such a table holds reciprocal BRDFs only.

The file is three little-endian 32-bit integers (90, 90, 180), then a plane of 64-bit numbers
for each of R, G, B, phi_d running fastest. A number times the channel's scale is the BRDF in
1/sr; a negative one says that there is no value.
"""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = ["CHANNELS", "FILE_BYTES", "HEADER", "SCALES", "SHAPE", "cell_directions", "write_merl"]

Array = NDArray[np.float64]

SHAPE = (90, 90, 180)
"""Cells of theta_h, theta_d and phi_d."""

CHANNELS = ("R", "G", "B")
SCALES = (1.0 / 1500.0, 1.15 / 1500.0, 1.66 / 1500.0)
"""What the numbers of a channel's plane are multiplied by, in 1/sr."""

HEADER = np.array(SHAPE, dtype="<i4").tobytes()
FILE_BYTES = len(HEADER) + 3 * 8 * SHAPE[0] * SHAPE[1] * SHAPE[2]

_MISSING = -1.0


def cell_directions(h: ArrayLike, d: ArrayLike, p: ArrayLike) -> tuple[Array, Array, Array]:
    """Give the directions of cells' centres.

    Parameters
    ----------
    h, d, p : array_like of int
        Cell numbers of theta_h, theta_d and phi_d; they broadcast.

    Returns
    -------
    theta_i, theta_o, phi_o : ndarray
        In radians, with phi_i = 0; theta at or above pi/2 where the cell lies below the
        horizon.
    """
    half = 0.5 * np.pi * ((np.asarray(h) + 0.5) / SHAPE[0]) ** 2
    difference = 0.5 * np.pi * (np.asarray(d) + 0.5) / SHAPE[1]
    turn = np.pi * (np.asarray(p) + 0.5) / SHAPE[2]
    # The light seen from the half vector, then from the surface; the view is its mirror image.
    along = np.sin(difference) * np.cos(turn)
    across = np.sin(difference) * np.sin(turn)
    cos_d, cos_h, sin_h = np.cos(difference), np.cos(half), np.sin(half)
    i_x, i_z = along * cos_h + cos_d * sin_h, cos_d * cos_h - along * sin_h
    o_x, o_z = cos_d * sin_h - along * cos_h, cos_d * cos_h + along * sin_h
    theta_i = np.arctan2(np.hypot(i_x, across), i_z)
    theta_o = np.arctan2(np.hypot(o_x, across), o_z)
    phi_o = np.mod(np.arctan2(-across, o_x) - np.arctan2(across, i_x), 2.0 * np.pi)
    return theta_i, theta_o, phi_o


def write_merl(path: str | os.PathLike[str], table: ArrayLike) -> None:
    """Write a MERL table.

    Parameters
    ----------
    path : path-like
        By custom it ends in ``.binary``.
    table : array_like, shape (3, 90, 90, 180)
        BRDF in 1/sr of R, G, B in the cells of theta_h, theta_d and phi_d; NaN or negative
        where there is none.

    Raises
    ------
    ValueError
        Another shape.
    """
    values = np.asarray(table, dtype=np.float64)
    if values.shape != (3, *SHAPE):
        raise ValueError(f"a MERL table has the shape {(3, *SHAPE)}, not {values.shape}")
    with Path(path).open("wb") as stream:
        stream.write(HEADER)
        for plane, scale in zip(values, SCALES, strict=True):
            stored = np.where(plane >= 0.0, plane / scale, _MISSING)
            stream.write(stored.astype("<f8").tobytes())
