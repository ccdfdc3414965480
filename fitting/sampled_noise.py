"""What `sample` takes for the noise: given, scaled, held or sampled, and how much values count."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lobefit.fitting.diagnostics import CORRELATED
from lobefit.fitting.measurement import Measurement
from lobefit.fitting.noise import estimate_noise, level, variance
from lobefit.fitting.result import FitResult
from lobefit.fitting.space import NoiseModel
from lobefit.kernels import FitError

__all__ = ["Scales", "decide_noise", "likelihood_power", "noise_scales"]

Array = NDArray[np.float64]
# Additive and relative noise at the point fit, and the model's values.
Scales = tuple[Array, Array, Array]


def decide_noise(
    result: FitResult, m: Measurement, wanted: str, scales: Scales
) -> tuple[NoiseModel, Array | None, list[str]]:
    """Decide what is sampled of the noise; returns known sigmas and what to tell."""
    notes: list[str] = []
    given = result.noise.given and m.sigma is not None
    if wanted == "auto" and given:
        wanted, reduced = "given", result.diagnostics.reduced_chi_square
        if result.diagnostics.misfit_limited and reduced > 1.0:
            wanted = "scaled"
            notes.append(
                f"Residuals are {np.sqrt(reduced):.2g} times the stated sigma, which is therefore "
                "scaled by a factor that is sampled."
            )
    if wanted in ("given", "scaled"):
        if m.sigma is None:
            raise FitError(f'noise="{wanted}" needs a measurement with sigma')
        return ("given" if wanted == "given" else "scaled"), m.sigma, notes
    additive, relative, values = scales
    if wanted == "auto" and result.diagnostics.misfit_limited:
        # A likelihood with noise in proportion to the model explains a misfit by a
        # brighter model; the point fit's levels do not follow the model. Where the misfit
        # is small, no level is the measured value's.
        notes.append(
            "The residuals are misfit, not noise: sigma is held at the point fit's, times a "
            "factor that is sampled."
        )
        h = level(values, m.values, gross=True)
        return "scaled", np.sqrt(variance(h, additive, relative)), notes
    if wanted == "fixed":
        notes.append("The noise is held at what the point fit found.")
        return "given", np.sqrt(variance(values, additive, relative)), notes
    if wanted not in ("auto", "fit"):
        raise FitError(f"noise is auto, fit, scaled, given or fixed; not {wanted!r}")
    return "fit", None, notes


def noise_scales(result: FitResult, m: Measurement) -> Scales:
    """Give the noise's scales at the point fit, and the model's values."""
    values = result.predict(m.theta_i, m.phi_i, m.theta_o, m.phi_o)
    additive, relative = np.array(result.noise.additive), np.array(result.noise.relative)
    if not (additive > 0.0).all():  # sigma was given, or the metric has no noise
        used = np.isfinite(m.values)
        additive, relative = estimate_noise(m.values - values, values, used, result.n_parameters)
    return additive, relative, values


def likelihood_power(result: FitResult, correlation: str, notes: list[str]) -> float:
    """Give what the log-likelihood is multiplied with, below 1 where residuals are correlated."""
    d = result.diagnostics
    factor = d.samples / d.effective_samples
    if correlation == "ignore" or not d.misfit_limited or factor <= CORRELATED:
        return 1.0
    notes.append(
        f"Residuals are correlated over {factor:.1f} values: the log-likelihood is divided by that."
    )
    return 1.0 / factor
