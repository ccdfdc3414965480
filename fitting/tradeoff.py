"""Speed against accuracy: measure the choices on one surface and chart time against error."""

from __future__ import annotations

import platform
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

from lobefit import __version__
from lobefit.fitting.artefacts import save_together, write_json
from lobefit.fitting.asked import chosen_candidates, chosen_metric
from lobefit.fitting.fit import fit
from lobefit.fitting.tradeoff_albedo import albedo_panel
from lobefit.fitting.tradeoff_arithmetic import arithmetic_panel
from lobefit.fitting.tradeoff_fits import fit_panel
from lobefit.fitting.tradeoff_points import Panel
from lobefit.fitting.tradeoff_posterior import posterior_panel
from lobefit.fitting.tradeoff_subject import Subject
from lobefit.fitting.tradeoff_texts import answer, finding, functions
from lobefit.fitting.tradeoff_timing import Clock
from lobefit.kernels import Device, FitError, get_device

__all__ = ["GROUPS", "SCHEMA", "Chart", "chart"]

SCHEMA = "lobefit.chart/1"
"""Raised when a key changes its meaning or goes; new keys may appear under the same number."""

GROUPS = ("fit", "evaluation", "albedo", "posterior")
# Errors that do no harm: of an evaluation (the fits' own are larger), of an albedo, of quantiles.
ENOUGH = {"evaluation": 1e-5, "albedo": 1e-3, "posterior": 0.1}


@dataclass(frozen=True, kw_only=True, eq=False)
class Chart:
    """What was measured.

    Attributes
    ----------
    name : str
        File, or model.
    tolerance : float
        Relative error that was asked for.
    answer : str
        Which fit keeps within it, and what it takes.
    panels : tuple of Panel
        Choices of one kind each.
    settings : dict
        What is needed to make the chart again.
    device : str
    versions : dict of str to str
    seconds : float
        That the whole chart took.
    """

    name: str
    tolerance: float
    answer: str
    panels: tuple[Panel, ...]
    settings: Mapping[str, Any]
    device: str
    versions: Mapping[str, str]
    seconds: float

    @property
    def finding(self) -> str:
        """The first panel's sentence."""
        return self.panels[0].finding

    def panel(self, name: str) -> Panel | None:
        """Give a panel by its name, if the chart has it."""
        return next((p for p in self.panels if p.name == name), None)

    def to_dict(self) -> dict[str, Any]:
        """Give the whole chart as JSON-ready values."""
        return {
            "schema": SCHEMA,
            "name": self.name,
            "tolerance": self.tolerance,
            "answer": self.answer,
            "finding": self.finding,
            "settings": dict(self.settings),
            "device": self.device,
            "versions": dict(self.versions),
            "seconds": self.seconds,
            "panels": [p.to_dict() for p in self.panels],
        }

    @classmethod
    def from_dict(cls, document: Mapping[str, Any]) -> Chart:
        """Read what `to_dict` gave.

        Raises
        ------
        FitError
            It is no chart, or one of another schema.
        """
        if not isinstance(document, Mapping) or document.get("schema") != SCHEMA:
            raise FitError(f"this is no chart of the schema {SCHEMA}")
        try:
            return cls(
                **{
                    key: document[key]
                    for key in (
                        "name",
                        "tolerance",
                        "answer",
                        "settings",
                        "device",
                        "versions",
                        "seconds",
                    )
                },
                panels=tuple(Panel.from_dict(p) for p in document["panels"]),
            )
        except (KeyError, TypeError, ValueError) as error:
            raise FitError(f"the chart is damaged: {error!r}") from error

    def save(self, folder: Path) -> dict[str, Path]:
        """Write chart.png and chart.json into a folder, together; returns their paths."""
        from lobefit.fitting.tradeoff_figure import write_chart

        return save_together(
            folder,
            {
                "chart": ("chart.png", lambda path: write_chart(path, self)),
                "json": ("chart.json", lambda path: write_json(path, self.to_dict())),
            },
        )


def chart(
    subject: Subject,
    *,
    models: str | Sequence[str] = "all",
    metric: str = "auto",
    tolerance: float = 0.02,
    groups: Sequence[str] = GROUPS,
    repeats: int = 5,
    seed: int = 0,
    device: str | Device | None = None,
    progress: Callable[[int, int, str], None] | None = None,
    clock: Clock = time.perf_counter,
) -> Chart:
    """Measure what choices cost and what they bring, on one surface.

    Parameters
    ----------
    subject : Subject
        From `held_out` or `simulated` of `lobefit.fitting.tradeoff_subject`.
    models : str or sequence of str
        As for `lobefit.fitting.fit`; anisotropic ones are left out of a set where the sample
        was not turned.
    metric : str
        The usual one; others are among the choices.
    tolerance : float
        Relative error that would do, such as 0.02.
    groups : sequence of str
        Which of `GROUPS` to measure; "fit" always is.
    repeats : int
        Timed runs of each choice, turn by turn, after one that is not timed.
    seed : int
        Of the posteriors.
    device : str, Device or None
        See `lobefit.kernels.get_device`.
    progress : callable, optional
        Called with (done, total, label).
    clock : callable
        Gives seconds.

    Returns
    -------
    Chart

    Raises
    ------
    FitError
        An unknown group, a tolerance or number of repeats that is none, or no model fits.
    ModelError, DeviceError
        As `lobefit.fitting.fit`.
    """
    unknown = [g for g in groups if g not in GROUPS]
    if unknown:
        raise FitError(f"there is no group {unknown[0]!r}; there are {', '.join(GROUPS)}")
    if not 0.0 < tolerance < float("inf"):
        raise FitError(f"tolerance is a relative error such as 0.02, not {tolerance!r}")
    if repeats < 1:
        raise FitError(f"repeats is {repeats}; one run at least must be timed")
    began = clock()
    opened = get_device(device)
    m = subject.train
    metric = chosen_metric(m, metric)
    wanted = chosen_candidates(m, models)
    tell = progress or (lambda _done, _total, _label: None)
    panel, leaders = fit_panel(
        subject,
        wanted,
        metric,
        opened,
        tolerance=tolerance,
        repeats=repeats,
        clock=clock,
        tell=tell,
    )
    panels = [panel]
    if "evaluation" in groups:
        tell(0, 1, "arithmetics")
        panels.append(arithmetic_panel(leaders, opened, repeats=repeats, clock=clock))
    best = fit(m, [leaders[0]], metric=metric, device=opened).best
    if "albedo" in groups:
        tell(0, 1, "grids of the albedo")
        panels.append(albedo_panel(best, opened, repeats=repeats, clock=clock))
    if "posterior" in groups:
        quick = min(leaders, key=lambda name: _seconds(panel, name))
        panels.append(
            posterior_panel(quick, m, opened, repeats=repeats, seed=seed, clock=clock, tell=tell)
        )
    found = tuple(replace(p, finding=_said(p)) for p in panels)
    return Chart(
        name=subject.name,
        tolerance=tolerance,
        answer=answer(panel, tolerance, subject.noise(best)),
        panels=found,
        settings={
            "subject": dict(subject.settings),
            "models": models if isinstance(models, str) else list(models),
            "metric": metric,
            "groups": list(groups),
            "repeats": repeats,
            "seed": seed,
        },
        device=str(opened.info),
        versions={
            "lobefit": __version__,
            "python": platform.python_version(),
            **{name: version(name) for name in ("numpy", "nlopt", "pyopencl", "emcee")},
        },
        seconds=clock() - began,
    )


def _said(panel: Panel) -> str:
    said = finding(panel, ENOUGH.get(panel.name, 0.0))
    return f"{said} {functions(panel)}" if panel.name == "evaluation" else said


def _seconds(panel: Panel, label: str) -> float:
    return next(p.seconds.median for p in panel.points if p.label == label)
