"""Points of a chart of speed against accuracy, and which of them form the Pareto front.

Both coordinates have a spread: the quartiles of repeated runs. A point is no contender where
another one is as good and faster by more than the spread, or better by more than the spread and
no slower in the median. The front runs through the contenders' medians; contenders that it passes
by are level with it: no run of this length tells which are better.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

__all__ = [
    "SAME",
    "Panel",
    "Point",
    "Spread",
    "beats",
    "clearly_beaten",
    "contenders",
    "front",
    "within",
]

# Errors that differ by less than this share of themselves are the same.
SAME = 0.01


@dataclass(frozen=True, slots=True)
class Spread:
    """A number that was measured several times.

    Attributes
    ----------
    runs : tuple of float
        Every run, in their order; one where it is the same each time.
    low, median, high : float
        The quartiles.
    """

    runs: tuple[float, ...]
    low: float = field(init=False)
    median: float = field(init=False)
    high: float = field(init=False)

    def __post_init__(self) -> None:
        """Find the quartiles, once: they are asked for many times."""
        quartiles = np.quantile(self.runs, (0.25, 0.5, 0.75)).tolist()
        for name, number in zip(("low", "median", "high"), quartiles, strict=True):
            object.__setattr__(self, name, number)

    def to_dict(self) -> dict[str, Any]:
        """Give median, quartiles and runs as JSON-ready values."""
        return {"median": self.median, "low": self.low, "high": self.high, "runs": list(self.runs)}

    @classmethod
    def from_dict(cls, document: Mapping[str, Any]) -> Spread:
        """Read what `to_dict` gave."""
        return cls(tuple(float(r) for r in document["runs"]))


@dataclass(frozen=True, slots=True, kw_only=True)
class Point:
    """One choice, measured.

    Attributes
    ----------
    label : str
        What was chosen; unique within its panel.
    group : str
        Which kind of choice it is.
    seconds, error : Spread
        What it takes, and how far off it is.
    settings : dict
        Everything that is needed to run it again.
    detail : dict
        What the run said, such as the algorithm and why it stopped.
    usual : bool
        Whether the program does this unless told otherwise.
    """

    label: str
    group: str
    seconds: Spread
    error: Spread
    settings: Mapping[str, Any] = field(default_factory=dict)
    detail: Mapping[str, Any] = field(default_factory=dict)
    usual: bool = False

    def to_dict(self) -> dict[str, Any]:
        """Give JSON-ready values."""
        return {
            "label": self.label,
            "group": self.group,
            "usual": self.usual,
            "seconds": self.seconds.to_dict(),
            "error": self.error.to_dict(),
            "settings": dict(self.settings),
            "detail": dict(self.detail),
        }

    @classmethod
    def from_dict(cls, document: Mapping[str, Any]) -> Point:
        """Read what `to_dict` gave."""
        return cls(
            label=document["label"],
            group=document["group"],
            usual=document["usual"],
            seconds=Spread.from_dict(document["seconds"]),
            error=Spread.from_dict(document["error"]),
            settings=document["settings"],
            detail=document["detail"],
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Panel:
    """Choices of one kind against each other, on axes of their own.

    Attributes
    ----------
    name : str
        Such as "fit".
    title, seconds_label, error_label : str
        For the picture: what was chosen among, and what the axes are.
    percent : bool
        Errors are relative ones that people read in percent.
    points : tuple of Point
    notes : tuple of str
        What to know about how it was measured.
    failed : dict of str to str
        Choices that could not be made, and why.
    finding : str
        One sentence that says what to do.
    """

    name: str
    title: str
    seconds_label: str
    error_label: str
    points: tuple[Point, ...]
    percent: bool = False
    notes: tuple[str, ...] = ()
    failed: Mapping[str, str] = field(default_factory=dict)
    finding: str = ""

    def to_dict(self) -> dict[str, Any]:
        """Give JSON-ready values; `front` has the Pareto front, the fastest first.

        `level` has what the spread does not tell from it.
        """
        members, level = front(self.points), contenders(self.points)
        return {
            "name": self.name,
            "title": self.title,
            "seconds_label": self.seconds_label,
            "error_label": self.error_label,
            "percent": self.percent,
            "finding": self.finding,
            "front": [self.points[k].label for k in members],
            "level": [self.points[k].label for k in level if k not in members],
            "notes": list(self.notes),
            "failed": dict(self.failed),
            "points": [
                {"number": k + 1, "front": k in members, **p.to_dict()}
                for k, p in enumerate(self.points)
            ],
        }

    @classmethod
    def from_dict(cls, document: Mapping[str, Any]) -> Panel:
        """Read what `to_dict` gave."""
        texts = {key: document[key] for key in ("name", "title", "seconds_label", "error_label")}
        return cls(
            **texts,
            percent=document["percent"],
            points=tuple(Point.from_dict(p) for p in document["points"]),
            notes=tuple(document["notes"]),
            failed=dict(document["failed"]),
            finding=document["finding"],
        )


def _as_good(q: Point, p: Point) -> bool:
    return q.error.median <= max(p.error.median * (1.0 + SAME), p.error.high)


def _faster(q: Point, p: Point) -> bool:
    return q.seconds.high < p.seconds.low


def beats(q: Point, p: Point) -> bool:
    """Tell whether q is better than p by more than the spread, so that p is no contender.

    Along a chain of points that beat each other the median time never rises, and where it stays
    the error falls: no points beat each other in a circle, so that some always remain.
    """
    if _faster(q, p) and _as_good(q, p):
        return True
    better = q.error.high * (1.0 + SAME) < p.error.low
    return better and q.seconds.median <= p.seconds.median


def contenders(points: Sequence[Point]) -> list[int]:
    """Find the points that none other beats; indices, the fastest first."""
    left = [k for k, p in enumerate(points) if not any(beats(q, p) for q in points)]
    return sorted(left, key=lambda k: (points[k].seconds.median, points[k].error.median))


def front(points: Sequence[Point]) -> list[int]:
    """Find the Pareto front.

    Parameters
    ----------
    points : sequence of Point

    Returns
    -------
    list of int
        Indices, the fastest first: contenders of which each is better than the one before.
    """
    found: list[int] = []
    for k in contenders(points):
        error = points[k].error.median
        if not found or error * (1.0 + SAME) < points[found[-1]].error.median:
            found.append(k)
    return found


def clearly_beaten(p: Point, points: Sequence[Point], margin: Mapping[str, float]) -> str | None:
    """Name a point that is as good as another and faster beyond the spreads of two runs.

    Parameters
    ----------
    p : Point
    points : sequence of Point
        Of the same run.
    margin : mapping of str to float
        By label, the relative half spread of the time in the other run, which is added.
    """
    for q in points:
        slow = q.seconds.high * (1.0 + margin.get(q.label, 0.0))
        fast = p.seconds.low * (1.0 - min(margin.get(p.label, 0.0), 1.0))
        if slow < fast and _as_good(q, p):
            return q.label
    return None


def within(points: Sequence[Point], tolerance: float) -> Point | None:
    """Give the fastest point whose error is within a tolerance, if there is one."""
    near = [p for p in points if p.error.median <= tolerance]
    return min(near, key=lambda p: (p.seconds.median, p.error.median), default=None)
