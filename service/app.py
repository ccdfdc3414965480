"""The application: routes, what their errors become, and the edge around them.

Importing it imports neither numpy nor OpenCL: uploads go to the disk, work goes into the store's
table of jobs, and worker processes do it.
"""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

from fastapi import FastAPI

from lobefit import __version__
from lobefit.service.admission import admission
from lobefit.service.edge import Edge, Seen
from lobefit.service.handlers import add_handlers
from lobefit.service.observe import Metrics, logged
from lobefit.service.openapi import DESCRIPTION, openapi_document
from lobefit.service.routes import batches, charts, fits, measurements, models, pages, system
from lobefit.service.settings import Settings
from lobefit.service.state import Shared
from lobefit.service.store import Store

__all__ = ["create_app", "from_environment"]

_ROUTES = (measurements, fits, batches, charts, models, system, pages)


def create_app(settings: Settings, store: Store | None = None) -> FastAPI:
    """Make the application.

    Parameters
    ----------
    settings : Settings
        Of the server.
    store : Store, optional
        Opened in the settings' data folder, and closed in the end, where left out.

    Returns
    -------
    FastAPI
        An ASGI application; `app.state.shared` has its store.

    Raises
    ------
    StoreError
        The data folder cannot be used.
    """
    opened = Store(settings.data_dir, settings.limits) if store is None else store

    @asynccontextmanager
    async def lifespan(_: FastAPI) -> AsyncIterator[None]:
        yield
        if store is None:
            opened.close()

    app = FastAPI(
        title="Lobefit",
        version=__version__,
        description=DESCRIPTION,
        docs_url=None,
        redoc_url=None,
        lifespan=lifespan,
        redirect_slashes=False,
        telemetry={"tracing": False, "metrics": False, "logs": False, "auto_configure": False},
    )
    app.openapi = lambda: openapi_document(app)  # type: ignore[method-assign]
    app.state.settings = settings
    app.state.shared = Shared(settings, opened)
    app.state.metrics = Metrics(opened)
    for module in _ROUTES:
        app.include_router(module.routes)
    add_handlers(app)
    log, metrics = logged(), app.state.metrics

    def observe(seen: Seen) -> None:
        metrics.observe(seen)
        log(seen)

    app.add_middleware(Edge, settings=settings, observe=observe, admit=admission(settings))
    return app


def from_environment() -> FastAPI:
    """Make the application of the settings that the supervisor left in the environment."""
    return create_app(Settings.from_environment())
