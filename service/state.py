"""What all routes share: the settings, the store, and ways to use it without blocking the loop.

Reads take some 50 us and are made where they are needed. Writes wait for the disk and for other
writers, so they are made in threads, few of them, since SQLite takes one writer at a time.
"""

from __future__ import annotations

import asyncio
import json
import time
from collections.abc import Callable
from typing import Annotated, Any, ParamSpec, TypeVar

from anyio import CapacityLimiter, to_thread
from fastapi import Depends, Request

from lobefit.service.problems import Problem
from lobefit.service.rows import ENDED, JobRow, NotFound
from lobefit.service.settings import Settings
from lobefit.service.store import Store
from lobefit.service.watch import Watch

__all__ = ["Shared", "SharedState", "owner"]

P = ParamSpec("P")
T = TypeVar("T")
_WRITERS = 4


class Shared:
    """Settings, store and watch of one application.

    Parameters
    ----------
    settings : Settings
        Of the server.
    store : Store
        Where everything is.
    """

    def __init__(self, settings: Settings, store: Store) -> None:
        self.settings = settings
        self.store = store
        self.watch = Watch(store, settings.poll_seconds)
        self.uploads = 0
        self.closing = False
        self._catalogue: list[dict[str, Any]] | None = None
        self._asking = asyncio.Lock()
        self._writers = CapacityLimiter(_WRITERS)

    def close(self) -> None:
        """End all waiting: the server is about to stop."""
        self.closing = True
        self.watch.wake()

    async def write(self, function: Callable[P, T], *args: P.args, **kwargs: P.kwargs) -> T:
        """Call a function of the store in a thread."""
        return await to_thread.run_sync(lambda: function(*args, **kwargs), limiter=self._writers)

    async def ask(
        self,
        kind: str,
        request: dict[str, Any],
        *,
        owner: str = "",
        measurement: str | None = None,
    ) -> JobRow:
        """Have a quick job done and wait for its end.

        Parameters
        ----------
        kind : str
            "inspect", "evaluate", ...
        request : dict
            What the worker needs, JSON-ready.
        owner : str
            Name of the token.
        measurement : str, optional
            The measurement that it reads.

        Returns
        -------
        JobRow
            Done.

        Raises
        ------
        Problem
            What the worker found wrong, or "timeout".
        """
        store, deadline = self.store, time.monotonic() + self.settings.quick_seconds
        job, _ = await self.write(store.submit, kind, request, owner=owner, measurement=measurement)
        try:
            while True:
                version = self.watch.version()
                job = store.job(job.id)
                if job.state in ENDED:
                    break
                if self.closing or time.monotonic() >= deadline:
                    raise Problem(
                        "timeout",
                        f"no worker answered in {self.settings.quick_seconds:g} seconds; "
                        "try again, or ask for less at once",
                        headers={"Retry-After": "5"},
                    )
                await self.watch.changed(version, deadline - time.monotonic())
        except BaseException:
            # Nobody waits any more, because of the time or since the client has left.
            await asyncio.shield(asyncio.create_task(self._abandon(job.id)))
            raise
        if job.state == "done":
            return job
        raise Problem.stored(job.problem or {"slug": "internal", "detail": "the job was cancelled"})

    async def _abandon(self, id: str) -> None:
        try:
            await self.write(self.store.cancel, id)
        except NotFound:
            return

    async def answer(
        self,
        kind: str,
        request: dict[str, Any],
        *,
        owner: str = "",
        measurement: str | None = None,
    ) -> tuple[bytes, str]:
        """Have a quick job done and give the bytes of its answer with their media type."""
        job = await self.ask(kind, request, owner=owner, measurement=measurement)
        return await to_thread.run_sync(self.store.answer, job)

    async def catalogue(self) -> list[dict[str, Any]]:
        """Give the models, as a worker lists them; asked for once."""
        async with self._asking:
            if self._catalogue is None:
                body, _ = await self.answer("catalogue", {})
                self._catalogue = json.loads(body)["items"]
        return self._catalogue


def _shared(request: Request) -> Shared:
    shared: Shared = request.app.state.shared
    return shared


def owner(request: Request) -> str:
    """Give the name of the token that the request came with."""
    name: str = request.scope.get("lobefit.owner", "")
    return name


SharedState = Annotated[Shared, Depends(_shared)]
"""A route's parameter that receives what is shared."""
