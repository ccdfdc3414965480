"""The point fit of one candidate: scan, NLopt, Gauss-Newton, and the noise in turn."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lobefit.fitting.dataset import Dataset
from lobefit.fitting.noise import estimate_noise, gaussian_deviance, level, variance
from lobefit.fitting.polish import Polished, polish
from lobefit.fitting.problem import Problem
from lobefit.fitting.search import Found, minimise
from lobefit.kernels import Candidate, FitError, MeasurementError
from lobefit.kernels.sums import Observations

__all__ = ["GROSS", "PointFit", "fit_point"]

Array = NDArray[np.float64]

# Separate valleys of the scan that NLopt starts from.
STARTS = 3
# ... if their nodes are no worse than this many times the best one.
RIVAL = 2.0
# Points per dimension of the finer look, by the number of dimensions.
ZOOM = (9, 7, 5, 3)
# Rounds of "estimate the noise, fit again"; two or three settle it.
NOISE_ROUNDS = 8
# A relative scale above this is no instrument's noise but a model that does not fit.
GROSS = 0.25
# A round that raises the deviance per value by this is a run-away and is undone.
RUNAWAY = 0.02


@dataclass(frozen=True, slots=True, kw_only=True)
class PointFit:
    """A candidate's best point, before it is judged.

    Attributes
    ----------
    problem : Problem
    polished : Polished
        The point, its objective and the curvature there.
    values : ndarray, shape (C, N)
        The model at all rows, 1/sr.
    sigma : ndarray, shape (C, N)
        Noise that residuals are weighed with (of the transformed values for
        the metrics "log" and "cube_root": then constant per measurement).
    additive, relative : ndarray, shape (C,)
        Scales of an estimated noise; 0 where sigma was given.
    dof : int
        Degrees of freedom.
    algorithm, reason : str
    seconds : float
    """

    problem: Problem
    polished: Polished
    values: Array
    sigma: Array
    additive: Array
    relative: Array
    dof: int
    algorithm: str
    reason: str
    seconds: float


def _starts(problem: Problem) -> list[tuple[Array, Array]]:
    """Scan for the valleys: points (t, c) to start from, the best first."""
    t = problem.nodes()
    value, c = problem.scan(t)
    spacing = problem.scale.spacing
    valleys: list[int] = []
    for k in np.argsort(value, kind="stable"):
        near = any(np.all(np.abs(t[k] - t[j]) <= 1.5 * spacing) for j in valleys)
        if not near and np.isfinite(value[k]):
            valleys.append(int(k))
        if len(valleys) == STARTS or (valleys and value[k] > RIVAL * value[valleys[0]]):
            break
    if len(valleys) < 2:
        return [(t[k], c[k]) for k in valleys]
    # Several are as good: a finer look around each tells them apart.
    steps = np.linspace(-0.5, 0.5, ZOOM[min(t.shape[1], len(ZOOM)) - 1])
    offsets = np.stack(
        [a.ravel() for a in np.meshgrid(*[steps] * t.shape[1], indexing="ij")], axis=-1
    )
    close = t[valleys][:, None, :] + offsets * spacing
    close = np.clip(close, problem.scale.low, problem.scale.high)
    value, c = problem.scan(close.reshape(-1, t.shape[1]))
    value = value.reshape(len(valleys), -1)
    c = c.reshape(len(valleys), len(offsets), *c.shape[1:])
    lowest = np.argmin(value, axis=1)
    best = value[np.arange(len(valleys)), lowest]
    return [
        (close[k, lowest[k]], c[k, lowest[k]])
        for k in np.argsort(best, kind="stable")
        if best[k] <= RIVAL * best.min()
    ]


def _search(problem: Problem, data: Observations, t: Array, c: Array) -> tuple[Found, Array]:
    """Run NLopt on thinned rows from one start; returns the coefficients too."""
    best, best_value = problem.start_coefficients(data, t, c), np.inf

    def objective(at: Array) -> float:
        nonlocal best, best_value
        value, solved = problem.project(data, at, best)
        if value < best_value:
            best, best_value = solved, value
        return value

    if not len(t):
        value, c = problem.project(data, t, best)
        return Found(t, value, "none", "the problem is linear", 1), c
    scale = problem.scale
    found = minimise(objective, t, scale.low, scale.high, 0.5 * scale.spacing)
    return found, best


def fit_point(
    candidate: Candidate, dataset: Dataset, options: Mapping[str, str] | None = None
) -> PointFit:
    """Fit one candidate.

    Parameters
    ----------
    candidate : Candidate
        What to fit.
    dataset : Dataset
        To what; its weights are changed.
    options : mapping of str to str, optional
        Pieces the model is compiled with.

    Returns
    -------
    PointFit

    Raises
    ------
    MeasurementError
        Too few directions for the model.
    FitError
        No finite objective anywhere.
    """
    began = time.perf_counter()
    problem = Problem(candidate, dataset, options)
    channels = dataset.measurement.n_channels
    n_parameters = candidate.n_parameters(channels)
    samples = int(dataset.used.sum())
    dof = samples - n_parameters
    if dof < 1 or (dataset.used.sum(axis=1) < 1 + len(candidate.solved)).any():
        raise MeasurementError(
            f"{samples} usable values in {channels} channels are too few directions for "
            f"{candidate.name} with {n_parameters} parameters; measure more or fit a simpler model",
            file=dataset.measurement.source or None,
        )
    dataset.reset_weights()
    starts = _starts(problem)
    if not starts:
        raise FitError(f"{candidate.name}: no point of the start scan gives finite residuals")
    scanned = problem.evaluations
    runs = [_search(problem, dataset.search, t, c) for t, c in starts]
    found, c = min(runs, key=lambda run: run[0].value)
    if not np.isfinite(found.value):
        raise FitError(f"{candidate.name}: {found.reason}")
    polished = polish(problem, found.point, c, dof)
    additive = relative = np.zeros(channels)
    algorithm = [
        f"scan of {scanned} nodes",
        f"NLopt {found.algorithm} from {len(runs)} starts",
        "Gauss-Newton",
    ]
    if dataset.estimates_noise:
        algorithm.append("noise and fit in turn")
        polished, additive, relative = _with_noise(problem, polished, n_parameters, dof)
        if relative.max() > GROSS:
            algorithm.append("again from a fit of the logarithm")
            start = _from_logarithm(problem, polished)
            polished, additive, relative = _with_noise(problem, start, n_parameters, dof)
    values = problem.values(polished.t, polished.c)
    return PointFit(
        problem=problem,
        polished=polished,
        values=values,
        sigma=_sigma(dataset, values, additive, relative, polished.value, dof),
        additive=additive,
        relative=relative,
        dof=dof,
        algorithm=", ".join(algorithm if len(found.point) else algorithm[2:]),
        reason=f"{polished.reason} (NLopt: {found.reason})",
        seconds=time.perf_counter() - began,
    )


def _noise(
    problem: Problem, point: Polished, n_parameters: int
) -> tuple[Array, Array, Array, float]:
    """Estimate the noise at a point; returns scales, weights and the deviance."""
    dataset = problem.dataset
    measured = dataset.measurement.values
    f = problem.values(point.t, point.c)
    h = level(f, measured)
    additive, relative = estimate_noise(
        measured - f, h, dataset.used, n_parameters, relative=dataset.metric == "relative"
    )
    v = variance(h, additive, relative)
    deviance = gaussian_deviance(measured - f, v, dataset.used)
    return additive, relative, np.divide(1.0, v, out=v), deviance


def _with_noise(
    problem: Problem, polished: Polished, n_parameters: int, dof: int
) -> tuple[Polished, Array, Array]:
    """Estimate the noise and fit again in turn until neither moves."""
    dataset = problem.dataset
    before: Array | None = None
    best, best_deviance = polished, np.inf
    for round_ in range(NOISE_ROUNDS):
        additive, relative, weights, deviance = _noise(problem, polished, n_parameters)
        # Reweighing is no descent: where the model is far off it may run away.
        if deviance > best_deviance + RUNAWAY * dataset.used.sum():
            polished = best
            additive, relative, weights, _ = _noise(problem, best, n_parameters)
            dataset.set_weights(weights)
            break
        if deviance < best_deviance:
            best, best_deviance = polished, deviance
        dataset.set_weights(weights)
        t, c = polished.t, polished.c
        if round_ == 0 and len(t):  # other weights may have moved the valley
            found, c = _search(problem, dataset.search, t, c)
            t = found.point
        polished = polish(problem, t, c, dof)
        now = np.concatenate([polished.c.ravel(), polished.t])
        if before is not None and np.allclose(now, before, rtol=1e-5, atol=1e-12):
            break
        before = now
    return polished, additive, relative


def _from_logarithm(problem: Problem, polished: Polished) -> Polished:
    """Go where the logarithm fits best, which gross misfits do not pull about."""
    found, c = _search(problem, problem.dataset.logarithmic, polished.t, polished.c)
    return replace(polished, t=found.point, c=c)


def _sigma(
    dataset: Dataset, values: Array, additive: Array, relative: Array, objective: float, dof: int
) -> Array:
    if dataset.uses_sigma and dataset.measurement.sigma is not None:
        return dataset.measurement.sigma
    if dataset.estimates_noise:
        h = level(values, dataset.measurement.values)
        return np.sqrt(variance(h, additive, relative))
    return np.full(values.shape, np.sqrt(max(objective, 1e-300) / dof))
