"""Fits against each other: models, their options, metrics, less data, other searches."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from lobefit.fitting.dataset import METRICS, Dataset
from lobefit.fitting.measurement import Measurement
from lobefit.fitting.point import PointFit, fit_point
from lobefit.fitting.search import ALGORITHMS, USUAL, SearchSettings
from lobefit.fitting.tradeoff_points import Panel, Point, Spread
from lobefit.fitting.tradeoff_subject import Subject, every
from lobefit.fitting.tradeoff_timing import Clock, interleaved
from lobefit.kernels import Candidate, Device, FitError, LobefitError, candidate
from lobefit.kernels.geometry import Directions

__all__ = ["FitChoice", "fit_panel", "leading", "near_best", "variations"]

# Models whose error is within this factor of the least one are as good a choice, if faster.
AS_GOOD = 1.1
STEPS = (2, 4, 8)
DENSITIES = (0.25, 0.5, 2.0)
TOLERANCES = (5e-2, 1e-4, 1e-6)
# Algorithms that look everywhere need more than those that walk down.
GLOBAL_EVALUATIONS = 1000

Tell = Callable[[int, int, str], None]


@dataclass(frozen=True, slots=True)
class FitChoice:
    """One way to fit.

    Attributes
    ----------
    label, group : str
    candidate : Candidate
    metric : str
    step : int
        Every so many angles of the measurement are used.
    search : SearchSettings
    """

    label: str
    group: str
    candidate: Candidate
    metric: str
    step: int = 1
    search: SearchSettings = USUAL

    @property
    def settings(self) -> dict[str, Any]:
        """What is needed to fit so again."""
        return {
            "candidate": self.candidate.name,
            "options": dict(self.candidate.model.options),
            "metric": self.metric,
            "every": self.step,
            "search": asdict(self.search),
        }


class _Run:
    """A choice that can be run again and again, from arrays in memory to fitted numbers."""

    def __init__(self, choice: FitChoice, data: Measurement, device: Device) -> None:
        self.choice, self._data, self._device = choice, data, device

    def __call__(self) -> None:
        with self._fitted():
            pass

    def measured(self, subject: Subject, directions: Directions) -> tuple[float, dict[str, Any]]:
        """Fit once; give the error and what the fit says of itself."""
        with self._fitted() as point:
            values = point.problem.values_at(directions, point.polished.t, point.polished.c)
            return subject.error(values), _detail(point)

    @contextmanager
    def _fitted(self) -> Iterator[PointFit]:
        dataset = Dataset(self._data, self.choice.metric, self._device, how=self.choice.search)
        try:
            yield fit_point(self.choice.candidate, dataset)
        finally:
            dataset.release()


def _detail(point: PointFit) -> dict[str, Any]:
    dataset = point.problem.dataset
    return {
        "algorithm": point.algorithm,
        "reason": point.reason,
        "evaluations": point.problem.evaluations,
        "converged": point.polished.converged,
        "parameters": point.problem.candidate.n_parameters(dataset.measurement.n_channels),
        "directions": dataset.measurement.n_directions,
        "precision": dataset.precision,
    }


def near_best(errors: Mapping[str, float], tolerance: float) -> list[str]:
    """Name the candidates within the tolerance, or nearly as good as the best, best first."""
    order = sorted(errors, key=errors.__getitem__)
    enough = max(tolerance, AS_GOOD * errors[order[0]])
    return [name for name in order if errors[name] <= enough]


def leading(errors: Mapping[str, float], seconds: Mapping[str, float]) -> list[str]:
    """Choose the two models whose settings are worth varying.

    Parameters
    ----------
    errors : mapping of str to float
        By candidate.
    seconds : mapping of str to float
        Of those that are good enough, see `near_best`.

    Returns
    -------
    list of str
        The one of the least error, and the fastest that is good enough; the second best where
        these are the same.
    """
    best, *others = sorted(errors, key=errors.__getitem__)
    quick = min(seconds, key=seconds.__getitem__)
    return [best, quick] if quick != best else [best, *others[:1]]


def variations(base: FitChoice) -> Iterator[FitChoice]:
    """Give every other way to fit a leading model.

    Parameters
    ----------
    base : FitChoice
        The usual way.
    """
    name, chosen = base.label, base.candidate
    for key, choices in chosen.model.allowed.items():
        for choice in choices:
            other = candidate(chosen.name, {key: choice})
            if dict(other.model.options) != dict(chosen.model.options):
                label = f"{name}, {key}={choice}"
                yield replace(base, label=label, group="option", candidate=other)
    for metric in METRICS:
        if metric != base.metric:
            label = f"{name}, metric {metric}"
            yield replace(base, label=label, group="metric", metric=metric)
    for step in STEPS:
        nth = {2: "2nd"}.get(step, f"{step}th")
        label = f"{name}, every {nth} angle"
        yield replace(base, label=label, group="data", step=step)
    if not chosen.shared:
        return  # nothing is searched for
    for density in DENSITIES:
        label, how = f"{name}, scan x {density:g}", SearchSettings(scan_density=density)
        yield replace(base, label=label, group="scan", search=how)
    usual = USUAL.run(len(chosen.shared))
    for algorithm in ALGORITHMS:
        how = SearchSettings(algorithm=algorithm)
        if how.is_global:
            how = replace(how, max_evaluations=GLOBAL_EVALUATIONS)
        if how.run(len(chosen.shared)) != usual:
            yield replace(base, label=f"{name}, {algorithm}", group="algorithm", search=how)
    for tolerance in TOLERANCES:
        label, how = f"{name}, search to {tolerance:g}", SearchSettings(tolerance=tolerance)
        yield replace(base, label=label, group="tolerance", search=how)


def fit_panel(
    subject: Subject,
    models: list[Candidate],
    metric: str,
    device: Device,
    *,
    tolerance: float,
    repeats: int,
    clock: Clock,
    tell: Tell,
) -> tuple[Panel, list[str]]:
    """Measure fits against each other.

    Parameters
    ----------
    subject : Subject
    models : list of Candidate
    metric : str
        The usual one.
    device : Device
    tolerance : float
        Error that was asked for.
    repeats : int
        Timed runs of each, after one that is not timed.
    clock, tell : callable
        Gives seconds; is told (done, total, label).

    Returns
    -------
    panel : Panel
    leaders : list of str
        Candidates whose settings were varied, the best first.

    Raises
    ------
    FitError
        Not one model could be fitted.
    """
    directions = Directions(device, *subject.angles)
    failed: dict[str, str] = {}
    runs: list[_Run] = []
    found: list[tuple[float, dict[str, Any]]] = []
    data = {1: subject.train}

    def prepare(choices: list[FitChoice]) -> None:
        for k, choice in enumerate(choices):
            tell(k, len(choices), choice.label)
            if choice.step not in data:
                thinned = every(subject.train, choice.step)
                if thinned is None:
                    failed[choice.label] = "too few angles in a scan"
                    continue
                data[choice.step] = thinned
            run = _Run(choice, data[choice.step], device)
            try:
                measured = run.measured(subject, directions)
            except LobefitError as error:
                failed[choice.label] = str(error)
                continue
            if not np.isfinite(measured[0]):
                failed[choice.label] = "what it predicts is not finite"
                continue
            runs.append(run)
            found.append(measured)

    try:
        prepare([FitChoice(c.name, "model", c, metric) for c in models])
        if not runs:
            raise FitError(f"no model could be fitted: {'; '.join(failed.values())}")
        errors = {run.choice.label: said[0] for run, said in zip(runs, found, strict=True)}
        near = near_best(errors, tolerance)
        rivals = [run for run in runs if run.choice.label in near]
        times = interleaved(rivals, 1, clock)
        leaders = leading(
            errors, {r.choice.label: t[0] for r, t in zip(rivals, times, strict=True)}
        )
        bases = [run.choice for run in runs if run.choice.label in leaders]
        prepare([v for base in bases for v in variations(base)])
    finally:
        directions.release()
    tell(0, repeats, f"timing {len(runs)} fits")
    times = interleaved(runs, repeats, clock)
    measured = [_point(r, t, f) for r, t, f in zip(runs, times, found, strict=True)]
    panel = Panel(
        name="fit",
        title="How to fit",
        seconds_label="time of a fit [s]",
        error_label="error of the prediction [%]",
        percent=True,
        points=tuple(measured),
        notes=(
            subject.note,
            (
                "error: root mean square of the relative errors of f cos(theta_i), below a twentieth "
                "of its median relative to that"
            ),
            (
                "time: from arrays in memory to fitted parameters, compiled before; "
                "the report about a fit is not in it; what takes more than a second was timed once"
            ),
        ),
        failed=failed,
    )
    return panel, leaders


def _point(run: _Run, times: tuple[float, ...], said: tuple[float, dict[str, Any]]) -> Point:
    choice = run.choice
    return Point(
        label=choice.label,
        group=choice.group,
        seconds=Spread(times),
        error=Spread((said[0],)),
        settings=choice.settings,
        detail=said[1],
        usual=choice.group == "model",
    )
