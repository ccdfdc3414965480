"""What tests of the client share: a service in memory, and both clients of it."""

from __future__ import annotations

from typing import Any

import httpx2
import pytest

from tests.service.clients import awaited, blocking
from tests.service.fake_service import FakeService


@pytest.fixture
def service() -> FakeService:
    return FakeService()


@pytest.fixture(params=[blocking, awaited], ids=["Client", "AsyncClient"])
def client(request: pytest.FixtureRequest, service: FakeService) -> Any:
    return request.param(httpx2.MockTransport(service))


@pytest.fixture
def quick_polls(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("lobefit.service.client.watching.FIRST_POLL", 1e-4)
