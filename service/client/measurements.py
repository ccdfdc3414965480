"""Operations on measurements: upload, look at, check, delete."""

from __future__ import annotations

import re
from pathlib import Path

from lobefit.service.client.base import Operations
from lobefit.service.client.bodies import Source, body_of, media_type, name_of
from lobefit.service.client.documents import id_of, quoted
from lobefit.service.client.operation import operation
from lobefit.service.client.resources import Checks, StoredMeasurement
from lobefit.service.client.wire import Operation, Request, Work

__all__ = ["Measurements", "is_measurement_id"]

PATH = "/v1/measurements"


class Measurements(Operations):
    """What a client does with measurements."""

    @operation
    def upload(self, source: Source, name: str | None = None) -> Operation[StoredMeasurement]:
        """Store a measurement in the service and say what was understood.

        Parameters
        ----------
        source : path-like, bytes, file or Measurement
            A CSV (also gzip) or MERL ``.binary``. The same content twice is one measurement.
        name : str, optional
            What to call it; the file's name if left out.

        Returns
        -------
        StoredMeasurement

        Raises
        ------
        MeasurementError
            It cannot be used; says file, line, column, what was found and what was expected.
        ServiceError
            The service cannot be reached, or does not take it.
        """
        return self._upload(source, name)

    @operation
    def measurement(self, measurement: StoredMeasurement | str) -> Operation[StoredMeasurement]:
        """Look at a measurement that is stored, by its id."""
        return self._measurement(id_of(measurement))

    @operation
    def measurements(self, limit: int | None = None) -> Operation[list[StoredMeasurement]]:
        """List the stored measurements, the newest first; all where there is no limit."""
        found = yield from self._pages(PATH, {}, limit)
        return [StoredMeasurement.read(item) for item in found]

    @operation
    def check(self, measurement: StoredMeasurement | Source) -> Operation[Checks]:
        """Look for what is wrong with a measurement; it is uploaded if it is not stored.

        Parameters
        ----------
        measurement : StoredMeasurement, id, path-like, bytes, file or Measurement

        Returns
        -------
        Checks
            As `lobefit.fitting.check` finds them.
        """
        stored = yield from self._stored(measurement)
        return stored.checks

    def _upload(self, source: Source, name: str | None = None) -> Operation[StoredMeasurement]:
        body: bytes | Path = yield Work(lambda: body_of(source))
        called = name or name_of(source)
        kind: str = yield Work(lambda: media_type(body, called))
        reply = yield from self._exchange(
            Request(
                method="POST",
                path=PATH,
                query={"name": called} if called else {},
                headers={"Content-Type": kind},
                body=body,
            )
        )
        return StoredMeasurement.read(reply.document())

    def _measurement(self, id: str) -> Operation[StoredMeasurement]:
        document = yield from self._get(f"{PATH}/{quoted(id)}")
        return StoredMeasurement.read(document)

    def _stored(self, measurement: StoredMeasurement | Source) -> Operation[StoredMeasurement]:
        """Give what is stored already, upload what is not."""
        if isinstance(measurement, StoredMeasurement):
            return measurement
        if isinstance(measurement, str) and is_measurement_id(measurement):
            return (yield from self._measurement(measurement))
        return (yield from self._upload(measurement))

    def _identified(
        self, measurement: StoredMeasurement | Source
    ) -> Operation[tuple[str, str | None]]:
        """Give its id, and its name where that is known; what is not stored is uploaded."""
        if isinstance(measurement, StoredMeasurement):
            return measurement.id, measurement.name
        if isinstance(measurement, str) and is_measurement_id(measurement):
            return measurement, None  # whoever submits it learns whether it is there
        stored = yield from self._upload(measurement)
        # The service keeps the name under which the same bytes came first.
        return stored.id, name_of(measurement)

    def _delete_measurement(self, id: str) -> Operation[None]:
        yield from self._measurement(id)  # what never was cannot be deleted
        yield from self._remove(f"{PATH}/{quoted(id)}")


def is_measurement_id(text: str) -> bool:
    """Tell the SHA-256 of a measurement from other ids and from paths."""
    return re.fullmatch(r"[0-9a-f]{64}", text) is not None
