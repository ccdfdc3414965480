"""One item of a batch, fitted in a worker: its files as bytes and its row of the table."""

from __future__ import annotations

import json
import math
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from lobefit.fitting.batch_inputs import Item
from lobefit.fitting.batch_table import REPORT, item_row
from lobefit.fitting.engine.worker import Runner
from lobefit.kernels.errors import LobefitError

__all__ = ["Fitted", "OpenBatch", "fit_item"]


@dataclass(frozen=True, slots=True)
class Fitted:
    """What came of an item.

    Attributes
    ----------
    files : dict of str to bytes
        What `FitReport.save` writes, by name, in its order; empty where the fit failed.
    row : dict
        JSON-ready: its columns of the table, and "parameters", a list of dicts.
    reason : str
        Why it failed.
    """

    files: dict[str, bytes]
    row: dict[str, Any]
    reason: str = ""


@dataclass(frozen=True, slots=True)
class OpenBatch:
    """Opens the device of a worker.

    Attributes
    ----------
    device : str or None
        See `lobefit.kernels.get_device`.
    """

    device: str | None = None

    @contextmanager
    def __call__(self) -> Iterator[Runner]:
        """Open it, so that a machine without one is found before the first item."""
        from lobefit.kernels import get_device

        get_device(self.device)
        yield self._fit

    def _fit(self, first: int, stop: int, sent: list[tuple[Item, bytes | None]]) -> list[Fitted]:
        return [fit_item(item, data, self.device) for item, data in sent]


def fit_item(item: Item, data: bytes | None = None, device: str | None = None) -> Fitted:
    """Fit an item; whatever goes wrong is said in what comes back.

    Parameters
    ----------
    item : Item
        Which, and how.
    data : bytes, optional
        The file's content, where the file itself is on another machine.
    device : str, optional
        See `lobefit.kernels.get_device`.
    """
    try:
        with tempfile.TemporaryDirectory(prefix="lobefit-") as folder:
            path = Path(item.file)
            if data is not None:
                path = Path(folder) / path.name  # reports name it
                path.write_bytes(data)
            return _fit(item, path, Path(folder) / "report", device)
    except LobefitError as error:
        return Fitted({}, {}, str(error))
    except Exception as error:  # noqa: BLE001 - a defect of ours must not end the others
        return Fitted({}, {}, f"{type(error).__name__}: {error}")


def _fit(item: Item, path: Path, folder: Path, device: str | None) -> Fitted:
    from lobefit.fitting.fit import fit
    from lobefit.fitting.readers import read_measurement

    measurement = read_measurement(path)
    if item.max_theta is not None:
        measurement = measurement.within(math.radians(item.max_theta))
    report = fit(
        measurement,
        models=item.models,
        metric=item.metric,
        options=dict(item.options),
        tolerance=item.tolerance,
        student=item.student,
        device=device,
    )
    added = {} if item.max_theta is None else {"max_theta_deg": item.max_theta}
    settings = {**report.settings, "sha256": item.digest or None, **added}
    report = replace(report, settings=settings)
    files = {place.name: place.read_bytes() for place in report.save(folder).values()}
    return Fitted(files, item_row(json.loads(files[REPORT])))
