"""Directional albedo: the share of light from one direction that leaves the surface.

The hemisphere of outgoing directions is integrated over half vectors, where
lobes sit at the normal whatever the incidence: nodes crowd geometrically around
the normal, so that a lobe of alpha 0.001 is resolved, and end exactly at the
horizon, so that nothing is cut off in the middle of a cell. A lobe that looks
back at the light is integrated over the half vectors of the turned incidence.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache, lru_cache, partial

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lobefit.kernels.device import Device, get_device
from lobefit.kernels.errors import ModelError
from lobefit.kernels.evaluate import Params, basis_values
from lobefit.kernels.geometry import MIN_COSINE, Directions
from lobefit.kernels.parameters import coefficients_of, complete, nonlinear_of
from lobefit.kernels.program import ModelProgram, model_program
from lobefit.kernels.registry import Model, get_model

__all__ = [
    "HemisphereGrid",
    "azimuth_refinement",
    "basis_albedo",
    "coarse_grid",
    "directional_albedo",
    "model_albedo",
]

Array = NDArray[np.float64]

# Away from the normal panels are even: V-cavity masking has kinks there.
PANELS = np.linspace(0.125, 1.0, 29)[1:]


class HemisphereGrid:
    """Quadrature nodes over outgoing directions for one direction of incidence.

    Parameters
    ----------
    device : Device
        Where the directions are kept.
    theta_i, phi_i : float
        Incidence in radians, above the horizon.
    order : int
        Gauss-Legendre nodes per panel; 8 is the standard, fewer are faster.
    azimuths : int
        Azimuths of the half vector.
    back : bool
        Crowd the nodes about the direction of incidence instead of the mirror direction.
    edge : float or None
        Angle from the mirror direction in radians where the integrand jumps: no cell
        crosses it.

    Attributes
    ----------
    directions : Directions
        The nodes.
    weights : ndarray, shape (N,)
        Solid angle times cos_theta_o of each node: ``sum(weights) = pi``.
    shares : ndarray, shape (N,)
        The same, times a share that falls from 1 where the nodes crowd to 0 where they
        would crowd on the other grid; the shares of both grids add up to 1 everywhere.
    """

    def __init__(
        self,
        device: Device,
        theta_i: float,
        phi_i: float,
        order: int = 8,
        azimuths: int = 256,
        back: bool = False,
        edge: float | None = None,
    ) -> None:
        cos_i, sin_i = np.cos(theta_i), np.sin(theta_i)
        # Half the azimuths would do by symmetry for isotropic models only.
        phi_h = (np.arange(azimuths, dtype=np.float64) + 0.5) * (2.0 * np.pi / azimuths)
        # Where wo, the reflection of wi by h, reaches the horizon.
        theta_end = 0.5 * np.arctan2(cos_i, -sin_i * np.cos(phi_h))
        edges = np.concatenate([[0.0], np.geomspace(1e-4, 0.125, 11), PANELS])
        node, node_weight = np.polynomial.legendre.leggauss(order)
        width = np.diff(edges)[:, None]
        u = (edges[:-1, None] + 0.5 * width * (node + 1.0)).ravel()[None, :]
        u_weight = (0.5 * width * node_weight).ravel()[None, :]
        if edge is not None:
            cut = (_theta_h_at(edge, theta_i, phi_h, theta_end) / theta_end)[:, None]
            u = np.concatenate([cut * u, cut + (1.0 - cut) * u], axis=1)
            u_weight = np.concatenate([cut * u_weight, (1.0 - cut) * u_weight], axis=1)

        theta_h = theta_end[:, None] * u
        phi = np.broadcast_to(phi_h[:, None], theta_h.shape)
        sin_h, cos_h = np.sin(theta_h), np.cos(theta_h)
        h = np.stack([sin_h * np.cos(phi), sin_h * np.sin(phi), cos_h])
        # Incidence in the plane phi = 0; phi_i turns everything afterwards.
        i_dot_h = sin_i * h[0] + cos_i * h[2]
        o = 2.0 * i_dot_h * h - np.array([sin_i, 0.0, cos_i])[:, None, None]
        # d wo = 4 (i.h) d wh,  d wh = sin(theta_h) d theta_h d phi_h
        solid = 4.0 * i_dot_h * sin_h * theta_end[:, None] * u_weight * (2.0 * np.pi / azimuths)
        self.weights: Array = (solid * o[2]).ravel()
        # Squared distances from the mirror direction and from the light.
        there = (o[0] + sin_i) ** 2 + o[1] ** 2 + (o[2] - cos_i) ** 2
        here = (o[0] - sin_i) ** 2 + o[1] ** 2 + (o[2] - cos_i) ** 2
        self.shares: Array = self.weights * (here / (here + there + 1e-300)).ravel()
        if sin_i < 1e-9:  # both are the normal
            self.shares = 0.5 * self.weights
        turn = np.pi if back else 0.0
        theta_o = np.arctan2(np.hypot(o[0], o[1]), o[2])
        self.directions = Directions(
            device,
            theta_i,
            phi_i,
            np.clip(theta_o, 0.0, np.pi).ravel(),
            (np.arctan2(o[1], o[0]) + phi_i + turn).ravel(),
        )


def _theta_h_at(angle: float, theta_i: float, phi_h: Array, theta_end: Array) -> Array:
    """Give the half vector's zenith angle whose wo is that far from the mirror direction."""
    low: Array = np.zeros_like(theta_end)
    high: Array = theta_end.copy()
    for _ in range(60):  # it grows with theta_h: halved until nothing is left
        theta_h = 0.5 * (low + high)
        i_dot_h = np.sin(theta_i) * np.sin(theta_h) * np.cos(phi_h)
        i_dot_h = i_dot_h + np.cos(theta_i) * np.cos(theta_h)
        # |r - wo| = 2 |(i.n) n - (i.h) h|
        length2 = np.cos(theta_i) ** 2 + i_dot_h**2
        length2 = length2 - 2.0 * np.cos(theta_i) * i_dot_h * np.cos(theta_h)
        beyond = np.sqrt(np.maximum(length2, 0.0)) > np.sin(0.5 * angle)
        high = np.where(beyond, theta_h, high)
        low = np.where(beyond, low, theta_h)
    middle: Array = 0.5 * (low + high)
    return middle


@lru_cache(maxsize=64)
def coarse_grid(
    device: Device,
    theta_i: float,
    phi_i: float,
    refine: int = 1,
    back: bool = False,
    edge: float | None = None,
) -> HemisphereGrid:
    """Give a grid good to three digits, kept for the next model (1 MB each times `refine`)."""
    return HemisphereGrid(device, theta_i, phi_i, 4, 64 * refine, back, edge)


def azimuth_refinement(model: Model, x: Array) -> int:
    """Tell how many times more azimuths a lobe needs that is narrow in azimuth.

    Parameters
    ----------
    model : Model
        The model.
    x : ndarray, shape (n_x,)
        Its nonlinear parameters.

    Returns
    -------
    int
        A power of two, 1 for isotropic models and axis ratios up to 4.
    """
    names = [p.name for p in model.nonlinear]
    largest = 1.0
    for axes in model.axes:
        wide, narrow = (float(x[names.index(name)]) for name in axes[:2])
        largest = max(largest, wide / narrow, narrow / wide)
    return int(2 ** np.ceil(np.log2(np.clip(largest / 4.0, 1.0, 32.0))))


def basis_albedo(
    program: ModelProgram, grid: Callable[[bool, float | None], HemisphereGrid], x: Array
) -> Array:
    """Integrate each basis function times cos_theta_o over the hemisphere.

    Parameters
    ----------
    program : ModelProgram
        The model.
    grid : callable
        Gives the grid for one direction of incidence, from (back, edge) of
        `HemisphereGrid`; each term of the model has the one that follows its peak.
    x : ndarray, shape (P, n_x)
        Nonlinear parameters.

    Returns
    -------
    ndarray, shape (P, n_basis)
        Directional albedo of each basis function.
    """
    names = [p.name for p in program.model.nonlinear]
    values: dict[tuple[bool, float | None], Array] = {}
    columns = []
    first = 0
    for term in program.model.terms:
        own = slice(first, first + len(term.coefficients))
        first = own.stop
        edge = None if term.edge is None else float(x[0, names.index(term.edge)])
        total = np.zeros((len(x), own.stop - own.start))
        for peak in term.lobe.peaks:
            kind = (peak == "back", edge)
            nodes = grid(*kind)
            if kind not in values:
                values[kind] = basis_values(program, nodes.directions, x)
            weights = nodes.weights if len(term.lobe.peaks) == 1 else nodes.shares
            # Not `@`: BLAS shares it among threads, whose number is seen in the last digit.
            total += np.einsum("pkn,n->pk", values[kind][:, own], weights)
        columns.append(total)
    return np.concatenate(columns, axis=1)


def directional_albedo(
    model: str | Model,
    params: Params,
    theta_i: ArrayLike,
    phi_i: float = 0.0,
    *,
    options: Mapping[str, str] | None = None,
    device: str | Device | None = None,
) -> Array:
    """Integrate f cos_theta_o over the outgoing hemisphere, for each incidence.

    Parameters
    ----------
    model, params, options, device
        As for `lobefit.kernels.evaluate`.
    theta_i : array_like, shape (M,)
        Zenith angles of incidence in radians, below 90 degrees.
    phi_i : float
        Azimuth of incidence in radians; matters for anisotropic models.

    Returns
    -------
    ndarray, shape (channels, M)
        Directional albedo; above 1 the surface gives out more than it receives.

    Raises
    ------
    ModelError
        As `evaluate`, and for incidence at or below the horizon.
    """
    known = (model if isinstance(model, Model) else get_model(model)).choose(options)
    angles = np.atleast_1d(np.asarray(theta_i, dtype=np.float64))
    if not (
        np.isfinite(angles).all() and (angles >= 0).all() and (np.cos(angles) > MIN_COSINE).all()
    ):
        raise ModelError("the albedo needs theta_i in radians, from 0 to below pi/2")
    full = complete(known, params)
    azimuths = 256 * max(azimuth_refinement(known, nonlinear_of(known, full)[0]) // 2, 1)
    return model_albedo(known, full, angles, phi_i, get_device(device), 8, azimuths)


def model_albedo(
    model: Model,
    full: Mapping[str, Array],
    angles: Array,
    phi_i: float,
    device: Device,
    order: int,
    azimuths: int,
) -> Array:
    """Integrate on grids of a given size.

    Parameters
    ----------
    model : Model
        Its options chosen.
    full : mapping of str to ndarray
        All parameters, as `lobefit.kernels.parameters.complete` gives them.
    angles : ndarray, shape (M,)
        Zenith angles of incidence in radians, above the horizon.
    phi_i : float
        Azimuth of incidence.
    device : Device
    order, azimuths : int
        See `HemisphereGrid`.

    Returns
    -------
    ndarray, shape (channels, M)
    """
    program = model_program(model)
    x, coefficients = nonlinear_of(model, full), coefficients_of(model, full)
    columns = []
    for theta in angles:
        grid = cache(partial(HemisphereGrid, device, float(theta), float(phi_i), order, azimuths))
        columns.append((basis_albedo(program, grid, x) * coefficients).sum(axis=1))
    return np.stack(columns, axis=1)
