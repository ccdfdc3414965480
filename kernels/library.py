"""The closed schema of a reflectance lobe: the record that a model file declares.

A *lobe* is two files, ``models/NAME.py`` (this record, with the manual page as
its docstring) and ``models/NAME.cl`` (the formula as basis functions). What is
evaluated and fitted is a *model* (`lobefit.kernels.registry`): lobes that are
summed, the diffuse term among them::

    f(channel) = sum_k c_k(channel) b_k(wi, wo; x)

The coefficients ``c_k`` are products of linear parameters and the basis values
``b_k`` depend on the nonlinear parameters ``x`` only.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from importlib.resources import files
from itertools import product
from typing import Literal

from lobefit.kernels.errors import ModelError

__all__ = ["SETS", "Choice", "Lobe", "Parameter", "Reference", "Variant"]

SETS = ("quick", "standard", "all")


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
    scale : {"linear", "log", "root"}
        The scale on which a nonlinear parameter is scanned and searched; "root" is
        the square root, for one whose small values matter and that may be 0.
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
    scale: Literal["linear", "log", "root"] = "linear"
    period: float | None = None
    nodes: int = 0

    def check(self, lobe: str) -> None:
        """Raise a `ModelError` where the row contradicts itself."""
        low, high = self.bounds
        problem = None
        if self.scale not in ("linear", "log", "root"):
            problem = f"has the scale {self.scale!r}, not linear, log or root"
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
        elif self.scale == "root" and low < 0.0:
            problem = "has a scale of roots and a negative lower bound"
        elif not self.unit or not self.meaning:
            problem = "lacks a unit or a meaning"
        if problem:
            raise ModelError(f"models/{lobe}.py: parameter {self.name} {problem}")


@dataclass(frozen=True, slots=True, kw_only=True)
class Choice:
    """What one choice of an option brings to a lobe, such as Schlick's F0.

    Attributes
    ----------
    parameters : tuple of Parameter
        Placed between the lobe's own linear and nonlinear parameters.
    factors : tuple of tuple of str
        Every coefficient of the lobe, but for a k_d alone (a diffuse base of its own),
        is multiplied by each of these, so that one basis function becomes as many as
        there are factors; () is a factor 1.
    """

    parameters: tuple[Parameter, ...] = ()
    factors: tuple[tuple[str, ...], ...] = ((),)


@dataclass(frozen=True, slots=True, kw_only=True)
class Reference:
    """A value of the model that another source gives; angles in degrees, value in 1/sr."""

    params: Mapping[str, float]
    options: Mapping[str, str] = field(default_factory=dict)
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
        Parameters held at a value; also k_d of the diffuse term that is added.
    tied : mapping of str to str
        Parameters that follow another one, as in ``{"alpha_y": "alpha_x"}``.
    options : mapping of str to str
        Choices that the variant is compiled with.
    isotropic : bool
        The variant needs no azimuthal evidence although the full model does.
    sets : tuple of str or None
        Candidate sets it belongs to; None for those of the model.
    """

    name: str
    fixed: Mapping[str, float] = field(default_factory=dict)
    tied: Mapping[str, str] = field(default_factory=dict)
    options: Mapping[str, str] = field(default_factory=dict)
    isotropic: bool = True
    sets: tuple[str, ...] | None = None


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
        Whether the diffuse term `lambert` is added to it; False for a diffuse term
        and for a lobe that has its own.
    reciprocal, isotropic : bool
        Properties that the tests hold the lobe to.
    sets : tuple of str
        Candidate sets that the model belongs to ("quick", "standard", "all"); none
        for one that is fitted only where it is named.
    partners : mapping of str to tuple of str
        Lobes whose sum with this one is a candidate, and of which sets.
    options : mapping of str to tuple of str
        Pieces the lobe can be compiled with; the first is the default.
    choices : mapping of str to Choice
        What a choice brings with it; one that is not listed brings nothing.
    variants : tuple of Variant
        Restricted forms that are candidates of their own.
    axes : tuple of str or None
        Names of (alpha_x, alpha_y, phi_x) of an anisotropic lobe, kept in the
        order alpha_x >= alpha_y so that labels are unique.
    peaks : tuple of str
        Where the lobe may be narrow: about the "mirror" direction, "back" towards the
        light, or both. Quadratures follow it.
    edge : str or None
        The parameter that is the angle from the mirror direction where the lobe ends
        abruptly, if it does.
    uses : tuple of str
        Shared pieces of ``cl/`` that the formula needs, in order.
    formula : str
        The formula's text, of a term that is no model and has no file.
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
    partners: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    options: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    choices: Mapping[str, Choice] = field(default_factory=dict)
    variants: tuple[Variant, ...] = ()
    axes: tuple[str, str, str] | None = None
    peaks: tuple[str, ...] = ("mirror",)
    edge: str | None = None
    uses: tuple[str, ...] = ()
    formula: str = ""

    def chosen(self, options: Mapping[str, str]) -> Lobe:
        """Give the lobe with one choice for each of its options.

        Parameters
        ----------
        options : mapping of str to str
            Choices; the first of the record where left out. Others are ignored.

        Returns
        -------
        Lobe
            Its parameters and coefficients include what the choices bring.
        """
        picked = {key: options.get(key, allowed[0]) for key, allowed in self.options.items()}
        brought = [self.choices[name] for name in picked.values() if name in self.choices]
        coefficients = self.coefficients
        for choice in brought:
            coefficients = tuple(
                c + f for c in coefficients for f in (((),) if c == ("k_d",) else choice.factors)
            )
        return replace(
            self,
            parameters=(
                *(p for p in self.parameters if p.linear),
                *(p for choice in brought for p in choice.parameters),
                *(p for p in self.parameters if not p.linear),
            ),
            coefficients=coefficients,
            options={key: (name,) for key, name in picked.items()},
            choices={},
        )

    def forms(self) -> Iterator[Lobe]:
        """Give the lobe with every combination of its options."""
        for names in product(*self.options.values()):
            yield self.chosen(dict(zip(self.options, names, strict=True)))

    def check(self) -> None:
        """Raise a `ModelError` that names the file where the record is inconsistent."""
        problems = [
            (len(self.references) < 3, "has fewer than three reference values"),
            (
                not {*self.sets, *(s for v in self.variants for s in v.sets or ())} <= set(SETS)
                or not {s for sets in self.partners.values() for s in sets} <= set(SETS),
                f"belongs to an unknown set; known are {SETS}",
            ),
            (
                not self.peaks or not set(self.peaks) <= {"mirror", "back"},
                "has its peak neither about the mirror direction nor back",
            ),
            (
                len({v.name for v in self.variants}) < len(self.variants),
                "names a variant twice",
            ),
            (any(not choices for choices in self.options.values()), "has an option of no choice"),
            (
                not set(self.choices) <= {n for names in self.options.values() for n in names},
                "says what a choice brings that it does not have",
            ),
            (
                any(
                    value not in self.options.get(key, ())
                    for chosen in (
                        *(r.options for r in self.references),
                        *(v.options for v in self.variants),
                    )
                    for key, value in chosen.items()
                ),
                "has a variant or a reference value with an option that it does not declare",
            ),
            (
                any(not (files("lobefit.kernels") / "cl" / u).is_file() for u in self.uses),
                "uses a shared piece that cl/ does not have",
            ),
        ]
        self._complain(problems)
        for form in self.forms():
            form._check_form()
        for reference in self.references:
            names = {p.name for p in self.chosen(reference.options).parameters}
            if not set(reference.params) <= {*names, "k_d"}:
                text = "has a reference value with a parameter that it does not declare"
                self._complain([(True, text)])
        for variant in self.variants:
            self.chosen(variant.options)._check_variant(variant)

    def _check_form(self) -> None:
        """Check parameters and coefficients, with the options chosen."""
        for parameter in self.parameters:
            parameter.check(self.name)
        names = [p.name for p in self.parameters]
        linear = {p.name for p in self.parameters if p.linear}
        alone = {c[0] for c in self.coefficients if len(c) == 1}
        bounds = {p.name: p.bounds for p in self.parameters}
        self._complain(
            [
                (len(set(names)) < len(names), "names a parameter twice"),
                (not self.coefficients, "declares no basis function"),
                (
                    {n for c in self.coefficients for n in c} != linear,
                    "has coefficients that do not use exactly its linear parameters",
                ),
                (
                    # A ratio such as F0 is found as c_a / c_b, so its scale must stand alone.
                    any(
                        len(c) > 2 or (len(c) == 2 and c[0] not in alone) for c in self.coefficients
                    ),
                    "has a product coefficient whose first factor is no coefficient by itself",
                ),
                (
                    self.diffuse and "k_d" in names,
                    "has a k_d of its own beside the diffuse term",
                ),
                (
                    any(
                        bounds.get(c[1], (0.0,))[0] != 0.0 for c in self.coefficients if len(c) == 2
                    ),
                    "has a ratio whose lower bound is not 0",
                ),
                (
                    self.axes is not None and not set(self.axes) <= set(names),
                    "names axes that are not its parameters",
                ),
                (
                    self.edge is not None and self.edge not in names,
                    "has its edge at what is not its parameter",
                ),
            ]
        )

    def _check_variant(self, variant: Variant) -> None:
        """Check a variant against the lobe with the variant's options chosen."""
        known = {p.name: p for p in self.parameters}
        # The diffuse term that is added can be left out: its k_d held at 0.
        fixable = {"k_d": (0.0, math.inf)} if self.diffuse else {}
        fixable |= {name: p.bounds for name, p in known.items()}
        tied = {*variant.tied, *variant.tied.values()}
        self._complain(
            [
                (
                    not (tied <= set(known) and set(variant.fixed) <= set(fixable)),
                    "has a variant of a parameter that it does not declare",
                ),
                (
                    any(
                        not fixable[n][0] <= value <= fixable[n][1]
                        for n, value in variant.fixed.items()
                        if n in fixable
                    ),
                    "has a variant that holds a parameter outside its bounds",
                ),
                (
                    any(known[n].linear for n in tied if n in known),
                    "has a variant that ties linear parameters, which the solution cannot",
                ),
            ]
        )

    def _complain(self, problems: list[tuple[bool, str]]) -> None:
        for wrong, text in problems:
            if wrong:
                raise ModelError(f"models/{self.name}.py {text}")
