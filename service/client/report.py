"""The report of a fit, typed; everything else of it is in its `document`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Self

from lobefit.service.client import html
from lobefit.service.client.documents import record

__all__ = ["Estimate", "FittedModel", "Report"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Estimate:
    """One fitted number; see `lobefit.fitting.result.ParameterEstimate`."""

    name: str
    channel: str | None
    value: float
    standard_error: float | None
    status: str
    unit: str = ""
    meaning: str = ""

    def __str__(self) -> str:
        """Give value and error, or why there is no error."""
        if self.standard_error is not None:
            return f"{self.value:.5g} ± {self.standard_error:.2g}"
        return f"{self.value:.5g} ({self.status})"


@dataclass(frozen=True, slots=True, kw_only=True)
class FittedModel:
    """One candidate with its fitted parameters.

    Attributes
    ----------
    rank : int
        1 is recommended.
    candidate, model, title : str
        Such as "ggx:k_s=1", "ggx", and what that is.
    options : mapping of str to str
        Masking and Fresnel term, where the model leaves a choice.
    channels : tuple of str
    params : mapping of str to float or list of float
        By channel where a parameter is; as `Client.evaluate` takes them.
    estimates : tuple of Estimate
        The same with their errors.
    n_parameters : int
        Free ones.
    rmse : float
        In 1/sr.
    bic_difference : float or None
        BIC above the lowest; None for metrics that have no likelihood.
    document : mapping
        Everything about it, as in report.json.
    """

    rank: int
    candidate: str
    model: str
    title: str
    options: Mapping[str, str]
    channels: tuple[str, ...]
    params: Mapping[str, Any]
    estimates: tuple[Estimate, ...] = field(repr=False)
    n_parameters: int
    rmse: float
    bic_difference: float | None
    document: Mapping[str, Any] = field(repr=False)

    @classmethod
    def read(cls, document: Mapping[str, Any]) -> Self:
        """Make it of an entry of report.json."""
        return record(
            cls,
            document,
            channels=tuple(document.get("channels", ())),
            estimates=tuple(record(Estimate, e) for e in document.get("estimates", ())),
            document=document,
        )

    def __str__(self) -> str:
        """Give its parameters, one line each."""
        lines = [
            f"  {_label(e)} = {e}" + (f" {e.unit}" if e.unit not in ("", "1") else "")
            for e in self.estimates
        ]
        return "\n".join([f"{self.candidate}: {self.title}", *lines])

    def _repr_html_(self) -> str:
        rows = [(_label(e), e, e.unit, e.meaning) for e in self.estimates]
        head = ("parameter", "value", "unit", "")
        return html.heading(f"{self.candidate}: {self.title}") + html.table(head, rows)


@dataclass(frozen=True, slots=True, kw_only=True)
class Report:
    """All candidates fitted to one measurement, the recommended one first.

    Attributes
    ----------
    verdict : str
        The answer in two or three sentences.
    described : bool
        False where even the best candidate does not describe the surface.
    metric : str
        How residuals were weighed.
    results : tuple of FittedModel
        Ranked.
    failed : tuple of mapping
        Candidates that could not be fitted, each with "candidate" and "reason".
    posterior : mapping or None
        posterior.json, where a posterior was asked for: its summary, and whether it converged.
    document : mapping
        report.json.
    """

    verdict: str
    described: bool
    metric: str
    results: tuple[FittedModel, ...]
    failed: tuple[Mapping[str, Any], ...] = ()
    posterior: Mapping[str, Any] | None = field(default=None, repr=False)
    document: Mapping[str, Any] = field(repr=False)

    @classmethod
    def read(cls, document: Mapping[str, Any], posterior: Mapping[str, Any] | None = None) -> Self:
        """Make it of report.json, and posterior.json."""
        return record(
            cls,
            document,
            results=tuple(FittedModel.read(r) for r in document.get("results", ())),
            failed=tuple(document.get("failed", ())),
            posterior=posterior,
            document=document,
        )

    @property
    def best(self) -> FittedModel:
        """The recommended candidate: the simplest sufficient one."""
        return self.results[0]

    def __getitem__(self, candidate: str) -> FittedModel:
        """Give a candidate by name."""
        for result in self.results:
            if result.candidate == candidate:
                return result
        raise KeyError(candidate)

    def table(self) -> str:
        """Rank the candidates in a text table."""
        rows = [HEAD, *self._ranking()]
        widths = [max(len(row[k]) for row in rows) for k in range(len(HEAD))]
        return "\n".join(
            "  ".join(
                entry.ljust(width) if k == 1 else entry.rjust(width)
                for k, (entry, width) in enumerate(zip(row, widths, strict=True))
            ).rstrip()
            for row in rows
        )

    def __str__(self) -> str:
        """Verdict and ranking."""
        return f"{self.verdict}\n\n{self.table()}"

    def _ranking(self) -> list[tuple[str, ...]]:
        return [
            (
                str(r.rank),
                r.candidate,
                str(r.n_parameters),
                "-" if r.bic_difference is None else f"{r.bic_difference:.1f}",
                f"{r.rmse:.3g}",
            )
            for r in self.results
        ]

    def _repr_html_(self) -> str:
        said = html.paragraph(self.verdict) + html.table(HEAD, self._ranking())
        if self.failed:
            rows = [(f.get("candidate"), f.get("reason")) for f in self.failed]
            said += html.table(("not fitted", "why"), rows)
        return said + (self.best._repr_html_() if self.results else "")


HEAD = ("rank", "candidate", "parameters", "BIC diff", "rmse [1/sr]")


def _label(estimate: Estimate) -> str:
    return estimate.name if estimate.channel is None else f"{estimate.name}[{estimate.channel}]"
