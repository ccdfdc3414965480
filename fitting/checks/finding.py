"""What a check of the data gives back."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from typing import Any, Literal

__all__ = ["DataCheck", "DataChecks", "Figure", "Verdict"]

Verdict = Literal["ok", "suspicious", "cannot tell"]
Figure = float | int | str | bool | None


@dataclass(frozen=True, slots=True, kw_only=True)
class DataCheck:
    """One question to the data, and what they answer.

    Attributes
    ----------
    name : str
        Which check.
    verdict : {"ok", "suspicious", "cannot tell"}
        "ok": nothing speaks against the data here. "suspicious": something does.
        "cannot tell": these data hold no evidence either way.
    figures : mapping of str to number, text or None
        What was found; keys that end in ``_deg`` are degrees.
    sentence : str
        The same in one sentence.
    remedy : str
        What to do; empty where there is nothing to do.
    """

    name: str
    verdict: Verdict
    figures: Mapping[str, Figure]
    sentence: str
    remedy: str = ""


@dataclass(frozen=True, slots=True)
class DataChecks:
    """All checks of one measurement, in the order in which to read them.

    Attributes
    ----------
    checks : tuple of DataCheck
    """

    checks: tuple[DataCheck, ...]

    def __iter__(self) -> Iterator[DataCheck]:
        """Go through the checks."""
        return iter(self.checks)

    def __len__(self) -> int:
        """Count the checks."""
        return len(self.checks)

    def __getitem__(self, name: str) -> DataCheck:
        """Give a check by name."""
        for found in self.checks:
            if found.name == name:
                return found
        raise KeyError(name)

    @property
    def suspicious(self) -> tuple[DataCheck, ...]:
        """Give the checks that found something."""
        return tuple(c for c in self.checks if c.verdict == "suspicious")

    def to_dict(self) -> dict[str, Any]:
        """Give JSON-ready values; a figure that is not finite is None."""
        return {
            "suspicious": [c.name for c in self.suspicious],
            "checks": [
                asdict(c) | {"figures": {key: _plain(value) for key, value in c.figures.items()}}
                for c in self.checks
            ],
        }

    def table(self) -> str:
        """Give a line for each check: name, verdict, sentence."""
        name = max(len(c.name) for c in self.checks)
        verdict = max(len(c.verdict) for c in self.checks)
        return "\n".join(
            f"{c.name:{name}}  {c.verdict:{verdict}}  {c.sentence}" for c in self.checks
        )

    def __str__(self) -> str:
        """Give the table, then the remedies."""
        remedies = [f"{c.name}: {c.remedy}" for c in self.suspicious if c.remedy]
        return "\n".join([self.table(), *([""] if remedies else []), *remedies])


def _plain(value: Figure) -> Figure:
    return None if isinstance(value, float) and not math.isfinite(value) else value
