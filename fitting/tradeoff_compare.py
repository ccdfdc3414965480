"""Whether two runs of one chart agree on the Pareto front, up to their spreads."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from lobefit.fitting.tradeoff import Chart
from lobefit.fitting.tradeoff_points import Panel, clearly_beaten, front
from lobefit.kernels import FitError

__all__ = ["Agreement", "compare"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Agreement:
    """What two runs of one panel say of each other.

    Attributes
    ----------
    panel : str
    shared : int
        Points on both fronts.
    first, second : int
        Points on each.
    disputed : tuple of str
        One sentence for each point that is on one front and, in the other run, slower than another
        that is as good by more than the spreads of both runs together.
    """

    panel: str
    shared: int
    first: int
    second: int
    disputed: tuple[str, ...]

    def __str__(self) -> str:
        """One line."""
        said = "agree" if not self.disputed else f"DISAGREE on {len(self.disputed)}"
        return (
            f"{self.panel}: fronts of {self.first} and {self.second} points, {self.shared} of them "
            f"the same; {said} up to the spread"
        )


def compare(first: Chart, second: Chart) -> list[Agreement]:
    """Compare two charts of the same surface.

    Parameters
    ----------
    first, second : Chart

    Returns
    -------
    list of Agreement
        One for each panel that both have.

    Raises
    ------
    FitError
        They are of different surfaces, or have no panel in common.
    """
    if (first.name, first.settings.get("subject")) != (second.name, second.settings.get("subject")):
        raise FitError(f"the charts are of {first.name} and {second.name}, not of one surface")
    pairs = [(p, q) for p in first.panels for q in second.panels if p.name == q.name]
    if not pairs:
        raise FitError("the charts have no panel in common")
    return [_compared(p, q) for p, q in pairs]


def _compared(first: Panel, second: Panel) -> Agreement:
    a, b = ([panel.points[k].label for k in front(panel.points)] for panel in (first, second))
    return Agreement(
        panel=first.name,
        shared=len(set(a) & set(b)),
        first=len(a),
        second=len(b),
        disputed=(*_disputed(a, first, second), *_disputed(b, second, first)),
    )


def _margins(panel: Panel) -> Mapping[str, float]:
    return {
        p.label: max(p.seconds.high - p.seconds.median, p.seconds.median - p.seconds.low)
        / max(p.seconds.median, 1e-300)
        for p in panel.points
    }


def _disputed(labels: list[str], own: Panel, other: Panel) -> Iterator[str]:
    known = {p.label: p for p in other.points}
    margins = _margins(own)
    for label in labels:
        if label not in known:
            yield f"{label} was not measured in the other run"
            continue
        by = clearly_beaten(known[label], other.points, margins)
        if by is not None:
            yield f"{label} is beaten by {by} in the other run"
