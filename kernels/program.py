"""The OpenCL C text of a model: shared pieces, the terms' formulas, and the glue between them.

The glue is generated from the records, so that the order of parameters and
basis functions is written down once.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from importlib.resources import files

from lobefit.kernels.library import Lobe
from lobefit.kernels.registry import Model

__all__ = ["BLOCK", "ModelProgram", "build_options", "model_program", "shared_text"]

# Directions a work-item handles before it adds its partial sums up in double:
# few enough that single precision partial sums keep their digits.
BLOCK = 16


@cache
def shared_text(name: str) -> str:
    """Read a file of ``cl/`` with a line marker, so that build errors name it."""
    text = (files("lobefit.kernels") / "cl" / name).read_text(encoding="utf-8")
    return f'#line 1 "{name}"\n{text}'


def build_options(width: int, precision: str) -> tuple[str, ...]:
    """Give the compiler options that fix the generic types.

    Single precision may also reorder sums and take reciprocals and roots by
    approximation and a Newton step. ``-cl-fast-relaxed-math`` allows the same, but some
    runtimes take it as a licence for functions of 12 bits (Intel's CPU runtime: exp,
    rsqrt, atan and erf wrong by 2e-4).
    """
    bits = 64 if precision == "double" else 32
    options = (f"-DWIDTH={width}", f"-DPRECISION={bits}", "-cl-mad-enable")
    if precision == "double":
        return options
    relaxed = ("-cl-unsafe-math-optimizations", "-cl-finite-math-only")
    return (*options, "-cl-single-precision-constant", *relaxed)


def _lobe_text(lobe: Lobe) -> str:
    own = [p for p in lobe.parameters if not p.linear]
    fields = " ".join(f"scalar {p.name};" for p in own) or "int unused;"
    place = files("lobefit.kernels") / "models" / f"{lobe.name}.cl"
    formula = lobe.formula or place.read_text(encoding="utf-8")
    return "\n".join(
        [
            f"typedef struct {{ {fields} }} {lobe.name}_parameters;",
            *(f"#define OPTION_{key} {choice[0]}" for key, choice in lobe.options.items()),
            f'#line 1 "{lobe.name}.cl"',
            formula,
            '#line 1 "generated"',
            *(f"#undef OPTION_{key}" for key in lobe.options),
        ]
    )


@dataclass(frozen=True)
class ModelProgram:
    """The generated program of one model, its options chosen.

    Attributes
    ----------
    model : Model
        What it evaluates.
    """

    model: Model

    @property
    def n_basis(self) -> int:
        """Number of basis functions."""
        return len(self.model.coefficients)

    @property
    def n_x(self) -> int:
        """Number of nonlinear parameters."""
        return len(self.model.nonlinear)

    @cached_property
    def derivatives(self) -> tuple[tuple[int, int], ...]:
        """Pairs (basis, nonlinear parameter) of the columns behind the basis columns."""
        pairs = []
        basis = x = 0
        for term in self.model.terms:
            own = sum(not p.linear for p in term.parameters)
            count = len(term.coefficients)
            pairs += [(basis + k, x + j) for j in range(own) for k in range(count)]
            basis += count
            x += own
        return tuple(sorted(pairs, key=lambda pair: (pair[1], pair[0])))

    @cached_property
    def text(self) -> str:
        """Program text up to the kernels: types, pieces, formulas, glue."""
        lobes = list(dict.fromkeys(term.lobe for term in self.model.terms))
        uses = list(dict.fromkeys(u for lobe in lobes for u in lobe.uses))
        parts = [shared_text("types.h"), shared_text("geometry.h"), *map(shared_text, uses)]
        parts += [_lobe_text(lobe) for lobe in lobes]
        return "\n".join([*parts, self._glue(), shared_text("views.h")])

    def _glue(self) -> str:
        fields, values, calls = [], [], []
        basis = x = 0
        for t, term in enumerate(self.model.terms):
            own = sum(not p.linear for p in term.parameters)
            arguments = ", ".join(f"x[{x + j}]" for j in range(own)) or "0"
            name = term.lobe.name
            fields.append(f"{name}_constants t{t};")
            values.append(
                f"  {{ const {name}_parameters p = {{{arguments}}}; c.t{t} = {name}_prepare(p); }}"
            )
            calls.append(f"  {name}_basis(g, c->t{t}, basis + {basis});")
            basis += len(term.coefficients)
            x += own
        derivatives = [
            f"  if (j == {j}) out[{column}] = (plus[{k}] - minus[{k}]) * per_step;"
            for column, (k, j) in enumerate(self.derivatives)
        ]
        body = "\n".join(["  constants c;", *values, "  return c;", "}"])
        lines = [
            '#line 1 "generated"',
            f"#define N_BASIS {self.n_basis}",
            f"#define N_X {self.n_x}",
            f"typedef struct {{ {' '.join(fields)} }} constants;",
            f"static inline constants prepare(global const scalar *x) {{\n{body}",
            f"static inline constants prepare_private(const scalar *x) {{\n{body}",
            "static inline void evaluate_basis(const geometry g, const constants *c, real *basis) {",
            *calls,
            "}",
            "static inline void fill_derivatives(const int j, const real *plus,",
            "                                    const real *minus, const scalar per_step,",
            "                                    real *out) {",
            *derivatives,
            "}",
        ]
        return "\n".join(lines)

    @cached_property
    def values_source(self) -> str:
        """Text of the kernel that writes basis values."""
        return f"{self.text}\n{shared_text('values.cl')}"

    @cache  # noqa: B019 - programs live as long as the process
    def sums_source(
        self, *, metric: int, gram: bool, derivatives: bool, strided: bool, channel_x: bool = False
    ) -> str:
        """Text of a kernel of fused sums.

        Parameters
        ----------
        metric : int
            0 identity, 1 logarithm, 2 cube root.
        gram : bool
            Sum the Gram matrix and right-hand side too.
        derivatives : bool
            Append the derivatives along the nonlinear parameters to the columns.
        strided : bool
            Neighbouring work-items read neighbouring directions, as GPUs like it.
        channel_x : bool
            Each channel has nonlinear parameters of its own.
        """
        n_columns = self.n_basis + (len(self.derivatives) if derivatives else 0)
        defines: Sequence[tuple[str, int]] = [
            ("METRIC", metric),
            ("GRAM", int(gram)),
            ("DERIVATIVES", int(derivatives and self.n_x > 0)),
            ("N_COLUMNS", n_columns),
            ("BLOCK", BLOCK),
            ("STRIDED", int(strided)),
            ("CHANNEL_X", int(channel_x)),
        ]
        lines = "\n".join(f"#define {name} {value}" for name, value in defines)
        return f"{self.text}\n{lines}\n{shared_text('sums.cl')}"


@cache
def model_program(model: Model) -> ModelProgram:
    """Give the program of a model; the same object for the same model."""
    return ModelProgram(model)
