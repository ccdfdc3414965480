"""The OpenAPI 3.1 document: what FastAPI gathers, with our problem documents and tokens."""

from __future__ import annotations

from typing import Any

from fastapi import FastAPI
from fastapi.openapi.utils import get_openapi

__all__ = ["DESCRIPTION", "openapi_document"]

DESCRIPTION = (
    "Fit reflectance models (BRDFs) to measurements: upload a CSV, get ranked models, their "
    "uncertainty and pictures. Many fits sent in together are a batch; a chart measures what each "
    "choice of how to fit costs and how far off it is. Times are RFC 3339 in UTC, angles degrees, "
    "BRDF values 1/sr. Every error is a problem document of RFC 9457."
)

_PLACE = {
    "type": "object",
    "properties": {
        "pointer": {"type": "string", "description": "JSON pointer into the body."},
        "parameter": {"type": "string", "description": "Query or path parameter."},
        "header": {"type": "string"},
        "detail": {"type": "string"},
    },
    "required": ["detail"],
}
_PROBLEM = {
    "title": "Problem",
    "type": "object",
    "description": "An error (RFC 9457).",
    "properties": {
        "type": {"type": "string", "description": "/problems/ and a slug."},
        "title": {"type": "string"},
        "status": {"type": "integer"},
        "detail": {"type": "string", "description": "What was found, expected, and to do."},
        "instance": {"type": "string", "description": "Id of the request, as in the log."},
        "file": {"type": "string"},
        "row": {"type": "integer", "description": "Line of the CSV, counted from 1."},
        "column": {"type": "string"},
        "text": {"type": "string", "description": "What stands there."},
        "expected": {"type": "string"},
        "errors": {"type": "array", "items": _PLACE},
    },
    "required": ["type", "title", "status", "detail", "instance"],
    "examples": [
        {
            "type": "/problems/invalid-measurement",
            "title": "The measurement cannot be used",
            "status": 422,
            "detail": "'4O' is no number",
            "instance": "0f8fad5bd9cb469fa16570867728950e",
            "file": "rough_copper.csv",
            "row": 12,
            "column": "theta_o",
            "text": "4O",
            "expected": "a number",
        }
    ],
}
_TOKEN = {"type": "http", "scheme": "bearer", "description": "Where the server wants a token."}


def openapi_document(app: FastAPI) -> dict[str, Any]:
    """Give the document, made once for each application.

    Parameters
    ----------
    app : FastAPI
        With all routes.
    """
    if app.openapi_schema is None:
        document = get_openapi(
            title=app.title,
            version=app.version,
            description=app.description,
            routes=app.routes,
        )
        components = document.setdefault("components", {})
        schemas = components.setdefault("schemas", {})
        for unused in ("HTTPValidationError", "ValidationError"):
            schemas.pop(unused, None)
        schemas["Problem"] = _PROBLEM
        components["securitySchemes"] = {"token": _TOKEN}
        for path, methods in document["paths"].items():
            for operation in methods.values():
                _plain(operation)
                if path.startswith("/v1/") or path == "/metrics":
                    # Or none: on loopback a server wants no token.
                    operation["security"] = [{"token": []}, {}]
        app.openapi_schema = document
    return app.openapi_schema


def _plain(operation: dict[str, Any]) -> None:
    for answer in operation["responses"].values():
        content = answer.get("content", {})
        # FastAPI adds its default type beside those that are declared.
        if len(content) > 1 and content.get("application/json") == {}:
            del content["application/json"]
