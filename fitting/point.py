"""The point fit of one candidate: scan, NLopt, Gauss-Newton, and the noise in turn."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lobefit.fitting.dataset import Dataset
from lobefit.fitting.instrument_nuisance import Nuisance
from lobefit.fitting.noise import level, variance
from lobefit.fitting.polish import Polished, polish, sums_at
from lobefit.fitting.problem import Problem
from lobefit.fitting.reweigh import Weighed, fit_with_noise
from lobefit.fitting.robust import fit_robustly, student_weights
from lobefit.fitting.valley import descend, starts
from lobefit.kernels import Candidate, FitError, MeasurementError

__all__ = ["PointFit", "fit_point"]

Array = NDArray[np.float64]


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
    gross : bool
        Whether its levels take the measured value into account, see `lobefit.fitting.noise`.
    meat : ndarray or None, shape (C, n + D, n + D)
        Sums of w^2 r^2 J J^T where the metric has no likelihood: its residuals do not
        have the scatter that the weights say, and the errors are those of a sandwich.
    dof : int
        Degrees of freedom.
    algorithm, reason : str
    seconds : float
    nu : float or None
        Degrees of freedom of Student's t, whose scale is sigma; None for a Gaussian.
    nuisance : Nuisance or None
        What is not known of the instrument.
    """

    problem: Problem
    polished: Polished
    values: Array
    sigma: Array
    additive: Array
    relative: Array
    gross: bool
    meat: Array | None
    dof: int
    algorithm: str
    reason: str
    seconds: float
    nu: float | None = None
    nuisance: Nuisance | None = None

    @property
    def weights(self) -> Array:
        """Weights of the squared residuals of a metric with a likelihood, shape (C, N)."""
        v = self.sigma**2
        if self.nu is None:
            return np.asarray(1.0 / v)
        r = self.problem.dataset.measurement.values - self.values
        return student_weights(r * r / v, self.nu) / v

    def variance_at(self, values: Array) -> Array:
        """Give the variance that the noise would have if the model had other values, (C, N)."""
        dataset = self.problem.dataset
        if not dataset.estimates_noise:
            return np.asarray(self.sigma**2)
        h = level(values, dataset.measurement.values, gross=self.gross)
        return variance(h, self.additive, self.relative)


def fit_point(candidate: Candidate, dataset: Dataset) -> PointFit:
    """Fit one candidate.

    Parameters
    ----------
    candidate : Candidate
        What to fit.
    dataset : Dataset
        To what; its weights are changed.

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
    problem = Problem(candidate, dataset)
    channels = dataset.measurement.n_channels
    n_parameters = candidate.n_parameters(channels) + dataset.extra_parameters
    samples = int(dataset.used.sum())
    dof = samples - n_parameters
    _check_enough(candidate, dataset, n_parameters)
    dataset.reset_weights()
    valleys = starts(problem)
    if not valleys:
        raise FitError(f"{candidate.name}: no point of the start scan gives finite residuals")
    scanned = problem.evaluations
    begun = valleys[:1] if dataset.how.is_global else valleys
    runs = [descend(problem, dataset.search, t, c) for t, c in begun]
    found, c = min(runs, key=lambda run: run[0].value)
    if not np.isfinite(found.value):
        raise FitError(f"{candidate.name}: {found.reason}")
    polished = polish(problem, found.point, c, dof)
    weighed = Weighed(polished, np.zeros(channels), np.zeros(channels), gross=False)
    algorithm = [
        f"scan of {scanned} nodes",
        f"NLopt {found.algorithm} from {len(runs)} starts",
        "Gauss-Newton",
    ]
    if dataset.student:
        weighed = fit_robustly(problem, polished, n_parameters, dof)
        polished = weighed.polished
        algorithm.append("Student's t by reweighing")
    elif dataset.estimates_noise:
        weighed = fit_with_noise(problem, polished, n_parameters, dof)
        polished = weighed.polished
        algorithm.append("noise and fit in turn")
        if weighed.gross:
            algorithm.append("again from a fit of the logarithm")
    if _switched(problem, polished.t):
        polished = polish(problem, *_switch(problem, polished.t, polished.c), dof)
    values = problem.values(polished.t, polished.c)
    return PointFit(
        problem=problem,
        polished=polished,
        values=values,
        sigma=_sigma(dataset, values, weighed, dof),
        additive=weighed.additive,
        relative=weighed.relative,
        gross=weighed.gross,
        meat=None if dataset.has_likelihood else _meat(problem, polished, values),
        dof=dof,
        algorithm=", ".join(algorithm if len(found.point) else algorithm[2:]),
        reason=f"{polished.reason} (NLopt: {found.reason})",
        seconds=time.perf_counter() - began,
        nu=weighed.nu,
    )


def _switched(problem: Problem, t: Array) -> bool:
    """Tell whether two lobes of one kind stand in the wrong order."""
    ordered = problem.candidate.model.ordered
    names = [p.name for p in problem.candidate.shared]
    if ordered is None or not set(ordered) <= set(names):
        return False
    first, second = (t[names.index(name)] for name in ordered)
    return bool(first > second)


def _switch(problem: Problem, t: Array, c: Array) -> tuple[Array, Array]:
    """Exchange the parameters of two lobes of one kind."""

    def other(name: str) -> str:
        return {"_1": f"{name[:-2]}_2", "_2": f"{name[:-2]}_1"}.get(name[-2:], name)

    def exchange(names: list[str]) -> list[int]:
        return [names.index(other(name)) for name in names]

    products = ["*".join(names) for names in problem.candidate.model.coefficients]
    swapped = ["*".join(other(n) for n in p.split("*") if n) for p in products]
    k = problem.program.n_basis
    rows = [products.index(name) for name in swapped]
    own = [k + j for j in exchange([p.name for p in problem.candidate.own])]
    return t[exchange([p.name for p in problem.candidate.shared])], c[:, [*rows, *own]]


def _check_enough(candidate: Candidate, dataset: Dataset, n_parameters: int) -> None:
    """Raise a `MeasurementError` where the data cannot determine the candidate."""
    m = dataset.measurement
    advice = "measure more or fit a simpler model"
    counts = dataset.used.sum(axis=1)
    fewest = int(np.argmin(counts))
    least = 1 + len(candidate.solved)
    if counts[fewest] < least:
        usable = "positive values, for the logarithm," if dataset.metric == "log" else "values"
        raise MeasurementError(
            f"{counts[fewest]} usable {usable} are too few for {candidate.name}, which needs "
            f"{least} in each channel; {advice}",
            file=m.source or None,
            column=m.channels[fewest],
        )
    distinct, least = dataset.distinct_directions, len(candidate.searched) + least
    if distinct < least or counts.sum() <= n_parameters:
        raise MeasurementError(
            f"{distinct} distinct directions and {counts.sum()} values are too few for "
            f"{candidate.name} with {n_parameters} parameters; {advice}",
            file=m.source or None,
        )


def _meat(problem: Problem, point: Polished, values: Array) -> Array:
    """Sum w^2 r^2 J J^T at a point; the weights of these metrics are 1."""
    dataset = problem.dataset
    dataset.set_weights(dataset.residuals(values) ** 2)
    return sums_at(problem, point.t, point.c)[1].matrix


def _sigma(dataset: Dataset, values: Array, weighed: Weighed, dof: int) -> Array:
    """Give the noise that residuals are judged by, shape (C, N)."""
    if dataset.uses_sigma and dataset.measurement.sigma is not None:
        return dataset.measurement.sigma
    if dataset.estimates_noise:
        h = level(values, dataset.measurement.values, gross=weighed.gross)
        return np.sqrt(variance(h, weighed.additive, weighed.relative))
    return np.full(values.shape, np.sqrt(max(weighed.polished.value, 1e-300) / dof))
