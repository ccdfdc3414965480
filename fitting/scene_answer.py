"""Which combination is enough, which is next cheaper, and which are richer than needed.

A frame's cost is its fastest round, since a busy machine only adds to it. Costs within a factor of
`SAME` count as the same, so that a machine that is busy with other things does not turn the answer
over. Of those within the tolerance that cost the same as the cheapest of them, the simplest is
enough: the model of fewest parameters; of its ways of shading whose counted work is
the least, within that factor too, the simpler one as taught (flat, Gouraud, Phong), then the
coarser mesh, then the smaller error.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from lobefit.fitting.scene_candidates import ShadingModel
from lobefit.fitting.scene_colour import Errors
from lobefit.fitting.scene_cost import Cost
from lobefit.fitting.scene_file import Tolerance
from lobefit.kernels.surface import Shading

__all__ = ["SAME", "Answer", "Combination", "answer_for"]

SAME = 2.0
SHADINGS = ("flat", "gouraud", "phong")


@dataclass(frozen=True, eq=False)
class Combination:
    """A model with a way of shading.

    Attributes
    ----------
    model : ShadingModel
    shading : {"flat", "gouraud", "phong"}
    level : int
        Subdivision level of the mesh.
    cost : Cost
    errors : Errors
    """

    model: ShadingModel
    shading: Shading
    level: int
    cost: Cost
    errors: Errors

    @property
    def name(self) -> str:
        """As the table has it."""
        return f"{self.model.name} + {self.shading}"

    @property
    def richness(self) -> tuple[int, int, int]:
        """Parameters, shading as taught, level of the mesh: what is simpler comes first."""
        return self.model.n_parameters, SHADINGS.index(self.shading), self.level

    def excess(self, tolerance: Tolerance) -> float:
        """By how many times its error exceeds a tolerance; within at 1 and below."""
        return tolerance.excess(self.errors.mean, self.errors.p99)

    def works_no_more_than(self, other: Combination) -> bool:
        """Tell whether its counted work is the same as another's, or less."""
        return self.cost.work <= SAME * other.cost.work

    def costs_no_more_than(self, other: Combination) -> bool:
        """Tell whether it costs the same as another, or less."""
        return self.cost.fastest <= SAME * other.cost.fastest


@dataclass(frozen=True, eq=False)
class Answer:
    """What a tolerance leads to.

    Attributes
    ----------
    tolerance : Tolerance
    chosen : Combination or None
        Within the tolerance, and the simplest of the same cost as the cheapest that is; None where
        there is none.
    equals : tuple of Combination
        Others within the tolerance that cost the same as the cheapest, from cheap to dear.
    cheaper : Combination or None
        Of those that fail, with no more parameters and simpler or of less work, the richest; where
        nothing is within the tolerance, the one nearest to it.
    richer : tuple of Combination
        All others within the tolerance, from cheap to dear.
    """

    tolerance: Tolerance
    chosen: Combination | None
    equals: tuple[Combination, ...]
    cheaper: Combination | None
    richer: tuple[Combination, ...]


def answer_for(combinations: Sequence[Combination], tolerance: Tolerance) -> Answer:
    """Answer for a tolerance, of combinations from cheap to dear."""

    def excess(c: Combination) -> float:
        return c.excess(tolerance)

    within = [c for c in combinations if excess(c) <= 1.0]
    if not within:
        return Answer(tolerance, None, (), min(combinations, key=excess), ())
    same = [c for c in within if c.costs_no_more_than(within[0])]
    fewest = min(c.model.n_parameters for c in same)
    small = [c for c in same if c.model.n_parameters == fewest]
    least = min(small, key=lambda c: c.cost.work)
    chosen = min(
        (c for c in small if c.works_no_more_than(least)), key=lambda c: (c.richness, excess(c))
    )

    def saves(c: Combination) -> bool:
        if c.model.n_parameters > chosen.model.n_parameters or excess(c) <= 1.0:
            return False
        simpler = c.richness < chosen.richness and c.works_no_more_than(chosen)
        less = simpler or not chosen.works_no_more_than(c)
        return less and c.costs_no_more_than(chosen)

    return Answer(
        tolerance,
        chosen,
        tuple(c for c in same if c is not chosen),
        max(
            filter(saves, combinations),
            key=lambda c: (c.richness, -excess(c)),
            default=None,
        ),
        tuple(c for c in within if c is not chosen),
    )
