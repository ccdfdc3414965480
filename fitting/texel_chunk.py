"""One chunk of texels fitted with every candidate: poison set apart, the simplest chosen."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lobefit.fitting.selection import BIC_MARGIN
from lobefit.fitting.texel_parameters import parameters_of
from lobefit.fitting.texel_result import Reason, Status, TexelFit
from lobefit.fitting.texel_solve import Solution, TexelSolver
from lobefit.kernels import Candidate
from lobefit.kernels.texel_program import MISSING

__all__ = ["ChunkFitter"]

Numbers = NDArray[np.floating]
Index = NDArray[np.intp]

# Beyond this, squares of weighted readings leave single precision.
HUGE = 1e12
# Relative residuals below this are rounding of the device's numbers.
ROUNDING = {"double": 1e-12, "single": 1e-6}
# Texels in a launch: enough to keep a device busy, few enough for its memory.
LAUNCH = {"cpu": 16_384, "gpu": 262_144, "other": 65_536}


class ChunkFitter:
    """Every candidate on a device, ready for chunks of texels.

    Parameters
    ----------
    solvers : sequence of TexelSolver
        One for each candidate, all on the same directions.
    settings : mapping
        How the fit is made, for the record.
    """

    def __init__(self, solvers: Sequence[TexelSolver], settings: Mapping[str, Any]) -> None:
        self.solvers = tuple(solvers)
        self.settings = settings
        self.models = [s.model for s in solvers]
        texels = solvers[0].texels
        self.launch = LAUNCH[texels.device.info.kind]
        self.dtype = texels.dtype
        self.shape = (texels.directions.count, self.models[0].channels)
        self.rounding = ROUNDING[self.models[0].precision]
        # Solved parameters belong to a channel, searched ones to the texel.
        self.shapes: dict[str, tuple[int, ...]] = {}
        for m in self.models:
            self.shapes |= {p.name: () for p in m.candidate.searched}
            self.shapes |= {p.name: (m.channels,) for p in m.candidate.solved}
        self.held = {m.candidate.name: _held(m.candidate) for m in self.models}

    def release(self) -> None:
        """Free the device's memory."""
        for solver in self.solvers:
            solver.release()

    def fit(self, values: Numbers) -> TexelFit:
        """Fit a chunk.

        Parameters
        ----------
        values : ndarray, shape (T, N, C)
            BRDF in 1/sr of any type of numbers; NaN is a missing reading.
        """
        began = time.perf_counter()
        for solver in self.solvers:
            solver.seconds.clear()
        result = self._empty(len(values))
        for first in range(0, len(values), self.launch):
            block = np.ascontiguousarray(values[first : first + self.launch], self.dtype)
            self._fit_block(block, slice(first, first + len(block)), result)
        for solver in self.solvers:
            for stage, spent in solver.seconds.items():
                result.seconds[stage] = result.seconds.get(stage, 0.0) + spent
        result.seconds["rest"] = time.perf_counter() - began - sum(result.seconds.values())
        return result

    def _empty(self, count: int) -> TexelFit:
        def nan(*shape: int) -> NDArray[np.float32]:
            return np.full((count, *shape), np.nan, np.float32)

        return TexelFit(
            models=tuple(m.candidate.name for m in self.models),
            channels=self.shape[1],
            model=np.full(count, -1, np.int16),
            params={name: nan(*shape) for name, shape in self.shapes.items()},
            errors={name: nan(*shape) for name, shape in self.shapes.items()},
            rmse=nan(),
            scatter=nan(),
            bic=nan(len(self.models)),
            status=np.zeros(count, np.uint8),
            reason=np.zeros(count, np.uint8),
            held=self.held,
            seconds={},
            settings=self.settings,
        )

    def _fit_block(self, block: Numbers, where: slice, result: TexelFit) -> None:
        """Fit texels of one launch; what has gaps and what has none apart."""
        with np.errstate(invalid="ignore", over="ignore"):
            low, high = block.min(axis=(1, 2)), block.max(axis=(1, 2))
        reason, counts = np.zeros(len(block), np.uint8), np.full(len(block), block[0].size)
        least = 2 + min(m.n_parameters for m in self.models)
        # NaN passes through the extremes, so that whole texels cost no closer look.
        odd = np.flatnonzero(~(np.isfinite(low) & np.isfinite(high)))
        if odd.size:
            block = block.copy()  # the caller's readings stay what they are
            present = ~np.isnan(block[odd])
            counts[odd] = present.sum(axis=(1, 2))
            low[odd] = np.where(present, block[odd], np.inf).min(axis=(1, 2))
            high[odd] = np.where(present, block[odd], -np.inf).max(axis=(1, 2))
            block[odd] = np.where(present, block[odd], MISSING)
        # The last rule that applies names the reason.
        reason[high <= 0.0] = Reason.DARK
        reason[low == high] = Reason.CONSTANT
        reason[np.maximum(np.abs(low), np.abs(high)) > HUGE] = Reason.HUGE
        reason[counts < least] = Reason.TOO_FEW
        gaps = np.zeros(len(block), bool)
        gaps[odd] = counts[odd] < block[0].size
        result.reason[where] = reason
        result.status[where][reason > 0] |= np.uint8(Status.FAILED)
        result.status[where][gaps] |= np.uint8(Status.GAPS)
        for chosen in (np.flatnonzero((reason == 0) & ~gaps), np.flatnonzero((reason == 0) & gaps)):
            if chosen.size:
                readings = block if chosen.size == len(block) else block[chosen]
                known = (readings > MISSING) if gaps[chosen[0]] else None
                self._choose(readings, known, counts[chosen], chosen + where.start, result)

    def _choose(
        self,
        readings: Numbers,
        present: NDArray[np.bool_] | None,
        counts: Index,
        where: Index,
        result: TexelFit,
    ) -> None:
        """Fit every candidate to texels without poison, and keep the simplest sufficient one."""
        bics, fits = [], []
        for solver in self.solvers:
            solution = solver.solve(readings, present)
            size = solver.model.n_parameters
            # One more parameter is the scale of the noise.
            bic = solution.deviance(counts, self.rounding) + (size + 1) * np.log(counts)
            dof = np.maximum(counts - size, 1)
            finite = np.isfinite(bic) & np.isfinite(solution.d).all(axis=(1, 2))
            finite &= np.isfinite(solution.t).all(axis=1) & (counts > size + 1)
            bics.append(np.where(finite, bic, np.inf))
            fits.append((solution, solution.chi_square / dof))
        score = np.stack(bics, axis=1)
        best = score.min(axis=1)
        sizes = np.array([m.n_parameters for m in self.models])
        within = score <= best[:, None] + BIC_MARGIN
        # The fewest parameters first, then the better score.
        fewest = np.where(within, sizes, sizes.max() + 1).min(axis=1)
        chosen = np.where(within & (sizes == fewest[:, None]), score, np.inf).argmin(axis=1)
        lost = ~np.isfinite(best)
        result.model[where] = np.where(lost, -1, chosen)
        result.bic[where] = np.where(np.isfinite(score), score, np.nan)
        result.reason[where[lost]] = Reason.NOT_FINITE
        result.status[where[lost]] |= np.uint8(Status.FAILED)
        for index, (solution, scatter) in enumerate(fits):
            mine = np.flatnonzero((chosen == index) & ~lost)
            if mine.size:
                self._write(
                    index, solution.take(mine), scatter[mine], counts[mine], where[mine], result
                )

    def _write(
        self,
        index: int,
        solution: Solution,
        scatter: Numbers,
        counts: Index,
        where: Index,
        result: TexelFit,
    ) -> None:
        found = parameters_of(self.models[index], solution, scatter)
        for name, rows in found.params.items():
            result.params[name][where] = rows
            result.errors[name][where] = found.errors[name]
        result.rmse[where] = np.sqrt(solution.squares / counts)
        result.scatter[where] = np.sqrt(scatter)
        flags = (
            (Status.CONVERGED, solution.converged),
            (Status.POLISHED, solution.polished),
            (Status.ON_BOUND, found.on_bound),
        )
        for flag, true in flags:
            result.status[where[true]] |= np.uint8(flag)


def _held(candidate: Candidate) -> dict[str, float | str]:
    return {**{name: float(v) for name, v in candidate.fixed.items()}, **candidate.tied}
