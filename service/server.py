"""The server process: granian around the application, alone in its process.

The supervisor starts it as ``python -m lobefit.service.server`` with the settings in the
environment, and ends it with SIGTERM. Granian is embedded rather than run as a program: that would
be two more processes, and the supervisor restarts this one already.
"""

from __future__ import annotations

import asyncio
import gc
import logging
import signal

from granian.constants import HTTPModes, Interfaces
from granian.http import HTTP1Settings
from granian.server.embed import Server

from lobefit.service.app import create_app
from lobefit.service.settings import Settings

__all__ = ["main"]

# Answers that are still being made get so long at the end.
GRACE_SECONDS = 5.0


async def _serve(settings: Settings) -> None:
    app = create_app(settings)
    server = Server(
        app,
        address=settings.host.strip("[]"),
        port=settings.port,
        interface=Interfaces.ASGI,
        http=HTTPModes.http1,
        websockets=False,
        backlog=1024,
        # More at once wait in the kernel; event streams are the reason for so many.
        backpressure=1024,
        http1_settings=HTTP1Settings(
            header_read_timeout=int(1000 * settings.header_seconds), max_buffer_size=64 * 1024
        ),
        log_enabled=False,
    )
    stopped = asyncio.Event()
    loop = asyncio.get_running_loop()
    for number in (signal.SIGTERM, signal.SIGINT):
        loop.add_signal_handler(number, stopped.set)
    serving = asyncio.create_task(server.serve())
    stopping = asyncio.create_task(stopped.wait())
    await asyncio.wait({serving, stopping}, return_when=asyncio.FIRST_COMPLETED)
    if not serving.done():
        # First what waits for a worker or a fit, which could go on for hours.
        app.state.shared.close()
        server.stop()  # type: ignore[no-untyped-call]
        await asyncio.wait({serving}, timeout=GRACE_SECONDS)
    stopping.cancel()
    if serving.done():
        await serving  # tells what went wrong, such as an address in use


def main() -> None:
    """Serve until SIGTERM or SIGINT."""
    logging.getLogger("_granian").setLevel(logging.WARNING)
    settings = Settings.from_environment()
    gc.freeze()
    asyncio.run(_serve(settings))


if __name__ == "__main__":
    main()
