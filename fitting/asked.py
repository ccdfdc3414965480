"""What a fit is asked for: what is left open is chosen, what cannot be is refused."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from lobefit.fitting.dataset import METRICS
from lobefit.fitting.instrument import Instrument
from lobefit.fitting.measurement import Measurement
from lobefit.kernels import Candidate, FitError, MeasurementError, ModelError, candidates
from lobefit.kernels.library import SETS

__all__ = [
    "check_channels",
    "check_known",
    "check_metric",
    "check_options",
    "chosen_candidates",
    "chosen_metric",
]


def check_known(metric: str) -> None:
    """Raise a `FitError` for a metric that does not exist."""
    if metric != "auto" and metric not in METRICS:
        raise FitError(f"metric is one of auto, {', '.join(METRICS)}; not {metric!r}")


def chosen_metric(measurement: Measurement, metric: str) -> str:
    """Give the metric that "auto" stands for, or the one that is named.

    Raises
    ------
    FitError
        There is no such metric.
    """
    check_known(metric)
    if metric != "auto":
        return metric
    return "chi2" if measurement.sigma is not None else "relative"


def chosen_candidates(measurement: Measurement, models: str | Sequence[str]) -> list[Candidate]:
    """Give candidates; of a set the anisotropic ones only where the sample was turned."""
    wanted = candidates(models)
    if isinstance(models, str) and models in SETS and not measurement.has_azimuthal_evidence:
        return [c for c in wanted if c.isotropic]
    return wanted


def check_metric(metric: str, student: bool, instrument: Instrument | None) -> None:
    """Raise a `FitError` for what needs a likelihood with a metric that has none."""
    needs = ["Student's t"] if student else []
    if instrument is not None:
        needs += ["a tilt"] if instrument.tilt else []
        needs += ["a gain"] if instrument.gain is not None else []
    if needs and METRICS[metric] != "identity":
        verb = "goes" if len(needs) == 1 else "go"
        raise FitError(
            f"{' and '.join(needs)} {verb} with the metric chi2 or relative only, not {metric}"
        )
    if metric == "cosine_log" and instrument is not None and instrument.bends:
        raise FitError("an aperture needs another metric than cosine_log")


def check_channels(m: Measurement) -> None:
    """Raise a `MeasurementError` for a channel that reflects nothing anywhere."""
    for channel, values in zip(m.channels, m.values, strict=True):
        if not np.any(values > 0.0):
            raise MeasurementError(
                "the channel has no value above zero; leave it out",
                file=m.source or None,
                column=channel,
            )


def check_options(wanted: list[Candidate], options: Mapping[str, str] | None) -> None:
    """Raise a `ModelError` for an option that no candidate has."""
    known = {key for c in wanted for key in c.model.allowed}
    for key in options or {}:
        if key not in known:
            raise ModelError(
                f"no candidate has the option {key!r}; there are: {', '.join(sorted(known)) or 'none'}"
            )
