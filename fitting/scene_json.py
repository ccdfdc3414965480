"""Values of a JSON document read strictly, with a pointer to what is wrong (RFC 6901)."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path
from typing import Any, NoReturn

from lobefit.kernels.errors import SceneError

__all__ = ["Node", "read_node"]

LARGEST = 1 << 20  # bytes


@dataclass(frozen=True)
class Node:
    """A value and where it stands.

    Attributes
    ----------
    value : object
        As the JSON reader gave it.
    file : str
        Name of the file, for messages.
    pointer : str
        Such as ``/lights/0/direction``; empty for the whole document.
    """

    value: Any
    file: str
    pointer: str = ""

    def fail(self, message: str) -> NoReturn:
        """Raise a `SceneError` that says where."""
        raise SceneError(f"{self.file}: {self.pointer or '/'}: {message}")

    def members(self, known: Iterable[str], required: Iterable[str] = ()) -> dict[str, Node]:
        """Give the members of an object that may have no others."""
        if not isinstance(self.value, dict):
            self.fail(f"an object is expected, not {_short(self.value)}")
        names = list(known)
        for key in self.value:
            if key not in names:
                near = get_close_matches(key, names, n=1)
                hint = f"did you mean {near[0]!r}? " if near else ""
                self.fail(f"{_short(key)} is not known here; {hint}Known are {', '.join(names)}")
        for key in required:
            if key not in self.value:
                self.fail(f"{key!r} is missing; add it")
        return {
            key: Node(value, self.file, f"{self.pointer}/{key}")
            for key, value in self.value.items()
        }

    def items(self, most: int, least: int = 0) -> list[Node]:
        """Give the entries of an array."""
        if not isinstance(self.value, list):
            self.fail(f"an array is expected, not {_short(self.value)}")
        if not least <= len(self.value) <= most:
            self.fail(f"{len(self.value)} entries; {least} to {most} are allowed")
        return [Node(value, self.file, f"{self.pointer}/{k}") for k, value in enumerate(self.value)]

    def number(self, low: float = -1e9, high: float = 1e9) -> float:
        """Give a number within bounds, both included."""
        value = self.value
        if isinstance(value, bool) or not isinstance(value, int | float):
            self.fail(f"a number is expected, not {_short(value)}")
        # A whole number may be too large for any float.
        if not low <= value <= high:
            self.fail(f"{_short(value)} is outside {low:g} to {high:g}")
        return float(value)

    def whole(self, low: int, high: int) -> int:
        """Give a whole number within bounds, both included."""
        value = self.number(low, high)
        if value != int(value):
            self.fail(f"a whole number is expected, not {value:g}")
        return int(value)

    def vector(self, low: float = -1e9, high: float = 1e9) -> tuple[float, float, float]:
        """Give three numbers."""
        x, y, z = (item.number(low, high) for item in self.items(3, 3))
        return x, y, z

    def per_channel(self, high: float = 1e9) -> tuple[float, ...]:
        """Give one number, or one for each channel, none negative."""
        if isinstance(self.value, list):
            return tuple(item.number(0.0, high) for item in self.items(64, 1))
        return (self.number(0.0, high),)

    def text(self, most: int = 2000) -> str:
        """Give a string."""
        if not isinstance(self.value, str):
            self.fail(f"a string is expected, not {_short(self.value)}")
        if len(self.value) > most:
            self.fail(f"{len(self.value)} characters; {most} are the most")
        return self.value

    def choice(self, known: Sequence[str]) -> str:
        """Give one of some strings."""
        if self.value not in known:
            self.fail(f"{_short(self.value)} is not known; choose {', '.join(known)}")
        return str(self.value)


def read_node(path: Path) -> Node:
    """Read a JSON file whose numbers are finite and whose keys stand once.

    Raises
    ------
    SceneError
        It cannot be read, is too large, or is no JSON.
    """
    try:
        with path.open("rb") as stream:
            data = stream.read(LARGEST + 1)
    except OSError as error:
        raise SceneError(f"{path}: cannot be read: {error.strerror or error}") from error
    if len(data) > LARGEST:
        raise SceneError(f"{path.name}: is larger than {LARGEST >> 20} MiB; no scene is")
    try:
        value = json.loads(
            data.decode("utf-8"),
            parse_constant=_refuse,
            parse_float=_finite,
            object_pairs_hook=_once,
        )
    except (ValueError, RecursionError) as error:
        raise SceneError(f"{path.name}: is no JSON that can be used: {error}") from None
    return Node(value, path.name)


def _refuse(text: str) -> NoReturn:
    raise ValueError(f"{text} is no number of JSON")


def _finite(text: str) -> float:
    value = float(text)
    if not math.isfinite(value):
        raise ValueError(f"{text[:40]} is too large for a number")
    return value


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) < len(pairs):
        keys = [key for key, _ in pairs]
        twice = next(key for key in keys if keys.count(key) > 1)
        raise ValueError(f"the key {twice[:40]!r} stands twice in one object")
    return found


def _short(value: Any) -> str:
    text = json.dumps(value, ensure_ascii=True)
    return text if len(text) <= 60 else f"{text[:57]}..."
