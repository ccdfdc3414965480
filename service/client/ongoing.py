"""What the service does after it was asked to: things that are waited for, cancelled, kept."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Self

from lobefit.kernels.errors import LobefitError
from lobefit.service.client.documents import id_of, quoted
from lobefit.service.client.errors import ServiceError
from lobefit.service.client.operation import operation
from lobefit.service.client.wire import Operation

if TYPE_CHECKING:
    from lobefit.service.client.drivers import AsyncClient, Client

__all__ = ["Ongoing"]

ENDED = frozenset({"done", "failed", "cancelled"})


class Ongoing:
    """A fit, a chart or a batch, and the client that gave it, which does what its methods say.

    The methods block or are awaited as those of the client.
    """

    __slots__ = ("_giver",)  # no field: it is neither compared, shown, copied nor pickled

    NOUN: ClassVar[str]
    PATH: ClassVar[str]
    HAS_EVENTS: ClassVar[bool] = True

    id: str
    state: str
    _giver: Client | AsyncClient

    @classmethod
    def read(cls, document: Mapping[str, Any], /) -> Self:
        """Make it of the service's answer."""
        raise NotImplementedError

    @classmethod
    def path_of(cls, what: Self | str) -> str:
        """Give the path of one, or of an id."""
        return f"{cls.PATH}/{quoted(id_of(what))}"

    @property
    def path(self) -> str:
        """Where it is in the service."""
        return self.path_of(self.id)

    @property
    def has_ended(self) -> bool:
        """Whether nothing more will come: done, failed or cancelled."""
        return self.state in ENDED

    @property
    def extent(self) -> tuple[int, int] | None:
        """How much is done, of how much; None where that is not known."""
        raise NotImplementedError

    @property
    def news(self) -> str:
        """What there is to say while it goes on, in one line."""
        return str(self)

    def failure(self) -> LobefitError | None:
        """Give the error that the local API would raise, where it failed."""
        return None

    def given_by(self, client: Any) -> Self:
        """Note the client; gives the thing itself."""
        object.__setattr__(self, "_giver", client)  # frozen otherwise
        return self

    @operation
    def status(self) -> Operation[Any]:
        """Look how far it is; gives it as it is now."""
        return self._client._status(type(self), self)

    @operation
    def wait(
        self,
        *,
        progress: bool | Callable[[Any], object] = True,
        timeout: float | None = None,
    ) -> Operation[Any]:
        """Wait until it has ended, and give it as it is then.

        Parameters
        ----------
        progress : bool or callable
            True shows a line on a terminal or in a notebook, and nothing elsewhere. A callable is
            given what this is, as it is then, whenever there is news.
        timeout : float, optional
            Most seconds to wait. It goes on afterwards.

        Raises
        ------
        MeasurementError, ModelError, FitError
            It failed, with the error that the local API would raise.
        ServiceError
            It failed otherwise, the service cannot be reached, or the time is up.
        """
        return self._client._wait(type(self), self, progress, timeout)

    @operation
    def cancel(self) -> Operation[Any]:
        """Stop what is queued or running of it, and give it ended; what is finished is kept."""
        return self._client._cancel(type(self), self)

    @operation
    def delete(self) -> Operation[None]:
        """Delete it with all its files; it is cancelled before."""
        return self._client._delete(type(self), self)

    @operation
    def save(self, folder: str | Path) -> Operation[dict[str, Path]]:
        """Download its files into a folder, which is made if it does not exist.

        Returns
        -------
        dict of str to Path
            Where they are, by name.

        Raises
        ------
        LobefitError
            A file cannot be written.
        ServiceError
            The service cannot be reached, or sends something else than it promised.
        """
        return self._save(Path(folder))

    def _save(self, folder: Path) -> Operation[dict[str, Path]]:
        raise NotImplementedError

    @property
    def _client(self) -> Client | AsyncClient:
        try:
            return self._giver
        except AttributeError:
            raise ServiceError(
                f"this {self.NOUN} is a copy, which knows no client; ask a client for it by its id"
            ) from None

    def _run(self, operation: Operation[Any]) -> Any:
        return self._client._run(operation)
