"""Operations on fits: submit, look at, wait for, read, cancel, delete."""

from __future__ import annotations

import uuid
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from lobefit.kernels.errors import FitError, LobefitError
from lobefit.service.client.base import STATUS_SILENCE, json_body
from lobefit.service.client.bodies import Source
from lobefit.service.client.documents import plain, quoted
from lobefit.service.client.errors import ServiceError, error_of, refused_as
from lobefit.service.client.measurements import Measurements, is_measurement_id
from lobefit.service.client.operation import operation
from lobefit.service.client.progress_line import showing
from lobefit.service.client.report import Report
from lobefit.service.client.resources import Fit, StoredMeasurement
from lobefit.service.client.retries import AGAIN, pause, refusal
from lobefit.service.client.watching import until_ended
from lobefit.service.client.wire import Dropped, Operation, Reply, Request, Send

__all__ = ["Fits"]

PATH = "/v1/fits"
SETS = ("quick", "standard", "all")


class Fits(Measurements):
    """What a client does with fits."""

    @operation
    def fit(
        self,
        measurement: StoredMeasurement | Source,
        models: str | Sequence[str] = "standard",
        *,
        metric: str = "auto",
        options: Mapping[str, str] | None = None,
        tolerance: float | None = None,
        max_theta_deg: float | None = None,
        posterior: bool | Mapping[str, Any] = False,
        seed: int = 0,
        name: str | None = None,
        wait: bool = False,
        progress: bool | Callable[[Fit], object] = True,
    ) -> Operation[Fit]:
        """Have candidate models fitted to a measurement, which is uploaded if it is not stored.

        One call makes one fit, however often the connection breaks.

        Parameters
        ----------
        measurement : StoredMeasurement, id, path-like, bytes, file or Measurement
        models : str or sequence of str
            A set ("quick", "standard", "all"), or names such as "ggx" and "ggx:k_s=1".
        metric, options, tolerance
            See `lobefit.fitting.fit`.
        max_theta_deg : float, optional
            Rows with theta_i or theta_o above it are left out.
        posterior : bool or mapping
            Whether to sample the posterior too. A mapping says how: "model", "steps",
            "ensembles", "walkers", "noise", "student", "saturation", "floor".
        seed : int
            Of the posterior's chains.
        name : str, optional
            What to call the fit.
        wait : bool
            Return when it has ended, as `wait` does.
        progress : bool or callable
            While waiting; see `wait`.

        Returns
        -------
        Fit
            Queued, or ended if `wait`.

        Raises
        ------
        MeasurementError, ModelError, FitError
            As the local `fit` does.
        ServiceError
            The service cannot be reached, or its queue is full.
        """
        if isinstance(measurement, str) and is_measurement_id(measurement):
            id = measurement
        else:
            stored = yield from self._stored(measurement)
            id = stored.id
        single = isinstance(models, str) and models not in SETS
        document = {
            "measurement": id,
            "models": [models] if single else plain(models),
            "metric": metric,
            "options": dict(options or {}),
            "tolerance": tolerance,
            "max_theta_deg": max_theta_deg,
            "posterior": plain(posterior) if isinstance(posterior, Mapping) else None,
            "seed": seed,
            "name": name,
        }
        if posterior is True:
            document["posterior"] = {}
        request = Request(
            method="POST",
            path=PATH,
            # Made once: however often the request arrives, it is one fit.
            headers={"Content-Type": "application/json", "Idempotency-Key": uuid.uuid4().hex},
            body=json_body(document),
        )
        with refused_as(FitError):
            reply = yield from self._exchange(request)
        fit = Fit.read(reply.document())
        return (yield from self._wait(fit, progress, None)) if wait else fit

    @operation
    def fits(
        self,
        limit: int | None = None,
        *,
        measurement: StoredMeasurement | str | None = None,
        state: str | None = None,
    ) -> Operation[list[Fit]]:
        """List fits, the newest first; all where there is no limit.

        Parameters
        ----------
        limit : int, optional
            How many at most.
        measurement : StoredMeasurement or id, optional
            Only fits of this one.
        state : str, optional
            Only those "queued", "running", "done", "failed" or "cancelled".
        """
        query = {} if state is None else {"state": state}
        if measurement is not None:
            query["measurement"] = measurement if isinstance(measurement, str) else measurement.id
        found = yield from self._pages(PATH, query, limit)
        return [Fit.read(item) for item in found]

    @operation
    def status(self, fit: Fit | str) -> Operation[Fit]:
        """Look how far a fit is."""
        document = yield from self._document(fit)
        return Fit.read(document)

    @operation
    def wait(
        self,
        fit: Fit | str,
        *,
        progress: bool | Callable[[Fit], object] = True,
        timeout: float | None = None,
    ) -> Operation[Fit]:
        """Wait until a fit has ended.

        Parameters
        ----------
        fit : Fit or id
        progress : bool or callable
            True shows a line on a terminal or in a notebook, and nothing elsewhere. A callable is
            given the `Fit` whenever there is news.
        timeout : float, optional
            Most seconds to wait. The fit goes on afterwards.

        Returns
        -------
        Fit
            Done or cancelled.

        Raises
        ------
        MeasurementError, ModelError, FitError
            It failed, with the error that the local `fit` would raise.
        ServiceError
            It failed otherwise, the service cannot be reached, or the time is up.
        """
        return self._wait(fit, progress, timeout)

    @operation
    def result(self, fit: Fit | str) -> Operation[Report]:
        """Give the report of a fit that is done, or what a cancelled one has finished.

        Raises
        ------
        FitError
            There is none: it has not ended, or failed.
        """
        document = yield from self._document(fit)
        if document.get("result") is None:
            raise _no_result(Fit.read(document))
        return Report.read(document["result"], document.get("posterior"))

    @operation
    def cancel(self, fit: Fit | str) -> Operation[Fit]:
        """Stop a fit that is queued or running; what it has finished is kept.

        A fit that has ended stays as it is.

        Returns
        -------
        Fit
            Ended.
        """
        return self._cancel(_path(fit))

    @operation
    def delete(self, what: Fit | StoredMeasurement | str) -> Operation[None]:
        """Delete a fit with its files, or a measurement; a fit is cancelled before.

        Parameters
        ----------
        what : Fit, StoredMeasurement or id

        Raises
        ------
        ServiceError
            There is none, or fits of the measurement are queued or running.
        """
        if isinstance(what, StoredMeasurement):
            yield from self._delete_measurement(what.id)
        elif isinstance(what, str) and is_measurement_id(what):
            yield from self._delete_measurement(what)
        else:
            path = _path(what)
            yield from self._cancel(path)
            yield from self._remove(path)

    def _document(self, fit: Fit | str) -> Operation[dict[str, Any]]:
        return self._get(_path(fit))

    def _cancel(self, path: str) -> Operation[Fit]:
        failures = 0
        while True:
            found = Fit.read((yield from self._get(path)))
            if found.has_ended:
                return found
            trouble: LobefitError | Dropped
            try:
                # A request that is repeated blindly could delete what the first has cancelled.
                reply: Reply = yield Send(
                    Request(
                        method="DELETE", path=path, query={"keep": "true"}, silence=STATUS_SILENCE
                    )
                )
            except Dropped as error:
                trouble = error
            else:
                if reply.status < 400:
                    return (yield from until_ended(self._retries, path, lambda _: None, None))
                trouble = refusal(reply)
                if reply.status not in {*AGAIN, 409}:  # 409: it ended meanwhile
                    raise trouble
            failures += 1
            yield from pause(self._retries, failures, trouble)

    def _wait(
        self, fit: Fit | str, progress: bool | Callable[[Fit], object], timeout: float | None
    ) -> Operation[Fit]:
        with showing(progress) as show:
            ended = yield from until_ended(self._retries, _path(fit), show, timeout)
        if ended.state == "failed":
            raise _failure(ended)
        return ended


def _path(fit: Fit | str) -> str:
    return f"{PATH}/{quoted(fit if isinstance(fit, str) else fit.id)}"


def _failure(fit: Fit) -> LobefitError:
    error = error_of(fit.problem or {"title": "the service does not say why the fit failed"})
    if isinstance(error, ServiceError) and error.slug == "invalid-request":
        error = FitError(error.message)
    error.add_note(f"fit {fit.id} failed in the service")
    return error


def _no_result(fit: Fit) -> LobefitError:
    if fit.state == "failed":
        return _failure(fit)
    if fit.has_ended:
        return FitError(f"fit {fit.id} was cancelled before it had a result")
    return FitError(f"fit {fit.id} is {fit.state}; wait(fit) returns when it has a result")
