"""The main job: fit every candidate to a measurement, rank them, and say what was found."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from lobefit.fitting.asked import (
    check_channels,
    check_metric,
    check_options,
    chosen_candidates,
    chosen_metric,
)
from lobefit.fitting.choice import Choice, Contender, choose
from lobefit.fitting.dataset import Dataset
from lobefit.fitting.diagnostics import CORRELATED, by_size, outliers, rmse, worst_regions
from lobefit.fitting.identifiability import with_identifiability
from lobefit.fitting.instrument import Instrument
from lobefit.fitting.instrument_fit import fit_behind
from lobefit.fitting.instrument_result import (
    instrument_fit,
    surface_alone,
    tilt_rows,
    without_veil,
)
from lobefit.fitting.measurement import Measurement
from lobefit.fitting.noise import GROSS, gaussian_deviance
from lobefit.fitting.plausibility import plausibility
from lobefit.fitting.point import PointFit, fit_point
from lobefit.fitting.report import FailedFit, FitReport
from lobefit.fitting.result import Diagnostics, FitResult, NoiseScales, StopReport
from lobefit.fitting.robust import student_deviance, student_spread, student_weights
from lobefit.fitting.search import USUAL, SearchSettings
from lobefit.fitting.selection import BIC_MARGIN, RMS_MARGIN, bic
from lobefit.fitting.uncertainty import estimates
from lobefit.fitting.verdict import verdict
from lobefit.kernels import (
    Device,
    FitError,
    LobefitError,
    MeasurementError,
    get_device,
)

__all__ = ["Progress", "fit"]

Array = NDArray[np.float64]
Progress = Callable[[int, int, str], None]

# rms of log10 above which a misfit is too large to call the surface described.
DESCRIBED = 0.1


@dataclass(frozen=True, slots=True)
class _Judged:
    """A point fit with what its residuals say."""

    fit: PointFit
    deviance: float | None
    correlation: float
    z: Array
    weighted: Array  # the same, less what Student's t takes off outliers

    @property
    def spread(self) -> float:
        """Relative scatter that the fit ascribes to noise; 0 where sigma was given."""
        dataset = self.fit.problem.dataset
        if dataset.metric == "log":
            return float(self.fit.sigma.flat[0])
        return float(self.fit.relative.max())


def _judge(dataset: Dataset, point: PointFit) -> _Judged:
    residuals, deviance = dataset.residuals(point.values), None
    if point.nu is not None:
        deviance = student_deviance(residuals, point.sigma**2, dataset.used, point.nu)
    elif dataset.has_likelihood:
        deviance = gaussian_deviance(residuals, point.sigma**2, dataset.used)
    residuals /= point.sigma
    residuals[~dataset.used] = np.nan
    weighted = residuals
    if point.nu is not None:
        weighted = residuals * np.sqrt(student_weights(residuals * residuals, point.nu))
    correlation = dataset.scans.autocorrelation_time(weighted)
    return _Judged(point, deviance, correlation, residuals, weighted)


def _diagnostics(dataset: Dataset, judged: _Judged, samples: int) -> Diagnostics:
    m, point = dataset.measurement, judged.fit
    sizes = by_size(m.values, point.values, dataset.present)
    reduced = float(np.nansum(judged.weighted**2)) / point.dof
    spread = 1.0 + 5.0 * np.sqrt(2.0 / point.dof)
    reason = ""
    if dataset.uses_sigma and reduced > max(spread, 1.2):
        reason = (
            f"residuals are {np.sqrt(reduced):.2g} times the stated sigma "
            f"(reduced chi-square {reduced:.3g})"
        )
    elif judged.spread > GROSS:
        reason = (
            f"residuals of {100 * judged.spread:.0f} % of the value are more than any "
            "instrument's noise"
        )
    elif judged.correlation > CORRELATED:
        reason = (
            f"residuals are correlated over {judged.correlation:.0f} neighbouring values: "
            f"{samples} values count as {samples / judged.correlation:.0f}"
        )
    return Diagnostics(
        log10_rms=sizes.log10_rms,
        log10_count=sizes.count,
        log10_excluded=sizes.excluded,
        decades=sizes.decades,
        reduced_chi_square=reduced,
        effective_samples=samples / judged.correlation,
        samples=samples,
        outliers=outliers(m, judged.z, point.values),
        misfit_limited=bool(reason),
        misfit_reason=reason,
        worst=worst_regions(dataset.regions, m.values, point.values, judged.weighted, dataset.used)
        if reason
        else (),
    )


def _result(dataset: Dataset, judged: _Judged, correlation: float) -> FitResult:
    """Assemble the result; `correlation` is the time that all candidates share."""
    m, point = dataset.measurement, judged.fit
    problem, polished = point.problem, point.polished
    samples = int(dataset.used.sum())
    diagnostics = _diagnostics(dataset, judged, samples)
    scale = 1.0
    if not dataset.uses_sigma:
        # Without a likelihood the scatter is in the sandwich already.
        spread = diagnostics.reduced_chi_square if point.meat is None else samples / point.dof
        scale = spread * judged.correlation
    if point.nu is not None:
        scale = student_spread(judged.z[dataset.used], point.nu, point.dof)
        scale *= 1.0 if dataset.uses_sigma else judged.correlation
    found = estimates(point, m.channels, scale)
    size = problem.candidate.n_parameters(m.n_channels) + dataset.extra_parameters
    instrument = dataset.instrument
    effective = samples / correlation
    return FitResult(
        model=problem.candidate.model.name,
        candidate=problem.candidate.name,
        options=problem.candidate.model.options,
        channels=m.channels,
        params=found.params,
        estimates=found.rows,
        covariance=found.covariance,
        rmse=rmse(m.values, point.values, dataset.used),
        bic=None if judged.deviance is None else bic(judged.deviance, samples, effective, size),
        log_likelihood=None
        if judged.deviance is None
        else -0.5 * judged.deviance * effective / samples,
        objective=polished.value,
        n_parameters=size,
        noise=NoiseScales(
            given=dataset.uses_sigma,
            relative=tuple(float(s) for s in point.relative),
            additive=tuple(float(s) for s in point.additive),
            nu=point.nu,
        ),
        stop=StopReport(
            algorithm=point.algorithm,
            reason=point.reason,
            evaluations=problem.evaluations,
            seconds=point.seconds,
            converged=polished.converged,
            device=str(dataset.device.info),
            precision=dataset.precision,
        ),
        diagnostics=diagnostics,
        plausibility=plausibility(problem, polished.t, surface_alone(problem, polished.c)),
        instrument=None
        if instrument is None
        else instrument_fit(instrument, tilt_rows(point, found.tilt_covariance)),
    )


def fit(
    measurement: Measurement,
    models: str | Sequence[str] = "standard",
    *,
    metric: str = "auto",
    options: Mapping[str, str] | None = None,
    tolerance: float | None = None,
    student: bool = False,
    instrument: Instrument | None = None,
    search: SearchSettings = USUAL,
    device: str | Device | None = None,
    progress: Progress | None = None,
    stop: Callable[[], bool] | None = None,
) -> FitReport:
    """Fit candidate models to a measurement and rank them, the simplest sufficient one first.

    Parameters
    ----------
    measurement : Measurement
        N directions, C channels.
    models : str or sequence of str
        A set ("quick", "standard", "all"), or names such as "ggx" and
        "ggx:k_s=1". Anisotropic models are left out of a set where the sample was
        not turned; named ones are always fitted.
    metric : {"auto", "chi2", "relative", "log", "cube_root", "cosine_log"}
        "chi2": residuals over the given sigma (constant noise without one).
        "relative": noise of a relative and an additive part, both estimated.
        "log": logarithms, for data that span decades; values that are not
        positive are left out and counted. "cube_root": cube roots. "cosine_log":
        ln(1 + f cos_theta_i) of Low et al. 2012, which is even between bright and
        dark values and does not follow the darkest ones as "log" does.
        "auto": "chi2" where the measurement has sigma, else "relative".
    options : mapping of str to str, optional
        Pieces that every model which knows them is compiled with.
    tolerance : float, optional
        Relative error of the predicted radiance that does not matter, such as 0.01: a
        richer model must change predictions by more at some incidence, or the simpler
        one is recommended.
    student : bool
        Student's t instead of a Gaussian, for outliers; nu is chosen by its likelihood.
    instrument : Instrument, optional
        Tilt, veil, gain and aperture to account for; each result's `instrument` has what
        was found. Without it readings are those of an ideal instrument.
    search : SearchSettings
        How the valleys are found; what is left out is the usual.
    device : str, Device or None
        See `lobefit.kernels.get_device`.
    progress : callable, optional
        Called with (done, total, label) before each candidate and at the end.
    stop : callable, optional
        Asked before each candidate once there is a first; True ranks those fitted so far.

    Returns
    -------
    FitReport

    Raises
    ------
    MeasurementError
        Too few directions for every candidate.
    FitError
        No candidate could be fitted, an unknown metric, a negative tolerance, or a metric
        that Student's t or the instrument does not go with.
    ModelError
        An unknown model, set or option.
    DeviceError
        No usable device.

    Examples
    --------
    >>> from lobefit.fitting import fit, simulate
    >>> surface = simulate("lambert", {"k_d": 0.3}, noise=(0.01, 0.0), seed=1)
    >>> fit(surface, models="lambert").best.model
    'lambert'
    """
    began = time.perf_counter()
    if not isinstance(measurement, Measurement):
        raise MeasurementError(
            f"fit takes a Measurement, not {type(measurement).__name__}; "
            "read a file with read_measurement first"
        )
    metric = chosen_metric(measurement, metric)
    if tolerance is not None and not 0.0 <= tolerance < np.inf:
        raise FitError(f"tolerance is a relative error such as 0.01, not {tolerance!r}")
    check_metric(metric, student, instrument)
    wanted = chosen_candidates(measurement, models)
    check_options(wanted, options)
    check_channels(measurement)
    opened = get_device(device)
    made = partial(Dataset, measurement, metric, opened, instrument, student=student, how=search)
    datasets = [dataset := made()]
    judged: list[_Judged] = []
    failed: list[FailedFit] = []
    try:
        for done, candidate in enumerate(wanted):
            if judged and stop is not None and stop():
                failed += [FailedFit(c.name, "not fitted: stopped before") for c in wanted[done:]]
                break
            if progress is not None:
                progress(done, len(wanted), candidate.name)
            try:
                chosen = candidate.choose(options or {})
                if instrument is None:
                    point = fit_point(chosen, dataset)
                else:
                    if instrument.tilt:  # each candidate has its own
                        datasets.append(made())
                    point = fit_behind(chosen, datasets[-1], instrument)
                judged.append(_judge(dataset, point))
            except LobefitError as error:
                failed.append(FailedFit(candidate.name, str(error)))
                if not judged and candidate is wanted[-1]:
                    raise
        results, choice = _ranked(dataset, judged, tolerance)
        results = with_identifiability(
            results, {j.fit.problem.candidate.name: j.fit for j in judged}
        )
        results = [without_veil(r) for r in results]
        if progress is not None:
            progress(len(wanted), len(wanted), "done")
    finally:
        for used in datasets:
            used.release()
    best = results[0]
    rms = best.diagnostics.log10_rms
    described = not (best.diagnostics.misfit_limited and (rms is None or rms > DESCRIBED))
    return FitReport(
        measurement=measurement,
        metric=metric,
        results=tuple(results),
        failed=tuple(failed),
        described=described,
        verdict=verdict(
            measurement, results, described, metric, dataset.distinct_directions, choice.sentence
        ),
        choice=choice,
        seconds=time.perf_counter() - began,
        settings={
            "models": models if isinstance(models, str) else list(models),
            "candidates": [c.name for c in wanted],
            "margin": BIC_MARGIN if results[0].bic is not None else RMS_MARGIN,
            "metric": metric,
            "options": dict(options or {}),
            "tolerance": tolerance,
            "student": student,
            "instrument": None if instrument is None else instrument.to_dict(),
            "search": asdict(search),
            "device": dataset.device.info.id,
        },
    )


def _ranked(
    dataset: Dataset, judged: list[_Judged], tolerance: float | None
) -> tuple[list[FitResult], Choice]:
    likely = [j for j in judged if j.deviance is not None]
    if likely:
        correlation = min(likely, key=lambda j: j.deviance or 0.0).correlation
    else:
        correlation = min(judged, key=lambda j: j.fit.polished.value).correlation
    results = [_result(dataset, j, correlation) for j in judged]
    entrants = [
        Contender(
            r.candidate,
            r.n_parameters,
            r.bic if r.bic is not None else float(np.sqrt(r.objective)),
            j.fit,
        )
        for r, j in zip(results, judged, strict=True)
    ]
    choice = choose(entrants, dataset, tolerance)
    return [results[k] for k in choice.order], choice
