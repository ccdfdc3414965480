"""Operations on charts of speed against accuracy: submit, list, look at."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from lobefit.service.client.bodies import Source
from lobefit.service.client.documents import plain
from lobefit.service.client.fits import fit_members
from lobefit.service.client.job_records import Chart
from lobefit.service.client.jobs import Jobs
from lobefit.service.client.operation import operation
from lobefit.service.client.resources import StoredMeasurement
from lobefit.service.client.wire import Operation

__all__ = ["Charts"]


class Charts(Jobs):
    """What a client does with charts."""

    @operation
    def chart(
        self,
        subject: StoredMeasurement | Source | Mapping[str, Any],
        models: str | Sequence[str] = "all",
        *,
        metric: str = "auto",
        tolerance: float = 0.02,
        groups: Sequence[str] = ("fit", "evaluation", "albedo", "posterior"),
        repeats: int = 5,
        seed: int = 0,
        max_theta_deg: float | None = None,
        name: str | None = None,
        wait: bool = False,
        progress: bool | Callable[[Chart], object] = True,
    ) -> Operation[Chart]:
        """Have the time of each choice measured against its error, for one surface.

        One call makes one chart, however often the connection breaks.

        Parameters
        ----------
        subject : StoredMeasurement, id, path-like, bytes, file, Measurement or mapping
            A measurement, uploaded if it is not stored; a part of it is kept back to score fits
            on. Or a true model to simulate one of: a mapping with "model" and "params", and
            "geometry", "noise" and "seed" as for `simulate`.
        models : str or sequence of str
            As for `fit`.
        metric, tolerance, groups, repeats
            See `lobefit.fitting.chart`.
        seed : int
            Of the posteriors.
        max_theta_deg : float, optional
            Rows of a measurement with theta_i or theta_o above it are left out.
        name : str, optional
            What to call the chart.
        wait : bool
            Return when it has ended, as `Chart.wait` does.
        progress : bool or callable
            While waiting; see `Chart.wait`.

        Returns
        -------
        Chart
            Queued, or ended if `wait`.

        Raises
        ------
        MeasurementError, ModelError, FitError
            As the local `chart` does.
        ServiceError
            The service cannot be reached, or its queue is full.
        """
        about: dict[str, Any]
        if isinstance(subject, Mapping):
            about = {"truth": plain(subject)}
        else:
            id, _ = yield from self._identified(subject)
            about = {"measurement": id}
        document = {
            **about,
            **fit_members(models=models),
            "metric": metric,
            "tolerance": tolerance,
            "groups": list(groups),
            "repeats": repeats,
            "seed": seed,
            "max_theta_deg": max_theta_deg,
            "name": name,
        }
        return (yield from self._submit(Chart, document, wait, progress))

    @operation
    def charts(
        self,
        limit: int | None = None,
        *,
        measurement: StoredMeasurement | str | None = None,
        state: str | None = None,
    ) -> Operation[list[Chart]]:
        """List charts, the newest first; all where there is no limit. See `fits`."""
        return self._list(Chart, limit, measurement=measurement, state=state)

    @operation
    def chart_status(self, chart: Chart | str) -> Operation[Chart]:
        """Look how far a chart is, or by its id at what came of it."""
        return self._status(Chart, chart)
