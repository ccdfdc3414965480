"""The OpenCL C text of a model: shared pieces, the terms' formulas, and the glue between them.

The glue is generated from the records, so that the order of parameters and
basis functions is written down once.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from importlib.resources import files

from lobefit.kernels.errors import ModelError
from lobefit.kernels.library import Lobe, Model

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

    Single precision also gets relaxed mathematics: reciprocals and roots by
    approximation and a Newton step, nearly twice as fast for GGX. The largest error
    against double stayed the same (1e-6 of the value for GGX; `make bench` shows it).
    """
    bits = 64 if precision == "double" else 32
    options = (f"-DWIDTH={width}", f"-DPRECISION={bits}", "-cl-mad-enable")
    if precision == "double":
        return options
    return (*options, "-cl-single-precision-constant", "-cl-fast-relaxed-math")


def _term_text(lobe: Lobe, options: Mapping[str, str]) -> str:
    own = [p for p in lobe.parameters if not p.linear]
    fields = " ".join(f"scalar {p.name};" for p in own) or "int unused;"
    formula = (files("lobefit.kernels") / "models" / f"{lobe.name}.cl").read_text(encoding="utf-8")
    chosen = [(key, options.get(key, allowed[0])) for key, allowed in lobe.options.items()]
    return "\n".join(
        [
            f"typedef struct {{ {fields} }} {lobe.name}_parameters;",
            *(f"#define OPTION_{key} {value}" for key, value in chosen),
            f'#line 1 "{lobe.name}.cl"',
            formula,
            '#line 1 "generated"',
            *(f"#undef OPTION_{key}" for key, _ in chosen),
        ]
    )


@dataclass(frozen=True)
class ModelProgram:
    """The generated program of one model with one choice of options.

    Attributes
    ----------
    model : Model
        What it evaluates.
    options : tuple of (str, str)
        The choices it is compiled with.
    """

    model: Model
    options: tuple[tuple[str, str], ...]

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
        uses = list(dict.fromkeys(u for term in self.model.terms for u in term.uses))
        distinct = list(dict.fromkeys(self.model.terms))
        parts = [shared_text("types.h"), shared_text("geometry.h"), *map(shared_text, uses)]
        parts += [_term_text(term, dict(self.options)) for term in distinct]
        return "\n".join([*parts, self._glue()])

    def _glue(self) -> str:
        fields, values, calls = [], [], []
        basis = x = 0
        for t, term in enumerate(self.model.terms):
            own = sum(not p.linear for p in term.parameters)
            arguments = ", ".join(f"x[{x + j}]" for j in range(own)) or "0"
            fields.append(f"{term.name}_constants t{t};")
            values.append(
                f"  {{ const {term.name}_parameters p = {{{arguments}}}; "
                f"c.t{t} = {term.name}_prepare(p); }}"
            )
            calls.append(f"  {term.name}_basis(g, c->t{t}, basis + {basis});")
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
    def sums_source(self, *, metric: int, gram: bool, derivatives: bool, strided: bool) -> str:
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
        """
        n_columns = self.n_basis + (len(self.derivatives) if derivatives else 0)
        defines: Sequence[tuple[str, int]] = [
            ("METRIC", metric),
            ("GRAM", int(gram)),
            ("DERIVATIVES", int(derivatives and self.n_x > 0)),
            ("N_COLUMNS", n_columns),
            ("BLOCK", BLOCK),
            ("STRIDED", int(strided)),
        ]
        lines = "\n".join(f"#define {name} {value}" for name, value in defines)
        return f"{self.text}\n{lines}\n{shared_text('sums.cl')}"


@cache
def _cached_program(model: Model, options: tuple[tuple[str, str], ...]) -> ModelProgram:
    return ModelProgram(model, options)


def model_program(model: Model, options: Mapping[str, str] | None = None) -> ModelProgram:
    """Give the program of a model.

    Parameters
    ----------
    model : Model
        What to evaluate.
    options : mapping of str to str, optional
        Choices such as ``{"masking": "smith_separable"}``; the record's first
        choice where left out.

    Raises
    ------
    ModelError
        An option or choice that the model does not have.
    """
    allowed = {key: choices for term in model.terms for key, choices in term.options.items()}
    for key, value in (options or {}).items():
        if key not in allowed:
            known = ", ".join(allowed) or "none"
            raise ModelError(f"{model.name} has no option {key!r}; its options: {known}")
        if value not in allowed[key]:
            raise ModelError(
                f"{model.name} has no {key} {value!r}; it can be {', '.join(allowed[key])}"
            )
    chosen = {key: (options or {}).get(key, choices[0]) for key, choices in allowed.items()}
    return _cached_program(model, tuple(sorted(chosen.items())))
