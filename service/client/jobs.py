"""What is done alike with fits, charts and batches: submit, list, look, wait, cancel, delete."""

from __future__ import annotations

import uuid
from collections.abc import Callable, Mapping
from typing import Any, TypeVar

from lobefit.kernels.errors import FitError, LobefitError
from lobefit.service.client.base import JSON, STATUS_SILENCE, json_body
from lobefit.service.client.documents import id_of
from lobefit.service.client.errors import refused_as
from lobefit.service.client.measurements import Measurements
from lobefit.service.client.ongoing import Ongoing
from lobefit.service.client.progress_line import showing
from lobefit.service.client.resources import StoredMeasurement
from lobefit.service.client.retries import AGAIN, pause, refusal
from lobefit.service.client.watching import until_ended
from lobefit.service.client.wire import Dropped, Operation, Reply, Request, Send

__all__ = ["Jobs"]

Kept = TypeVar("Kept", bound=Ongoing)


class Jobs(Measurements):
    """What a client does with anything that goes on in the service."""

    def _reader(self, kind: type[Kept]) -> Callable[[Mapping[str, Any]], Kept]:
        return lambda document: kind.read(document).given_by(self)

    def _submit(
        self,
        kind: type[Kept],
        document: Mapping[str, Any],
        wait: bool,
        progress: bool | Callable[[Kept], object],
    ) -> Operation[Kept]:
        request = Request(
            method="POST",
            path=kind.PATH,
            # Made once: however often the request arrives, it is done once.
            headers={**JSON, "Idempotency-Key": uuid.uuid4().hex},
            body=json_body(document),
        )
        with refused_as(FitError):
            reply = yield from self._exchange(request)
        made = self._reader(kind)(reply.document())
        return (yield from self._wait(kind, made, progress, None)) if wait else made

    def _list(
        self, kind: type[Kept], limit: int | None, **query: Ongoing | StoredMeasurement | str | None
    ) -> Operation[list[Kept]]:
        asked = {name: id_of(value) for name, value in query.items() if value is not None}
        found = yield from self._pages(kind.PATH, asked, limit)
        return [self._reader(kind)(item) for item in found]

    def _status(self, kind: type[Kept], what: Kept | str) -> Operation[Kept]:
        document = yield from self._get(kind.path_of(what))
        return self._reader(kind)(document)

    def _wait(
        self,
        kind: type[Kept],
        what: Kept | str,
        progress: bool | Callable[[Kept], object],
        timeout: float | None,
    ) -> Operation[Kept]:
        with showing(progress) as show:
            ended = yield from self._until_ended(kind, what, show, timeout)
        error = ended.failure()
        if error is not None:
            raise error
        return ended

    def _cancel(self, kind: type[Kept], what: Kept | str) -> Operation[Kept]:
        failures = 0
        while True:
            found = yield from self._status(kind, what)
            if found.has_ended:
                return found
            trouble: LobefitError | Dropped
            try:
                # A request that is repeated blindly could delete what the first has cancelled.
                reply: Reply = yield Send(
                    Request(
                        method="DELETE",
                        path=found.path,
                        query={"keep": "true"},
                        silence=STATUS_SILENCE,
                    )
                )
            except Dropped as error:
                trouble = error
            else:
                if reply.status < 400:
                    return (yield from self._until_ended(kind, found, lambda _: None, None))
                trouble = refusal(reply)
                if reply.status not in {*AGAIN, 409}:  # 409: it ended meanwhile
                    raise trouble
            failures += 1
            yield from pause(self._retries, failures, trouble)

    def _delete(self, kind: type[Kept], what: Kept | str) -> Operation[None]:
        yield from self._cancel(kind, what)
        yield from self._remove(kind.path_of(what))

    def _until_ended(
        self,
        kind: type[Kept],
        what: Kept | str,
        tell: Callable[[Kept], object],
        timeout: float | None,
    ) -> Operation[Kept]:
        return until_ended(
            self._retries,
            kind.path_of(what),
            self._reader(kind),
            tell,
            timeout,
            events=kind.HAS_EVENTS,
        )
