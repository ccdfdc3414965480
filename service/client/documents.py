"""Frozen records made of JSON documents."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from datetime import datetime
from typing import Any, TypeVar
from urllib.parse import quote

from lobefit.service.client.errors import ServiceError

__all__ = ["id_of", "moment", "plain", "quoted", "record"]

T = TypeVar("T")


def record(kind: type[T], members: Any, /, **given: Any) -> T:
    """Make a dataclass of the members of a document that it has fields for.

    Newer services may answer more members; they are left out.

    Raises
    ------
    ServiceError
        A member is missing.
    """
    document = members if isinstance(members, Mapping) else {}
    names = {f.name for f in fields(kind)}  # type: ignore[arg-type]
    try:
        return kind(**{k: v for k, v in document.items() if k in names} | given)
    except TypeError as error:
        raise ServiceError(
            f"the service's answer is not understood: {error}; is its version that of this client?"
        ) from error


def moment(document: Mapping[str, Any], name: str) -> datetime | None:
    """Read a time, RFC 3339."""
    text = document.get(name)
    return datetime.fromisoformat(text) if isinstance(text, str) else None


def plain(value: Any) -> Any:
    """Turn arrays, tuples and mappings, also nested ones, into what JSON has."""
    if hasattr(value, "tolist"):  # numpy, which is not imported here
        return value.tolist()
    if isinstance(value, Mapping):
        return {str(key): plain(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple | range):
        return [plain(entry) for entry in value]
    return value


def quoted(part: str) -> str:
    """Quote an id or a name as one step of a path."""
    # Dots need no quotes, but two of them are no name.
    return quote(part, safe="").replace(".", "%2E") if set(part) <= {"."} else quote(part, safe="")


def id_of(what: Any) -> str:
    """Give the id of something that the service keeps, or the id itself."""
    found: str = what if isinstance(what, str) else what.id
    return found
