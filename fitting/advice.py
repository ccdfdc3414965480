"""Which further incidence would help most: hypothetical readings added to the information."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lobefit.fitting.dataset import METRICS
from lobefit.fitting.identifiability_result import Advice
from lobefit.fitting.information import information
from lobefit.fitting.point import PointFit
from lobefit.fitting.polish import Curvature, sums_at
from lobefit.fitting.projection import solve_bounded
from lobefit.kernels.geometry import Directions
from lobefit.kernels.sums import Observations

__all__ = ["INCIDENCES", "advise"]

Array = NDArray[np.float64]

INCIDENCES = tuple(float(angle) for angle in range(5, 81, 5))
"""Angles of incidence that are tried, in degrees."""

# Views of a hypothetical scan; of more, some stand for all.
ROWS = 2048
# A relative error below this determines a parameter.
ENOUGH = 0.1
# Incidences closer than this to a measured one are not further ones (degrees).
SAME = 1.0


def advise(fit: PointFit, scale: float, name: str, channel: int) -> Advice | None:
    """Find the further angle of incidence that shrinks the error of a parameter most.

    Each is thought to be measured at the views, and with the noise, of the incidence that has
    most readings.

    Parameters
    ----------
    fit : PointFit
        The best point.
    scale : float
        Variance in units of the objective.
    name : str
        The parameter.
    channel : int
        Of which channel.

    Returns
    -------
    Advice or None
        None where the readings form no scans at separate incidences.
    """
    problem, m = fit.problem, fit.problem.dataset.measurement
    # Not all rows of a large set: which incidences there are shows in its thinned ones.
    sampled = m if m.n_directions <= ROWS * 8 else m.select(problem.dataset.search_rows)
    groups = sampled.distinct_incidences()
    if len(groups) > max(3, sampled.n_directions // 5):
        return None
    largest = max(groups.values(), key=len)
    rows = largest[:: -(-len(largest) // ROWS)]
    share = len(largest) / len(rows) * m.n_directions / sampled.n_directions
    phi_i, theta_o = sampled.phi_i[rows], sampled.theta_o[rows]
    phi_o = sampled.phi_o[rows]
    measured = np.degrees([theta_i for theta_i, _ in groups])
    before = _error(fit, fit.polished.curvature, scale, name, channel)
    if before is None:
        return None
    noise = _noise(fit)
    factors, enough = [], None
    for angle in INCIDENCES:
        if np.min(np.abs(measured - angle)) < SAME:
            continue
        theta_i = np.full(len(rows), np.radians(angle))
        directions = Directions(
            problem.dataset.device, theta_i, phi_i, theta_o, phi_o, problem.dataset.precision
        )
        added = _curvature(fit, directions, noise, share)
        after = _error(fit, added, scale, name, channel)
        directions.release()
        if after is not None:
            factors.append((angle, before / after))
            if after < ENOUGH and enough is None:
                enough = (angle, after)
    if not factors:
        return None
    angle, factor = max(factors, key=lambda pair: pair[1])
    own = name not in [p.name for p in problem.candidate.shared] and m.n_channels > 1
    label = m.channels[channel] if own else None
    return Advice(
        parameter=name,
        channel=label,
        theta_i_deg=angle,
        factor=factor,
        enough=enough,
        factors=tuple(factors),
    )


def _error(
    fit: PointFit, curvature: Curvature, scale: float, name: str, channel: int
) -> float | None:
    found = information(fit, curvature, scale, channel)
    return float(found.errors[found.names.index(name)]) if name in found.names else None


def _noise(fit: PointFit) -> tuple[Array, Array]:
    """Give the additive and relative variance of each channel, also of a stated sigma."""
    if not fit.problem.dataset.uses_sigma:
        return fit.additive**2, fit.relative**2
    pairs = []
    for f, sigma, used in zip(fit.values, fit.sigma, fit.problem.dataset.used, strict=True):
        shape = np.stack([np.ones(int(used.sum())), f[used] ** 2], axis=1)
        shape /= sigma[used][:, None] ** 2
        scale = np.linalg.norm(shape, axis=0)
        scale = np.where(scale > 0.0, scale, 1.0)
        shape /= scale
        low, high = np.zeros(2), np.full(2, np.inf)
        found = solve_bounded((shape.T @ shape)[None], shape.sum(axis=0)[None], low, high)[0]
        pairs.append(found / scale)
    additive, relative = np.array(pairs).T
    return additive, relative


def _curvature(
    fit: PointFit, directions: Directions, noise: tuple[Array, Array], share: float
) -> Curvature:
    """Add the curvature of hypothetical readings to that of the fit."""
    problem, point = fit.problem, fit.polished
    f = problem.values_at(directions, point.t, point.c)
    metric = METRICS[problem.dataset.metric]
    weights = np.full(f.shape, share)
    if metric == "identity":
        variance = noise[0][:, None] + noise[1][:, None] * f * f
        weights = np.divide(share, variance, out=np.zeros_like(f), where=variance > 0.0)
    data = Observations(directions, np.where(directions.visible, f, np.nan), weights, metric)
    try:
        added = sums_at(problem, point.t, point.c, data)[1].matrix
    finally:
        data.release()
    return Curvature(point.curvature.matrix + added, point.curvature.gradient)
