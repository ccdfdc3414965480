"""An upload: what was understood of it, and whether it can be what it says."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from lobefit.fitting import check, read_measurement
from lobefit.fitting.document import measurement_summary
from lobefit.kernels.errors import MeasurementError
from lobefit.service.rows import NotFound
from lobefit.service.task import Outcome, Task
from lobefit.service.work.measured import named, stored

__all__ = ["perform"]


def perform(task: Task) -> Outcome:
    """Read an upload or a stored measurement; give summary, checks and warnings."""
    wanted = task.request
    if "measurement" in wanted:
        m, digest = stored(task.store, wanted["measurement"])
    else:
        path = task.store.files.upload(wanted["upload"])
        if not path.is_file():
            raise NotFound("the upload is there no more")
        with named(wanted["name"]):
            m = replace(read_measurement(path), source=wanted["name"])
        digest = None
    checks: dict[str, Any] | None = None
    warnings = list(m.notes)
    if wanted.get("checks", True):
        try:
            found = check(m)
        except MeasurementError as error:
            # It can be read but not judged, such as a single direction.
            warnings.append(str(error))
        else:
            checks = found.to_dict()
            warnings += [c.sentence for c in found.suspicious]
    summary = measurement_summary(m, digest)
    return Outcome({"summary": summary, "checks": checks, "warnings": warnings})
