"""The machine-readable report: one JSON document with everything to judge and repeat a fit."""

from __future__ import annotations

import dataclasses
import json
import math
import platform
import re
from collections.abc import Mapping
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import PurePath
from typing import Any

import numpy as np

from lobefit import __version__
from lobefit.fitting.measurement import Measurement
from lobefit.fitting.plausibility import model_checks
from lobefit.fitting.report import FitReport
from lobefit.fitting.result import FitResult
from lobefit.kernels import get_model

__all__ = ["SCHEMA", "measurement_summary", "report_document", "to_json"]

SCHEMA = "lobefit.report/1"
"""Raised when a key changes its meaning or goes; new keys may appear under the same number."""

RECORDED = ("numpy", "nlopt", "pyopencl")


def report_document(report: FitReport) -> dict[str, Any]:
    """Turn a report into JSON-ready values.

    Parameters
    ----------
    report : FitReport
        The fit; ``settings["sha256"]``, if there, is taken as the digest of the file read.

    Returns
    -------
    dict
        Strings, numbers, booleans, None, lists and dicts only. Angles whose key ends in
        ``_deg`` are degrees; parameters and their errors are in the unit beside them. A
        number that is not finite is None.
    """
    settings = dict(report.settings)
    digest = settings.pop("sha256", None)
    known = [r.bic for r in report.results if r.bic is not None]
    document: Any = _plain(
        {
            "schema": SCHEMA,
            "created": datetime.now(UTC).isoformat(timespec="seconds"),
            "verdict": report.verdict,
            "choice": None if report.choice is None else report.choice.to_dict(),
            "described": report.described,
            "best": report.best.candidate if report.results else None,
            "metric": report.metric,
            "settings": settings,
            "versions": _versions(),
            "device": report.best.stop.device if report.results else None,
            "seconds": report.seconds,
            "measurement": measurement_summary(report.measurement, digest),
            "checks": report.checks.to_dict() if report.results else None,
            "results": [
                _result(r, rank, min(known, default=0.0))
                for rank, r in enumerate(report.results, start=1)
            ],
            "failed": [dataclasses.asdict(f) for f in report.failed],
        }
    )
    found: dict[str, Any] = document
    return found


def to_json(document: Mapping[str, Any]) -> str:
    """Write a document as strict JSON, indented, with lists of numbers on one line."""
    text = json.dumps(document, indent=2, ensure_ascii=False, allow_nan=False)
    # A line break stands only between values, never inside a string.
    return re.sub(
        r"\[\n\s*((?:(?:-?\d[\d.eE+-]*|null),?\s+)+)\]",
        lambda found: f"[{' '.join(found[1].split())}]",
        text,
    )


def _versions() -> dict[str, str | None]:
    found: dict[str, str | None] = {"lobefit": __version__, "python": platform.python_version()}
    for name in RECORDED:
        try:
            found[name] = version(name)
        except PackageNotFoundError:  # a copy on sys.path without its metadata
            found[name] = None
    return found


def measurement_summary(m: Measurement, digest: str | None = None) -> dict[str, Any]:
    """Say what a measurement holds, as the report does.

    Parameters
    ----------
    m : Measurement
        What was read.
    digest : str, optional
        SHA-256 of the file.

    Returns
    -------
    dict
        JSON-ready values; angles whose key ends in ``_deg`` are degrees.
    """
    summary: Any = _plain(
        {
            "file": m.source or None,
            "sha256": digest,
            "metadata": dict(m.metadata),
            "channels": [
                {
                    "name": name,
                    "values": int(np.count_nonzero(~np.isnan(values))),
                    "negative": int(np.count_nonzero(values < 0)),
                    "lowest": _extreme(np.nanmin, values),
                    "highest": _extreme(np.nanmax, values),
                }
                for name, values in zip(m.channels, m.values, strict=True)
            ],
            "unit": "1/sr",
            "sigma_given": m.sigma is not None,
            "rows": {
                "read": m.rows_read,
                "used": m.n_directions,
                "dropped": m.n_dropped,
                "merged": m.n_merged,
            },
            "dropped": [
                {"rule": d.rule, "count": d.count, "first_lines": list(d.rows)} for d in m.dropped
            ],
            "notes": list(m.notes),
            "incidences": len(m.distinct_incidences()),
            "theta_i_deg": [math.degrees(m.theta_i.min()), math.degrees(m.theta_i.max())],
            "theta_o_deg": [math.degrees(m.theta_o.min()), math.degrees(m.theta_o.max())],
            "azimuthal_evidence": m.has_azimuthal_evidence,
            "decades": m.decades,
        }
    )
    found: dict[str, Any] = summary
    return found


def _extreme(of: Any, values: np.ndarray[Any, Any]) -> float | None:
    return None if np.isnan(values).all() else float(of(values))


def _result(r: FitResult, rank: int, lowest_bic: float) -> dict[str, Any]:
    model = get_model(r.model, r.options)
    plausibility = dataclasses.asdict(r.plausibility)
    where = plausibility.pop("albedo_max_theta_i")
    plausibility["albedo_max_theta_i_deg"] = [math.degrees(theta) for theta in where]
    return {
        "rank": rank,
        "candidate": r.candidate,
        "model": r.model,
        "title": model.title,
        "convention": model.convention,
        "formula_source": model.source,
        "options": dict(r.options),
        "channels": list(r.channels),
        "params": r.params,
        "n_parameters": r.n_parameters,
        "estimates": [dataclasses.asdict(e) for e in r.estimates],
        "covariance_of": [e.label for e in r.estimates if not e.held],
        "covariance": r.covariance,
        "rmse": r.rmse,
        "bic": r.bic,
        "bic_difference": None if r.bic is None else r.bic - lowest_bic,
        "log_likelihood": r.log_likelihood,
        "objective": r.objective,
        "noise": dataclasses.asdict(r.noise),
        "stop": dataclasses.asdict(r.stop),
        "diagnostics": dataclasses.asdict(r.diagnostics),
        "plausibility": plausibility,
        "checks": model_checks(r).to_dict(),
        "identifiability": None
        if r.identifiability is None
        else dataclasses.asdict(r.identifiability),
        "instrument": None if r.instrument is None else r.instrument.to_dict(),
    }


def _plain(value: Any) -> Any:
    """Turn numpy, tuples and paths into what JSON has; what is not finite into None."""
    if value is None or isinstance(value, str | bool):
        return value
    if isinstance(value, np.ndarray | np.generic):
        return _plain(value.tolist())
    if isinstance(value, int):
        return int(value)
    if isinstance(value, float):
        return float(value) if math.isfinite(value) else None
    if isinstance(value, Mapping):
        return {str(key): _plain(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(entry) for entry in value]
    if isinstance(value, PurePath):
        return str(value)
    # Settings may hold what a call was given, such as a device object.
    return str(value)
