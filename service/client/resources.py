"""What the service keeps and is, as the client gives it: measurements, and whether it is ready."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from datetime import datetime
from typing import Any, Self

from lobefit.service.client import html
from lobefit.service.client.documents import moment, record

__all__ = ["Check", "Checks", "Readiness", "StoredMeasurement"]


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
