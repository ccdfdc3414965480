"""What schemathesis needs to get past 404: the ids of something that is there.

Half of the requests keep the ids that were made up. Loaded by `benchmarks.service`.
"""

from __future__ import annotations

import os
import re
from typing import Any

import schemathesis

__all__: list[str] = []

FIT, MEASUREMENT = os.environ["LOBEFIT_FIT"], os.environ["LOBEFIT_MEASUREMENT"]
_seen = 0


@schemathesis.hook
def before_call(context: Any, case: Any, kwargs: Any) -> None:
    """Put ids of what is there into every second request, but for those that delete."""
    global _seen
    _seen += 1
    if _seen % 2 or case.method == "DELETE":
        return
    if isinstance(case.path_parameters, dict) and "id" in case.path_parameters:
        case.path_parameters["id"] = FIT if "/fits/" in case.path else MEASUREMENT
    body = case.body
    if (
        isinstance(body, dict)
        and isinstance(body.get("measurement"), str)
        and re.fullmatch("[0-9a-f]{64}", body["measurement"])
    ):
        body["measurement"] = MEASUREMENT
