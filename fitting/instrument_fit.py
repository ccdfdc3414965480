"""The point fit of a candidate behind an instrument: the sample's tilt, and what a gain moves.

The tilt is found around the point fit. At a fit, Gauss-Newton over the two angles with the
candidate's parameters eliminated (variable projection with its full Jacobian) moves it with the
weights held, each step followed by a polish of the parameters; then everything is fitted anew,
noise and all, until that moves the tilt no more.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lobefit.fitting.dataset import Dataset
from lobefit.fitting.instrument import Instrument
from lobefit.fitting.instrument_nuisance import MOUNTING, Nuisance
from lobefit.fitting.point import PointFit, fit_point
from lobefit.fitting.polish import Polished, polish, sums_at
from lobefit.fitting.problem import Problem
from lobefit.fitting.reweigh import refitted
from lobefit.fitting.uncertainty import joint_covariance
from lobefit.kernels import Candidate
from lobefit.kernels.sums import Observations
from lobefit.kernels.veil import with_veil

__all__ = ["fit_behind"]

Array = NDArray[np.float64]

# Half width of the differences along the tilt, in radians: far below any lobe that is resolved.
STEP = 2e-4
# Largest move in one step, and rounds of steps and of fits.
FARTHEST = 0.02
STEPS, FITS = 12, 6
# A promised gain in units of the residuals' variance: a hundredth of a standard error.
GAIN = 1e-4


def fit_behind(candidate: Candidate, dataset: Dataset, instrument: Instrument) -> PointFit:
    """Fit a candidate and the tilt, and find what an uncertain gain moves.

    Parameters
    ----------
    candidate : Candidate
        What to fit, its options chosen.
    dataset : Dataset
        Whose metric has a likelihood if tilt or gain are asked for; its tilt is changed.
    instrument : Instrument

    Returns
    -------
    PointFit
        With `nuisance` where there is a tilt or a gain.

    Raises
    ------
    MeasurementError, FitError
        As of `lobefit.fitting.point.fit_point`.
    """
    if instrument.veil:
        candidate = with_veil(candidate, instrument.cosine)
    dataset.turn((0.0, 0.0))
    point = fit_point(candidate, dataset)
    if not instrument.tilt and instrument.gain is None:
        return point
    seconds = point.seconds
    if instrument.tilt:
        for _ in range(FITS):
            if not _turned(point):
                break
            point = fit_point(candidate, dataset)
            seconds += point.seconds
    found = _linear(point)
    return replace(
        point,
        seconds=seconds,
        algorithm=point.algorithm + (", tilt by Gauss-Newton" if instrument.tilt else ""),
        nuisance=Nuisance(
            np.array(dataset.tilt) if instrument.tilt else np.zeros(0),
            found.cross,
            found.inner,
            instrument.gain or 0.0,
            found.gain_cross,
            found.gain_tilt,
        ),
    )


@dataclass(frozen=True, slots=True)
class _Linear:
    """The problem about a point, linear in the tilt; see `Nuisance`."""

    cross: Array
    inner: Array
    downhill: Array
    gain_cross: Array
    gain_tilt: Array


def _linear(point: PointFit, at: Polished | None = None) -> _Linear:
    """Linearise in the tilt, with the fit's weights."""
    problem, dataset = point.problem, point.problem.dataset
    at = at or point.polished
    tilt = dataset.tilt
    instrument = dataset.instrument
    f = problem.values(at.t, at.c)
    columns: list[Array] = []
    for axis in range(2 if instrument is not None and instrument.tilt else 0):
        sides = []
        for sign in (1.0, -1.0):
            moved = list(tilt)
            moved[axis] += sign * STEP
            dataset.turn((moved[0], moved[1]))
            sides.append(problem.values(at.t, at.c))
        columns.append((sides[0] - sides[1]) / (2.0 * STEP))
    if columns:
        dataset.turn(tilt)
    weights = np.where(dataset.used, point.weights, 0.0)
    residuals = np.where(dataset.used, dataset.measurement.values - f, 0.0)
    tilts = np.array(columns).reshape(-1, *f.shape)
    precision = 1.0 / MOUNTING**2
    cross = [_along(problem, at, f, column, weights).sum(axis=0) for column in tilts]
    by_channel = _along(problem, at, f, f, weights)
    size = len(by_channel[0])
    return _Linear(
        cross=np.array(cross).reshape(-1, size).T,
        inner=np.einsum("acn,cn,bcn->ab", tilts, weights, tilts) + precision * np.eye(len(tilts)),
        downhill=np.einsum("acn,cn->a", tilts, weights * residuals)
        - precision * np.array(tilt)[: len(tilts)],
        gain_cross=by_channel.T,
        gain_tilt=np.einsum("acn,cn->ac", tilts, weights * f),
    )


def _along(problem: Problem, at: Polished, f: Array, column: Array, weights: Array) -> Array:
    """Give weighted products of the parameters' columns with one more, by channel: (C, m).

    The kernel sums products with residuals: here the residuals are that column.
    """
    dataset = problem.dataset
    data = Observations(dataset.full.directions, f + column, weights)
    try:
        products = sums_at(problem, at.t, at.c, data)[1].gradient
    finally:
        data.release()
    n, (channels, size) = len(at.t), products.shape
    found = np.zeros((channels, n + channels * (size - n)))
    for c in range(channels):
        found[c, :n] = products[c, :n]
        found[c, n + c * (size - n) : n + (c + 1) * (size - n)] = products[c, n:]
    return found


def _turned(point: PointFit) -> bool:
    """Move the dataset's tilt to the best one at a fit's weights; False if it stays."""
    problem, dataset = point.problem, point.problem.dataset
    n = len(point.polished.t)
    dataset.set_weights(point.weights)
    at = polish(problem, point.polished.t, point.polished.c, point.dof)
    value = at.value + _prior(dataset.tilt)
    moved = False
    for step in range(STEPS):
        d = problem.coordinates.coordinates(at.c)
        inside = (d > problem.coordinates.low) & (d < problem.coordinates.high)
        known = joint_covariance(at.curvature, n, inside)
        linear = _linear(point, at)
        move = np.linalg.solve(
            linear.inner - linear.cross.T @ known @ linear.cross, linear.downhill
        )
        if float(move @ linear.downhill) <= GAIN * max(value / point.dof, 1.0):
            break
        move = np.clip(move, -FARTHEST, FARTHEST)
        start = dataset.tilt
        for _ in range(6):
            dataset.turn((start[0] + float(move[0]), start[1] + float(move[1])))
            # A peak that was out of place may have been fitted too wide.
            new = refitted(problem, at, point.dof, anew=step == 0)
            new_value = new.value + _prior(dataset.tilt)
            if new_value < value:
                break
            move = 0.5 * move
        else:
            dataset.turn(start)
            break
        at, value, moved = new, new_value, True
    return moved


def _prior(tilt: tuple[float, float]) -> float:
    return (tilt[0] ** 2 + tilt[1] ** 2) / MOUNTING**2
