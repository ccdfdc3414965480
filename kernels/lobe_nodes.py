"""Quadrature nodes over half vectors that crowd where the lobes of a model are.

The nodes of an environment's integral are shares of the way from the normal to the half vector
whose wi is at the horizon. How far the lobes reach is read off the basis functions themselves,
for light along the normal: each gets an equal part of the nodes, whatever its height, and a
part is spread evenly for what is seen elsewhere.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from lobefit.kernels.device import Device
from lobefit.kernels.evaluate import basis_values
from lobefit.kernels.geometry import Directions
from lobefit.kernels.program import ModelProgram

__all__ = ["azimuth_nodes", "radial_nodes"]

Array = NDArray[np.float64]

EVEN = 0.25  # part of the nodes that is spread evenly
AZIMUTHS = 8
# Half vectors from the normal to 45 degrees, where light along the normal leaves at the horizon.
EDGES = np.concatenate([[0.0], np.geomspace(1e-5, 1.0, 241)])
MIDDLES = 0.5 * (EDGES[1:] + EDGES[:-1])


@lru_cache(maxsize=8)
def _directions(device: Device) -> Directions:
    theta_h = np.tile(MIDDLES * (np.pi / 4.0), AZIMUTHS)
    phi = np.repeat(np.arange(AZIMUTHS) * (2.0 * np.pi / AZIMUTHS), MIDDLES.size)
    return Directions(device, 0.0, 0.0, 2.0 * theta_h, phi)


def radial_nodes(
    program: ModelProgram, device: Device, x: Array, used: NDArray[np.bool_], panels: int
) -> Array:
    """Give shares u of theta_h from 0 to its end at the horizon, and their weights.

    Parameters
    ----------
    program : ModelProgram
        The model.
    device : Device
        Where to evaluate it.
    x : ndarray, shape (P, n_x)
        Nonlinear parameters; the nodes serve all of them.
    used : ndarray of bool, shape (n_basis,)
        Basis functions that the nodes serve.
    panels : int
        Intervals of equal importance; each has two Gauss-Legendre nodes.

    Returns
    -------
    ndarray, shape (2 panels, 2)
        Shares, and weights that add up to 1.
    """
    values = basis_values(program, _directions(device), x)[:, used]
    values = values.reshape(*values.shape[:2], AZIMUTHS, -1).mean(axis=2).reshape(-1, MIDDLES.size)
    theta_h = MIDDLES * (np.pi / 4.0)
    # f cos_theta_o dwo with dwo = 4 cos_theta_h sin_theta_h dtheta_h dphi
    mass = values * np.cos(2.0 * theta_h) * np.sin(2.0 * theta_h) * np.diff(EDGES)
    # Bins are even in the logarithm: roots give the lobe's skirts their panels too.
    mass = np.sqrt(np.maximum(mass, 0.0))
    total = mass.sum(axis=1, keepdims=True)
    mass = (mass / np.where(total > 0.0, total, 1.0)).sum(axis=0)
    share = (1.0 - EVEN) * mass / max(mass.sum(), 1e-300) + EVEN * np.diff(EDGES)
    reached = np.concatenate([[0.0], np.cumsum(share)])
    bounds = np.interp(np.linspace(0.0, reached[-1], panels + 1), reached, EDGES)
    width = np.diff(bounds)[:, None]
    offset = 0.5 / np.sqrt(3.0)
    nodes = bounds[:-1, None] + width * np.array([0.5 - offset, 0.5 + offset])
    weights = np.broadcast_to(0.5 * width, nodes.shape)
    return np.stack([nodes.ravel(), weights.ravel()], axis=1)


def azimuth_nodes(program: ModelProgram, x: Array, count: int) -> Array:
    """Give azimuths of the half vector as cosine, sine and weight, shape (count, 3).

    For an anisotropic lobe they crowd about its longer axis, where it is narrow in azimuth.
    """
    names = [p.name for p in program.model.nonlinear]
    ratio, first = 1.0, 0.0
    for alpha_x, alpha_y, phi_x in program.model.axes:
        wide, narrow, phi = (float(x[0, names.index(n)]) for n in (alpha_x, alpha_y, phi_x))
        if min(wide, narrow) / max(wide, narrow) < ratio:
            ratio = min(wide, narrow) / max(wide, narrow)
            first = phi if wide >= narrow else phi + np.pi / 2.0
    narrowed = np.sqrt(ratio)  # half way: what is wide is seen from all sides
    psi = (np.arange(count) + 0.5) * (2.0 * np.pi / count)
    phi = first + np.arctan2(narrowed * np.sin(psi), np.cos(psi))
    weight = narrowed / (np.cos(psi) ** 2 + (narrowed * np.sin(psi)) ** 2) * (2.0 * np.pi / count)
    return np.stack([np.cos(phi), np.sin(phi), weight], axis=1)
