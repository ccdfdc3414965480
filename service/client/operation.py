"""Methods that are written once and work with and without ``await``."""

from __future__ import annotations

from collections.abc import Callable, Coroutine, Iterator
from functools import partial, wraps
from types import MethodType
from typing import TYPE_CHECKING, Any, Concatenate, Generic, ParamSpec, TypeVar, overload

from lobefit.service.client.wire import Effect, Operation

if TYPE_CHECKING:
    from lobefit.service.client.drivers import AsyncClient, Client
    from lobefit.service.client.ongoing import Ongoing

__all__ = ["Course", "operation"]

P = ParamSpec("P")
T = TypeVar("T")


class operation(Generic[P, T]):  # noqa: N801 - used as a decorator, like property
    """A method that gives an `Operation`.

    Called on a `Client`, or on what one gave, it gives what the operation returns; on an
    `AsyncClient`, or on what one gave, something to await that gives the same.
    """

    def __init__(self, function: Callable[Concatenate[Any, P], Operation[T]]) -> None:
        @wraps(function)
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
    # Which of both gave it, its type does not say.
    @overload
    def __get__(self, client: Ongoing, owner: type) -> Callable[P, Any]: ...
    def __get__(self, client: Client | AsyncClient | Ongoing | None, owner: type) -> Any:
        """Bind the method as functions are bound."""
        return self._method if client is None else MethodType(self._method, client)


class Course(Generic[T]):
    """An operation that a driver carries out: it goes through the effects and tells of each.

    Attributes
    ----------
    result : object
        What the operation returned, once there are no more effects.
    """

    result: T

    def __init__(self, operation: Operation[T]) -> None:
        self._operation = operation
        self._resume: Callable[[], Effect] = partial(next, operation)

    def __iter__(self) -> Iterator[Effect]:
        """Go through the effects; `gave` or `failed` is called between two of them."""
        while True:
            try:
                effect = self._resume()
            except StopIteration as end:
                self.result = end.value
                return
            yield effect

    def gave(self, value: Any) -> None:
        """Tell what came of an effect."""
        self._resume = partial(self._operation.send, value)

    def failed(self, error: BaseException) -> None:
        """Tell what went wrong, also Ctrl-C or a cancelled task: the operation closes streams."""
        self._resume = partial(self._operation.throw, error)
