"""Packages that load lazily offer the same names as if they did not."""

from __future__ import annotations

import importlib
import pkgutil
import subprocess
import sys
from types import FunctionType, ModuleType

import pytest

PACKAGES = ("lobefit.kernels", "lobefit.fitting", "lobefit.service")
# Names that are also those of submodules.
TRAPS = [
    f"{package}.{found.name}"
    for package in PACKAGES
    for found in pkgutil.iter_modules(importlib.import_module(package).__path__)
    if found.name in importlib.import_module(package).__all__
]


@pytest.mark.parametrize("package", PACKAGES)
def test_every_name_is_found(package: str) -> None:
    module = importlib.import_module(package)
    for name in module.__all__:
        assert not isinstance(getattr(module, name), ModuleType), name
        assert name in dir(module)
    with pytest.raises(AttributeError, match=r"has no attribute 'no_such_name'"):
        module.no_such_name  # noqa: B018


@pytest.mark.parametrize("order", ["submodule first", "name first"])
def test_a_function_is_not_replaced_by_its_submodule(order: str) -> None:
    """In a fresh interpreter: here the submodules were imported long ago."""
    assert {"lobefit.fitting.fit", "lobefit.kernels.models"} <= set(TRAPS)
    imports = "".join(f"import {path}\n" for path in TRAPS)
    names = "".join(f"from {path.rpartition('.')[0]} import {path[16:]}\n" for path in TRAPS)
    checks = "".join(f"assert callable({path}) and {path} is {path[16:]}\n" for path in TRAPS)
    script = imports + names if order == "submodule first" else names + imports
    done = subprocess.run(
        [sys.executable, "-c", script + checks], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr


def test_a_name_can_be_replaced_and_put_back(monkeypatch: pytest.MonkeyPatch) -> None:
    import lobefit.fitting

    with monkeypatch.context() as patch:
        patch.setattr("lobefit.fitting.fit", len)
        assert lobefit.fitting.fit is len  # type: ignore[comparison-overlap]
    assert isinstance(lobefit.fitting.fit, FunctionType)
    assert lobefit.fitting.fit.__module__ == "lobefit.fitting.fit"
