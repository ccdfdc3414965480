"""What each kind of job does; modules are imported by the first job of their kind."""

from __future__ import annotations

from importlib import import_module

from lobefit.service.rows import WAITING
from lobefit.service.task import Work

__all__ = ["KINDS", "QUICK", "work_of"]

KINDS = {
    "inspect": "lobefit.service.work.inspect",
    "table": "lobefit.service.work.table",
    "catalogue": "lobefit.service.work.catalogue",
    "evaluate": "lobefit.service.work.evaluate",
    "simulate": "lobefit.service.work.simulate",
    "curves": "lobefit.service.work.curves",
    "sphere": "lobefit.service.work.sphere",
    "batch": "lobefit.service.work.batch",
    "fit": "lobefit.service.work.fit",
    "chart": "lobefit.service.work.chart",
}
"""Module of each kind, which has a function `perform`."""

QUICK = tuple(kind for kind in KINDS if kind not in WAITING)


def work_of(kind: str) -> Work:
    """Give the function that does jobs of a kind."""
    work: Work = import_module(KINDS[kind]).perform
    return work
