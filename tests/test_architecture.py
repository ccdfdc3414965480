"""The rooms: imports go one way, importing does no work, and every module says what it offers."""

from __future__ import annotations

import ast
import importlib
import pkgutil
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

import lobefit

PACKAGE = Path(lobefit.__file__).parent
CHECKOUT = Path(__file__).parents[1]
# A room may import itself and what stands before it.
ROOMS = ("kernels", "fitting", "service")
# Folders of the checkout whose files must stay readable; data are no text to read.
READABLE = ("kernels", "fitting", "service", "src", "tests", "benchmarks", "samples", "docs")
SOURCE_ENDINGS = {".py", ".cl", ".h"}
MOST_LINES = 400


def modules_of(room: str) -> list[Path]:
    # Resolved, since a search does not follow the links of an editable install.
    return sorted((PACKAGE / room).resolve().rglob("*.py"))


def imported_rooms(source: str) -> Iterator[str]:
    """Give the rooms that a module imports anywhere, in functions and for types too."""
    for node in ast.walk(ast.parse(source)):
        names: list[str] = []
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, "imports are absolute here"
            names = [f"{node.module}.{alias.name}" for alias in node.names]
        elif isinstance(node, ast.Call) and "import_module" in ast.unparse(node.func):
            names = re.findall(r"lobefit\.\w+", ast.unparse(node))
        for name in names:
            parts = name.split(".")
            if parts[0] == "lobefit" and len(parts) > 1 and parts[1] in ROOMS:
                yield parts[1]


def everything() -> list[str]:
    return ["lobefit", *(m.name for m in pkgutil.walk_packages(lobefit.__path__, "lobefit."))]


def run(script: str) -> None:
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, timeout=60, check=False
    )
    assert done.returncode == 0, done.stderr


# Put before a script, this makes the named packages as if they were not installed.
BLOCK = """
import sys
class Blocked:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in {names!r}:
            raise ImportError(name + " must not be imported here")
sys.meta_path.insert(0, Blocked())
"""


@pytest.mark.parametrize(
    ("source", "rooms"),
    [
        ("import lobefit.service.cli", ["service"]),
        ("from lobefit import fitting, __version__", ["fitting"]),
        ("def f():\n    from lobefit.kernels.device import devices", ["kernels"]),
        ("import importlib\nimportlib.import_module(f'lobefit.kernels.models.{x}')", ["kernels"]),
        ("import numpy\nfrom lobefit import __version__", []),
    ],
)
def test_every_way_to_import_is_seen(source: str, rooms: list[str]) -> None:
    assert list(imported_rooms(source)) == rooms


@pytest.mark.parametrize("room", ROOMS)
def test_imports_go_one_way(room: str) -> None:
    allowed = set(ROOMS[: ROOMS.index(room) + 1])
    paths = modules_of(room)
    assert paths
    wrong = [
        f"{path.name} imports {other}"
        for path in paths
        for other in imported_rooms(path.read_text(encoding="utf-8"))
        if other not in allowed
    ]
    assert wrong == []


def test_the_root_imports_no_room() -> None:
    assert list(imported_rooms((PACKAGE / "__init__.py").read_text(encoding="utf-8"))) == []


def test_rooms_are_imported_by_their_full_name() -> None:
    """From the checkout's root a bare ``import kernels`` would load a second copy."""
    for room in ROOMS:
        for path in modules_of(room):
            for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
                if isinstance(node, ast.Import):
                    assert not {a.name.partition(".")[0] for a in node.names} & set(ROOMS)
                elif isinstance(node, ast.ImportFrom):
                    assert (node.module or "").partition(".")[0] not in ROOMS


def test_a_client_stays_light() -> None:
    heavy = ("pyopencl", "nlopt", "emcee", "numpy", "OpenEXR", "matplotlib")
    run(
        BLOCK.format(names=heavy)
        + "import lobefit, lobefit.service, lobefit.service.cli\n"
        + "assert not {'lobefit.kernels.registry', 'lobefit.fitting.fit'} & set(sys.modules)\n"
    )


def test_importing_does_no_device_work() -> None:
    """Without pyopencl the models can still be listed and a measurement be read."""
    run(
        BLOCK.format(names=("pyopencl",))
        + "import lobefit.fitting, lobefit.kernels\n"
        + "assert 'ggx' in lobefit.kernels.models()\n"
    )


def test_the_block_works() -> None:
    with pytest.raises(AssertionError, match="must not be imported"):
        run(BLOCK.format(names=("numpy",)) + "import lobefit.kernels.evaluate\n")


def test_importing_makes_no_threads_and_opens_no_device() -> None:
    run(
        "import threading, lobefit.fitting, lobefit.kernels, lobefit.kernels.device as device\n"
        "assert threading.active_count() == 1\n"
        "assert device._open == {}\n"
        "import sys\n"
        "assert 'pyopencl' not in sys.modules\n"
    )


@pytest.mark.parametrize("name", everything())
def test_a_module_says_what_it_offers(name: str) -> None:
    module = importlib.import_module(name)
    assert (module.__doc__ or "").strip(), "no docstring"
    public = getattr(module, "__all__", None)
    if public is None:  # only a package that offers nothing but its submodules may be silent
        tree = ast.parse(Path(module.__file__ or "").read_text(encoding="utf-8"))
        defined = [
            node
            for node in tree.body
            if not isinstance(node, ast.Expr)
            and not (isinstance(node, ast.Assign) and "__version__" in ast.unparse(node))
        ]
        assert defined == [], "no __all__"
        return
    assert len(set(public)) == len(public)
    missing = [entry for entry in public if not hasattr(module, entry)]
    assert missing == []


@pytest.mark.parametrize("room", ["kernels", "fitting"])
def test_what_a_room_offers_is_documented(room: str) -> None:
    module = importlib.import_module(f"lobefit.{room}")
    silent = [
        entry
        for entry in module.__all__
        if callable(getattr(module, entry)) and not getattr(module, entry).__doc__
    ]
    assert silent == []


def test_no_file_is_long() -> None:
    paths = [
        path
        for folder in READABLE
        for path in (CHECKOUT / folder).rglob("*")
        if path.suffix in SOURCE_ENDINGS
    ]
    assert len(paths) > 50
    long = {
        str(path.relative_to(CHECKOUT)): count
        for path in paths
        if (count := len(path.read_text(encoding="utf-8").splitlines())) > MOST_LINES
    }
    assert long == {}


def test_the_version_is_the_newest_in_the_changelog() -> None:
    changelog = CHECKOUT / "CHANGELOG.md"
    if not changelog.exists():
        pytest.skip("there is no CHANGELOG.md")
    top = re.search(
        r"^## +\[?v?(\d+\.\d+\.\d+\w*)", changelog.read_text(encoding="utf-8"), re.MULTILINE
    )
    assert top is not None, "no entry such as `## 0.1.0`"
    assert top[1] == lobefit.__version__
