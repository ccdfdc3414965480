"""Candidates: what is fitted. A model, or a restricted form of it such as ``ggx:k_s=1``."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from difflib import get_close_matches

import numpy as np
from numpy.typing import NDArray

from lobefit.kernels.errors import ModelError
from lobefit.kernels.library import SETS, Parameter
from lobefit.kernels.registry import Model, get_model, models

__all__ = ["Candidate", "candidate", "candidates"]

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Candidate:
    """A model with some parameters held or tied, ready to be fitted.

    Attributes
    ----------
    name : str
        ``model`` or ``model:variant``.
    model : Model
        The full model.
    fixed : mapping of str to float
        Parameters held at a value.
    tied : mapping of str to str
        Parameters that follow another.
    isotropic : bool
        Whether only the difference of the azimuths matters.
    """

    name: str
    model: Model
    fixed: Mapping[str, float] = field(default_factory=dict)
    tied: Mapping[str, str] = field(default_factory=dict)
    isotropic: bool = True

    @property
    def searched(self) -> tuple[Parameter, ...]:
        """Nonlinear parameters that are free."""
        return tuple(
            p for p in self.model.nonlinear if p.name not in self.fixed and p.name not in self.tied
        )

    @property
    def shared(self) -> tuple[Parameter, ...]:
        """Searched parameters with one value for all channels."""
        return tuple(p for p in self.searched if not p.per_channel)

    @property
    def own(self) -> tuple[Parameter, ...]:
        """Searched parameters of which each channel has its own."""
        return tuple(p for p in self.searched if p.per_channel)

    @property
    def solved(self) -> tuple[Parameter, ...]:
        """Linear parameters that are free."""
        return tuple(p for p in self.model.linear if p.name not in self.fixed)

    @property
    def descending(self) -> tuple[tuple[str, str], ...]:
        """Pairs of searched parameters whose first is the larger one, so that labels are unique."""
        searched = {p.name for p in self.searched}
        pairs = [axes[:2] for axes in self.model.axes if set(axes) <= searched]
        if self.model.ordered is not None:
            pairs.append(self.model.ordered[::-1])
        return tuple((a, b) for a, b in pairs)

    def choose(self, options: Mapping[str, str]) -> Candidate:
        """Give the candidate compiled with other choices, those that its model knows.

        Raises
        ------
        ModelError
            The model has the option but not the choice.
        """
        known = {key: value for key, value in options.items() if key in self.model.allowed}
        return candidate(self.name, known) if known else self

    def n_parameters(self, channels: int) -> int:
        """Count the free parameters for so many channels."""
        return sum(channels if p.per_channel else 1 for p in (*self.searched, *self.solved))

    def expand(self, free: Array) -> Array:
        """Turn values of `searched`, shape (..., n), into all nonlinear parameters."""
        column = {p.name: free[..., k] for k, p in enumerate(self.searched)}
        full = []
        for p in self.model.nonlinear:
            if p.name in self.fixed:
                full.append(np.full(free.shape[:-1], self.fixed[p.name]))
            else:
                full.append(column[self.tied.get(p.name, p.name)])
        return np.stack(full, axis=-1) if full else np.zeros((*free.shape[:-1], 0))


def candidate(name: str, options: Mapping[str, str] | None = None) -> Candidate:
    """Give the candidate of that name.

    Parameters
    ----------
    name : str
        ``ggx``, ``ggx:k_s=1``, ``ward:isotropic``, ``ggx+ggx``, ...
    options : mapping of str to str, optional
        Choices the model is compiled with; those of a variant come first.

    Raises
    ------
    ModelError
        No such model, variant, option or choice.
    """
    base, _, variant = name.partition(":")
    model = get_model(base, options)
    if not variant:
        return Candidate(base, model, isotropic=model.isotropic)
    known = {v.name: v for v in model.variants}
    if variant not in known:
        near = get_close_matches(variant, known, n=1)
        hint = f"; did you mean {base}:{near[0]}?" if near else ""
        listed = ", ".join(f"{base}:{v}" for v in known) or "none"
        raise ModelError(f"{base} has no variant {variant!r}{hint} Its variants: {listed}")
    v = known[variant]
    return Candidate(name, model.choose(v.options), v.fixed, v.tied, v.isotropic)


def _names(which: str) -> list[str]:
    """Give the names of a set: models, their variants, and sums with their partners."""
    names = []
    for name, model in models().items():
        if which in model.sets:
            names.append(name)
        for v in model.variants:
            if which in (model.sets if v.sets is None else v.sets):
                names.append(f"{name}:{v.name}")
        names += [
            f"{name}+{partner}" for partner, sets in model.lobe.partners.items() if which in sets
        ]
    return names


def candidates(which: str | Sequence[str]) -> list[Candidate]:
    """Give the candidates of a set, or those listed.

    Parameters
    ----------
    which : str or sequence of str
        "quick", "standard" or "all" (the models, variants and sums of that set),
        one name, names separated by commas, or a list of names.

    Raises
    ------
    ModelError
        Unknown names, or none at all.
    """
    if isinstance(which, str) and which in SETS:
        names = _names(which)
    else:
        names = which.split(",") if isinstance(which, str) else list(which)
    names = list(dict.fromkeys(n.strip() for n in names if n.strip()))
    if not names:
        raise ModelError(f"no model was named; give names or a set ({', '.join(SETS)})")
    return [candidate(name) for name in names]
