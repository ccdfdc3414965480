"""Fits of many surfaces in one launch: load, scan, refine, weigh and judge on the device."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lobefit.kernels.device import Device, opencl_errors
from lobefit.kernels.geometry import Directions
from lobefit.kernels.program import build_options
from lobefit.kernels.texel_program import TexelProgram

__all__ = ["Judged", "ScanTable", "TexelBatch", "Texels"]

# Sum of squares of a column in 1/sr^2 below which no reading knows of it.
UNSEEN = 1e-24

Array = NDArray[np.float64]
Numbers = NDArray[Any]


@dataclass(frozen=True, slots=True)
class ScanTable:
    """What the scan of every texel shares.

    Attributes
    ----------
    nodes : ndarray, shape (J, n)
        Search coordinates.
    columns : ndarray, shape (J, N, M)
        Columns at the nodes; M is D, and one more for the part of a given coefficient.
    spacing : ndarray, shape (n,)
        Distance of neighbouring nodes.
    """

    nodes: Array
    columns: Array
    spacing: Array

    @property
    def grams(self) -> Array:
        """Lower triangles of the columns' Gram matrices, shape (J, M (M + 1) / 2)."""
        gram = np.einsum("jsk,jsl->jkl", self.columns, self.columns)
        rows, columns = np.tril_indices(self.columns.shape[2])
        triangle: Array = gram[:, rows, columns]
        return triangle

    def solutions(self, program: TexelProgram) -> Array:
        """Solve for every set of held coordinates: shape (J, states, D, D + 1).

        A row gives the coordinate as a linear function of the right-hand side and 1. States
        are numbered as the kernels number them: the first coordinate's digit counts fastest.
        """
        n_d = program.n_d
        gram = np.einsum("jsk,jsl->jkl", self.columns, self.columns)[:, :n_d, :n_d]
        states = []
        for digits in product(*(range(n) for n in reversed(program.states_of))):
            digit = np.array(digits[::-1])
            free = digit == 0
            held = np.where(free, 0.0, np.where(digit == 1, program.low, program.high))
            inverse = np.zeros_like(gram)
            power = np.einsum("jkk->jk", gram)[:, free]
            # A lobe so narrow that no direction sees it has no coefficient.
            scale = np.where(power > UNSEEN, np.sqrt(power), np.inf)
            block = gram[:, free][:, :, free] / (scale[:, :, None] * scale[:, None, :])
            # A column that adds nothing new takes no part.
            pinv = np.linalg.pinv(block, rcond=1e-7, hermitian=True)
            pinv /= scale[:, :, None] * scale[:, None, :]
            inverse[np.ix_(range(len(gram)), free, free)] = pinv
            fixed = held - np.einsum("jkl,jlm,m->jk", inverse, gram, held)
            states.append(np.concatenate([inverse, fixed[:, :, None]], axis=2))
        return np.stack(states, axis=1)


@dataclass(frozen=True, slots=True)
class Judged:
    """What the last pass says of T texels, in the precision of the device.

    Attributes
    ----------
    d : ndarray, shape (T, C, D)
        Coordinates.
    chi_square, power, squares, log_weights : ndarray, shape (T,)
        Weighted sums of the squared residuals and readings; plain sum of squared residuals;
        sum of log2 of the weights, 0 where all count alike.
    along_t : ndarray, shape (T, n, n)
        Inverse of the curvature along the search coordinates; 0 where one is on its bound.
    of_d : ndarray, shape (T, C, D, D)
        The same of each channel's coordinates.
    """

    d: Numbers
    chi_square: Numbers
    power: Numbers
    squares: Numbers
    log_weights: Numbers
    along_t: Numbers
    of_d: Numbers


class Texels:
    """Kernels of one model for texels that share their directions.

    Parameters
    ----------
    program : TexelProgram
        The model.
    directions : Directions
        N directions above the horizon, in the program's precision.
    table : ScanTable
        The scan.
    """

    def __init__(self, program: TexelProgram, directions: Directions, table: ScanTable) -> None:
        import pyopencl as cl

        self.program = program
        self.directions = directions
        self.n_nodes = len(table.nodes)
        self.device: Device = directions.device
        self.dtype = directions.dtype
        flags = cl.mem_flags.READ_ONLY | cl.mem_flags.COPY_HOST_PTR
        with opencl_errors("uploading a scan"):
            self.tables = [
                cl.Buffer(
                    self.device.context,
                    flags,
                    hostbuf=np.ascontiguousarray(a, self.dtype) if a.size else np.zeros(1),
                )
                for a in (
                    table.columns,
                    table.grams,
                    table.solutions(program),
                    table.nodes,
                    table.spacing,
                )
            ]

    def kernel(self, name: str, weighted: bool) -> Any:
        """Give a kernel, compiled at first use."""
        source = self.program.source(
            weighted=weighted, nodes=self.n_nodes, strided=not self.device.is_cpu
        )
        options = build_options(self.directions.width, self.directions.precision)
        return self.device.kernel(source, name, options)

    def batch(self, readings: Numbers, *, gaps: bool, reweigh: bool) -> TexelBatch:
        """Bring texels to the device.

        Parameters
        ----------
        readings : ndarray, shape (T, N, C)
            BRDF in 1/sr.
        gaps : bool
            Whether readings may be missing, which are `MISSING` then.
        reweigh : bool
            Whether readings will be weighed one by one later; until then they count alike.
        """
        return TexelBatch(self, readings, gaps=gaps, reweigh=reweigh)

    def release(self) -> None:
        """Free the device's memory; the directions stay."""
        for table in self.tables:
            table.release()


class TexelBatch:
    """Texels on the device, fitted together.

    Parameters
    ----------
    texels : Texels
        Kernels.
    readings, gaps, reweigh
        See `Texels.batch`.
    """

    def __init__(self, texels: Texels, readings: Numbers, *, gaps: bool, reweigh: bool) -> None:
        import pyopencl as cl

        self.texels = texels
        self.weighted = gaps
        p, d = texels.program, texels.directions
        self.count = len(readings)
        self.groups = -(-self.count // d.width)
        flags, context = cl.mem_flags, texels.device.context
        size = self.groups * d.width * d.dtype.itemsize
        with opencl_errors("bringing texels to the device"):
            raw = np.ascontiguousarray(readings, d.dtype)
            read = flags.READ_ONLY | (
                flags.USE_HOST_PTR if texels.device.is_cpu else flags.COPY_HOST_PTR
            )
            source = cl.Buffer(context, read, hostbuf=raw)
            self.values = cl.Buffer(context, flags.READ_WRITE, size * d.count * p.channels)
            self.weights = (
                cl.Buffer(context, flags.READ_WRITE, size * d.count * p.channels)
                if gaps or reweigh
                else self.values  # never read
            )
            self.search = cl.Buffer(context, flags.READ_WRITE, size * (2 * p.n_t + 2))
            self.state = cl.Buffer(context, flags.READ_WRITE, size * (p.channels * p.n_d + 2))
            self._run("load_texels", source, np.int32(self.count), np.int32(d.count),
                      np.int32(gaps or reweigh), self.values, self.weights)  # fmt: skip
            texels.device.queue.finish()
            source.release()

    def _run(self, name: str, *arguments: Any) -> None:
        device = self.texels.device
        kernel = self.texels.kernel(name, self.weighted)
        kernel(device.queue, (self.groups,), (1,) if device.is_cpu else None, *arguments)

    def _rows(self, buffer: Any, rows: int) -> Numbers:
        """Read rows of a result back, shape (rows, T)."""
        import pyopencl as cl

        out = np.empty((rows, self.groups * self.texels.directions.width), self.texels.dtype)
        if rows:
            cl.enqueue_copy(self.texels.device.queue, out, buffer)
        return out[:, : self.count]

    def _geometry(self) -> tuple[Any, ...]:
        d = self.texels.directions
        return (d.planes, np.int32(d.padded), np.int32(d.count), self.values, self.weights)

    def scan(self) -> tuple[Numbers, Numbers, Numbers]:
        """Look for the best node of each texel, all readings counting alike.

        Returns
        -------
        best, rival : ndarray, shape (T, n)
            Search coordinates of the best node, and of the best that is no neighbour of it.
        excess : ndarray, shape (T,)
            The rival's sum of squared residuals over the best one's.
        """
        t, n = self.texels, self.texels.program.n_t
        with opencl_errors(f"scanning {t.program.program.model.name}"):
            self._run("scan_texels", np.int32(t.directions.count), self.values, self.weights,
                      np.int32(t.n_nodes), *t.tables, self.search)  # fmt: skip
            rows = self._rows(self.search, 2 * n + 2)
        return rows[:n].T, rows[n : 2 * n].T, rows[-1] / np.maximum(rows[-2], 1e-37)

    def refine(
        self, start: Numbers, gain: float, most_steps: int, *, fresh: bool = True
    ) -> tuple[Numbers, Numbers, Any]:
        """Walk from a start to the minimum.

        Parameters
        ----------
        start : ndarray, shape (T, n)
            Search coordinates.
        gain : float
            A step that promises less than this part of the sum of squares ends the walk.
        most_steps : int
            Limit of steps.
        fresh : bool
            Otherwise the walk before ended at this start, and its coordinates are known.

        Returns
        -------
        t : ndarray, shape (T, n)
            Search coordinates.
        value : ndarray, shape (T,)
            Sum of weighted squared residuals there.
        converged : ndarray of bool, shape (T,)
        """
        p, t = self.texels.program, self.texels
        with opencl_errors(f"refining {p.program.model.name}"):
            self._place(start)
            self._run("refine_texels", *self._geometry(), np.int32(fresh), np.int32(most_steps),
                      t.dtype.type(gain), self.search, self.state)  # fmt: skip
            found = self._rows(self.search, p.n_t).T
            state = self._rows(self.state, p.channels * p.n_d + 2)
        return found, state[-2], state[-1] > 0.5

    def _place(self, start: Numbers) -> None:
        import pyopencl as cl

        p, d = self.texels.program, self.texels.directions
        if not p.n_t:
            return
        rows = np.zeros((p.n_t, self.groups * d.width), d.dtype)
        rows[:, : self.count] = start.T
        rows[:, self.count :] = rows[:, self.count - 1 : self.count]
        cl.enqueue_copy(self.texels.device.queue, self.search, rows)

    def weigh(self, start: Numbers, relative: float, additive: float, floor: float) -> None:
        """Set the weights from the model at the coordinates that `refine` left.

        Parameters
        ----------
        start : ndarray, shape (T, n)
            Search coordinates.
        relative, additive, floor : float
            The variance is ``(relative f)^2 + additive^2 + (floor mean)^2`` with f the model
            and mean that of the channel's readings, without their signs.
        """
        with opencl_errors("weighing texels"):
            self._place(start)
            self.weighted = True
            squares = (self.texels.dtype.type(v * v) for v in (relative, additive, floor))
            self._run("weigh_texels", *self._geometry(), *squares, self.search, self.state)

    def judge(self, t: Numbers) -> Judged:
        """Give coordinates and variances at the search coordinates that `refine` left."""
        import pyopencl as cl

        p, device = self.texels.program, self.texels.device
        size = (
            p.judged_rows * self.groups * self.texels.directions.width * self.texels.dtype.itemsize
        )
        with opencl_errors(f"judging {p.program.model.name}"):
            self._place(t)
            out = cl.Buffer(device.context, cl.mem_flags.READ_WRITE, size)
            self._run("judge_texels", *self._geometry(), self.search, self.state, out)
            rows = self._rows(out, p.judged_rows)
            out.release()
        n, d, c = p.n_t, p.n_d, p.channels
        first = c * d + 4
        last = first + n * (n + 1) // 2
        of_d = np.ascontiguousarray(rows[last:].T).reshape(self.count, c, -1)
        return Judged(
            d=np.ascontiguousarray(rows[: c * d].T).reshape(self.count, c, d),
            chi_square=rows[c * d],
            power=rows[c * d + 1],
            squares=rows[c * d + 2],
            log_weights=rows[c * d + 3],
            along_t=_symmetric(rows[first:last].T, n),
            of_d=_symmetric(of_d, d),
        )

    def release(self) -> None:
        """Free the device's memory."""
        for buffer in (self.values, self.search, self.state):
            buffer.release()
        if self.weights is not self.values:
            self.weights.release()


def _symmetric(triangles: Numbers, size: int) -> Numbers:
    """Fill square matrices from lower triangles, the last axis."""
    full = np.zeros((*triangles.shape[:-1], size, size), triangles.dtype)
    rows, columns = np.tril_indices(size)
    full[..., rows, columns] = triangles
    full[..., columns, rows] = triangles
    return full
