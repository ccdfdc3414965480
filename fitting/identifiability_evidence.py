"""A judged fit with what its data say of each parameter: what all questions about it start from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from lobefit.fitting.identifiability_noise import NoiseFreedom
from lobefit.fitting.information import Information, information_of_all
from lobefit.fitting.point import PointFit
from lobefit.fitting.resolution import Peak
from lobefit.fitting.result import FitResult, ParameterEstimate
from lobefit.fitting.robust import student_spread

__all__ = ["Evidence", "evidence"]


@dataclass(frozen=True, slots=True)
class Evidence:
    """What the data of a fit say, to first order.

    Attributes
    ----------
    fit : PointFit
        Its dataset is still on the device; its weights are changed.
    result : FitResult
        The same, judged.
    every : sequence of Information
        Of each channel.
    scale : float
        Variance of the residuals in units of the objective, correlation included.
    freedom : NoiseFreedom
        How well the noise is known.
    peak : Peak or None
        A peak that the readings do not resolve.
    """

    fit: PointFit
    result: FitResult
    every: Sequence[Information]
    scale: float
    freedom: NoiseFreedom
    peak: Peak | None

    def row_of(self, e: ParameterEstimate) -> int:
        """Give the number of an estimate's channel; 0 where it belongs to all of them."""
        channels = self.result.channels
        return channels.index(e.channel) if e.channel in channels else 0


def evidence(fit: PointFit, result: FitResult, peak: Peak | None = None) -> Evidence:
    """Put together what the data of a fit say.

    Parameters
    ----------
    fit : PointFit
        Its dataset is still on the device.
    result : FitResult
        The same, judged.
    peak : Peak, optional
        What `lobefit.fitting.resolution.unresolved_peak` finds, where it matters.
    """
    d = result.diagnostics
    correlation = d.samples / max(d.effective_samples, 1.0)
    scale = _scale(fit, result, correlation)
    every = information_of_all(fit, fit.polished.curvature, scale)
    freedom = NoiseFreedom(fit, every, scale, correlation)
    return Evidence(fit, result, every, scale, freedom, peak)


def _scale(fit: PointFit, result: FitResult, correlation: float) -> float:
    dataset, d = fit.problem.dataset, result.diagnostics
    if fit.nu is not None:
        r = dataset.residuals(fit.values) / fit.sigma
        spread = student_spread(r[dataset.used], fit.nu, fit.dof)
        return spread * (1.0 if dataset.uses_sigma else correlation)
    if dataset.uses_sigma:
        # A misfit lets nothing be known better than it allows.
        return max(1.0, d.reduced_chi_square * correlation) if d.misfit_limited else 1.0
    if dataset.has_likelihood:
        return d.reduced_chi_square * correlation
    return fit.polished.value / fit.dof * correlation
