"""Trying again: when, how often and after how long."""

from __future__ import annotations

import random
from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime
from email.utils import parsedate_to_datetime

from lobefit.kernels.errors import LobefitError
from lobefit.service.client.errors import ServiceError, error_of
from lobefit.service.client.wire import Dropped, Operation, Reply, Request, Send, Sleep

__all__ = ["Retries", "exchange", "pause", "refusal"]

# Too busy, and what a proxy answers for a service that restarts.
AGAIN = frozenset({429, 502, 503, 504})


@dataclass(frozen=True, kw_only=True)
class Retries:
    """How a client tries again after a dropped connection, or a 429 or 503.

    Attributes
    ----------
    attempts : int
        How often it tries again; 0 for never. What got further counts anew.
    first : float
        Seconds before the second attempt, at most; the limit doubles with each. The time is drawn
        evenly below it, so that clients do not come back all at once.
    longest : float
        Where the limit stops to grow.
    patience : float
        Longest ``Retry-After`` of the service that is waited for, in seconds.
    """

    attempts: int = 6
    first: float = 0.2
    longest: float = 10.0
    patience: float = 60.0


def _succeeded(reply: Reply) -> bool:
    return reply.status < 400


def exchange(
    retries: Retries, request: Request, good: Callable[[Reply], bool] = _succeeded
) -> Operation[Reply]:
    """Send a request until it is answered.

    It may arrive more than once, so what it asks for has to be the same done twice.

    Parameters
    ----------
    retries : Retries
    request : Request
    good : callable
        Whether an answer is what was asked for.

    Raises
    ------
    LobefitError
        The answer is an error, or there is none after all attempts.
    """
    failures = 0
    while True:
        trouble: LobefitError | Dropped
        after = 0.0
        try:
            reply: Reply = yield Send(request)
        except Dropped as error:
            trouble = error
        else:
            if good(reply):
                return reply
            trouble = refusal(reply)
            if reply.status not in AGAIN:
                raise trouble
            after = retry_after(reply)
        failures += 1
        yield from pause(retries, failures, trouble, after)


def pause(
    retries: Retries, failures: int, trouble: LobefitError | Dropped, after: float = 0.0
) -> Operation[None]:
    """Wait before the next attempt, or give up.

    Parameters
    ----------
    retries : Retries
    failures : int
        How many attempts failed in a row.
    trouble : LobefitError or Dropped
        What the last one met; raised where it was the last.
    after : float
        What the service asked to wait, in seconds.
    """
    if failures > retries.attempts or after > retries.patience:
        if isinstance(trouble, Dropped):
            raise ServiceError(
                f"the service cannot be reached at {trouble}; is `lobefit serve` running there?"
            ) from None  # what lies beneath fills screens and says no more
        raise trouble
    limit = min(retries.longest, retries.first * 2.0 ** (failures - 1))
    yield Sleep(after + random.uniform(0.0, limit))


def refusal(reply: Reply) -> LobefitError:
    """Make the error that an answer tells of."""
    try:
        problem = reply.document()
    except ServiceError:  # of a proxy in between
        problem = {"title": f"the service answered with status {reply.status}"}
    return error_of(problem, reply.status)


def retry_after(reply: Reply) -> float:
    """Read ``Retry-After``, seconds or a date, in seconds from now; 0 where there is none."""
    text = reply.headers.get("retry-after", "").strip()
    if text.isascii() and text.isdigit():
        return float(text)
    try:
        moment = parsedate_to_datetime(text)
    except ValueError:
        return 0.0
    if moment.tzinfo is None:
        moment = moment.replace(tzinfo=UTC)
    return max(0.0, (moment - datetime.now(UTC)).total_seconds())
