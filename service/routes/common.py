"""What the routes have in common: parameters, and the problems that an operation documents."""

from __future__ import annotations

import re
from typing import Annotated, Any

from fastapi import APIRouter, Depends, Path, Query

from lobefit.service.problems import MEDIA_TYPE, PROBLEMS, Problem
from lobefit.service.strict_json import StrictRoute

__all__ = ["Cursor", "Id", "Limit", "ModelQuery", "problems", "router"]

_ID = re.compile(r"[0-9A-Za-z-]{1,64}")


def router(tag: str) -> APIRouter:
    """Give a router whose JSON bodies are read strictly."""
    return APIRouter(tags=[tag], route_class=StrictRoute)


def problems(*slugs: str) -> dict[int | str, dict[str, Any]]:
    """Describe problem answers for the OpenAPI document.

    Parameters
    ----------
    *slugs : str
        Keys of `lobefit.service.problems.PROBLEMS`, besides those of every operation.
    """
    by_status: dict[int, list[str]] = {}
    for slug in (*slugs, "bad-request", "unauthorized", "forbidden", "too-large", "internal"):
        titles = by_status.setdefault(PROBLEMS[slug][0], [])
        if PROBLEMS[slug][1] not in titles:
            titles.append(PROBLEMS[slug][1])
    schema = {"$ref": "#/components/schemas/Problem"}
    return {
        status: {
            "description": ". ".join(titles) + ".",
            "content": {MEDIA_TYPE: {"schema": schema}},
        }
        for status, titles in sorted(by_status.items())
    }


def _id(id: Annotated[str, Path(description="Id.", max_length=200)]) -> str:
    # Whatever cannot be an id is as unknown as any other that was never given out.
    if not _ID.fullmatch(id):
        raise Problem("not-found", "there is nothing with this id")
    return id


Id = Annotated[str, Depends(_id)]
Limit = Annotated[int, Query(ge=1, le=200, description="Most items on a page.")]
Cursor = Annotated[
    str | None,
    Query(max_length=18, pattern=r"^[0-9]+$", description='"next" of the page before.'),
]
ModelQuery = Annotated[
    str | None,
    Query(
        max_length=120,
        pattern=r"^[\x21-\x7e]+$",
        description="Name of a fitted candidate; the best where left out.",
    ),
]
