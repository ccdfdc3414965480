"""A candidate prepared for many surfaces: what is searched, what is solved, and the scan."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from lobefit.fitting.projection import Coordinates, coordinates
from lobefit.fitting.scale import SearchScale
from lobefit.kernels import Candidate, ModelError
from lobefit.kernels.evaluate import basis_values
from lobefit.kernels.geometry import Directions, Precision
from lobefit.kernels.program import model_program
from lobefit.kernels.texel_program import TexelProgram, vectorises
from lobefit.kernels.texels import ScanTable

__all__ = ["MOST_SEARCHED", "TexelModel", "refusal"]

Array = NDArray[np.float64]

# Searched parameters, and coordinates per channel, of which the kernels try every active set.
MOST_SEARCHED = 3
MOST_SOLVED = 5
# Nodes of the scan by the number of searched parameters: the refinement takes longer ways
# than that of a single measurement.
NODES = (1, 40, 400, 600)
# Largest change of a search coordinate in a step, in distances of the scan's nodes.
MOST_NODES_MOVED = 2.0


def refusal(candidate: Candidate, channels: int) -> str:
    """Say why a candidate cannot be fitted to texels of so many channels; "" if it can."""
    if candidate.own and channels > 1:
        names = ", ".join(p.name for p in candidate.own)
        return (
            f"{candidate.name} searches for {names} in each channel; texels are fitted with "
            "nonlinear parameters that the channels share (one channel at a time would do)"
        )
    if len(candidate.searched) > MOST_SEARCHED:
        return (
            f"{candidate.name} searches for {len(candidate.searched)} parameters, "
            f"texels for {MOST_SEARCHED} at most"
        )
    size = coordinates(candidate).T.shape[1]
    if not 1 <= size <= MOST_SOLVED:
        return (
            f"{candidate.name} solves for {size} parameters per channel, "
            f"texels for 1 to {MOST_SOLVED}"
        )
    if not vectorises(model_program(candidate.model)):
        return f"{candidate.name} has a formula that takes one surface at a time"
    return ""


@dataclass(frozen=True, eq=False)
class TexelModel:
    """A candidate for texels of C channels.

    Attributes
    ----------
    candidate : Candidate
    channels : int
    precision : {"single", "double"}

    Raises
    ------
    ModelError
        The candidate cannot be fitted to texels; the message says why.
    """

    candidate: Candidate
    channels: int
    precision: Precision

    def __post_init__(self) -> None:
        """Refuse what the kernels cannot do."""
        reason = refusal(self.candidate, self.channels)
        if reason:
            raise ModelError(reason)

    @cached_property
    def linear(self) -> Coordinates:
        """Map from the coordinates that are solved for to coefficients."""
        return coordinates(self.candidate)

    @cached_property
    def scale(self) -> SearchScale:
        """Scales of the searched parameters."""
        return SearchScale(self.candidate.searched, NODES[len(self.candidate.searched)])

    @property
    def n_parameters(self) -> int:
        """Free parameters of a texel."""
        return self.candidate.n_parameters(self.channels)

    @cached_property
    def program(self) -> TexelProgram:
        """The program of the kernels."""
        c, scale, linear = self.candidate, self.scale, self.linear
        index = {p.name: k for k, p in enumerate(c.searched)}
        sources: list[int | float] = [
            float(c.fixed[p.name]) if p.name in c.fixed else index[c.tied.get(p.name, p.name)]
            for p in c.model.nonlinear
        ]
        return TexelProgram(
            program=model_program(c.model),
            T=linear.T,
            c0=linear.c0,
            low=linear.low,
            high=linear.high,
            scales=tuple(p.scale for p in c.searched),
            sources=tuple(sources),
            t_low=scale.low,
            t_high=scale.high,
            most_move=MOST_NODES_MOVED * scale.spacing,
            channels=self.channels,
            precision=self.precision,
        )

    def table(self, directions: Directions) -> ScanTable:
        """Evaluate the scan, once for all texels."""
        t = self.scale.nodes()
        names = [p.name for p in self.candidate.searched]
        for first, second in self.candidate.descending:
            t = t[t[:, names.index(first)] >= t[:, names.index(second)] - 1e-12]
        x = self.candidate.expand(self.scale.to_parameters(t))
        basis = basis_values(model_program(self.candidate.model), directions, x)
        linear = self.linear
        maps = np.column_stack([linear.T, linear.c0]) if self.program.has_fixed else linear.T
        return ScanTable(t, np.einsum("jks,kd->jsd", basis, maps), self.scale.spacing)
