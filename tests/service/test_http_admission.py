"""Who may come in: tokens, names of the host, pages of other sites."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from lobefit.service.settings import is_loopback
from lobefit.service.tokens import add_token, given_tokens, read_tokens, remove_token
from tests.service.fake_worker import CSV, Service, service
from tests.service.test_http_resources import is_problem

TOKEN = "a-token-of-a-good-length"
TEXT = {"Content-Type": "text/csv"}


@pytest.fixture(scope="module")
def guarded(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Service]:
    with service(
        tmp_path_factory.mktemp("data"), tokens=given_tokens([TOKEN, f"anna={TOKEN}2"])
    ) as found:
        yield found


def test_tokens(guarded: Service) -> None:
    for path in ("/v1/fits", "/metrics", "/v1/nothing"):
        answer = guarded.client.get(path)
        is_problem(answer, 401, "unauthorized")
        assert answer.headers["www-authenticate"].startswith("Bearer")
    for path in ("/healthz", "/readyz", "/openapi.json", "/docs", "/"):
        assert guarded.client.get(path).status_code != 401
    for given in ("", "Bearer", "Bearer x", f"Basic {TOKEN}", f"Bearer {TOKEN}x", "Bearer \xe9"):
        headers = {b"Authorization": given.encode("latin-1")}
        is_problem(guarded.client.get("/v1/fits", headers=headers), 401, "unauthorized")
    for given in (TOKEN, f"{TOKEN}2"):
        answer = guarded.client.get("/v1/fits", headers={"Authorization": f"Bearer {given}"})
        assert answer.status_code == 200


def test_a_token_is_checked_before_the_body_is_read(guarded: Service) -> None:
    answer = guarded.client.post("/v1/measurements", content=bytes(10_000_000), headers=TEXT)
    is_problem(answer, 401, "unauthorized")


def test_tokens_are_kept_as_hashes(tmp_path: Path) -> None:
    token = add_token(tmp_path, "anna")
    assert token not in (tmp_path / "tokens.json").read_text()
    assert (tmp_path / "tokens.json").stat().st_mode & 0o777 == 0o600
    assert read_tokens(tmp_path) == given_tokens([f"anna={token}"])
    assert add_token(tmp_path, "anna") != token
    remove_token(tmp_path, "anna")
    assert read_tokens(tmp_path) == {}
    with pytest.raises(ValueError, match="there is no token 'anna'"):
        remove_token(tmp_path, "anna")
    with pytest.raises(ValueError, match="cannot name"):
        add_token(tmp_path, "../x")
    with pytest.raises(ValueError, match="16 or more"):
        given_tokens(["short"])


def test_pages_of_other_sites_cannot_use_a_server_on_loopback(tmp_path: Path) -> None:
    with service(tmp_path, hosts=("localhost", "127.0.0.1", "::1")) as found:
        get = found.client.get
        for host in ("localhost:8000", "127.0.0.1", "[::1]:8000", "LOCALHOST"):
            assert get("/v1/fits", headers={"Host": host}).status_code == 200
        for host in ("evil.example", "localhost.evil.example:8000", "127.0.0.1.nip.io", "[::2]:80"):
            is_problem(get("/v1/fits", headers={"Host": host}), 403, "forbidden")
        headers = {**TEXT, "Host": "localhost:8000"}
        for origin, status in (("http://localhost:8000", 201), ("http://evil.example", 403)):
            answer = found.client.post(
                "/v1/measurements", content=CSV, headers={**headers, "Origin": origin}
            )
            assert answer.status_code == status


@pytest.mark.parametrize(
    ("host", "only_here"),
    [
        ("127.0.0.1", True),
        ("127.9.9.9", True),
        ("::1", True),
        ("[::1]", True),
        ("localhost", True),
        ("0.0.0.0", False),
        ("::", False),
        ("192.168.0.1", False),
        ("localhost.example", False),
        ("", False),
    ],
)
def test_which_addresses_are_loopback(host: str, only_here: bool) -> None:
    assert is_loopback(host) is only_here
