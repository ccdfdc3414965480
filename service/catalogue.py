"""Names of models in a request, checked against what the workers know before anything queues."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from difflib import get_close_matches
from itertools import islice
from typing import Any

from lobefit.service.problems import MOST_ERRORS, Problem, pointer

__all__ = ["check_models"]

Items = Sequence[Mapping[str, Any]]


def check_models(
    items: Items,
    names: Iterable[tuple[str, Sequence[str | int]]],
    options: Iterable[tuple[Mapping[str, str], Sequence[str | int]]],
) -> None:
    """Refuse models, variants and options that do not exist.

    Parameters
    ----------
    items : sequence of mapping
        The catalogue: name, variants (with the model's name in front), options and their choices.
    names : iterable of (str, path)
        Candidates such as ``ggx``, ``ggx:k_s=1`` or ``ggx+phong``, each with its place in the body.
    options : iterable of (mapping of str to str, path)
        Choices of the models, each with its place in the body.

    Raises
    ------
    Problem
        "unknown-model" or "invalid-request", with pointers.
    """
    known = {item["name"]: item for item in items}
    _refuse(
        "unknown-model",
        ((place, detail) for name, place in names if (detail := _unknown(name, known))),
    )
    choices: dict[str, set[str]] = {}
    for item in items:
        for option, allowed in item.get("options", {}).items():
            choices.setdefault(option, set()).update(allowed)
    _refuse(
        "invalid-request",
        (
            ((*place, option), detail)
            for given, place in options
            for option, choice in given.items()
            if (detail := _impossible(option, choice, choices))
        ),
    )


def _refuse(slug: str, found: Iterable[tuple[Sequence[str | int], str]]) -> None:
    """Raise a problem where anything is found; what comes after many errors is not looked at."""
    errors = [
        {"pointer": pointer(place), "detail": detail}
        for place, detail in islice(found, MOST_ERRORS)
    ]
    if errors:
        raise Problem(slug, errors[0]["detail"], errors=errors)


def _impossible(option: str, choice: str, choices: Mapping[str, set[str]]) -> str:
    """Say what is wrong with a choice; nothing where there is such a one."""
    if option not in choices:
        return f"no model has the option {option!r}; there are {_listed(choices)}"
    if choice not in choices[option]:
        return f"{option} is one of {_listed(choices[option])}, not {choice!r}"
    return ""


def _unknown(name: str, known: Mapping[str, Mapping[str, Any]]) -> str:
    """Say what is wrong with a candidate's name; nothing where it is known."""
    base, colon, variant = name.partition(":")
    for part in base.split("+"):
        if part not in known:
            near = get_close_matches(part, known, n=1, cutoff=0.4)
            hint = f"did you mean {near[0]!r}? " if near else ""
            return f"no model is called {part!r}; {hint}known are {_listed(known)}"
    if colon:
        variants = known.get(base, {}).get("variants", [])
        if name not in variants:
            near = get_close_matches(variant, [v.partition(":")[2] for v in variants], n=1)
            hint = f"; did you mean {base}:{near[0]}?" if near else ""
            return (
                f"{base} has no variant {variant!r}{hint} Its variants: "
                f"{', '.join(variants) or 'none'}"
            )
    return ""


def _listed(names: Iterable[str]) -> str:
    return ", ".join(sorted(names))
