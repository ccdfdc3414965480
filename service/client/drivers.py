"""The clients: one carries operations out with blocking calls, the other with ``await``."""

from __future__ import annotations

import ipaddress
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Generic, Self, TypeVar

import anyio
import anyio.to_thread
import httpx2

from lobefit import __version__
from lobefit.service.client.batches import Batches
from lobefit.service.client.bodies import FileBody
from lobefit.service.client.charts import Charts
from lobefit.service.client.errors import ServiceError
from lobefit.service.client.evaluations import Evaluations
from lobefit.service.client.files import Files
from lobefit.service.client.fits import Fits
from lobefit.service.client.operation import Course
from lobefit.service.client.retries import Retries
from lobefit.service.client.wire import (
    Close,
    Dropped,
    Effect,
    Open,
    Operation,
    Reply,
    Request,
    Send,
    Sleep,
    Stream,
    Take,
    Together,
    Work,
)

__all__ = ["DEFAULT_URL", "AsyncClient", "Client"]

DEFAULT_URL = "http://127.0.0.1:8000"
"""Where ``lobefit serve`` listens if nothing else is said."""

AT_ONCE = 4
"""Operations that go on at once; half of the uploads that the service takes."""

T = TypeVar("T")
Transport = TypeVar("Transport", bound=httpx2.BaseTransport | httpx2.AsyncBaseTransport)


class _Operations(Fits, Charts, Batches, Files, Evaluations, Generic[Transport]):
    """What both clients are made of.

    Parameters
    ----------
    url : str
        Address of the service, such as ``https://lab.example/lobefit``.
    token : str, optional
        For a service that asks for one.
    timeout : float
        Seconds without a byte after which a connection counts as dropped. Longer than the service
        takes to inspect an upload or to evaluate a model.
    retries : int or Retries
        How often it tries again after a dropped connection, or a 429 or 503.
    transport : httpx2.BaseTransport or httpx2.AsyncBaseTransport, optional
        In place of the network, for tests.

    Raises
    ------
    ServiceError
        The address or the token cannot be one.
    """

    def __init__(
        self,
        url: str = DEFAULT_URL,
        token: str | None = None,
        *,
        timeout: float = 150.0,
        retries: int | Retries = 6,
        transport: Transport | None = None,
    ) -> None:
        try:
            parsed = httpx2.URL(url)
        except httpx2.InvalidURL as error:
            raise ServiceError(f"{url!r} is no address: {error}") from error
        if parsed.scheme not in ("http", "https") or not parsed.host:
            raise ServiceError(f"{url!r} is no address; expected one such as {DEFAULT_URL}")
        self.url = url.rstrip("/")
        self._host = parsed.netloc.decode("ascii")
        self._headers = {"User-Agent": f"lobefit/{__version__}"}
        if token is not None:
            if not token.isascii() or not token.isprintable():
                raise ServiceError("the token holds characters that no token has")
            self._headers["Authorization"] = f"Bearer {token}"
        self._timeout = timeout
        self._retries = Retries(attempts=retries) if isinstance(retries, int) else retries
        # A proxy of the environment cannot reach what listens on this machine only.
        self._connect(transport, proxies=not _is_loopback(parsed.host))

    def _connect(self, transport: Transport | None, *, proxies: bool) -> None:
        raise NotImplementedError

    def __repr__(self) -> str:
        """Give the address, not the token."""
        return f"<{type(self).__name__} of {self.url}>"

    def _build(self, request: Request) -> httpx2.Request:
        silence = self._timeout if request.silence is None else request.silence
        timeout = httpx2.Timeout(silence, connect=min(10.0, silence))
        given: dict[str, Any] = {"content": request.body}
        headers = {**self._headers, **request.headers}
        if isinstance(request.body, Path):
            body = FileBody(request.body)
            # With a stream of ours, httpx2 adds no headers of its own.
            headers |= {"Content-Length": str(body.size), "Host": self._host}
            given = {"stream": body}
        return httpx2.Request(
            request.method,
            self.url + request.path,
            params=dict(request.query) or None,
            headers=headers,
            extensions={"timeout": timeout.as_dict()},
            **given,
        )


class Client(_Operations[httpx2.BaseTransport]):
    """A client of ``lobefit serve``.

    It holds connections and nothing else, so it can be shared between threads.
    """

    __doc__ += (_Operations.__doc__ or "").partition("\n")[2]

    def _connect(self, transport: httpx2.BaseTransport | None, *, proxies: bool) -> None:
        self._http = httpx2.Client(transport=transport, trust_env=proxies)

    def __enter__(self) -> Self:
        """Give the client itself."""
        return self

    def __exit__(self, *error: object) -> None:
        """Close its connections."""
        self.close()

    def close(self) -> None:
        """Close its connections."""
        self._http.close()

    def _run(self, operation: Operation[T]) -> T:
        course = Course(operation)
        for effect in course:
            try:
                course.gave(self._perform(effect))
            except BaseException as error:  # noqa: BLE001 - the operation is told of any
                course.failed(error)
        return course.result

    def _perform(self, effect: Effect) -> Any:
        match effect:
            case Send(request):
                with _dropping(self.url):
                    return _reply(self._http.send(self._build(request)))
            case Open(request, events):
                with _dropping(self.url):
                    response = self._http.send(self._build(request), stream=True)
                source = httpx2.EventSource(response) if events else response.iter_bytes()
                return Stream(response.status_code, _names(response), iter(source), response)
            case Take(stream):
                with _dropping(self.url):
                    return next(stream.items, None)
            case Close(stream):
                stream.response.close()
            case Sleep(seconds):
                time.sleep(seconds)
            case Work(function):
                return function()
            case Together(operations):
                return [self._run(one) for one in operations]
        return None


class AsyncClient(_Operations[httpx2.AsyncBaseTransport]):
    """A client of ``lobefit serve`` whose methods are awaited, under asyncio or trio."""

    __doc__ += "\n" + (_Operations.__doc__ or "").partition("\n")[2]

    def _connect(self, transport: httpx2.AsyncBaseTransport | None, *, proxies: bool) -> None:
        self._http = httpx2.AsyncClient(transport=transport, trust_env=proxies)

    async def __aenter__(self) -> Self:
        """Give the client itself."""
        return self

    async def __aexit__(self, *error: object) -> None:
        """Close its connections."""
        await self.aclose()

    async def aclose(self) -> None:
        """Close its connections."""
        await self._http.aclose()

    async def _run(self, operation: Operation[T]) -> T:
        course = Course(operation)
        for effect in course:
            try:
                course.gave(await self._perform(effect))
            except BaseException as error:  # noqa: BLE001 - the operation is told of any
                course.failed(error)
        return course.result

    async def _perform(self, effect: Effect) -> Any:
        match effect:
            case Send(request):
                with _dropping(self.url):
                    return _reply(await self._http.send(self._build(request)))
            case Open(request, events):
                with _dropping(self.url):
                    response = await self._http.send(self._build(request), stream=True)
                source = httpx2.EventSource(response) if events else response.aiter_bytes()
                return Stream(response.status_code, _names(response), aiter(source), response)
            case Take(stream):
                with _dropping(self.url):
                    return await anext(stream.items, None)
            case Close(stream):
                await stream.response.aclose()
            case Sleep(seconds):
                await anyio.sleep(seconds)
            case Work(function):
                return await anyio.to_thread.run_sync(function)
            case Together(operations):
                return await self._gather(operations)
        return None

    async def _gather(self, operations: Sequence[Operation[Any]]) -> list[Any]:
        found: list[Any] = [None] * len(operations)
        errors: list[Exception] = []
        turn = anyio.Semaphore(AT_ONCE)

        async def do(k: int) -> None:
            async with turn:
                try:
                    found[k] = await self._run(operations[k])
                except Exception as error:  # noqa: BLE001 - raised below, without a group around it
                    errors.append(error)
                    group.cancel_scope.cancel()

        async with anyio.create_task_group() as group:
            for k in range(len(operations)):
                group.start_soon(do, k)
        if errors:
            raise errors[0]
        return found


@contextmanager
def _dropping(url: str) -> Iterator[None]:
    """Tell a connection that broke from everything else that can go wrong."""
    try:
        yield
    except (httpx2.TransportError, httpx2.DecodingError) as error:
        raise Dropped(f"{url}: {str(error) or type(error).__name__}") from error


def _names(response: httpx2.Response) -> Mapping[str, str]:
    return {name.lower(): value for name, value in response.headers.items()}


def _reply(response: httpx2.Response) -> Reply:
    headers = _names(response)
    promised = headers.get("content-length", "")
    # Nothing comes encoded, since no request asks for it.
    if promised.isdigit() and len(response.content) < int(promised):
        raise Dropped(f"{len(response.content)} of {promised} bytes arrived")
    return Reply(response.status_code, headers, response.content)


def _is_loopback(host: str) -> bool:
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost" or host.endswith(".localhost")
