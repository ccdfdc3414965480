"""The answer in words: which model, how well, and what to beware of."""

from __future__ import annotations

from collections.abc import Sequence

from lobefit.fitting.result import FitResult
from lobefit.fitting.selection import BIC_MARGIN

__all__ = ["verdict"]


def verdict(results: Sequence[FitResult], described: bool, metric: str) -> str:
    """Say what a fit found.

    Parameters
    ----------
    results : sequence of FitResult
        Ranked.
    described : bool
        Whether the first one describes the surface.
    metric : str
        How residuals were weighed.

    Returns
    -------
    str
        Two or three sentences.
    """
    best = results[0]
    d = best.diagnostics
    quality = f"(rmse {best.rmse:.3g} 1/sr"
    if best.noise.given:
        quality += f", reduced chi-square {d.reduced_chi_square:.3g})"
    else:
        quality += ")" if d.log10_rms is None else f", rms of log10 {d.log10_rms:.3f})"
    if described:
        text = [f"{best.candidate} describes this surface {quality}."]
    else:
        text = [f"No candidate describes this surface; the best is {best.candidate} {quality}."]
        if d.worst:
            text.append(f"It fails most at {d.worst[0]}.")
    if best.bic is not None and len(results) > 1:
        rival = results[1]
        if rival.bic is not None:
            lead = rival.bic - best.bic
            if lead < 0.0:
                text.append(
                    f"{rival.candidate} fits no better than its {rival.n_parameters} parameters "
                    f"against {best.n_parameters} allow (BIC {-lead:.3g} lower, margin {BIC_MARGIN:g})."
                )
            else:
                text.append(f"The next best, {rival.candidate}, has a BIC {lead:.4g} higher.")
    if metric == "log" and d.log10_excluded:
        text.append(
            f"{d.log10_excluded} of {d.log10_count + d.log10_excluded} values are not positive "
            "and have no logarithm: they were left out."
        )
    if d.misfit_limited:
        text.append(
            f"The fit is misfit-limited: {d.misfit_reason}; its errors are first order only."
        )
    if not best.plausibility.conserves_energy:
        worst = max(best.plausibility.albedo_max)
        text.append(
            f"Its directional albedo reaches {worst:.3g}, more than it receives: check the "
            "quantity (a factor pi or a cosine) or trust only the measured angles."
        )
    return " ".join(text)
