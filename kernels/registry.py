"""Models: what is evaluated and fitted, found by file name or put together from a sum's name."""

from __future__ import annotations

import importlib
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from difflib import get_close_matches
from functools import cache, cached_property
from importlib.resources import files

from lobefit.kernels.errors import ModelError
from lobefit.kernels.library import Lobe, Parameter, Variant

__all__ = ["Model", "Term", "get_model", "models"]

# Imported now, so that the package lobefit.kernels.models cannot take the place of
# the function `models` in lobefit.kernels later.
importlib.import_module("lobefit.kernels.models")

PAGE_SECTIONS = ("Formula", "Convention", "Domain", "Source", "Verified against")


@dataclass(frozen=True, eq=False)
class Term:
    """A lobe in a sum, its options chosen and its parameters renamed.

    Attributes
    ----------
    lobe : Lobe
        With its options chosen.
    suffix : str
        Put behind the names of its parameters, where a sum has two lobes.
    """

    lobe: Lobe
    suffix: str = ""

    @cached_property
    def parameters(self) -> tuple[Parameter, ...]:
        """The lobe's parameters under the names that they have in the sum."""
        return tuple(replace(p, name=p.name + self.suffix) for p in self.lobe.parameters)

    @cached_property
    def coefficients(self) -> tuple[tuple[str, ...], ...]:
        """The lobe's coefficients, with those names."""
        return tuple(tuple(n + self.suffix for n in c) for c in self.lobe.coefficients)

    @property
    def edge(self) -> str | None:
        """Name of the angle from the mirror direction where the lobe ends, if it does."""
        return None if self.lobe.edge is None else self.lobe.edge + self.suffix

    @property
    def axes(self) -> tuple[str, str, str] | None:
        """Names of (alpha_x, alpha_y, phi_x), where the lobe is anisotropic."""
        if self.lobe.axes is None:
            return None
        x, y, phi = self.lobe.axes
        return (x + self.suffix, y + self.suffix, phi + self.suffix)


@dataclass(frozen=True, eq=False)
class Model:
    """A BRDF that can be evaluated and fitted: the sum of its terms.

    Attributes
    ----------
    name : str
        A registered name, or several joined by "+".
    terms : tuple of Term
        What is summed, the diffuse term first.
    records : tuple of Lobe
        The records that give the model its name, their options open.
    page : str
        The manual page.
    """

    name: str
    terms: tuple[Term, ...]
    records: tuple[Lobe, ...]
    page: str = field(repr=False)

    @property
    def lobe(self) -> Lobe:
        """The record that gives the model its name; the first one of a sum."""
        return self.records[0]

    @cached_property
    def parameters(self) -> tuple[Parameter, ...]:
        """Parameters of all terms, the diffuse term's first."""
        return tuple(p for term in self.terms for p in term.parameters)

    @cached_property
    def linear(self) -> tuple[Parameter, ...]:
        """Parameters that the BRDF is linear in."""
        return tuple(p for p in self.parameters if p.linear)

    @cached_property
    def nonlinear(self) -> tuple[Parameter, ...]:
        """Parameters that are searched for, in the order of the kernel's arguments."""
        return tuple(p for p in self.parameters if not p.linear)

    @cached_property
    def coefficients(self) -> tuple[tuple[str, ...], ...]:
        """For each basis function the linear parameters whose product multiplies it."""
        return tuple(c for term in self.terms for c in term.coefficients)

    @property
    def options(self) -> dict[str, str]:
        """The choices that the model is compiled with."""
        return {key: c[0] for term in self.terms for key, c in term.lobe.options.items()}

    @property
    def allowed(self) -> dict[str, tuple[str, ...]]:
        """For each option the choices that all its lobes have, the default first."""
        found: dict[str, tuple[str, ...]] = {}
        for record in self.records:
            for key, choices in record.options.items():
                common = found.get(key, choices)
                found[key] = tuple(c for c in common if c in choices)
        return found

    @property
    def variants(self) -> tuple[Variant, ...]:
        """Restricted forms; a sum has none."""
        return self.lobe.variants if len(self.records) == 1 else ()

    @cached_property
    def ordered(self) -> tuple[str, str] | None:
        """Parameters kept in ascending order where two lobes are alike and could switch."""
        terms = [term for term in self.terms if term.suffix]
        if len(terms) < 2 or terms[0].lobe.name != terms[1].lobe.name:
            return None
        own = next(p.name for p in self.records[-1].parameters if not p.linear)
        return (own + terms[0].suffix, own + terms[1].suffix)

    @property
    def axes(self) -> tuple[tuple[str, str, str], ...]:
        """Names of (alpha_x, alpha_y, phi_x) of each anisotropic term."""
        return tuple(term.axes for term in self.terms if term.axes is not None)

    @property
    def title(self) -> str:
        """One line that says what the model is."""
        return " + ".join(r.title for r in self.records)

    @property
    def convention(self) -> str:
        """The normalisation by name."""
        return "; ".join(dict.fromkeys(r.convention for r in self.records))

    @property
    def source(self) -> str:
        """Paper and equation."""
        return "; ".join(dict.fromkeys(r.source for r in self.records))

    @property
    def energy(self) -> str:
        """For which parameters energy is conserved."""
        if len(self.records) == 1:
            return self.lobe.energy
        return "; ".join(f"{r.name}: {r.energy}" for r in self.records)

    @property
    def reciprocal(self) -> bool:
        """Whether f(i, o) = f(o, i)."""
        return all(term.lobe.reciprocal for term in self.terms)

    @property
    def isotropic(self) -> bool:
        """Whether only the difference of the azimuths matters."""
        return all(term.lobe.isotropic for term in self.terms)

    @property
    def sets(self) -> tuple[str, ...]:
        """Candidate sets that the model belongs to."""
        if len(self.records) == 1:
            return self.lobe.sets
        first, *others = self.records
        return first.partners.get("+".join(r.name for r in others), ())

    def choose(self, options: Mapping[str, str] | None) -> Model:
        """Give the model compiled with other choices, such as ``{"fresnel": "conductor"}``.

        Raises
        ------
        ModelError
            An option or choice that the model does not have.
        """
        return get_model(self.name, {**self.options, **options}) if options else self


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
def _lobes() -> dict[str, tuple[Lobe, str]]:
    folder = files("lobefit.kernels") / "models"
    names = sorted(
        entry.name.removesuffix(".py")
        for entry in folder.iterdir()
        if entry.name.endswith(".py") and not entry.name.startswith("_")
    )
    return {name: _load_lobe(name) for name in names}


@cache
def _chosen(name: str, options: tuple[tuple[str, str], ...]) -> Lobe:
    """Give a lobe with its options chosen; the same object for the same choices."""
    return _lobes()[name][0].chosen(dict(options))


def _pick(records: tuple[Lobe, ...], name: str, options: Mapping[str, str]) -> None:
    """Raise a `ModelError` for an option or choice that no lobe of the sum has."""
    for key, value in options.items():
        having = [r for r in records if key in r.options]
        if not having:
            known = ", ".join(dict.fromkeys(k for r in records for k in r.options)) or "none"
            raise ModelError(f"{name} has no option {key!r}; its options: {known}")
        for record in having:
            if value not in record.options[key]:
                allowed = ", ".join(record.options[key])
                raise ModelError(f"{record.name} has no {key} {value!r}; it can be {allowed}")


@cache
def _build(name: str, options: tuple[tuple[str, str], ...]) -> Model:
    """Sum the lobes of a name; the diffuse term is added where no lobe brings one."""
    names = name.split("+")
    records = tuple(_lobes()[n][0] for n in names)
    _pick(records, name, dict(options))
    own = tuple(n for n in names if not _lobes()[n][0].diffuse)
    lobes = tuple(n for n in names if _lobes()[n][0].diffuse)
    if len(lobes) > 2 or len(own) > 1:
        raise ModelError(
            f"{name}: a sum is of at most two lobes and one diffuse term; "
            "the diffuse term lambert is there without being named"
        )
    terms: list[Term] = []
    for n in (*(own or ("lambert",)), *lobes):
        suffix = f"_{lobes.index(n) + 1}" if len(lobes) == 2 and n in lobes else ""
        if suffix and any(t.suffix == suffix for t in terms):  # the same lobe once more
            suffix = "_2"
        known = _lobes()[n][0].options
        terms.append(Term(_chosen(n, tuple((k, v) for k, v in options if k in known)), suffix))
    twice = [n for n, c in Counter(p.name for t in terms for p in t.parameters).items() if c > 1]
    if twice:
        raise ModelError(f"{name}: its terms share the parameter {twice[0]!r} and cannot be summed")
    page = _lobes()[names[0]][1]
    if len(names) > 1:
        page = f"{name}: a sum; see the pages of {' and '.join(dict.fromkeys(names))}."
    return Model(name, tuple(terms), records, page)


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
    for name, (lobe, _) in _lobes().items():
        unknown = [partner for partner in lobe.partners if partner not in _lobes()]
        if unknown:
            raise ModelError(f"models/{name}.py has a partner that is no model: {unknown[0]}")
    return {name: _build(name, ()) for name in _lobes()}


def get_model(name: str, options: Mapping[str, str] | None = None) -> Model:
    """Give the model of that name.

    Parameters
    ----------
    name : str
        A registered name, or a sum such as "ggx+ggx": two lobes at most and one
        diffuse term, lambert where none is named. The parameters of two lobes
        are told apart by ``_1`` and ``_2`` behind their names.
    options : mapping of str to str, optional
        Choices such as ``{"masking": "smith_separable"}``; the first of the
        record where left out.

    Raises
    ------
    ModelError
        No such model, option or choice; the message suggests the nearest names.
    """
    known = _lobes()
    names = [n.strip() for n in name.split("+")]
    for n in names:
        if n not in known:
            near = get_close_matches(n, known, n=1, cutoff=0.4)
            hint = f"did you mean {near[0]!r}? " if near else ""
            raise ModelError(f"no model is called {n!r}; {hint}Known are {', '.join(known)}")
    return _build("+".join(names), tuple(sorted((options or {}).items())))
