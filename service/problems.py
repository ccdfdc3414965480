"""Answers that are errors: one shape, `application/problem+json` of RFC 9457.

Every error of the service is a `Problem` with a slug of `PROBLEMS`; its type is
``/problems/<slug>``. What concerns a CSV carries file, row, column, text and expected, what
concerns a JSON body a list of errors with JSON pointers (RFC 6901).
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any

from starlette.responses import Response
from starlette.types import Scope

__all__ = ["MEDIA_TYPE", "MOST_ERRORS", "PROBLEMS", "Problem", "pointer", "problem_response"]

MEDIA_TYPE = "application/problem+json"
MOST_ERRORS = 20
"""Places of a body that one problem names at most."""

PROBLEMS: Mapping[str, tuple[int, str]] = {
    "malformed-json": (400, "The body is not valid JSON"),
    "malformed-form": (400, "The form cannot be read"),
    "bad-request": (400, "The request cannot be understood"),
    "unauthorized": (401, "A token is required"),
    "forbidden": (403, "The request comes from another site"),
    "not-found": (404, "There is no such thing"),
    "method-not-allowed": (405, "The method is not allowed here"),
    "request-timeout": (408, "The body did not arrive in time"),
    "conflict": (409, "The request contradicts what is stored"),
    "too-large": (413, "The body is too large"),
    "unsupported-media-type": (415, "The type of the body is not supported"),
    "range-not-satisfiable": (416, "The range lies outside the file"),
    "invalid-measurement": (422, "The measurement cannot be used"),
    "invalid-request": (422, "The request has invalid values"),
    "unknown-model": (422, "There is no such model"),
    "invalid-model": (422, "The model or its parameters are not valid"),
    "impossible-fit": (422, "The fit cannot be done"),
    "too-many-requests": (429, "Too many requests at once"),
    "internal": (500, "Something went wrong in the server"),
    "no-device": (503, "The OpenCL device cannot be used"),
    "queue-full": (503, "The queue is full"),
    "timeout": (503, "The answer took too long"),
    "storage-full": (507, "There is no space left in the store"),
}
"""Slug of every kind of problem with its status and title."""


class Problem(Exception):  # noqa: N818  it is the RFC's word
    """An error that is answered as a problem document.

    Parameters
    ----------
    slug : str
        A key of `PROBLEMS`.
    detail : str
        What was found, what was expected and what to do.
    errors : sequence of mapping, optional
        Places in the body, each with "pointer" (or "parameter", "header") and "detail".
    headers : mapping of str to str, optional
        Added to the response.
    **fields : object
        Further members, such as row and column; those that are None are left out.
    """

    def __init__(
        self,
        slug: str,
        detail: str,
        *,
        errors: Sequence[Mapping[str, Any]] = (),
        headers: Mapping[str, str] | None = None,
        **fields: Any,
    ) -> None:
        super().__init__(detail)
        self.slug = slug
        self.status, self.title = PROBLEMS[slug]
        self.detail = detail
        self.errors = [dict(e) for e in errors]
        self.headers = dict(headers or {})
        self.fields = {key: value for key, value in fields.items() if value is not None}

    @classmethod
    def stored(cls, document: Mapping[str, Any]) -> Problem:
        """Make the problem that a worker has left in a job."""
        fields = {k: v for k, v in document.items() if k not in _OWN}
        slug = str(document.get("slug"))
        return cls(
            slug if slug in PROBLEMS else "internal",
            str(document.get("detail") or document.get("title") or ""),
            errors=document.get("errors", ()),
            **fields,
        )

    def document(self, instance: str | None = None) -> dict[str, Any]:
        """Give the members of the problem document."""
        members: dict[str, Any] = {
            "type": f"/problems/{self.slug}",
            "title": self.title,
            "status": self.status,
            "detail": self.detail,
        }
        if instance is not None:
            members["instance"] = instance
        members |= self.fields
        if self.errors:
            members["errors"] = self.errors
        return members


_OWN = {"slug", "type", "title", "status", "detail", "instance", "errors", "headers"}


def problem_response(problem: Problem, scope: Scope) -> Response:
    """Give the response; `instance` is the request's id."""
    document = problem.document(scope.get("lobefit.request_id"))
    # Texts of a client may hold what UTF-8 cannot; escapes can say everything.
    body = json.dumps(document, ensure_ascii=True, allow_nan=False).encode()
    return Response(body, problem.status, problem.headers, MEDIA_TYPE)


def pointer(parts: Sequence[str | int]) -> str:
    """Join the steps of a path in a JSON document, as RFC 6901 says."""
    return "".join("/" + str(p).replace("~", "~0").replace("/", "~1") for p in parts)
