"""The OpenAPI document: whole, true of the answers, and with the errors there are."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

import pytest

from lobefit.service.problems import PROBLEMS
from tests.service.fake_worker import Service, service

PROBLEM = {"$ref": "#/components/schemas/Problem"}


@pytest.fixture(scope="module")
def running(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Service]:
    with service(tmp_path_factory.mktemp("data")) as found:
        found.wait(found.fit())
        yield found


@pytest.fixture(scope="module")
def document(running: Service) -> dict[str, Any]:
    found: dict[str, Any] = running.client.get("/openapi.json").json()
    return found


def operations(document: dict[str, Any]) -> Iterator[tuple[str, dict[str, Any]]]:
    for path, methods in document["paths"].items():
        for method, operation in methods.items():
            yield f"{method} {path}", operation


def test_every_operation_is_explained(document: dict[str, Any]) -> None:
    assert document["openapi"].startswith("3.1")
    names = [name for name, _ in operations(document)]
    assert len(names) >= 28
    for name, operation in operations(document):
        assert operation["summary"], name
        assert operation["description"], name
        assert operation["tags"], name
    assert not {"HTTPValidationError", "ValidationError"} & set(document["components"]["schemas"])


def test_every_error_is_a_problem_document(document: dict[str, Any]) -> None:
    statuses = {str(status) for status, _ in PROBLEMS.values()}
    for name, operation in operations(document):
        errors = {s: a for s, a in operation["responses"].items() if s in statuses}
        assert {"400", "401", "403", "413", "500"} <= set(errors), name
        for status, answer in errors.items():
            if (name, status) == ("get /readyz", "503"):
                continue
            assert answer["content"] == {"application/problem+json": {"schema": PROBLEM}}, name


def test_bodies_come_with_examples_that_are_valid(
    running: Service, document: dict[str, Any]
) -> None:
    id = running.upload()
    found = 0
    for name, operation in operations(document):
        for kind, content in operation.get("requestBody", {}).get("content", {}).items():
            if kind != "application/json":
                continue
            schema = document["components"]["schemas"][content["schema"]["$ref"].split("/")[-1]]
            for example in schema["examples"]:
                body = json.dumps(example).replace("0" * 64, id)
                answer = running.client.post(
                    name.split()[1], content=body, headers={"Content-Type": kind}
                )
                assert answer.status_code in (200, 202), answer.text
                found += 1
    assert found >= 7


def test_schemathesis_finds_no_fault(running: Service) -> None:
    """A short run; `python -m benchmarks.service schemathesis` is the long one."""
    schemathesis = pytest.importorskip("schemathesis")
    from hypothesis import HealthCheck, Phase, given, settings
    from schemathesis.checks import load_all_checks
    from schemathesis.specs.openapi.checks import positive_data_acceptance

    load_all_checks()

    schema = schemathesis.openapi.from_asgi("/openapi.json", running.client.app)
    seen: set[str] = set()
    cases = 0

    for found in schema.get_all_operations():
        operation = found.ok()
        wanted = operation.as_strategy() | operation.as_strategy(
            generation_mode=schemathesis.GenerationMode.NEGATIVE
        )

        @settings(
            max_examples=6,
            deadline=None,
            derandomize=True,
            database=None,
            phases=[Phase.explicit, Phase.generate],
            suppress_health_check=list(HealthCheck),
        )
        @given(case=wanted)
        def check(case: Any) -> None:
            nonlocal cases
            # That any text is a CSV and any name a model, no schema can deny.
            answer = case.call_and_validate(excluded_checks=[positive_data_acceptance])
            assert answer.status_code < 500
            cases += 1

        check()
        seen.add(operation.label)
    assert len(seen) >= 28
    assert cases >= 60
