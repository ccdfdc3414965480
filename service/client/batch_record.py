"""A batch of fits in the service, as the client gives it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path
from typing import Any, Literal, Self

from lobefit.service.client import html
from lobefit.service.client.documents import moment, record
from lobefit.service.client.ongoing import ENDED, Ongoing
from lobefit.service.client.operation import operation
from lobefit.service.client.wire import Operation

__all__ = ["Batch"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Batch(Ongoing):
    """Many fits that were submitted at once, as they were when they were asked for.

    Attributes
    ----------
    id : str
    name : str or None
        Given with it.
    created, ended : datetime or None
    state : {"queued", "running", "done", "cancelled"}
        Done when every fit has ended, also where some failed.
    total : int
        How many fits.
    counts : mapping of str to int
        How many are "queued", "running", "done", "failed" and "cancelled".
    seconds_left : float or None
        The estimate of what remains.
    """

    NOUN = "batch"
    PATH = "/v1/batches"
    HAS_EVENTS = False

    id: str
    name: str | None
    created: datetime | None = None
    ended: datetime | None = None
    state: Literal["queued", "running", "done", "cancelled"]
    total: int
    counts: Mapping[str, int] = field(default_factory=dict)
    seconds_left: float | None = None

    @classmethod
    def read(cls, document: Mapping[str, Any], /) -> Self:
        """Make it of the service's answer."""
        return record(
            cls,
            document,
            created=moment(document, "created"),
            ended=moment(document, "ended"),
            counts=dict(document.get("counts") or {}),
        )

    @property
    def extent(self) -> tuple[int, int]:
        """How many fits have ended, of how many."""
        return sum(self.counts.get(state, 0) for state in ENDED), self.total

    @operation
    def fits(self, state: str | None = None) -> Operation[Any]:
        """List its fits, in the order in which they were given.

        Parameters
        ----------
        state : str, optional
            Only those "queued", "running", "done", "failed" or "cancelled".

        Returns
        -------
        list of Fit
        """
        return self._client._fits_of(self, state)

    @operation
    def table(self) -> Operation[list[dict[str, Any]]]:
        """Give a row for each fit that has ended, also for those that failed.

        Returns
        -------
        list of dict
            By column of table.csv (`lobefit.fitting.batch_table.ITEM_COLUMNS`); None where there is
            no value. "reason" says why there is no fit.
        """
        return self._client._table(self, "table.csv")

    @operation
    def parameters(self) -> Operation[list[dict[str, Any]]]:
        """Give a row for each parameter of each fit's best model.

        Returns
        -------
        list of dict
            By column of parameters.csv (`lobefit.fitting.batch_table.PARAMETER_COLUMNS`).
        """
        return self._client._table(self, "parameters.csv")

    def _save(self, folder: Path) -> Operation[dict[str, Path]]:
        return self._client._save_batch(self, folder)

    def __len__(self) -> int:
        """Count the fits."""
        return self.total

    def __str__(self) -> str:
        """Say in one line how far it is."""
        done, total = self.extent
        said = [f"{self.name or self.id}: {self.state}", f"{done} of {total} ended"]
        said += [
            f"{n} {state}" for state in ("failed", "cancelled") if (n := self.counts.get(state))
        ]
        said += [f"{self.seconds_left:.0f} s left"] if self.seconds_left is not None else []
        return ", ".join(said)

    def _repr_html_(self) -> str:
        facts = [*self.counts.items(), ("seconds left", self.seconds_left), ("id", self.id)]
        return html.heading(f"{self.name or 'Batch'}: {self.state}") + html.facts(facts)
