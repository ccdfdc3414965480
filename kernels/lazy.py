"""Packages that import their parts when they are asked for, so that a light client stays light."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from importlib import import_module
from types import ModuleType
from typing import Any

__all__ = ["load_lazily"]


def load_lazily(package: str, homes: Mapping[str, str]) -> None:
    """Let a package offer names that its submodules define, imported at their first use.

    A name may be that of its submodule too (``fit`` in ``lobefit.fitting.fit``): it is always
    what the submodule defines, also after somebody imported the submodule by its path.

    Parameters
    ----------
    package : str
        The ``__name__`` of the package, which is being imported.
    homes : mapping of str to str
        The submodule that defines each name.
    """

    class LazyPackage(ModuleType):
        """A package whose names are looked up in its submodules."""

        def __getattr__(self, name: str) -> Any:
            if name not in homes:
                raise AttributeError(f"module {package!r} has no attribute {name!r}")
            value = getattr(import_module(f"{package}.{homes[name]}"), name)
            super().__setattr__(name, value)  # the next look-up does not come here
            return value

        def __setattr__(self, name: str, value: Any) -> None:
            # The import system binds every submodule here; it must not take a name's place.
            if not (name in homes and isinstance(value, ModuleType)):
                super().__setattr__(name, value)

        def __dir__(self) -> list[str]:
            return sorted({*super().__dir__(), *homes})

    sys.modules[package].__class__ = LazyPackage
