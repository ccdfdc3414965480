"""Who may come in: the token, the name by which the server was called, the page that asks.

A server on loopback has no token, but every web page that its user visits can send requests to
it. So such a server answers only to its own names (a page's own domain could be pointed at
127.0.0.1), and no server takes a changing request that a browser says comes from another site.
"""

from __future__ import annotations

from collections.abc import Callable
from urllib.parse import urlsplit

from starlette.datastructures import Headers
from starlette.types import Scope

from lobefit.service.problems import Problem
from lobefit.service.settings import Settings
from lobefit.service.tokens import owner_of

__all__ = ["admission"]

# The rest is the page without data, the documents of the API, and what a load balancer asks.
_CLOSED = ("/v1/", "/metrics")
_SAFE = {"GET", "HEAD", "OPTIONS"}


def admission(settings: Settings) -> Callable[[Scope, Headers], None]:
    """Give the check of every request; it leaves the token's name in the scope.

    Parameters
    ----------
    settings : Settings
        With tokens and names of the host.

    Returns
    -------
    callable
        Takes scope and headers and raises a `Problem` where the request is refused.
    """
    hosts = {h.lower() for h in settings.hosts}

    def admit(scope: Scope, headers: Headers) -> None:
        scope["lobefit.owner"] = ""
        called = headers.get("host", "")
        if hosts and _name(called) not in hosts:
            raise Problem(
                "forbidden",
                f"this server does not go by the name {called!r}, only by "
                f"{', '.join(sorted(hosts))}; start it with --token to let every name in",
            )
        origin = headers.get("origin")
        if (
            scope["method"] not in _SAFE
            and origin is not None
            and urlsplit(origin).netloc.lower() != called.lower()
        ):
            raise Problem(
                "forbidden",
                f"the page is from {origin}, the server is {called}; requests from pages of other "
                "sites are refused",
            )
        if settings.tokens and scope["path"].startswith(_CLOSED):
            scope["lobefit.owner"] = owner_of(headers, settings.tokens)

    return admit


def _name(host: str) -> str:
    """Give the host without its port."""
    host = host.lower()
    if host.startswith("["):
        return host.partition("]")[0].lstrip("[")
    return host.rpartition(":")[0] if ":" in host else host
