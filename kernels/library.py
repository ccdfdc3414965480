"""The closed schema of a reflectance model, and the discovery of models by file name.

A *lobe* is two files, ``models/NAME.py`` (this record, with the manual page as
its docstring) and ``models/NAME.cl`` (the formula as basis functions). A
*model* is what is evaluated and fitted: a lobe together with the diffuse term,
or the diffuse term alone::

    f(channel) = sum_k c_k(channel) b_k(wi, wo; x)

The coefficients ``c_k`` are products of linear parameters and the basis values
``b_k`` depend on the nonlinear parameters ``x`` only.
"""

from __future__ import annotations

import importlib
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from difflib import get_close_matches
from functools import cache
from importlib.resources import files
from typing import Literal

from lobefit.kernels.errors import ModelError

__all__ = ["SETS", "Lobe", "Model", "Parameter", "Reference", "Variant", "get_model", "models"]

# Imported now, so that the package lobefit.kernels.models cannot take the place of
# the function `models` in lobefit.kernels later.
importlib.import_module("lobefit.kernels.models")

SETS = ("quick", "standard", "all")
PAGE_SECTIONS = ("Formula", "Convention", "Domain", "Source", "Verified against")


@dataclass(frozen=True, slots=True, kw_only=True)
class Parameter:
    """One parameter of a lobe.

    Attributes
    ----------
    name, unit, meaning : str
        Symbol of the literature, unit ("1" for none), and one line of physics.
    bounds : tuple of float
        Legal range, both ends included; ``inf`` is allowed for linear parameters.
    default : float
        Used where a call leaves the parameter out.
    linear : bool
        The BRDF is linear in it (solved exactly), else it is searched for.
    per_channel : bool
        One value per channel instead of one for all.
    scale : {"linear", "log"}
        The scale on which a nonlinear parameter is scanned and searched.
    period : float or None
        Period of an angle; its bounds then span one period.
    nodes : int
        Nodes of the start scan along a nonlinear parameter.
    """

    name: str
    unit: str
    meaning: str
    bounds: tuple[float, float]
    default: float
    linear: bool = False
    per_channel: bool = False
    scale: Literal["linear", "log"] = "linear"
    period: float | None = None
    nodes: int = 0

    def check(self, lobe: str) -> None:
        """Raise a `ModelError` where the row contradicts itself."""
        low, high = self.bounds
        problem = None
        if self.scale not in ("linear", "log"):
            problem = f"has the scale {self.scale!r}, not linear or log"
        elif not low < high:
            problem = f"has the empty range {self.bounds}"
        elif not low <= self.default <= high:
            problem = f"has its default {self.default} outside its bounds {self.bounds}"
        elif not self.linear and not (math.isfinite(low) and math.isfinite(high)):
            problem = "is nonlinear and needs finite bounds, for the scan"
        elif not self.linear and self.nodes < 2:
            problem = "is nonlinear and needs at least 2 scan nodes"
        elif self.scale == "log" and low <= 0.0:
            problem = "has a logarithmic scale and a lower bound that is not positive"
        elif not self.unit or not self.meaning:
            problem = "lacks a unit or a meaning"
        if problem:
            raise ModelError(f"models/{lobe}.py: parameter {self.name} {problem}")


@dataclass(frozen=True, slots=True, kw_only=True)
class Reference:
    """A value of the model that another source gives; angles in degrees, value in 1/sr."""

    params: Mapping[str, float]
    theta_i: float
    phi_i: float
    theta_o: float
    phi_o: float
    value: float
    source: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Variant:
    """A restricted form of a model that is a candidate of its own.

    Attributes
    ----------
    name : str
        Written behind the model's name, as in ``ggx:k_s=1``.
    fixed : mapping of str to float
        Parameters held at a value.
    tied : mapping of str to str
        Parameters that follow another one, as in ``{"alpha_y": "alpha_x"}``.
    isotropic : bool
        The variant needs no azimuthal evidence although the full model does.
    """

    name: str
    fixed: Mapping[str, float] = field(default_factory=dict)
    tied: Mapping[str, str] = field(default_factory=dict)
    isotropic: bool = True


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Lobe:
    """The record that a model file declares as ``LOBE``; no other field exists.

    Attributes
    ----------
    name : str
        The file's name without its ending.
    title, convention, source, energy : str
        One line each: what it is; its normalisation by name; paper and
        equation; for which parameters energy is conserved.
    parameters : tuple of Parameter
        The lobe's own parameters, in the order of the C struct.
    coefficients : tuple of tuple of str
        For each basis function of the ``.cl`` file the linear parameters whose
        product is its coefficient; empty for a basis with coefficient 1.
    diffuse : bool
        Whether a model of this name carries the diffuse term `lambert` too.
    reciprocal, isotropic : bool
        Properties that the tests hold the lobe to.
    sets : tuple of str
        Candidate sets that the model belongs to ("quick", "standard", "all").
    options : mapping of str to tuple of str
        Pieces the lobe can be compiled with; the first is the default.
    variants : tuple of Variant
        Restricted forms that are candidates of their own.
    axes : tuple of str or None
        Names of (alpha_x, alpha_y, phi_x) of an anisotropic lobe, kept in the
        order alpha_x >= alpha_y so that labels are unique.
    uses : tuple of str
        Shared pieces of ``cl/`` that the formula needs, in order.
    references : tuple of Reference
        At least three values from elsewhere.
    """

    name: str
    title: str
    convention: str
    source: str
    energy: str
    parameters: tuple[Parameter, ...]
    coefficients: tuple[tuple[str, ...], ...]
    reciprocal: bool
    isotropic: bool
    references: tuple[Reference, ...]
    diffuse: bool = True
    sets: tuple[str, ...] = ("standard", "all")
    options: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    variants: tuple[Variant, ...] = ()
    axes: tuple[str, str, str] | None = None
    uses: tuple[str, ...] = ()

    def check(self) -> None:
        """Raise a `ModelError` that names the file where the record is inconsistent."""
        for parameter in self.parameters:
            parameter.check(self.name)
        names = [p.name for p in self.parameters]
        linear = {p.name for p in self.parameters if p.linear}
        alone = {c[0] for c in self.coefficients if len(c) == 1}
        bounds = {p.name: p.bounds for p in self.parameters}
        kind = {p.name: p.linear for p in self.parameters}
        forms = [v.name for v in self.variants]
        problems = [
            (len(set(names)) < len(names), "names a parameter twice"),
            (not self.coefficients, "declares no basis function"),
            (len(self.references) < 3, "has fewer than three reference values"),
            (not set(self.sets) <= set(SETS), f"belongs to an unknown set; known are {SETS}"),
            (
                {n for c in self.coefficients for n in c} != linear,
                "has coefficients that do not use exactly its linear parameters",
            ),
            (
                # A ratio such as F0 is found as c_a / c_b, so its scale must stand alone.
                any(len(c) > 2 or (len(c) == 2 and c[0] not in alone) for c in self.coefficients),
                "has a product coefficient whose first factor is no coefficient by itself",
            ),
            (
                any(not {*v.fixed, *v.tied, *v.tied.values()} <= set(names) for v in self.variants),
                "has a variant of a parameter that it does not declare",
            ),
            (
                any(
                    not bounds[n][0] <= value <= bounds[n][1]
                    for v in self.variants
                    for n, value in v.fixed.items()
                    if n in bounds
                ),
                "has a variant that holds a parameter outside its bounds",
            ),
            (
                any(kind.get(a) or kind.get(b) for v in self.variants for a, b in v.tied.items()),
                "has a variant that ties linear parameters, which the solution cannot",
            ),
            (len(set(forms)) < len(forms), "names a variant twice"),
            (self.diffuse and "k_d" in names, "has a k_d of its own beside the diffuse term"),
            (
                any(bounds[c[1]][0] != 0.0 for c in self.coefficients if len(c) == 2),
                "has a ratio whose lower bound is not 0",
            ),
            (
                any(not (files("lobefit.kernels") / "cl" / u).is_file() for u in self.uses),
                "uses a shared piece that cl/ does not have",
            ),
            (
                any(not set(r.params) <= {*names, "k_d"} for r in self.references),
                "has a reference value with a parameter that it does not declare",
            ),
            (
                self.axes is not None and not set(self.axes) <= set(names),
                "names axes that are not its parameters",
            ),
            (any(not choices for choices in self.options.values()), "has an option of no choice"),
        ]
        for wrong, text in problems:
            if wrong:
                raise ModelError(f"models/{self.name}.py {text}")


@dataclass(frozen=True, slots=True, eq=False)
class Model:
    """A BRDF that can be evaluated and fitted: the sum of its terms.

    Attributes
    ----------
    name : str
        Registered name.
    lobe : Lobe
        The record that gives the model its name.
    terms : tuple of Lobe
        What is summed, the diffuse term first.
    page : str
        The manual page.
    """

    name: str
    lobe: Lobe
    terms: tuple[Lobe, ...]
    page: str

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Parameters of all terms, the diffuse term's first."""
        return tuple(p for term in self.terms for p in term.parameters)

    @property
    def linear(self) -> tuple[Parameter, ...]:
        """Parameters that the BRDF is linear in."""
        return tuple(p for p in self.parameters if p.linear)

    @property
    def nonlinear(self) -> tuple[Parameter, ...]:
        """Parameters that are searched for, in the order of the kernel's arguments."""
        return tuple(p for p in self.parameters if not p.linear)

    @property
    def coefficients(self) -> tuple[tuple[str, ...], ...]:
        """For each basis function the linear parameters whose product multiplies it."""
        return tuple(c for term in self.terms for c in term.coefficients)

    @property
    def title(self) -> str:
        """One line that says what the model is."""
        return self.lobe.title

    @property
    def reciprocal(self) -> bool:
        """Whether f(i, o) = f(o, i)."""
        return all(term.reciprocal for term in self.terms)

    @property
    def isotropic(self) -> bool:
        """Whether only the difference of the azimuths matters."""
        return all(term.isotropic for term in self.terms)

    @property
    def sets(self) -> tuple[str, ...]:
        """Candidate sets that the model belongs to."""
        return self.lobe.sets


def _load_lobe(name: str) -> tuple[Lobe, str]:
    try:
        module = importlib.import_module(f"lobefit.kernels.models.{name}")
    except TypeError as error:  # the closed schema: an unknown or missing field
        raise ModelError(f"models/{name}.py breaks the schema of a model: {error}") from error
    except Exception as error:
        raise ModelError(f"models/{name}.py cannot be loaded: {error}") from error
    lobe = getattr(module, "LOBE", None)
    if not isinstance(lobe, Lobe) or lobe.name != name:
        raise ModelError(f"models/{name}.py must declare LOBE = Lobe(name={name!r}, ...)")
    lobe.check()
    page = (module.__doc__ or "").strip()
    missing = [s for s in PAGE_SECTIONS if f"\n{s}\n{'-' * len(s)}\n" not in page]
    if missing:
        raise ModelError(f"models/{name}.py: its manual page lacks {', '.join(missing)}")
    if not (files("lobefit.kernels") / "models" / f"{name}.cl").is_file():
        raise ModelError(f"models/{name}.py has no formula beside it: write models/{name}.cl")
    return lobe, page


@cache
def models() -> dict[str, Model]:
    """Give every registered model by name.

    Returns
    -------
    dict of str to Model
        In alphabetical order. Found by file name: ``models/NAME.py``.

    Raises
    ------
    ModelError
        A model file breaks the schema.
    """
    folder = files("lobefit.kernels") / "models"
    names = sorted(
        entry.name.removesuffix(".py")
        for entry in folder.iterdir()
        if entry.name.endswith(".py") and not entry.name.startswith("_")
    )
    loaded = {name: _load_lobe(name) for name in names}
    diffuse = (loaded["lambert"][0],)
    return {
        name: Model(name, lobe, (*(diffuse if lobe.diffuse else ()), lobe), page)
        for name, (lobe, page) in loaded.items()
    }


def get_model(name: str) -> Model:
    """Give the registered model of that name.

    Raises
    ------
    ModelError
        No such model; the message suggests the nearest names.
    """
    known = models()
    if name in known:
        return known[name]
    near = get_close_matches(name, known, n=1, cutoff=0.4)
    hint = f"did you mean {near[0]!r}? " if near else ""
    raise ModelError(f"no model is called {name!r}; {hint}Known are {', '.join(known)}")
