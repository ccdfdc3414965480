"""Reports made by hand: what tables, documents and pictures get, without running a fit."""

from __future__ import annotations

import json
from typing import Any, Literal

import numpy as np

from lobefit.fitting.measurement import Measurement
from lobefit.fitting.report import FailedFit, FitReport
from lobefit.fitting.result import (
    Decade,
    Diagnostics,
    FitResult,
    NoiseScales,
    Outliers,
    ParameterEstimate,
    Plausibility,
    StopReport,
)
from lobefit.fitting.simulate import simulate
from lobefit.kernels import candidate
from lobefit.kernels.parameters import complete

Params = dict[str, float | list[float]]
Status = Literal["free", "fixed", "lower", "upper", "undetermined"]
GLOSSY: Params = {"k_d": 0.05, "F0": 0.05, "alpha": 0.1}
# Few directions: the tests look at files, not at fits.
SCANS = {
    "in-plane": "in-plane incidences=0,30,60 step=5",
    "hemisphere": "hemisphere incidences=20,50 theta_step=10 phi_step=30",
}


def simulated(scan: str, channels: list[str], **settings: Any) -> Measurement:
    """Measure a glossy surface along one of `SCANS`, or any other."""
    return simulate(
        "ggx", GLOSSY, SCANS.get(scan, scan), channels=channels, noise=(0.01, 1e-4), **settings
    )


def strict(text: str) -> Any:
    """Parse JSON without the extensions that Python's parser allows."""

    def refuse(constant: str) -> None:
        raise AssertionError(f"{constant} is not JSON")

    return json.loads(text, parse_constant=refuse)


def hand_made_result(m: Measurement, name: str, params: Params, **changes: Any) -> FitResult:
    """Take parameters as fitted, with errors of 1 % and diagnostics of a good fit."""
    chosen = candidate(name)
    full = complete(chosen.model, {**params, **chosen.fixed})
    estimates = []
    for p in chosen.model.parameters:
        values = np.broadcast_to(full[p.name], m.n_channels) if p.per_channel else full[p.name]
        full[p.name] = values
        for c, value in enumerate(values.tolist()):
            status: Status = "fixed" if p.name in chosen.fixed else "free"
            if status == "free" and value == p.bounds[0]:
                status = "lower"
            estimates.append(
                ParameterEstimate(
                    name=p.name,
                    channel=m.channels[c] if p.per_channel else None,
                    value=value,
                    standard_error=None if status == "fixed" else 0.01 * value + 1e-6,
                    status=status,
                    unit=p.unit,
                    meaning=p.meaning,
                )
            )
    free = sum(e.status != "fixed" for e in estimates)
    fields: dict[str, Any] = {
        "model": chosen.model.name,
        "candidate": name,
        "options": {},
        "channels": m.channels,
        "params": {k: v.tolist() if v.size > 1 else v.item() for k, v in full.items()},
        "estimates": tuple(estimates),
        "covariance": np.eye(free) * 1e-4,
        "rmse": 0.0123,
        "bic": -1234.5,
        "log_likelihood": 640.0,
        "objective": 99.0,
        "n_parameters": free,
        "noise": NoiseScales(
            given=m.sigma is not None,
            relative=(0.02,) * m.n_channels,
            additive=(1e-3,) * m.n_channels,
        ),
        "stop": StopReport(
            algorithm="scan, BOBYQA",
            reason="converged",
            evaluations=321,
            seconds=0.05,
            converged=True,
            device="a device",
            precision="single",
        ),
        "diagnostics": Diagnostics(
            log10_rms=0.021,
            log10_count=100,
            log10_excluded=2,
            decades=(Decade(low=0.1, high=1.0, count=50, mean_relative=0.01, rms_relative=0.02),),
            reduced_chi_square=1.02,
            effective_samples=98.0,
            samples=102,
            misfit_limited=False,
            misfit_reason="",
            worst=(),
            outliers=Outliers(0, ()),
        ),
        "plausibility": Plausibility(
            albedo_max=(0.91,) * m.n_channels,
            albedo_max_theta_i=(np.deg2rad(85.0),) * m.n_channels,
            conserves_energy=True,
            reciprocity_error=1e-16,
            reciprocal=True,
        ),
    }
    return FitResult(**{**fields, **changes})


def hand_made_report(m: Measurement, *results: FitResult, **changes: Any) -> FitReport:
    """Put results into a report, ranked as given."""
    fields: dict[str, Any] = {
        "measurement": m,
        "metric": "chi2",
        "results": results,
        "failed": (FailedFit("ward", "the sample was not turned"),),
        "described": True,
        "verdict": f"{results[0].candidate} describes the surface.",
        "seconds": 0.5,
        "settings": {"models": "standard", "metric": "auto", "device": None},
    }
    return FitReport(**{**fields, **changes})
