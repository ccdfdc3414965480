"""Measurements of the store, read under the names that people know."""

from __future__ import annotations

import math
from collections import OrderedDict
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace

from lobefit.fitting import Measurement, read_measurement
from lobefit.kernels.errors import MeasurementError
from lobefit.service.store import Store
from lobefit.service.task import Task

__all__ = ["named", "stored", "wanted_measurement"]

# The last few are kept, since a page asks for several views of one.
KEPT_ROWS = 200_000
_kept: OrderedDict[str, Measurement] = OrderedDict()


def stored(store: Store, id: str) -> tuple[Measurement, str]:
    """Read a stored measurement; gives its digest too.

    Raises
    ------
    NotFound
        There is none.
    """
    row = store.measurement(id)
    found = _kept.get(id)
    if found is None:
        with named(row.name):
            found = read_measurement(store.data_path(id))
        if found.n_directions <= KEPT_ROWS // 4:
            _kept[id] = found
            while sum(m.n_directions for m in _kept.values()) > KEPT_ROWS:
                _kept.popitem(last=False)
    else:
        _kept.move_to_end(id)
    return replace(found, source=row.name), row.id


def wanted_measurement(task: Task) -> tuple[Measurement, str]:
    """Read the measurement of a fit or a chart, without the rows it leaves out; and its digest."""
    measurement, digest = stored(task.store, task.request["measurement"])
    most = task.request.get("max_theta_deg")
    return measurement if most is None else measurement.within(math.radians(most)), digest


@contextmanager
def named(name: str) -> Iterator[None]:
    """Put the name that people know into errors, in place of the store's."""
    try:
        yield
    except MeasurementError as error:
        error.file = name
        raise
