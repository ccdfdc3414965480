"""The ranked answer to a fit: which model, with what parameters, and how far to trust it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lobefit.fitting.choice import Choice
from lobefit.fitting.measurement import Measurement
from lobefit.fitting.result import FitResult

if TYPE_CHECKING:
    from lobefit.fitting.checks import DataChecks

__all__ = ["FailedFit", "FitReport"]


@dataclass(frozen=True, slots=True)
class FailedFit:
    """A candidate that could not be fitted, and why."""

    candidate: str
    reason: str


@dataclass(frozen=True, eq=False)
class FitReport:
    """All candidates fitted to one measurement, the recommended one first.

    Attributes
    ----------
    measurement : Measurement
        What was fitted.
    metric : str
        How residuals were weighed: "chi2", "relative", "log" or "cube_root".
    results : tuple of FitResult
        Ranked; see `lobefit.fitting.selection`.
    failed : tuple of FailedFit
        Candidates that could not be fitted.
    described : bool
        False where even the best candidate does not describe the surface.
    verdict : str
        The answer in two or three sentences.
    seconds : float
        Wall time of everything.
    settings : dict
        What the call asked for: models, metric, tolerance, device; to repeat the fit.
    choice : Choice or None
        Why the first one is recommended: predictions of left-out blocks, and by how much
        candidates differ.
    """

    measurement: Measurement
    metric: str
    results: tuple[FitResult, ...]
    failed: tuple[FailedFit, ...]
    described: bool
    verdict: str
    seconds: float
    settings: dict[str, Any]
    choice: Choice | None = None

    @property
    def best(self) -> FitResult:
        """The recommended result: the simplest sufficient one."""
        return self.results[0]

    @cached_property
    def checks(self) -> DataChecks:
        """Whether the data can be what they are declared to be, the best result at hand."""
        # The checks of a measurement alone fit models, and so import what imports this.
        from lobefit.fitting.checks import check

        return check(self.measurement, self.best)

    def __getitem__(self, candidate: str) -> FitResult:
        """Give the result of a candidate by name."""
        for result in self.results:
            if result.candidate == candidate:
                return result
        raise KeyError(candidate)

    def table(self) -> str:
        """Rank the candidates in a text table."""
        from lobefit.fitting.tables import ranking

        return ranking(self)

    def to_dict(self) -> dict[str, Any]:
        """Give everything as JSON-ready values; the schema is versioned."""
        from lobefit.fitting.document import report_document

        return report_document(self)

    def save(self, folder: str | Path) -> dict[str, Path]:
        """Write report.json, fit.png, lobes.exr, albedo.exr and the samples used.

        Parameters
        ----------
        folder : str or Path
            Made if it does not exist.

        Returns
        -------
        dict of str to Path
            What was written, by kind: "report", "fit", "lobes", "albedo", "samples".
        """
        from lobefit.fitting.artefacts import save_report

        return save_report(self, Path(folder))

    def __str__(self) -> str:
        """Verdict and ranking."""
        return f"{self.verdict}\n\n{self.table()}"
