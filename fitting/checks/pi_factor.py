"""A factor pi: radiance factors, or percent, declared as BRDF give out more than they receive."""

from __future__ import annotations

from functools import partial

import numpy as np

from lobefit.fitting.checks.finding import DataCheck
from lobefit.fitting.checks.surface import Fitted
from lobefit.fitting.checks.view import View
from lobefit.kernels import directional_albedo

__all__ = ["check_pi_factor"]

# A diffuse standard reaches 0.99, and calibration may be wrong by a few percent.
CALIBRATION = 0.03
# Beyond this incidence the albedo is more model than measurement.
MAX_THETA = np.radians(70.0)
INCIDENCES = 5


def check_pi_factor(view: View, result: Fitted | None) -> DataCheck:
    """Integrate the fitted model at measured incidences, and compare with 1 and with pi."""
    answer = partial(DataCheck, name="pi factor")
    if result is None:
        return answer(
            verdict="cannot tell",
            figures={"albedo": None},
            sentence="No model could be fitted, so there is no albedo.",
            remedy="make sure that the values are in 1/sr",
        )
    measured = np.unique(np.round(view.m.theta_i, 4))
    within = measured[measured <= MAX_THETA]
    angles = within if within.size else measured[:1]
    angles = np.unique(angles[np.linspace(0, angles.size - 1, INCIDENCES).astype(int)])
    albedos = directional_albedo(result.model, result.params, angles, options=result.options)
    c, k = np.unravel_index(int(np.argmax(albedos)), albedos.shape)
    largest, theta = float(albedos[c, k]), float(np.degrees(angles[k]))
    channel = result.channels[c] if len(albedos) > 1 else None
    figures = {
        "albedo": largest,
        "albedo_over_pi": largest / np.pi,
        "theta_i_deg": theta,
        "channel": channel,
        "model": result.candidate,
    }
    answer = partial(answer, figures=figures)
    of = f"albedo {largest:.3g} at theta_i {theta:.3g}° ({result.candidate})"
    if largest <= 1.0 + CALIBRATION:
        return answer(
            verdict="cannot tell",
            sentence=f"The {of} is possible, and so is a pi-th of it: the size of the values "
            "excludes no factor pi.",
            remedy="make sure that the values are in 1/sr, not radiance or reflectance factors",
        )
    if largest <= np.pi * (1.0 + CALIBRATION):
        return answer(
            verdict="suspicious",
            sentence=f"The {of} is more than any passive surface has; divided by pi it is "
            f"{largest / np.pi:.3g}.",
            remedy="if these are radiance or reflectance factors, declare "
            "`# quantity: radiance factor`; else check the calibration",
        )
    return answer(
        verdict="suspicious",
        sentence=f"The {of} is more than any passive surface has, even divided by pi.",
        remedy="check the unit: percent, counts, or a calibration that is missing",
    )
