"""One model fitted to many texels: scan, refinement, and what is left to NLopt."""

from __future__ import annotations

import time
from collections import defaultdict
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from lobefit.fitting.texel_model import TexelModel
from lobefit.fitting.texel_noise import TexelNoise
from lobefit.fitting.texel_polish import TexelPolish
from lobefit.kernels.geometry import Directions
from lobefit.kernels.texels import TexelBatch, Texels

__all__ = ["Solution", "TexelSolver"]

Numbers = NDArray[np.floating]
Mask = NDArray[np.bool_]
Index = NDArray[np.intp]

# A step that promises less than this, in units of a reading's variance, ends the walk: the
# parameter would move by a thousandth of its standard error. Loose: before reweighing.
GAIN = 1e-6
LOOSE_GAIN = 1e-2
MOST_STEPS = 40
# Weights follow the model: fit, weigh, fit, weigh, fit. The first fit is a rough one.
ROUNDS = 2
# A second valley of the scan is walked down too if it is no worse than this many times the best.
RIVAL = 2.0
# Deviances that differ by less belong to the same minimum.
SAME = 1e-2


@dataclass(slots=True)
class Solution:
    """One model's fit of T texels.

    Attributes
    ----------
    t : ndarray, shape (T, n)
        Search coordinates.
    d, chi_square, power, squares, log_weights, along_t, of_d
        See `lobefit.kernels.texels.Judged`.
    converged, polished : ndarray of bool, shape (T,)
        The refinement, or NLopt after it, reached the minimum; NLopt was needed.
    """

    t: Numbers
    d: Numbers
    chi_square: Numbers
    power: Numbers
    squares: Numbers
    log_weights: Numbers
    along_t: Numbers
    of_d: Numbers
    converged: Mask
    polished: Mask

    def put(self, where: Index, other: Solution) -> None:
        """Replace some texels."""
        for field in fields(self):
            getattr(self, field.name)[where] = getattr(other, field.name)

    def take(self, where: Index) -> Solution:
        """Give some texels."""
        return Solution(*(getattr(self, field.name)[where] for field in fields(self)))

    def deviance(self, counts: Index, rounding: float) -> NDArray[np.float64]:
        """Give minus twice the log-likelihood at the most likely scale of the noise.

        Parameters
        ----------
        counts : ndarray of int, shape (T,)
            Readings of each texel.
        rounding : float
            Relative residuals below this are rounding, not evidence.
        """
        chi2 = np.maximum(self.chi_square, rounding**2 * np.maximum(self.power, 1e-300))
        found: NDArray[np.float64] = (
            counts * (np.log(2.0 * np.pi * chi2.astype(np.float64) / counts) + 1.0)
            - np.log(2.0) * self.log_weights
        )
        return found


class TexelSolver:
    """A model on a device, ready for any number of texels.

    Parameters
    ----------
    model : TexelModel
        What is fitted.
    single, double : Directions
        The N directions in the model's precision, and in double for NLopt.
    noise : TexelNoise
        How readings are weighed.
    """

    def __init__(
        self, model: TexelModel, working: Directions, double: Directions, noise: TexelNoise
    ) -> None:
        self.model = model
        self.noise = noise
        self.texels = Texels(model.program, working, model.table(double))
        self.polish = TexelPolish(model, double, noise)
        self.seconds: dict[str, float] = defaultdict(float)

    def release(self) -> None:
        """Free the device's memory."""
        self.texels.release()

    def solve(self, readings: Numbers, present: Mask | None) -> Solution:
        """Fit texels; what comes out for one does not depend on the others.

        Parameters
        ----------
        readings : ndarray, shape (T, N, C)
            BRDF in 1/sr, `MISSING` where there is none.
        present : ndarray of bool, shape (T, N, C), or None
            Which readings are there; None for all.
        """
        gaps = present is not None
        batch = self._batch(readings, gaps)
        try:
            start = rival = np.zeros((len(readings), 0))
            excess = np.full(len(readings), np.inf)
            if self.model.program.n_t:
                began = time.perf_counter()
                start, rival, excess = batch.scan()
                self.seconds["scan"] += time.perf_counter() - began
            solution = self._walk(batch, start)
        finally:
            batch.release()
        also = np.flatnonzero(excess < RIVAL)
        if also.size:
            self._try(solution, also, rival[also], readings, present)
        left = np.flatnonzero(~solution.converged)
        if left.size:  # a fresh walk from where it stopped often gets there
            self._try(solution, left, solution.t[left], readings, present)
            left = left[~solution.converged[left]]
        if left.size:
            began = time.perf_counter()
            self._polish(solution, left, readings, present)
            self.seconds["polish"] += time.perf_counter() - began
        return solution

    def _batch(self, readings: Numbers, gaps: bool) -> TexelBatch:
        began = time.perf_counter()
        batch = self.texels.batch(readings, gaps=gaps, reweigh=not self.noise.constant)
        self.seconds["load"] += time.perf_counter() - began
        return batch

    def _walk(self, batch: TexelBatch, t: Numbers, most_steps: int | None = None) -> Solution:
        """Refine from a start, weigh, and judge."""
        began = time.perf_counter()
        readings = self.model.channels * batch.texels.directions.count
        dof = max(readings - self.model.n_parameters, 1)
        rounds = 0 if self.noise.constant else ROUNDS
        most_steps = MOST_STEPS if most_steps is None else most_steps
        for round_ in range(rounds + 1):
            gain = GAIN if round_ == rounds else LOOSE_GAIN
            # Without a step, only a fresh walk solves for the coordinates under the new weights.
            fresh = round_ == 0 or most_steps == 0
            t, _, converged = batch.refine(t, gain / dof, most_steps, fresh=fresh)
            if round_ < rounds:
                batch.weigh(t, self.noise.relative, self.noise.additive, self.noise.floor)
        if not self.model.program.n_t:
            converged = np.ones(batch.count, dtype=bool)
        self.seconds["refine"] += time.perf_counter() - began
        began = time.perf_counter()
        judged = batch.judge(t)
        self.seconds["judge"] += time.perf_counter() - began
        return Solution(
            t=np.array(t),
            d=judged.d,
            chi_square=np.array(judged.chi_square),
            power=np.array(judged.power),
            squares=np.array(judged.squares),
            log_weights=np.array(judged.log_weights),
            along_t=judged.along_t,
            of_d=judged.of_d,
            converged=np.array(converged),
            polished=np.zeros(batch.count, dtype=bool),
        )

    def _try(
        self,
        solution: Solution,
        where: Index,
        start: Numbers,
        readings: Numbers,
        present: Mask | None,
    ) -> None:
        """Walk from another start, and keep it where it ends lower, or as low and converged."""
        batch = self._batch(readings[where], present is not None)
        try:
            other = self._walk(batch, start)
        finally:
            batch.release()
        old = solution.take(where)
        # The number of readings is the same for both.
        counts = np.full(len(where), readings[0].size)
        change = other.deviance(counts, 0.0) - old.deviance(counts, 0.0)
        lower = (change < 0.0) | ((change < SAME) & other.converged & ~old.converged)
        solution.put(where[lower], other.take(np.flatnonzero(lower)))

    def _polish(
        self, solution: Solution, where: Index, readings: Numbers, present: Mask | None
    ) -> None:
        """Let NLopt search from where the refinement stopped; the device judges the end."""
        ends = [
            self.polish.run(readings[k], None if present is None else present[k], solution.t[k])
            for k in where
        ]
        batch = self._batch(readings[where], present is not None)
        try:
            other = self._walk(batch, np.stack([t for t, _ in ends]), most_steps=0)
        finally:
            batch.release()
        other.converged[:] = [reached for _, reached in ends]
        other.polished[:] = True
        solution.put(where, other)
