"""What the service keeps, as the client gives it: measurements, fits and their files."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from datetime import datetime
from typing import Any, Literal, Self

from lobefit.service.client import html
from lobefit.service.client.documents import moment, record

__all__ = ["Artefact", "Check", "Checks", "Fit", "Progress", "Readiness", "StoredMeasurement"]

State = Literal["queued", "running", "done", "failed", "cancelled"]
ENDED = frozenset({"done", "failed", "cancelled"})


@dataclass(frozen=True, slots=True, kw_only=True)
class Check:
    """One question to the data, and what they answer.

    Attributes
    ----------
    name : str
        Which check.
    verdict : str
        "ok", "suspicious" or "cannot tell".
    figures : mapping
        What was found; keys that end in ``_deg`` are degrees.
    sentence, remedy : str
        The same in one sentence, and what to do; the latter empty where there is nothing to do.
    """

    name: str
    verdict: str
    figures: Mapping[str, Any]
    sentence: str
    remedy: str = ""


@dataclass(frozen=True, slots=True)
class Checks:
    """All checks of one measurement, in the order in which to read them."""

    checks: tuple[Check, ...]

    @classmethod
    def read(cls, document: Mapping[str, Any]) -> Self:
        """Make it of the service's answer."""
        return cls(tuple(record(Check, c) for c in document.get("checks") or ()))

    def __iter__(self) -> Iterator[Check]:
        """Go through the checks."""
        return iter(self.checks)

    def __len__(self) -> int:
        """Count the checks."""
        return len(self.checks)

    def __getitem__(self, name: str) -> Check:
        """Give a check by name."""
        for found in self.checks:
            if found.name == name:
                return found
        raise KeyError(name)

    @property
    def suspicious(self) -> tuple[Check, ...]:
        """Give the checks that found something."""
        return tuple(c for c in self.checks if c.verdict == "suspicious")

    def __str__(self) -> str:
        """Give a line for each check, then the remedies."""
        lines = [f"{c.name}: {c.verdict}. {c.sentence}" for c in self.checks]
        return "\n".join([*lines, *(f"{c.name}: {c.remedy}" for c in self.suspicious if c.remedy)])

    def _repr_html_(self) -> str:
        rows = [(c.name, c.verdict, c.sentence, c.remedy) for c in self.checks]
        return html.table(("check", "verdict", "", "what to do"), rows)


@dataclass(frozen=True, slots=True, kw_only=True)
class StoredMeasurement:
    """A measurement that the service keeps.

    Attributes
    ----------
    id : str
        SHA-256 of its bytes, in hexadecimal; the same file twice is one measurement.
    name : str
        Name of the file.
    bytes : int
        Its size, not compressed.
    created : datetime
        When it was uploaded first.
    summary : mapping
        What was understood, as "measurement" in a report: channels, rows, incidences, notes.
    checks : Checks
        Whether its numbers can be what they are declared to be.
    warnings : tuple of str
        What to look at before it is fitted.
    """

    id: str
    name: str
    bytes: int
    created: datetime | None
    summary: Mapping[str, Any] = field(repr=False)
    checks: Checks = field(repr=False)
    warnings: tuple[str, ...] = ()

    @classmethod
    def read(cls, document: Mapping[str, Any]) -> Self:
        """Make it of the service's answer."""
        return record(
            cls,
            document,
            created=moment(document, "created"),
            checks=Checks.read(document.get("checks") or {}),
            warnings=tuple(document.get("warnings") or ()),
        )

    @property
    def channels(self) -> tuple[str, ...]:
        """Names of its channels."""
        return tuple(c["name"] for c in self.summary.get("channels", ()))

    @property
    def directions(self) -> int:
        """How many pairs of directions are used."""
        return int(self.summary.get("rows", {}).get("used", 0))

    def __str__(self) -> str:
        """Say what it holds, and what to beware of."""
        size = f"{self.name}: {self.directions} directions, {', '.join(self.channels)}"
        return "\n".join([size, *(f"warning: {text}" for text in self.warnings)])

    def _repr_html_(self) -> str:
        facts: list[tuple[str, object]] = [
            ("directions", self.directions),
            ("channels", ", ".join(self.channels)),
            *((key, value) for key, value in self.summary.get("metadata", {}).items()),
            *(("note", text) for text in self.summary.get("notes", ())),
            *(("warning", text) for text in self.warnings),
            ("id", self.id),
        ]
        return html.heading(self.name) + html.facts(facts)


@dataclass(frozen=True, slots=True, kw_only=True)
class Progress:
    """How far a running fit has come.

    Attributes
    ----------
    stage : str
        "fit", "posterior" or "files".
    done, total : int
        Candidates, or steps of the chain.
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
    """A file that a fit made: report.json, fit.png, posterior.nc, ..."""

    name: str
    bytes: int
    media_type: str
    sha256: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Fit:
    """A fit in the service, as it was when it was asked for.

    Attributes
    ----------
    id : str
    name : str or None
        Given with the fit.
    measurement : str
        Id of what is fitted.
    request : mapping
        What was asked for, completed with what was not said.
    state : {"queued", "running", "done", "failed", "cancelled"}
    created, started, ended : datetime or None
    attempts : int
        How often it was begun; more than once where a worker died.
    position : int or None
        Place in the queue, from 1.
    progress : Progress or None
        Of a running fit.
    problem : mapping or None
        Why it failed.
    best, verdict : str or None
        The recommended candidate, and the answer in two or three sentences.
    converged : bool or None
        Whether the posterior's chains are long enough and mixed.
    artefacts : tuple of Artefact
        Its files.
    """

    id: str
    name: str | None
    measurement: str
    request: Mapping[str, Any] = field(repr=False)
    state: State
    created: datetime | None = None
    started: datetime | None = None
    ended: datetime | None = None
    attempts: int = 0
    position: int | None = None
    progress: Progress | None = None
    problem: Mapping[str, Any] | None = None
    best: str | None = None
    verdict: str | None = field(default=None, repr=False)
    converged: bool | None = None
    artefacts: tuple[Artefact, ...] = field(default=(), repr=False)

    @classmethod
    def read(cls, document: Mapping[str, Any]) -> Self:
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
    def has_ended(self) -> bool:
        """Whether nothing more will come: done, failed or cancelled."""
        return self.state in ENDED

    def __str__(self) -> str:
        """Say in one line how far it is."""
        said = f"{self.name or self.id}: {self.state}"
        if self.state == "queued" and self.position is not None:
            return f"{said}, place {self.position}"
        if self.state == "running" and self.progress is not None:
            return f"{said}, {self.progress}"
        if self.problem is not None:
            return f"{said}: {self.problem.get('detail') or self.problem.get('title')}"
        return f"{said}. {self.verdict}" if self.verdict else said

    def _repr_html_(self) -> str:
        facts: list[tuple[str, object]] = [
            ("best", self.best),
            ("progress", self.progress),
            ("posterior converged", self.converged),
            ("problem", (self.problem or {}).get("detail")),
            ("files", ", ".join(a.name for a in self.artefacts) or None),
            ("id", self.id),
        ]
        title = f"{self.name or 'Fit'}: {self.state}"
        return html.heading(title) + html.paragraph(self.verdict or "") + html.facts(facts)


@dataclass(frozen=True, slots=True, kw_only=True)
class Readiness:
    """Whether the service can take fits; true where it is.

    Attributes
    ----------
    ready : bool
    device : str or None
        OpenCL device of its workers.
    store : str
        "ok", or what is wrong with its data folder.
    free_bytes : int
        Space left there.
    """

    ready: bool
    device: str | None = None
    store: str = ""
    free_bytes: int = 0

    def __bool__(self) -> bool:
        """Whether it is ready."""
        return self.ready
