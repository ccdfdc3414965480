"""All models with their parameters and options."""

from __future__ import annotations

from typing import Any

from lobefit.kernels import models
from lobefit.service.task import Outcome, Task, answer
from lobefit.service.texts import model_document

__all__ = ["perform"]


def perform(task: Task) -> Outcome:
    """Give every model as ``lobefit models --json`` does, with the sets of its variants too."""
    return answer(task, {"items": [_item(model_document(model)) for model in models().values()]})


def _item(document: dict[str, Any]) -> dict[str, Any]:
    for rows in (
        document["parameters"],
        *(c for o in document["options"].values() for c in o.values()),
    ):
        for row in rows:
            row["low"], row["high"] = row.pop("lower"), row.pop("upper")
    return document
