"""The choice among fitted candidates, and one sentence that says why.

A richer model must earn its place twice. First by evidence: among the leaders by BIC it must
predict what was left out (`lobefit.fitting.left_out`) better than the simpler one by more than
one standard error; by more than two if its BIC is the higher one. Then, where a tolerance was
given, by size: it must change the predicted radiance by more than that at some incidence.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lobefit.fitting.blocks import Blocks, find_blocks
from lobefit.fitting.dataset import Dataset
from lobefit.fitting.left_out import block_scores
from lobefit.fitting.point import PointFit
from lobefit.fitting.selection import (
    BIC_MARGIN,
    BIC_WINDOW,
    RMS_MARGIN,
    RMS_WINDOW,
    leaders,
    rank,
    relative_change,
    simplest,
    sum_error,
)

__all__ = ["Choice", "Contender", "LeftOut", "choose"]

Array = NDArray[np.float64]

# Fewer blocks than this give no standard error worth the name.
FEWEST = 4
# Rows that tell by how much predictions differ.
ENOUGH = 65_536


@dataclass(frozen=True, slots=True)
class Contender:
    """A candidate in the choice; its score is BIC, or the rms where there is no likelihood."""

    name: str
    size: int
    score: float
    fit: PointFit


@dataclass(frozen=True, slots=True, kw_only=True)
class LeftOut:
    """How a leader predicts the blocks that it was not fitted to.

    Attributes
    ----------
    candidate : str
    score : float
        Expected log predictive density, summed over all blocks; for metrics without a
        likelihood the rms of the predictions' residuals.
    standard_error : float or None
        Of the score, from its scatter over the blocks.
    lead, lead_error : float
        By how much the chosen candidate predicts better, and its standard error, from the
        differences block by block. Without a likelihood: relative, of the rms.
    blocks : tuple of float
        The score of each block (minus the sum of squares without a likelihood).
    """

    candidate: str
    score: float
    standard_error: float | None
    lead: float
    lead_error: float
    blocks: tuple[float, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Choice:
    """Which candidate is recommended and why.

    Attributes
    ----------
    order : tuple of int
        The candidates: the chosen one first, then by score.
    sentence : str
        Why this one, and not the next simpler and the next richer; empty with one candidate.
    by : {"score", "left out", "tolerance"}
        What decided last: "score" is BIC, or the rms of the residuals.
    tolerance : float or None
        Relative change of the radiance that matters.
    changes : dict of str to float
        By how much each candidate's predictions differ from the chosen one's, relatively:
        root mean square over the directions of a block, of the block where that is largest.
    blocks, note : str
        What was left out at a time, and how the blocks were made.
    left_out : tuple of LeftOut
        The leaders; empty where nothing came near the first one.
    """

    order: tuple[int, ...]
    sentence: str
    by: str
    tolerance: float | None
    changes: dict[str, float]
    blocks: str
    note: str
    left_out: tuple[LeftOut, ...]

    def to_dict(self) -> dict[str, Any]:
        """Give everything but the order, which the ranking shows, as JSON-ready values."""
        found = asdict(self)
        del found["order"]
        return {
            **found,
            "left_out": [{**e, "blocks": list(e["blocks"])} for e in found["left_out"]],
        }


def choose(entrants: Sequence[Contender], dataset: Dataset, tolerance: float | None) -> Choice:
    """Choose the simplest sufficient candidate.

    Parameters
    ----------
    entrants : sequence of Contender
        All candidates that were fitted.
    dataset : Dataset
        What they were fitted to; its weights are changed.
    tolerance : float or None
        A richer candidate must change predictions by more, relatively.

    Returns
    -------
    Choice
    """
    likely = dataset.has_likelihood
    if len(entrants) == 1:
        return Choice(
            order=(0,),
            sentence="",
            by="score",
            tolerance=tolerance,
            changes={entrants[0].name: 0.0},
            blocks="",
            note="",
            left_out=(),
        )
    scores, sizes = [e.score for e in entrants], [e.size for e in entrants]
    lowest = min(scores)
    margin, window = (
        (BIC_MARGIN, BIC_WINDOW) if likely else (RMS_MARGIN * lowest, RMS_WINDOW * lowest)
    )
    everyone = list(range(len(entrants)))
    ranked = rank(everyone, scores, sizes, margin)
    first = chosen = ranked[0]
    blocks = find_blocks(dataset.measurement)
    rivals, onlookers = leaders(ranked, scores, sizes, margin, window)
    predicted: dict[int, Array] = {}
    if blocks.count >= FEWEST and len(rivals) + len(onlookers) > 1:
        for k in (*rivals, *onlookers):
            found = block_scores(entrants[k].fit, blocks)
            if np.isfinite(found).all():
                predicted[k] = found
    contested = [k for k in rivals if k in predicted]
    if first in contested and len(contested) > 1:
        chosen = contested[
            simplest(
                [predicted[k] for k in contested],
                [sizes[k] for k in contested],
                [scores[k] for k in contested],
            )
        ]
    by = "score" if chosen == first else "left out"
    displaced = None if chosen == first else first

    def change(k: int, reference: int) -> float:
        if k == reference:
            return 0.0
        rows = slice(None, None, -(-dataset.measurement.n_directions // ENOUGH))
        return relative_change(
            entrants[k].fit.values[:, rows],
            entrants[reference].fit.values[:, rows],
            np.cos(dataset.measurement.theta_i[rows]),
            blocks.labels[rows],
            dataset.present[:, rows],
        )

    if tolerance is not None:
        near = [k for k in everyone if sizes[k] < sizes[chosen] and change(k, chosen) <= tolerance]
        if near:
            displaced, by = chosen, "tolerance"
            chosen = min(near, key=lambda k: (sizes[k], scores[k]))
    reason = _Reason(entrants, chosen, displaced, predicted, likely, tolerance, blocks)
    changes = {e.name: change(k, chosen) for k, e in enumerate(entrants)}
    return Choice(
        order=(chosen, *(k for k in rank(everyone, scores, sizes, 0.0) if k != chosen)),
        sentence=reason.sentence(changes),
        by=by,
        tolerance=tolerance,
        changes=changes,
        blocks=blocks.kind,
        note=blocks.note,
        left_out=tuple(reason.left_out(k) for k in predicted),
    )


class _Reason:
    """Puts a choice into words."""

    def __init__(
        self,
        entrants: Sequence[Contender],
        chosen: int,
        displaced: int | None,
        predicted: dict[int, Array],
        likely: bool,
        tolerance: float | None,
        blocks: Blocks,
    ) -> None:
        self.entrants, self.chosen, self.displaced = entrants, chosen, displaced
        self.predicted, self.likely, self.tolerance = predicted, likely, tolerance
        self.blocks = blocks
        self.values = max(int(entrants[chosen].fit.problem.dataset.used.sum()), 1)

    def _lead(self, k: int) -> tuple[float, float] | None:
        """By how much the chosen candidate predicts better than another, with its error."""
        if k not in self.predicted or self.chosen not in self.predicted:
            return None
        difference = self.predicted[self.chosen] - self.predicted[k]
        lead, error = float(difference.sum()), sum_error(difference)
        if not self.likely:  # of squares; half of that, relatively, of their root
            squares = max(-float(self.predicted[self.chosen].sum()), 1e-300)
            lead, error = 0.5 * lead / squares, 0.5 * error / squares
        return lead, error

    def left_out(self, k: int) -> LeftOut:
        blocks = self.predicted[k]
        total = float(blocks.sum())
        lead, error = self._lead(k) or (0.0, 0.0)
        return LeftOut(
            candidate=self.entrants[k].name,
            score=total if self.likely else float(np.sqrt(-total / self.values)),
            standard_error=sum_error(blocks)
            if self.likely
            else 0.5 * sum_error(blocks) / float(np.sqrt(max(-total, 1e-300) * self.values)),
            lead=lead,
            lead_error=error,
            blocks=tuple(blocks.tolist()),
        )

    def sentence(self, changes: dict[str, float]) -> str:
        entrants, own = self.entrants, self.entrants[self.chosen]
        groups = {
            "simpler": [k for k, e in enumerate(entrants) if e.size < own.size],
            "richer": [k for k, e in enumerate(entrants) if e.size > own.size],
        }
        parts = []
        for word, group in groups.items():
            if not group:
                parts.append(f"nothing {word} was fitted")
                continue
            near = min(group, key=lambda k: entrants[k].score)
            near = self.displaced if self.displaced in group else near
            label = f"the next {word}, {entrants[near].name} ({entrants[near].size}),"
            parts.append(f"{label} {self._against(near, changes)}")
        others = [k for k in range(len(entrants)) if k != self.chosen]
        second = min(others, key=lambda k: (entrants[k].score, entrants[k].size))
        if entrants[second].size == own.size:
            label = f"of its own size, {entrants[second].name}"
            parts.append(f"{label} {self._against(second, changes)}")
        size = "1 parameter" if own.size == 1 else f"{own.size} parameters"
        return f"Why {own.name} ({size}): {'; '.join(parts)}."

    def _against(self, k: int, changes: dict[str, float]) -> str:
        """Say what speaks against another candidate."""
        own, other = self.entrants[self.chosen], self.entrants[k]
        richer = other.size > own.size
        said = [self._score(own, other)]
        found = self._lead(k)
        if found is not None:
            said.append(self._prediction(*found, richer=richer))
        change = changes[other.name]
        if richer and self.tolerance is not None and change <= self.tolerance:
            said.append(
                f"changes the predicted radiance by {100 * change:.2g} % at most, "
                f"less than the tolerance of {100 * self.tolerance:g} %"
            )
        *before, last = said
        return f"{', '.join(before)} and {last}" if before else last

    def _score(self, own: Contender, other: Contender) -> str:
        """Compare BICs or root mean squares."""
        if not self.likely:
            ratio = other.score / own.score - 1.0 if own.score > 0.0 else np.inf
            way = "larger" if ratio >= 0.0 else "smaller"
            return f"has residuals {100 * abs(ratio):.3g} % {way}"
        difference = other.score - own.score
        if difference >= 0.0:
            return f"has a BIC {difference:.3g} higher"
        short = other.size > own.size and -difference <= BIC_MARGIN
        needed = f" (a richer one needs {BIC_MARGIN:g})" if short else ""
        return f"has a BIC {-difference:.2g} lower{needed}"

    def _prediction(self, lead: float, error: float, *, richer: bool) -> str:
        """Compare how left-out blocks are predicted."""
        scale, unit = (1.0, " in log density") if self.likely else (100.0, " % in rms")
        way = "worse" if lead >= 0.0 else "better"
        figures = f"{abs(scale * lead):.2g} ± {scale * error:.2g}{unit}"
        said = f"predicts left-out {self.blocks.kind} {way} by {figures}"
        within = richer and lead < 0.0 and -lead <= error
        return f"{said} (no more than one standard error)" if within else said
