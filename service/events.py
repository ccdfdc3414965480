"""What happens to a job, as server-sent events: resumable, with comments while nothing happens."""

from __future__ import annotations

import json
import time
from collections.abc import AsyncIterator

from lobefit.service.answers import job_resource
from lobefit.service.rows import ENDED, EventRow, NotFound
from lobefit.service.state import Shared

__all__ = ["event_stream"]


def _line(shared: Shared, id: str, event: EventRow) -> bytes:
    data = event.data
    if event.type == "state":
        # The resource as it stands now, in the state that the event tells of.
        data = job_resource(shared.store, shared.store.job(id)) | data
    text = json.dumps(data, allow_nan=False, separators=(",", ":"))
    return f"id: {event.seq}\nevent: {event.type}\ndata: {text}\n\n".encode()


async def event_stream(shared: Shared, id: str, after: int) -> AsyncIterator[bytes]:
    """Give the events of a fit or a chart until it has ended.

    Parameters
    ----------
    shared : Shared
        With the store.
    id : str
        Of the job.
    after : int
        Number of the last event that the reader has seen, 0 for all.
    """
    pause = shared.settings.keep_alive_seconds
    spoke = time.monotonic()
    yield b"retry: 1000\n\n"
    while not shared.closing:
        version = shared.watch.version()
        try:
            ended = shared.store.job(id).state in ENDED
            events = shared.store.events(id, after)
            for event in events:
                yield _line(shared, id, event)
                after, spoke = event.seq, time.monotonic()
        except NotFound:  # deleted while somebody listens
            return
        if events:
            continue
        if ended:
            return
        if not await shared.watch.changed(version, spoke + pause - time.monotonic()):
            yield b": still here\n\n"
            spoke = time.monotonic()
