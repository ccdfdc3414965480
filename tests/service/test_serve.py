"""The commands `lobefit serve` and `lobefit token`, and the server process itself."""

from __future__ import annotations

import json
import os
import re
import signal
import socket
import subprocess
import sys
import time
import urllib.error
import urllib.request
from pathlib import Path

import pytest
from typer.testing import CliRunner

from lobefit.kernels.errors import LobefitError
from lobefit.service.cli import app
from lobefit.service.rows import Limits
from lobefit.service.serve import settings_for
from lobefit.service.settings import VARIABLE, Settings
from lobefit.service.tokens import add_token, read_tokens

TOKEN = "a-token-of-a-good-length"


def test_an_address_that_others_reach_needs_a_token(tmp_path: Path) -> None:
    for host in ("0.0.0.0", "::", "192.0.2.1", "example.org"):
        settings = Settings(tmp_path, host=host)
        with pytest.raises(LobefitError, match="a token is needed"):
            settings_for(settings, [])
        found = settings_for(settings, [TOKEN])
        assert list(found.tokens) == ["default"]
        assert found.hosts == ()
    result = CliRunner().invoke(app, ["serve", "--host", "0.0.0.0", "--data-dir", str(tmp_path)])
    assert result.exit_code == 2
    assert "lobefit token" in result.stderr
    add_token(tmp_path, "anna")
    assert list(settings_for(Settings(tmp_path, host="0.0.0.0"), []).tokens) == ["anna"]


def test_on_loopback_none_is_needed_but_only_its_own_names_are_answered(tmp_path: Path) -> None:
    found = settings_for(Settings(tmp_path), [])
    assert found.tokens == {}
    assert set(found.hosts) == {"localhost", "127.0.0.1", "::1"}


def test_settings_go_to_the_server_without_tokens_in_plain_text(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = settings_for(Settings(tmp_path, limits=Limits(queue=7), port=81), [f"anna={TOKEN}"])
    assert TOKEN not in made.to_json()
    monkeypatch.setenv(VARIABLE, made.to_json())
    assert Settings.from_environment() == made


def test_tokens_are_made_listed_and_removed(tmp_path: Path) -> None:
    def run(*arguments: str) -> str:
        result = CliRunner().invoke(app, ["token", *arguments, "--data-dir", str(tmp_path)])
        assert result.exit_code == 0, result.output
        return result.stdout.strip()

    token = run("anna")
    assert len(token) > 40
    assert token not in json.dumps(read_tokens(tmp_path))
    run("ben")
    assert run().split() == ["anna", "ben"]
    run("anna", "--remove")
    assert run() == "ben"
    result = CliRunner().invoke(app, ["token", "anna", "--remove", "--data-dir", str(tmp_path)])
    assert (result.exit_code, "there are: ben" in result.stderr) == (2, True)


def test_a_port_that_is_taken_is_told_at_once(tmp_path: Path) -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = str(taken.getsockname()[1])
        result = CliRunner().invoke(app, ["serve", "--port", port, "--data-dir", str(tmp_path)])
    assert result.exit_code == 2
    assert f"cannot listen on 127.0.0.1 port {port}" in result.stderr


def test_the_server_process_answers_closes_half_heads_and_stops(tmp_path: Path) -> None:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    settings = Settings(tmp_path, port=port, header_seconds=0.5, tokens={}, quick_seconds=60)
    log = tmp_path / "log"
    with log.open("wb") as stream:
        process = subprocess.Popen(
            [sys.executable, "-m", "lobefit.service.server"],
            env={**os.environ, VARIABLE: settings.to_json()},
            stderr=stream,
        )
    url = f"http://127.0.0.1:{port}"
    try:
        for _ in range(600):
            try:
                with urllib.request.urlopen(f"{url}/healthz") as answer:
                    assert answer.read() == b'{"status":"ok"}'
                break
            except urllib.error.URLError:
                time.sleep(0.1)
        with socket.create_connection(("127.0.0.1", port), 30) as half:
            half.sendall(b"GET /healthz HTTP/1.1\r\nHost: ")
            assert half.recv(1000) == b""
        with socket.create_connection(("127.0.0.1", port), 30) as odd:
            odd.sendall(
                b"POST /v1/fits HTTP/1.1\r\nHost: x\r\nContent-Type: application/json\r\n"
                b"Transfer-Encoding: chunked\r\nConnection: close\r\n\r\nnonsense\r\n"
            )
            assert re.match(rb"HTTP/1.1 400 ", odd.recv(4000))
        with socket.create_connection(("127.0.0.1", port), 30) as large:
            # Refused by its declared length, before anything of it is sent.
            large.sendall(
                b"POST /v1/fits HTTP/1.1\r\nHost: x\r\nContent-Type: application/json\r\n"
                b"Content-Length: 99999999999\r\nExpect: 100-continue\r\n\r\n"
            )
            assert re.match(rb"HTTP/1.1 413 ", large.recv(4000))
        # An upload that waits for a worker, who will never come, does not keep it from stopping.
        with socket.create_connection(("127.0.0.1", port), 30) as waiting:
            waiting.sendall(
                b"POST /v1/measurements HTTP/1.1\r\nHost: x\r\nContent-Type: text/csv\r\n"
                b"Content-Length: 3\r\n\r\nabc"
            )
            time.sleep(0.5)
            process.send_signal(signal.SIGTERM)
            assert re.match(rb"HTTP/1.1 503 ", waiting.recv(4000))
        assert process.wait(30) == 0
    finally:
        process.kill()
        process.wait()
    lines = [json.loads(line) for line in log.read_text().splitlines()]
    assert {line["status"] for line in lines} >= {413, 503}
    assert not any("exception" in line for line in lines)
