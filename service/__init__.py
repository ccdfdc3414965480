"""What people touch: the command line, the service, its page and its Python client.

Importing this package imports nothing heavy; the commands import what they need, and the client
is loaded when it is asked for.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from lobefit.service.client import AsyncClient, Client, ServiceError

__all__ = ["AsyncClient", "Client", "ServiceError"]

if not TYPE_CHECKING:  # mypy and editors read the imports above

    def __getattr__(name: str) -> Any:
        if name not in __all__:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        return getattr(import_module("lobefit.service.client"), name)

    def __dir__() -> list[str]:
        return sorted({*globals(), *__all__})
