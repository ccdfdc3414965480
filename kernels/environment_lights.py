"""An environment as some thousand directional lights.

Its picture is cut into cells, as P. Debevec cuts it (A median cut algorithm for light probe
sampling, SIGGRAPH 2005 posters): the larger a cell and the more of the light comes from it, the
sooner it is cut into four. A cell is a light from the mean direction of its radiance, so that a
lobe whose slope is even across the cell sees no difference: the error is of second order in the
size of the cells over the width of the lobe. Lobes narrower than the cells take the quadrature of
`lobefit.kernels.lobe_nodes` instead.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lobefit.kernels.lights import Environment

__all__ = ["environment_lights"]

Array = NDArray[np.float64]

COARSEST = 8  # rows; no cell is larger than a pixel of so many
LEAST, MOST = 64, 512  # rows that the picture has, interpolated or averaged


def _fours(v: Array) -> Array:
    """Add up two by two cells."""
    return np.asarray(v[0::2, 0::2] + v[1::2, 0::2] + v[0::2, 1::2] + v[1::2, 1::2])


def _moments(picture: Array) -> tuple[Array, Array]:
    """Give the irradiance of each pixel, (H, W, C), and its mean times its direction, (H, W, 3)."""
    rows = len(picture)
    edges, width = np.linspace(0.0, np.pi, rows + 1), np.pi / rows
    solid = (np.cos(edges[:-1]) - np.cos(edges[1:])) * width
    # Integrals over a row of sin^2 and of sin cos of theta, over a column of cos or sin of phi.
    across = 0.5 * width - 0.25 * np.diff(np.sin(2.0 * edges))
    up = 0.5 * width * np.diff(np.sin(edges) ** 2)
    phi = np.pi - (np.arange(2 * rows) + 0.5) * width
    chord = 2.0 * np.sin(0.5 * width)
    x, y = np.outer(across, chord * np.cos(phi)), np.outer(across, chord * np.sin(phi))
    towards = np.stack([x, y, np.repeat(up[:, None], 2 * rows, axis=1)], axis=2)
    return picture * solid[:, None, None], picture.mean(axis=2, keepdims=True) * towards


def environment_lights(environment: Environment, count: int) -> Array:
    """Cut an environment into directional lights.

    Parameters
    ----------
    environment : Environment
        The picture.
    count : int
        About how many; fewer where much of it is black.

    Returns
    -------
    ndarray, shape (lights, 4 + C)
        As of `lobefit.kernels.lights.light_rows`.
    """
    picture = next(level for level in environment.pyramid if len(level) <= MOST)
    levels = [_moments(picture if len(picture) >= LEAST else environment.resampled(LEAST))]
    while len(levels[0][0]) > COARSEST:
        power, moment = levels[0]
        levels.insert(0, (_fours(power), _fours(moment)))
    # A cell's worth is its power times its size: a parent's is larger than its children's, so
    # that those above a threshold are the top of the tree.
    worth = [power.mean(axis=2) / 4.0**k for k, (power, _) in enumerate(levels)]
    inner = np.sort(np.concatenate([w.ravel() for w in worth[:-1]]))
    cuts = min(max((count - worth[0].size) // 3, 1), inner.size)
    limit = max(float(inner[-cuts]), np.finfo(np.float64).tiny)
    lights: list[Array] = []
    here = np.ones(worth[0].shape, dtype=bool)
    for k, (power, moment) in enumerate(levels):
        cut = here & (worth[k] >= limit) & (k < len(levels) - 1)
        lit = here & ~cut & (worth[k] > 0.0)
        towards = moment[lit] / np.linalg.norm(moment[lit], axis=1, keepdims=True)
        lights.append(np.concatenate([towards, np.zeros((len(towards), 1)), power[lit]], axis=1))
        here = np.repeat(np.repeat(cut, 2, axis=0), 2, axis=1)
    return np.concatenate(lights)
