"""Both clients with one face, for the tests of what they share."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any

import pytest

from lobefit.service import AsyncClient, Client
from lobefit.service.client import Retries

__all__ = ["CSV", "QUICK", "Kind", "awaited", "blocking", "both"]

CSV = b"theta_i,phi_i,theta_o,phi_o,R\n0,0,10,180,0.5\n0,0,20,180,0.4\n"
QUICK = Retries(attempts=100, first=1e-5, longest=1e-4)


class Awaited:
    """An `AsyncClient` whose methods are run to their end, to be tested like a `Client`."""

    def __init__(self, client: AsyncClient) -> None:
        self.client = client

    def __getattr__(self, name: str) -> Callable[..., Any]:
        method = getattr(self.client, name)

        async def run(*args: Any, **kwargs: Any) -> Any:
            return await method(*args, **kwargs)

        return lambda *args, **kwargs: asyncio.run(run(*args, **kwargs))

    @staticmethod
    def made(thing: Any) -> Awaited:
        """Run the methods of what the client gave, too."""
        return Awaited(thing)


Kind = Callable[..., Any]


def blocking(transport: Any, **kwargs: Any) -> Client:
    return Client(transport=transport, **{"retries": QUICK, **kwargs})


def awaited(transport: Any, **kwargs: Any) -> Awaited:
    return Awaited(AsyncClient(transport=transport, **{"retries": QUICK, **kwargs}))


both = pytest.mark.parametrize("client_of", [blocking, awaited])
