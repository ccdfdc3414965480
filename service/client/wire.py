"""What the client asks for, without saying how it is sent.

An operation of the client is a generator: it yields a `Send`, `Open`, `Take`, `Close`, `Sleep`,
`Work` or `Together` and is given what came of it. The drivers in `lobefit.service.client.drivers` carry that out,
one with blocking calls and one with ``await``, so that everything else exists once.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Generator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeAlias, TypeVar

from lobefit.service.client.errors import ServiceError

__all__ = [
    "Close",
    "Dropped",
    "Effect",
    "Open",
    "Operation",
    "Reply",
    "Request",
    "Send",
    "Sleep",
    "Stream",
    "Take",
    "Together",
    "Work",
]

T = TypeVar("T")


class Dropped(Exception):  # noqa: N818 - it never leaves the client
    """A connection that could not be made, broke, or ended before the answer did."""


@dataclass(frozen=True, kw_only=True)
class Request:
    """A request, which can be sent again as it is.

    Attributes
    ----------
    method, path : str
        The path begins with a slash and is already quoted.
    query, headers : mapping of str to str
    body : bytes, Path or None
        A file is read anew each time.
    silence : float or None
        Seconds without a byte after which the connection counts as dropped; None for the
        client's own.
    """

    method: str = "GET"
    path: str
    query: Mapping[str, str] = field(default_factory=dict)
    headers: Mapping[str, str] = field(default_factory=dict)
    body: bytes | Path | None = None
    silence: float | None = None


@dataclass(frozen=True)
class Reply:
    """A complete answer; names of headers are in lower case."""

    status: int
    headers: Mapping[str, str]
    content: bytes

    def document(self) -> dict[str, Any]:
        """Give the JSON object it holds.

        Raises
        ------
        ServiceError
            It holds none, as where something else than Lobefit answers at this address.
        """
        try:
            found = json.loads(self.content)
        except ValueError:
            found = None
        if not isinstance(found, dict):
            raise ServiceError(
                "the answer is not that of a Lobefit service: a JSON object was expected; check "
                "the address",
                status=self.status,
            )
        return found


@dataclass(frozen=True, eq=False)
class Stream:
    """An answer that is still coming; `items` and `response` belong to the driver."""

    status: int
    headers: Mapping[str, str]
    items: Any
    response: Any


@dataclass(frozen=True)
class Send:
    """Send a request and give its `Reply`; `Dropped` where there was none."""

    request: Request


@dataclass(frozen=True)
class Open:
    """Send a request and give a `Stream` of bytes, or of server-sent events."""

    request: Request
    events: bool = False


@dataclass(frozen=True)
class Take:
    """Give the next piece of a stream, None at its end; `Dropped` where it broke."""

    stream: Stream


@dataclass(frozen=True)
class Close:
    """Let go of a stream."""

    stream: Stream


@dataclass(frozen=True)
class Sleep:
    """Wait so many seconds."""

    seconds: float


@dataclass(frozen=True)
class Work:
    """Give what a function returns that reads or writes much."""

    function: Callable[[], Any]


@dataclass(frozen=True)
class Together:
    """Give what operations return, in their order; the driver may do several at once."""

    operations: Sequence[Operation[Any]]


Effect: TypeAlias = Send | Open | Take | Close | Sleep | Work | Together
Operation: TypeAlias = Generator[Effect, Any, T]
