"""The limits of the store as options of a command line, from one process to the next."""

from __future__ import annotations

import argparse
from dataclasses import fields

from lobefit.service.rows import Limits

__all__ = ["add_limits", "limits_arguments", "limits_of"]

_TYPES = {"int": int, "float": float, "int | None": int}


def add_limits(parser: argparse.ArgumentParser) -> None:
    """Add an option for each of `Limits`."""
    for f in fields(Limits):
        name = f"--{f.name.replace('_', '-')}"
        parser.add_argument(name, type=_TYPES[str(f.type)], default=f.default)


def limits_of(given: argparse.Namespace) -> Limits:
    """Read the options."""
    return Limits(**{f.name: getattr(given, f.name) for f in fields(Limits)})


def limits_arguments(limits: Limits) -> list[str]:
    """Write the options that differ from the defaults."""
    return [
        f"--{f.name.replace('_', '-')}={getattr(limits, f.name)}"
        for f in fields(Limits)
        if getattr(limits, f.name) != f.default
    ]
