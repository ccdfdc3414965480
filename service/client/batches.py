"""Operations on batches: submit, list, look at, read and save their tables."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeAlias

from lobefit.kernels.errors import FitError
from lobefit.service.client.base import write_whole, writing
from lobefit.service.client.batch_record import Batch
from lobefit.service.client.bodies import Source
from lobefit.service.client.fits import fit_members
from lobefit.service.client.job_records import Fit
from lobefit.service.client.jobs import Jobs
from lobefit.service.client.operation import operation
from lobefit.service.client.resources import StoredMeasurement
from lobefit.service.client.tables import read_table
from lobefit.service.client.wire import Operation, Reply, Request, Together

__all__ = ["Batches"]

Item: TypeAlias = "StoredMeasurement | Source | Mapping[str, Any]"
FILES = ("table.csv", "parameters.csv", "summary.png")
# What the service takes.
MOST, LONGEST = 1000, 200


class Batches(Jobs):
    """What a client does with batches."""

    @operation
    def batch(
        self,
        inputs: Iterable[Item],
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
        progress: bool | Callable[[Batch], object] = True,
    ) -> Operation[Batch]:
        """Have many measurements fitted; those that are not stored are uploaded.

        All of them enter the queue, or none does. One call makes one batch, however often the
        connection breaks.

        Parameters
        ----------
        inputs : iterable
            At most 1000 of what `fit` takes as a measurement. A mapping has it as "measurement",
            and arguments of `fit` that are for this one, such as "models" and "name".
        models, metric, options, tolerance, max_theta_deg, posterior, seed
            As for `fit`, for all that say nothing else.
        name : str, optional
            What to call the batch. Fits are called after their measurements.
        wait : bool
            Return when all have ended, as `Batch.wait` does.
        progress : bool or callable
            While waiting; see `Batch.wait`.

        Returns
        -------
        Batch
            Queued, or ended if `wait`; fits that failed are counted and raise nothing.

        Raises
        ------
        MeasurementError, ModelError, FitError
            An input or an argument cannot be. Nothing is fitted then.
        ServiceError
            The service cannot be reached, or its queue has not so many places.
        """
        if isinstance(inputs, str | bytes | os.PathLike | Mapping):
            raise FitError(f"a batch is of a list of measurements, not of {inputs!r}")
        given = [
            entry if isinstance(entry, Mapping) else {"measurement": entry} for entry in inputs
        ]
        if not 1 <= len(given) <= MOST:
            raise FitError(f"{len(given)} measurements; a batch takes 1 to {MOST}")
        document = {
            "name": name,
            "items": (yield Together([self._item(entry) for entry in given])),
            **fit_members(
                models=models,
                metric=metric,
                options=options,
                tolerance=tolerance,
                max_theta_deg=max_theta_deg,
                posterior=posterior,
                seed=seed,
            ),
        }
        return (yield from self._submit(Batch, document, wait, progress))

    @operation
    def batches(self, limit: int | None = None) -> Operation[list[Batch]]:
        """List batches, the newest first; all where there is no limit."""
        return self._list(Batch, limit)

    @operation
    def batch_status(self, batch: Batch | str) -> Operation[Batch]:
        """Look how far a batch is."""
        return self._status(Batch, batch)

    def _item(self, entry: Mapping[str, Any]) -> Operation[dict[str, Any]]:
        if "measurement" not in entry:
            raise FitError(f"an input of a batch has no measurement: {dict(entry)!r}")
        id, called = yield from self._identified(entry["measurement"])
        # Any file name can be a file's, but not a fit's.
        name = called and "".join(c if c.isprintable() else "?" for c in called)[:LONGEST]
        return {"name": name, **fit_members(**entry), "measurement": id}

    def _fits_of(self, batch: Batch, state: str | None) -> Operation[list[Fit]]:
        found = yield from self._list(Fit, None, batch=batch, state=state)
        return found[::-1]  # the service lists the newest first

    def _table(self, batch: Batch, name: str) -> Operation[list[dict[str, Any]]]:
        reply = yield from self._file(batch, name)
        return read_table(name, reply.content.decode())

    def _save_batch(self, batch: Batch, folder: Path) -> Operation[dict[str, Path]]:
        with writing(folder):
            folder.mkdir(parents=True, exist_ok=True)
        found = {}
        for name in FILES:
            reply = yield from self._file(batch, name)
            found[name] = yield from write_whole(folder / name, reply.content)
        return found

    def _file(self, batch: Batch, name: str) -> Operation[Reply]:
        return self._exchange(Request(path=f"{batch.path}/{name}"))
