"""Operations on fits: submit, look at, wait for, read, cancel, delete."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from lobefit.kernels.errors import FitError, LobefitError
from lobefit.service.client.batch_record import Batch
from lobefit.service.client.bodies import Source
from lobefit.service.client.documents import id_of, plain
from lobefit.service.client.job_records import Fit
from lobefit.service.client.jobs import Jobs
from lobefit.service.client.measurements import is_measurement_id
from lobefit.service.client.ongoing import Ongoing
from lobefit.service.client.operation import operation
from lobefit.service.client.report import Report
from lobefit.service.client.resources import StoredMeasurement
from lobefit.service.client.wire import Operation

__all__ = ["Fits", "fit_members"]

SETS = ("quick", "standard", "all")


class Fits(Jobs):
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
        id, _ = yield from self._identified(measurement)
        document = {
            "measurement": id,
            **fit_members(
                models=models,
                metric=metric,
                options=options,
                tolerance=tolerance,
                max_theta_deg=max_theta_deg,
                posterior=posterior,
                seed=seed,
            ),
            "name": name,
        }
        return (yield from self._submit(Fit, document, wait, progress))

    @operation
    def fits(
        self,
        limit: int | None = None,
        *,
        measurement: StoredMeasurement | str | None = None,
        state: str | None = None,
        batch: Batch | str | None = None,
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
        batch : Batch or id, optional
            Only fits of this one.
        """
        return self._list(Fit, limit, measurement=measurement, state=state, batch=batch)

    @operation
    def status(self, fit: Fit | str) -> Operation[Fit]:
        """Look how far a fit is."""
        return self._status(Fit, fit)

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
        return self._wait(Fit, fit, progress, timeout)

    @operation
    def result(self, fit: Fit | str) -> Operation[Report]:
        """Give the report of a fit that is done, or what a cancelled one has finished.

        Raises
        ------
        FitError
            There is none: it has not ended, or failed.
        """
        document = yield from self._get(Fit.path_of(fit))
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
        return self._cancel(Fit, fit)

    @operation
    def delete(self, what: Ongoing | StoredMeasurement | str) -> Operation[None]:
        """Delete a fit, chart or batch with its files, cancelled before; or a measurement.

        Parameters
        ----------
        what : Fit, Chart, Batch, StoredMeasurement, or the id of a fit or a measurement
            With a batch go its fits; the measurements stay.

        Raises
        ------
        ServiceError
            There is none, or fits or charts of the measurement are queued or running.
        """
        if isinstance(what, StoredMeasurement) or (
            isinstance(what, str) and is_measurement_id(what)
        ):
            return self._delete_measurement(id_of(what))
        return self._delete(Fit if isinstance(what, str) else type(what), what)


def fit_members(**given: Any) -> dict[str, Any]:
    """Give members of the request for a fit, of arguments of `Fits.fit`."""
    members = {name: plain(value) for name, value in given.items()}
    if "models" in members and isinstance(models := members["models"], str) and models not in SETS:
        members["models"] = [models]
    if "options" in members:
        members["options"] = members["options"] or {}
    if isinstance(posterior := members.get("posterior"), bool):
        members["posterior"] = {} if posterior else None
    return members


def _no_result(fit: Fit) -> LobefitError:
    if fit.has_ended:
        return fit.failure() or FitError(f"fit {fit.id} was cancelled before it had a result")
    return FitError(f"fit {fit.id} is {fit.state}; wait(fit) returns when it has a result")
