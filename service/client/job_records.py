"""The jobs of the service as the client gives them: fits, charts, and their files."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path
from typing import Any, Literal, Self

from lobefit.kernels.errors import FitError, LobefitError
from lobefit.service.client import html
from lobefit.service.client.documents import moment, record
from lobefit.service.client.errors import ServiceError, error_of
from lobefit.service.client.ongoing import Ongoing
from lobefit.service.client.wire import Operation

__all__ = ["Artefact", "Chart", "Fit", "Job", "Progress"]

State = Literal["queued", "running", "done", "failed", "cancelled"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Progress:
    """How far a running fit or chart has come.

    Attributes
    ----------
    stage : str
        "fit", "posterior", "files" or "chart".
    done, total : int
        Candidates, steps of the chain, or choices of a chart.
    label : str
        What it works at.
    evaluations : int or None
        Parameter sets tried so far.
    tau, acceptance, ess : float or None
        Of the posterior's chains: autocorrelation time in steps, share of accepted moves, effective
        samples.
    seconds, seconds_left : float or None
        Since it started, and the estimate of what remains.
    """

    stage: str
    done: int
    total: int
    label: str
    evaluations: int | None = None
    tau: float | None = None
    acceptance: float | None = None
    ess: float | None = None
    seconds: float | None = None
    seconds_left: float | None = None

    def __str__(self) -> str:
        """Give it in one line."""
        said = [f"{self.stage} {self.done}/{self.total} {self.label}".rstrip()]
        said += [f"tau {self.tau:.0f}"] if self.tau is not None else []
        said += [f"acceptance {self.acceptance:.2f}"] if self.acceptance is not None else []
        said += [f"ess {self.ess:.0f}"] if self.ess is not None else []
        said += [f"{self.seconds_left:.0f} s left"] if self.seconds_left is not None else []
        return ", ".join(said)


@dataclass(frozen=True, slots=True, kw_only=True)
class Artefact:
    """A file that a fit or a chart made: report.json, fit.png, posterior.nc, ..."""

    name: str
    bytes: int
    media_type: str
    sha256: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Job(Ongoing):
    """What waits in the queue and is done by a worker, as it was when it was asked for.

    Attributes
    ----------
    id : str
    name : str or None
        Given with it.
    measurement : str or None
        Id of what it is about; None where a chart is about a model.
    request : mapping
        What was asked for, completed with what was not said.
    state : {"queued", "running", "done", "failed", "cancelled"}
    created, started, ended : datetime or None
    attempts : int
        How often it was begun; more than once where a worker died.
    position : int or None
        Place in the queue, from 1.
    progress : Progress or None
        While it runs.
    problem : mapping or None
        Why it failed.
    artefacts : tuple of Artefact
        Its files.
    """

    id: str
    name: str | None
    measurement: str | None
    request: Mapping[str, Any] = field(repr=False)
    state: State
    created: datetime | None = None
    started: datetime | None = None
    ended: datetime | None = None
    attempts: int = 0
    position: int | None = None
    progress: Progress | None = None
    problem: Mapping[str, Any] | None = None
    artefacts: tuple[Artefact, ...] = field(default=(), repr=False)

    @classmethod
    def read(cls, document: Mapping[str, Any], /) -> Self:
        """Make it of the service's answer."""
        progress = document.get("progress")
        return record(
            cls,
            document,
            created=moment(document, "created"),
            started=moment(document, "started"),
            ended=moment(document, "ended"),
            progress=None if progress is None else record(Progress, progress),
            artefacts=tuple(record(Artefact, a) for a in document.get("artefacts") or ()),
        )

    @property
    def extent(self) -> tuple[int, int] | None:
        """How much of a stage is done, of how much."""
        now = self._now
        return None if now is None else (now.done, now.total)

    @property
    def news(self) -> str:
        """What it does, or where it stands."""
        return str(self._now or self)

    @property
    def _now(self) -> Progress | None:
        return self.progress if self.state == "running" else None

    def __str__(self) -> str:
        """Say in one line how far it is."""
        said = f"{self.name or self.id}: {self.state}"
        if self.state == "queued" and self.position is not None:
            return f"{said}, place {self.position}"
        if self._now is not None:
            return f"{said}, {self._now}"
        if self.problem is not None:
            return f"{said}: {self.problem.get('detail') or self.problem.get('title')}"
        return f"{said}. {self._said}" if self._said else said

    @property
    def _said(self) -> str | None:
        """The answer, once there is one."""
        raise NotImplementedError

    def failure(self) -> LobefitError | None:
        """Give the error that the local API would raise, where it failed."""
        if self.state != "failed":
            return None
        unsaid = {"title": f"the service does not say why the {self.NOUN} failed"}
        error = error_of(self.problem or unsaid)
        if isinstance(error, ServiceError) and error.slug == "invalid-request":
            error = FitError(error.message)
        error.add_note(f"{self.NOUN} {self.id} failed in the service")
        return error

    def _save(self, folder: Path) -> Operation[dict[str, Path]]:
        return self._client._download(type(self), self, folder, None)

    def _repr_html_(self) -> str:
        facts: list[tuple[str, object]] = [
            *self._facts(),
            ("progress", self.progress),
            ("problem", (self.problem or {}).get("detail")),
            ("files", ", ".join(a.name for a in self.artefacts) or None),
            ("id", self.id),
        ]
        title = f"{self.name or self.NOUN.capitalize()}: {self.state}"
        return html.heading(title) + html.paragraph(self._said or "") + html.facts(facts)

    def _facts(self) -> list[tuple[str, object]]:
        return []


@dataclass(frozen=True, slots=True, kw_only=True)
class Fit(Job):
    """A fit in the service, as it was when it was asked for.

    Attributes
    ----------
    best, verdict : str or None
        The recommended candidate, and the answer in two or three sentences.
    converged : bool or None
        Whether the posterior's chains are long enough and mixed.
    batch : str or None
        Id of the batch that it belongs to.
    """

    __doc__ += (Job.__doc__ or "").partition("----------\n")[2]

    NOUN = "fit"
    PATH = "/v1/fits"

    measurement: str
    best: str | None = None
    verdict: str | None = field(default=None, repr=False)
    converged: bool | None = None
    batch: str | None = None

    @property
    def _said(self) -> str | None:
        return self.verdict

    def _facts(self) -> list[tuple[str, object]]:
        return [("best", self.best), ("posterior converged", self.converged)]


@dataclass(frozen=True, slots=True, kw_only=True)
class Chart(Job):
    """A chart of speed against accuracy in the service, as it was when it was asked for.

    Attributes
    ----------
    answer, finding : str or None
        Which choice to make, and what the measurement of them found.
    result : mapping or None
        chart.json, once it is there; lists of charts have none, `status` gives it.
    """

    __doc__ += (Job.__doc__ or "").partition("----------\n")[2]

    NOUN = "chart"
    PATH = "/v1/charts"

    answer: str | None = field(default=None, repr=False)
    finding: str | None = field(default=None, repr=False)
    result: Mapping[str, Any] | None = field(default=None, repr=False)

    @property
    def _said(self) -> str | None:
        return self.answer

    def _facts(self) -> list[tuple[str, object]]:
        return [("finding", self.finding)]
