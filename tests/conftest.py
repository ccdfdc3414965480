"""What tests of every room share: a running service."""

from __future__ import annotations

import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterator

import pytest

from lobefit.service import Client, ServiceError


@pytest.fixture(scope="session")
def service_url(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """Start a service of one worker on a free port; gives its address."""
    folder = tmp_path_factory.mktemp("service")
    program = "from lobefit.service.cli import main; main()"
    command = [sys.executable, "-c", program, "serve", "--port=0", "--workers=1"]
    with (folder / "log").open("w") as log:
        process = subprocess.Popen(
            [*command, f"--data-dir={folder / 'data'}"],
            stdout=subprocess.PIPE,
            stderr=log,
            text=True,
        )
    try:
        assert process.stdout is not None
        found = re.search(r"http://\S+", process.stdout.readline())
        assert found, (folder / "log").read_text()
        with Client(found[0]) as client:
            end = time.monotonic() + 200.0  # kernels are compiled first
            while time.monotonic() < end:
                try:
                    if client.ready():
                        break
                except ServiceError:
                    assert process.poll() is None, (folder / "log").read_text()
                time.sleep(0.1)
            else:
                pytest.fail(f"not ready: {client.ready()}")
        yield found[0]
        process.send_signal(signal.SIGTERM)
        process.communicate(timeout=30)
        assert process.returncode == 0, (folder / "log").read_text()
    finally:
        if process.poll() is None:
            process.kill()
            process.communicate()
