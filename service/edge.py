"""The outermost layer: limits, request ids, security headers, and nothing that escapes.

Plain ASGI around the application. It bounds every body, declared or chunked, and the time it may
take; answers HEAD by GET; gives each request an id and each response the security headers; turns
whatever still goes wrong into a problem document; and reports each request once to an observer.
"""

from __future__ import annotations

import asyncio
import re
import time
import uuid
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass

from starlette.datastructures import Headers, MutableHeaders
from starlette.requests import ClientDisconnect
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from lobefit.service.problems import Problem, problem_response
from lobefit.service.settings import Settings

__all__ = ["CONTENT_SECURITY_POLICY", "Edge", "Seen"]

CONTENT_SECURITY_POLICY = (
    "default-src 'self'; img-src 'self' blob: data:; base-uri 'none'; form-action 'self'; "
    "frame-ancestors 'none'; object-src 'none'"
)
_SECURITY = {
    "content-security-policy": CONTENT_SECURITY_POLICY,
    "x-content-type-options": "nosniff",
    "x-frame-options": "DENY",
    "referrer-policy": "no-referrer",
    "cross-origin-opener-policy": "same-origin",
    "cross-origin-resource-policy": "same-origin",
}
# How much of a refused body is read away, and for how long.
_LINGER_BYTES = 64 << 20
_LINGER_SECONDS = 5.0
_ID = re.compile(r"[A-Za-z0-9._-]{1,64}")
_UPLOAD = ("POST", "/v1/measurements")


@dataclass(frozen=True, slots=True)
class Seen:
    """What an observer is told of a finished request.

    Attributes
    ----------
    scope : dict
        The ASGI scope, with the route that answered, if any, under "route".
    request_id : str
        Its id.
    method : str
        As the client said it.
    status : int
        As sent; 499 where the client left first.
    seconds : float
        From the head of the request to the end of the answer.
    received, sent : int
        Bytes of the bodies.
    error : Exception or None
        What nobody had expected.
    """

    scope: Scope
    request_id: str
    method: str
    status: int
    seconds: float
    received: int
    sent: int
    error: Exception | None


class _GoneError(Exception):
    """The client has left; there is nobody to answer."""


class Edge:
    """The layer around the application.

    Parameters
    ----------
    app : ASGI application
        What answers.
    settings : Settings
        The limits.
    observe : callable
        Called once for each request.
    admit : callable
        Called with scope and headers before anything is read; raises a `Problem` to refuse.
    """

    def __init__(
        self,
        app: ASGIApp,
        settings: Settings,
        observe: Callable[[Seen], None],
        admit: Callable[[Scope, Headers], None],
    ) -> None:
        self._app = app
        self._settings = settings
        self._observe = observe
        self._admit = admit

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer one request; what is not HTTP goes through untouched."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        await _Exchange(self._settings, scope, receive, send).run(
            self._app, self._admit, self._observe
        )


class _Exchange:
    """One request and its answer."""

    def __init__(self, settings: Settings, scope: Scope, receive: Receive, send: Send) -> None:
        self._settings = settings
        self._scope = scope
        self._receive = receive
        self._send = send
        self._headers = Headers(scope=scope)
        given = self._headers.get("x-request-id", "")
        self._id = given if _ID.fullmatch(given) else uuid.uuid4().hex
        self._method = scope["method"]
        self._limit = settings.json_bytes
        if (self._method, scope["path"]) == _UPLOAD:
            # A form's own bytes come on top of the file's; the file is counted again later.
            self._limit = settings.upload_bytes + 64 * 1024
        self._received = self._sent = self._status = 0
        self._ended = False
        self._left = False
        # Whether all of the body has come; there is none without one of these headers.
        self._complete = (
            self._headers.get("content-length", "0") == "0"
            and "transfer-encoding" not in self._headers
        )

    async def run(
        self,
        app: ASGIApp,
        admit: Callable[[Scope, Headers], None],
        observe: Callable[[Seen], None],
    ) -> None:
        start, unexpected = time.perf_counter(), None
        self._scope["lobefit.request_id"] = self._id
        if self._method == "HEAD":
            self._scope["method"] = "GET"
        try:
            await self._answered(app, admit)
        except (_GoneError, ClientDisconnect):
            self._left = self._complete = True
            if not self._status:
                # A body that breaks off looks the same; who sent it may still be listening.
                await self._problem(Problem("bad-request", "the body broke off"))
        except Exception as error:  # noqa: BLE001  nothing may escape; it is logged
            unexpected = error
            if not self._status:
                detail = f"the server's log tells more under the request's id {self._id}"
                await self._problem(Problem("internal", detail))
        finally:
            # A cancelled task is a client that left.
            left = self._left or not self._ended
            observe(
                Seen(
                    scope=self._scope,
                    request_id=self._id,
                    method=self._method,
                    status=499 if left and unexpected is None else self._status,
                    seconds=time.perf_counter() - start,
                    received=self._received,
                    sent=self._sent,
                    error=unexpected,
                )
            )

    async def _answered(self, app: ASGIApp, admit: Callable[[Scope, Headers], None]) -> None:
        try:
            admit(self._scope, self._headers)
            self._check_declared()
            await app(self._scope, self._receive_bounded, self._send_dressed)
        except Problem as problem:
            if self._status:
                raise
            await self._problem(problem)

    def _check_declared(self) -> None:
        declared = self._headers.get("content-length", "0")
        if not (declared.isascii() and declared.isdigit()):
            raise Problem("bad-request", f"Content-Length {declared!r} is not a number")
        if int(declared[:20]) > self._limit:
            raise self._too_large()
        encoding = self._headers.get("content-encoding", "identity").strip().lower()
        allowed = {"identity", ""}
        if (self._method, self._scope["path"]) == _UPLOAD:
            allowed |= {"gzip", "x-gzip"}
        if encoding not in allowed:
            raise Problem(
                "unsupported-media-type",
                f"Content-Encoding {encoding} is not read here; send the body as it is",
            )

    def _too_large(self) -> Problem:
        return Problem(
            "too-large",
            f"the body has more than {self._limit} bytes, which is the most that is read here",
            # What is still to come is not read; the connection cannot be used again.
            headers={"Connection": "close"},
        )

    async def _receive_bounded(self) -> Message:
        if self._ended:
            return {"type": "http.disconnect"}
        # A stream that is being sent asks here whether its reader is still there.
        seconds = None if self._complete or self._status else self._settings.body_seconds
        try:
            async with asyncio.timeout(seconds):
                message = await self._receive()
        except TimeoutError:
            raise Problem(
                "request-timeout",
                f"nothing of the body arrived for {self._settings.body_seconds:g} seconds",
                headers={"Connection": "close"},
            ) from None
        if message["type"] == "http.disconnect":
            self._left = not self._ended
        else:
            self._received += len(message.get("body", b""))
            self._complete = not message.get("more_body", False)
            if self._received > self._limit:
                raise self._too_large()
        return message

    async def _send_dressed(self, message: Message) -> None:
        head = self._method == "HEAD"
        if message["type"] == "http.response.start":
            self._status = message["status"]
            headers = MutableHeaders(scope=message)
            for name, value in _SECURITY.items():
                headers.setdefault(name, value)
            headers["x-request-id"] = self._id
            headers.setdefault("cache-control", "no-store")
            await self._hand(message)
            if head:
                await self._hand({"type": "http.response.body", "body": b""})
                self._ended = True
            return
        if head:
            return
        self._sent += len(message.get("body", b""))
        await self._hand(message)
        if not message.get("more_body", False):
            self._ended = True

    async def _hand(self, message: Message) -> None:
        try:
            await self._send(message)
        except OSError:
            raise _GoneError from None

    async def _problem(self, problem: Problem) -> None:
        response = problem_response(problem, self._scope)
        start = {
            "type": "http.response.start",
            "status": response.status_code,
            "headers": response.raw_headers,
        }
        await self._send_dressed(start)
        linger = not self._complete and "expect" not in self._headers
        body = bytes(response.body)
        await self._send_dressed({"type": "http.response.body", "body": body, "more_body": linger})
        if linger:
            await self._read_away()
            await self._send_dressed({"type": "http.response.body", "body": b""})

    async def _read_away(self) -> None:
        """Take in the rest of a body that was refused.

        Closing on a client that is still sending would reset the connection, and many a client
        then never sees the answer.
        """
        rest = _LINGER_BYTES
        with suppress(TimeoutError, OSError):
            async with asyncio.timeout(_LINGER_SECONDS):
                while rest > 0 and not self._complete:
                    message = await self._receive()
                    if message["type"] == "http.disconnect":
                        return
                    rest -= len(message.get("body", b""))
                    self._complete = not message.get("more_body", False)
