"""The OpenCL C text that fits many surfaces at once: a model's formula with a surface per lane.

The same ``.cl`` files serve: what they call `scalar`, a parameter, becomes a vector with one
number per surface, and the directions are broadcast to all lanes.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from math import prod

import numpy as np
from numpy.typing import NDArray

from lobefit.kernels.geometry import Precision
from lobefit.kernels.program import ModelProgram, shared_text

__all__ = ["HUGE_NUMBER", "MISSING", "TexelProgram", "vectorises"]

Array = NDArray[np.float64]

# Stands for no bound: far beyond any reading.
HUGE_NUMBER = 1e30
# Readings at or below this are missing: a NaN would not survive the compiler's relaxed rules.
MISSING = -1e30
# Half width of the central differences along the search coordinates.
STEP = {"double": 1e-4, "single": 2e-3}
ROUNDING = {"double": 1e-14, "single": 5e-7}
# A column of which less than this is its own, relatively, cannot be told from the others.
TINY_PIVOT = {"double": 1e-13, "single": 2e-6}
RIDGE = {"double": 1e-14, "single": 1e-7}
SMALLEST = {"double": 1e-280, "single": 1e-35}

PIECES = ("texel_algebra.h", "texel_sums.h", "texel_scan.cl", "texel_refine.cl")

_SEARCH = {"linear": "t[{}]", "log": "exp2(t[{}] * LOG2_E)", "root": "t[{}] * t[{}]"}


def vectorises(program: ModelProgram) -> bool:
    """Tell whether a model's formula takes vectors of parameters: `double` is a number."""
    formulas = program.text.removeprefix(shared_text("types.h"))
    return re.search(r"^[^/\n]*\bdouble\b", formulas, re.MULTILINE) is None


@dataclass(frozen=True, eq=False)
class TexelProgram:
    """The program of one model for many surfaces.

    Attributes
    ----------
    program : ModelProgram
        The model, its options chosen.
    T, c0 : ndarray, shapes (K, D), (K,)
        Coefficients of the K basis functions from D coordinates, ``c = T d + c0``.
    low, high : ndarray, shape (D,)
        Bounds of the coordinates; ``high`` may be infinite.
    scales : tuple of {"linear", "log", "root"}
        Of the n searched parameters.
    sources : tuple of int or float
        For each nonlinear parameter of the model which of the searched ones it is, or the
        value that it is held at.
    t_low, t_high, most_move : ndarray, shape (n,)
        Bounds of the search coordinates, and their largest change in a step.
    channels : int
        C.
    precision : {"single", "double"}
        Of everything.
    """

    program: ModelProgram
    T: Array
    c0: Array
    low: Array
    high: Array
    scales: tuple[str, ...]
    sources: tuple[int | float, ...]
    t_low: Array
    t_high: Array
    most_move: Array
    channels: int
    precision: Precision

    @property
    def n_d(self) -> int:
        """Number of coordinates per channel."""
        return int(self.T.shape[1])

    @property
    def n_t(self) -> int:
        """Number of searched parameters."""
        return len(self.scales)

    @property
    def has_fixed(self) -> bool:
        """Whether part of the BRDF has a coefficient that is given."""
        return bool(np.any(self.c0 != 0.0))

    @property
    def states_of(self) -> tuple[int, ...]:
        """For each coordinate in how many ways it can stand: free, low, and high if bounded."""
        return tuple(3 if np.isfinite(h) else 2 for h in self.high)

    @property
    def judged_rows(self) -> int:
        """Rows of what ``judge_texels`` writes."""
        n, d = self.n_t, self.n_d
        return self.channels * d + 4 + n * (n + 1) // 2 + self.channels * d * (d + 1) // 2

    @cached_property
    def _formulas(self) -> str:
        """The model's text with a vector for every `scalar`."""
        types = shared_text("types.h")
        formulas = self.program.text.removeprefix(types)
        # Tables of numbers stay what they are.
        formulas = formulas.replace("constant scalar ", "constant number ")
        return f"{types}\ntypedef scalar number;\n#define scalar real\n{formulas}"

    def _glue(self) -> str:
        x = [
            _SEARCH[self.scales[s]].replace("{}", str(s)) if isinstance(s, int) else _literal(s)
            for s in self.sources
        ]
        lines = ["static inline void search_to_parameters(const real *t, scalar *x) {"]
        lines += [f"  x[{j}] = (real)({value});" for j, value in enumerate(x)]
        lines += ["}", "static inline void to_columns(const real *basis, real *column) {"]
        for d in range(self.n_d + 1):
            weights = self.T[:, d] if d < self.n_d else self.c0
            terms = [f"{_literal(w)} * basis[{k}]" for k, w in enumerate(weights) if w != 0.0]
            lines.append(f"  column[{d}] = {' + '.join(terms) or '(real)(0.0)'};")
        lines.append("}")
        tables = {
            "T_LOW": self.t_low,
            "T_HIGH": self.t_high,
            "MOST_MOVE": self.most_move,
            "LOW": self.low,
            "HIGH": np.where(np.isfinite(self.high), self.high, HUGE_NUMBER),
        }
        lines += [
            f"constant number {name}[] = {{{', '.join(map(_literal, row)) or '0.0'}}};"
            for name, row in tables.items()
        ]
        lines.append(f"constant int STATES_OF[] = {{{', '.join(map(str, self.states_of))}}};")
        return "\n".join(lines)

    def source(self, *, weighted: bool, nodes: int, strided: bool) -> str:
        """Give the text of all kernels.

        Parameters
        ----------
        weighted : bool
            Every reading has a weight of its own; otherwise all count alike.
        nodes : int
            Nodes of the scan.
        strided : bool
            Neighbouring work-items read neighbouring numbers, as GPUs like it.
        """
        defines: Sequence[tuple[str, object]] = [
            ("WEIGHTED", int(weighted)),
            ("STRIDED", int(strided)),
            ("N_CHANNELS", self.channels),
            ("N_D", self.n_d),
            ("N_T", self.n_t),
            ("HAS_FIXED", int(self.has_fixed)),
            ("N_NODES", nodes),
            ("N_STATES", prod(self.states_of)),
            ("STEP", STEP[self.precision]),
            ("ROUNDING", ROUNDING[self.precision]),
            ("TINY_PIVOT", TINY_PIVOT[self.precision]),
            ("RIDGE", RIDGE[self.precision]),
            ("SMALLEST", SMALLEST[self.precision]),
            ("HUGE_NUMBER", HUGE_NUMBER),
            ("MISSING", MISSING),
        ]
        lines = "\n".join(f"#define {name} ({value})" for name, value in defines)
        return "\n".join([self._formulas, lines, self._glue(), *map(shared_text, PIECES)])


def _literal(value: float) -> str:
    return repr(float(value))
