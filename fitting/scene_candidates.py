"""What a scene can be shaded with: the fitted models of a report, and Phong's."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lobefit.fitting.export.fitted import Fitted, read_fitted
from lobefit.fitting.measurement import Measurement
from lobefit.fitting.readers import read_measurement
from lobefit.fitting.selection import BIC_WINDOW
from lobefit.kernels.candidates import candidate
from lobefit.kernels.errors import LobefitError, SceneError

__all__ = ["CLASSIC", "Fits", "ShadingModel", "read_fits"]

CLASSIC = "phong"
"""The model that, with the ambient term, is the classic lighting model."""


@dataclass(frozen=True, eq=False)
class ShadingModel:
    """A fitted model that pictures are made with.

    Attributes
    ----------
    fitted : Fitted
        Model, options and parameters.
    n_parameters : int
        Free parameters of the fit.
    bic_difference : float or None
        BIC above the report's lowest.
    log10_rms : float or None
        Root mean square of log10(model/measured), as the report states it.
    determined : bool
        Whether the data say something about every parameter.
    origin : str
        "report", or "fitted here" to the samples beside it.
    """

    fitted: Fitted
    n_parameters: int
    bic_difference: float | None
    log10_rms: float | None
    origin: str = "report"
    determined: bool = True

    @property
    def name(self) -> str:
        """The candidate's name."""
        return self.fitted.candidate


@dataclass(frozen=True, eq=False)
class Fits:
    """The models of a report.

    Attributes
    ----------
    report : Path
        The file.
    models : tuple of ShadingModel
        Ranked as in the report; Phong's last where the report has none.
    described : bool
        False where the report says that no model describes the surface.
    channels : tuple of str
    samples : Measurement or None
        samples.csv beside the report.
    """

    report: Path
    models: tuple[ShadingModel, ...]
    described: bool
    channels: tuple[str, ...]
    samples: Measurement | None

    def chosen(self, names: tuple[str, ...]) -> tuple[ShadingModel, ...]:
        """Give those of some names, or all.

        Raises
        ------
        SceneError
            A name that the report does not have.
        """
        known = {m.name: m for m in self.models}
        for name in names:
            if name not in known:
                _exists(name)
                raise SceneError(
                    f"/models: no result is called {name!r}; the report has {', '.join(known)}. "
                    f"Fit it with `lobefit fit FILE --models {name},... --out DIR`"
                )
        return tuple(known[name] for name in names) or self.models

    @property
    def reference(self) -> ShadingModel:
        """The richest sufficient model.

        Of those whose BIC is within `BIC_WINDOW` of the lowest (without a likelihood, of the
        recommended one alone), the one of the most parameters; of equals the better BIC. One
        with a parameter that the data say nothing about is not richer for it: its picture,
        such as the axis of an anisotropy, would be made up.
        """
        own = [m for m in self.models if m.origin == "report"]
        near = [
            m
            for m in own
            if m.determined and m.bic_difference is not None and m.bic_difference <= BIC_WINDOW
        ]
        return max(near, key=lambda m: (m.n_parameters, -(m.bic_difference or 0.0)), default=own[0])


def read_fits(path: Path, wanted: tuple[str, ...] = (), *, device: str | None = None) -> Fits:
    """Read the models of a report, and fit Phong's if it is not among them.

    Parameters
    ----------
    path : Path
        A report.json, or the folder that a fit wrote it to.
    wanted : tuple of str
        Candidates that will be used; Phong's is fitted if it is one, or if there are none.
    device : str, optional
        For that fit.

    Raises
    ------
    LobefitError
        No report of this version, or the samples beside it cannot be read.
    """
    file = path / "report.json" if path.is_dir() else path
    read_fitted(file)  # complains about whatever is no report
    document = json.loads(file.read_text(encoding="utf-8"))
    names = [entry.get("candidate") for entry in document["results"]]
    models = [_model(file, entry) for entry in document["results"]]
    beside = file.parent / "samples.csv"
    samples = read_measurement(beside) if beside.is_file() else None
    channels = models[0].fitted.channels
    if samples is not None and samples.channels != channels:
        raise LobefitError(
            f"{beside} has the channels {', '.join(samples.channels)}, the report "
            f"{', '.join(channels)}; they are not of one fit"
        )
    if samples is not None and CLASSIC not in names and (not wanted or CLASSIC in wanted):
        models.append(_phong(samples, models[0].fitted, device))
    return Fits(file, tuple(models), bool(document.get("described", True)), channels, samples)


def _model(file: Path, entry: dict[str, Any]) -> ShadingModel:
    fitted = read_fitted(file, entry.get("candidate"))
    diagnostics = entry.get("diagnostics") or {}
    count = entry.get("n_parameters")
    if not isinstance(count, int):
        raise SceneError(f"{file}: the report lacks the number of parameters; fit anew")
    return ShadingModel(
        fitted,
        count,
        entry.get("bic_difference"),
        diagnostics.get("log10_rms"),
        determined=all(e.get("status") != "undetermined" for e in entry.get("estimates") or ()),
    )


def _exists(name: str) -> None:
    """Refuse a name that no candidate has."""
    try:
        candidate(name)
    except LobefitError as error:
        raise SceneError(f"/models: {error}") from error


def _phong(samples: Measurement, like: Fitted, device: str | None) -> ShadingModel:
    from lobefit.fitting.fit import fit

    result = fit(samples, models=CLASSIC, device=device).best
    fitted = Fitted(
        candidate=CLASSIC,
        model=result.model,
        options=result.options,
        params=result.params,
        channels=result.channels,
        convention="",
        origin=like.origin,
    )
    rms = result.diagnostics.log10_rms
    return ShadingModel(fitted, result.n_parameters, None, rms, "fitted here")
