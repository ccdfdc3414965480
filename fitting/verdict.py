"""The answer in words: which model, how well, and what to beware of."""

from __future__ import annotations

import math
from collections.abc import Sequence

from lobefit.fitting.measurement import Measurement
from lobefit.fitting.result import FitResult

__all__ = ["verdict"]

# A share of outliers above this is misfit, not bad readings.
FEW = 0.01
# Data that span more decades than this are better weighed by their logarithm.
WIDE = 3.0
# A scatter with a larger relative standard error is hardly known.
VAGUE = 0.3


def verdict(
    measurement: Measurement,
    results: Sequence[FitResult],
    described: bool,
    metric: str,
    directions: int,
    reason: str = "",
) -> str:
    """Say what a fit found.

    Parameters
    ----------
    measurement : Measurement
        What was fitted.
    results : sequence of FitResult
        Ranked.
    described : bool
        Whether the first one describes the surface.
    metric : str
        How residuals were weighed.
    directions : int
        Distinct ones: readings of one direction test its noise, not the model.
    reason : str
        The sentence that says why the first one was chosen.

    Returns
    -------
    str
        A few sentences.
    """
    sentences = [
        *_quality(results[0], described, directions),
        *([reason] if reason else []),
        *_doubts(results),
        *_data(measurement, results[0], described, metric),
    ]
    return " ".join(sentences)


def _quality(best: FitResult, described: bool, directions: int) -> list[str]:
    d = best.diagnostics
    quality = f"(rmse {best.rmse:.3g} 1/sr"
    if best.noise.given:
        quality += f", reduced chi-square {d.reduced_chi_square:.3g})"
    else:
        quality += ")" if d.log10_rms is None else f", rms of log10 {d.log10_rms:.3f})"
    if not described:
        text = [f"No candidate describes this surface; the best is {best.candidate} {quality}."]
        if d.worst:
            text.append(f"It fails most at {d.worst[0]}.")
        return text
    if d.misfit_limited:
        return [f"{best.candidate} approximates this surface, not to within its noise {quality}."]
    freedom = _freedom(best, directions)
    # GUM, E.4.3: of a standard deviation that is estimated with so many degrees of freedom.
    vague = 1.0 / math.sqrt(2.0 * max(freedom, 0.5))
    if vague > VAGUE:
        each = " in each channel" if len(best.channels) > 1 else ""
        return [
            (
                f"{best.candidate} is not contradicted by this measurement {quality}, which tests it "
                f"little: {directions} directions leave {freedom:.2g} degrees of freedom{each}, so that "
                f"the scatter about the model is known to {100 * vague:.0f} % and a misfit of about its "
                "size would not show."
            )
        ]
    return [f"{best.candidate} describes this surface to within its noise {quality}."]


def _freedom(best: FitResult, directions: int) -> float:
    """Give the independent readings of a channel, beyond those that the parameters follow.

    Of one channel: a misfit has the same shape in all of them, where noise has not.
    """
    d, channels = best.diagnostics, len(best.channels)
    apart = min(directions, d.samples / channels)
    left = (apart - best.n_parameters / channels) * d.effective_samples / d.samples
    return max(left, 0.0)


def _doubts(results: Sequence[FitResult]) -> list[str]:
    best = results[0]
    d, text = best.diagnostics, []
    if d.misfit_limited:
        text.append(
            f"The fit is misfit-limited: {d.misfit_reason}; real errors are larger than stated."
        )
    if 0 < d.outliers.count <= FEW * d.samples:
        several = d.outliers.count > 1
        text.append(
            f"{d.outliers.count} value{'s lie' if several else ' lies'} far outside the scatter "
            f"of the others and should be checked: {d.outliers.examples[0]}."
        )
    if not best.plausibility.conserves_energy:
        largest = max(best.plausibility.albedo_max)
        over = sum(not r.plausibility.conserves_energy for r in results)
        if 2 * over > len(results):
            unit = "percent, a factor pi" if largest > 10.0 else "a factor pi"
            advice = (
                f"so do {over} of {len(results)} candidates: check the quantity ({unit}, a cosine)"
            )
        else:
            advice = "trust the model at the measured angles only"
        text.append(
            f"Its directional albedo reaches {largest:.3g}, which no passive surface has; {advice}."
        )
    return text


def _data(m: Measurement, best: FitResult, described: bool, metric: str) -> list[str]:
    d, text = best.diagnostics, []
    if metric == "log" and d.log10_excluded:
        text.append(
            f"{d.log10_excluded} of {d.log10_count + d.log10_excluded} values are not positive "
            "and have no logarithm: they were left out."
        )
    if metric == "chi2" and not best.noise.given:
        text.append("No sigma is given: one constant noise per channel was assumed.")
    if metric == "relative" and not described and m.decades > WIDE:
        text.append(
            f"The data span {m.decades:.1f} decades: the metric log weighs them evenly; grazing "
            "angles may be left out (--max-theta)."
        )
    return text
