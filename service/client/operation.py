"""Methods that are written once and work with and without ``await``."""

from __future__ import annotations

import functools
from collections.abc import Callable, Coroutine
from types import MethodType
from typing import TYPE_CHECKING, Any, Concatenate, Generic, ParamSpec, TypeVar, overload

from lobefit.service.client.wire import Operation

if TYPE_CHECKING:
    from lobefit.service.client.drivers import AsyncClient, Client

__all__ = ["operation"]

P = ParamSpec("P")
T = TypeVar("T")


class operation(Generic[P, T]):  # noqa: N801 - used as a decorator, like property
    """A method that gives an `Operation`.

    Called on a `Client` it gives what the operation returns; on an `AsyncClient`, something to
    await that gives the same.
    """

    def __init__(self, function: Callable[Concatenate[Any, P], Operation[T]]) -> None:
        @functools.wraps(function)
        def method(client: Any, /, *args: P.args, **kwargs: P.kwargs) -> Any:
            return client._run(function(client, *args, **kwargs))

        self._method = method
        self.__doc__ = function.__doc__

    @overload
    def __get__(self, client: None, owner: type) -> Callable[..., Any]: ...
    @overload
    def __get__(self, client: Client, owner: type) -> Callable[P, T]: ...
    @overload
    def __get__(self, client: AsyncClient, owner: type) -> Callable[P, Coroutine[Any, Any, T]]: ...
    def __get__(self, client: Client | AsyncClient | None, owner: type) -> Any:
        """Bind the method as functions are bound."""
        return self._method if client is None else MethodType(self._method, client)
