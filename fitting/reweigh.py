"""Noise and fit in turn, where the measurement does not state its sigma."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lobefit.fitting.noise import GROSS, estimate_noise, gaussian_deviance, level, variance
from lobefit.fitting.polish import Polished, polish, sums_at
from lobefit.fitting.problem import Problem
from lobefit.fitting.valley import descend

__all__ = ["Weighed", "fit_with_noise", "judged_with", "refitted"]

Array = NDArray[np.float64]

# Rounds of "estimate the noise, fit again"; two or three settle it.
ROUNDS = 8
# A round that raises the deviance per value by this is a run-away and is undone.
RUNAWAY = 0.02


@dataclass(frozen=True, slots=True)
class Weighed:
    """A point together with the noise that its residuals suggest.

    Attributes
    ----------
    polished : Polished
    additive, relative : ndarray, shape (C,)
        Scales of the noise in 1/sr and 1.
    gross : bool
        The misfit is larger than any noise; levels take the measured value into
        account, see `lobefit.fitting.noise`.
    nu : float or None
        Degrees of freedom of Student's t; None for a Gaussian.
    """

    polished: Polished
    additive: Array
    relative: Array
    gross: bool
    nu: float | None = None


def refitted(problem: Problem, at: Polished, dof: int, *, anew: bool) -> Polished:
    """Fit again from a point with the weights in force.

    Parameters
    ----------
    problem : Problem
    at : Polished
        Where to start.
    dof : int
    anew : bool
        Walk down as from a start of the scan: the valley itself may have moved.

    Returns
    -------
    Polished
    """
    t, c = at.t, at.c
    if anew and len(t):
        found, c = descend(problem, problem.dataset.search, t, c)
        t = found.point
    return polish(problem, t, c, dof)


def judged_with(problem: Problem, at: Polished, weights: Array) -> Polished:
    """Put weights in force, and give a point with its objective and curvature under them."""
    problem.dataset.set_weights(weights)
    value, curvature = sums_at(problem, at.t, at.c)
    return replace(at, value=value, curvature=curvature)


def fit_with_noise(problem: Problem, polished: Polished, n_parameters: int, dof: int) -> Weighed:
    """Fit with weights from the noise that the residuals suggest.

    Parameters
    ----------
    problem : Problem
        Its dataset's weights are changed.
    polished : Polished
        Where to start.
    n_parameters, dof : int
        Free parameters and degrees of freedom.

    Returns
    -------
    Weighed
    """
    weighed = _rounds(problem, polished, n_parameters, dof, gross=False)
    if weighed.relative.max() <= GROSS:
        return weighed
    # Start again where the logarithm fits best, which gross misfits do not pull about.
    found, c = descend(problem, problem.dataset.logarithmic, polished.t, polished.c)
    start = replace(polished, t=found.point, c=c)
    return _rounds(problem, start, n_parameters, dof, gross=True)


def _rounds(
    problem: Problem, polished: Polished, n_parameters: int, dof: int, *, gross: bool
) -> Weighed:
    dataset = problem.dataset
    before: Array | None = None
    best, best_deviance = polished, np.inf
    for round_ in range(ROUNDS):
        additive, relative, weights, deviance = _noise(problem, polished, n_parameters, gross)
        # Reweighing is no descent: where the model is far off it may run away.
        if deviance > best_deviance + RUNAWAY * dataset.used.sum():
            additive, relative, weights, _ = _noise(problem, best, n_parameters, gross)
            polished = replace(
                judged_with(problem, best, weights),
                converged=False,
                reason="reweighing ran away and was undone",
            )
            break
        if deviance < best_deviance:
            best, best_deviance = polished, deviance
        dataset.set_weights(weights)
        polished = refitted(problem, polished, dof, anew=round_ == 0)
        now = np.concatenate([polished.c.ravel(), polished.t])
        if before is not None and np.allclose(now, before, rtol=1e-5, atol=1e-12):
            break
        before = now
    return Weighed(polished, additive, relative, gross)


def _noise(
    problem: Problem, point: Polished, n_parameters: int, gross: bool
) -> tuple[Array, Array, Array, float]:
    """Estimate the noise at a point; returns scales, weights and the deviance."""
    dataset = problem.dataset
    measured = dataset.measurement.values
    f = problem.values(point.t, point.c)
    h = level(f, measured, gross=gross)
    additive, relative = estimate_noise(
        measured - f, h, dataset.used, n_parameters, relative=dataset.metric == "relative"
    )
    v = variance(h, additive, relative)
    deviance = gaussian_deviance(measured - f, v, dataset.used)
    return additive, relative, np.divide(1.0, v, out=v), deviance
