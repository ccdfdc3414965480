"""Following what goes on until it has ended: by server-sent events, else by asking again and again."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Mapping
from typing import Any, Generic, TypeVar

from lobefit.service.client.base import STATUS_SILENCE
from lobefit.service.client.errors import ServiceError
from lobefit.service.client.ongoing import Ongoing
from lobefit.service.client.retries import Retries, exchange, pause
from lobefit.service.client.wire import (
    Close,
    Dropped,
    Open,
    Operation,
    Request,
    Sleep,
    Stream,
    Take,
)

__all__ = ["until_ended"]

Kept = TypeVar("Kept", bound=Ongoing)

SILENCE = 40.0
"""Seconds without a byte; the service comments every 15 s while there is no news."""

FIRST_POLL, LONGEST_POLL = 0.1, 3.0

# Event streams that brought nothing before something in between is taken to hold them back.
MUTE = 2


class _Follower(Generic[Kept]):
    """What is known of a fit, chart or batch, and whom to tell."""

    def __init__(
        self,
        document: Mapping[str, Any],
        read: Callable[[Mapping[str, Any]], Kept],
        tell: Callable[[Kept], object],
        deadline: float | None,
    ) -> None:
        self._document = document
        self._read = read
        self._tell = tell
        self._deadline = deadline
        self.last = ""  # id of the last event
        self.news = False
        self.what = read(document)
        tell(self.what)

    def remaining(self) -> float:
        """Give the seconds left, infinity where there is no limit."""
        if self._deadline is None:
            return float("inf")
        left = self._deadline - time.monotonic()
        if left <= 0.0:
            noun = self.what.NOUN
            raise ServiceError(
                f"{noun} {self.what.id} is still {self.what.state} and goes on in the service; "
                f"{noun}.wait() waits for it again"
            )
        return left

    def update(self, document: Mapping[str, Any]) -> None:
        self._document = document
        what = self._read(document)
        if what != self.what:
            self.what = what
            self._tell(what)

    def take(self, kind: str, data: str, id: str) -> None:
        """Understand an event; one that came before is not news."""
        if id.isdigit() and self.last.isdigit() and int(id) <= int(self.last):
            return
        if kind == "progress":
            seen = {"state": "running", "progress": json.loads(data)}
            self.update({**self._document, **seen})
        elif kind == "state":
            self.update(json.loads(data))
        else:  # such as the time after which to reconnect
            return
        self.last = id
        self.news = True


def until_ended(
    retries: Retries,
    path: str,
    read: Callable[[Mapping[str, Any]], Kept],
    tell: Callable[[Kept], object],
    timeout: float | None,
    *,
    events: bool = True,
) -> Operation[Kept]:
    """Follow a fit, chart or batch until it has ended.

    Parameters
    ----------
    retries : Retries
        How often to try again without any news.
    path : str
        Of it.
    read : callable
        Makes it of the service's answer.
    tell : callable
        Given it whenever there is news.
    timeout : float or None
        Most seconds.
    events : bool
        Whether the service sends events about it.

    Returns
    -------
    Fit, Chart or Batch
        As the service answers it after its end.
    """
    deadline = None if timeout is None else time.monotonic() + timeout
    status = Request(path=path, silence=STATUS_SILENCE)
    reply = yield from exchange(retries, status)
    follower = _Follower(reply.document(), read, tell, deadline)
    failures, mute = 0, 0 if events else MUTE
    poll = FIRST_POLL
    while not follower.what.has_ended:
        if mute < MUTE:
            trouble = yield from _listen(path, follower)
            mute = 0 if follower.news else mute + 1
            failures = 0 if follower.news else failures + 1
            if trouble is not None and mute < MUTE:
                yield from pause(retries, max(1, failures), trouble)
        else:
            yield Sleep(min(poll, follower.remaining()))
            poll = min(LONGEST_POLL, 1.5 * poll)
        reply = yield from exchange(retries, status)
        follower.update(reply.document())
        if not follower.what.has_ended:
            follower.remaining()
    return follower.what


def _listen(path: str, follower: _Follower[Any]) -> Operation[Dropped | None]:
    """Take events until the stream ends or breaks; gives what broke it."""
    follower.news = False
    headers = {"Accept": "text/event-stream", "Cache-Control": "no-store"}
    if follower.last:
        headers["Last-Event-ID"] = follower.last
    silence = min(SILENCE, follower.remaining())
    try:
        stream: Stream = yield Open(
            Request(path=f"{path}/events", headers=headers, silence=silence), events=True
        )
    except Dropped as error:
        return error
    try:
        kind = stream.headers.get("content-type", "").partition(";")[0].strip().lower()
        if stream.status != 200 or kind != "text/event-stream":
            return Dropped(f"the event stream was answered with status {stream.status}")
        while (event := (yield Take(stream))) is not None:
            follower.take(event.event, event.data, event.id)
            if follower.what.has_ended:
                break
            follower.remaining()
    except (Dropped, ValueError) as error:  # ValueError: an event that was cut off
        return error if isinstance(error, Dropped) else Dropped("an event was cut off")
    finally:
        yield Close(stream)
    return None
