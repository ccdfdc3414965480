"""A service started for a benchmark, and what its processes use."""

from __future__ import annotations

import os
import re
import select
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import httpx2

__all__ = ["Served", "quantile", "served"]

MIB = 1 << 20


@dataclass
class Served:
    """A running service.

    Attributes
    ----------
    url : str
        Where it listens.
    log : Path
        What its processes wrote to standard error.
    answers, ready : float
        Seconds from its start until /healthz and /readyz said yes.
    """

    url: str
    pid: int
    log: Path
    answers: float = 0.0
    ready: float = 0.0

    def client(self, **settings: Any) -> httpx2.Client:
        """Give a client of it."""
        return httpx2.Client(base_url=self.url, timeout=300.0, **settings)

    def memory(self) -> dict[str, float]:
        """Give the resident MiB of each process by its name."""
        found = {"supervisor": _resident(self.pid)}
        for path in Path("/proc").glob("[0-9]*/stat"):
            try:
                parent = int(path.read_text().rpartition(")")[2].split()[1])
                command = (path.parent / "cmdline").read_text().split("\0")
            except OSError:  # it has ended meanwhile
                continue
            if parent == self.pid:
                name = command[command.index("--name") + 1] if "--name" in command else "server"
                found[name] = _resident(int(path.parent.name))
        return found

    def tracebacks(self) -> int:
        """Count the faults in the log."""
        text = self.log.read_text(encoding="utf-8", errors="replace")
        return text.count("Traceback (most recent call last)") + text.count('"level": "error"')


def _resident(pid: int) -> float:
    pages = int(Path(f"/proc/{pid}/statm").read_text(encoding="ascii").split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / MIB


def quantile(values: list[float], q: float) -> float:
    """Give a quantile by the nearest rank."""
    return sorted(values)[min(len(values) - 1, int(q * len(values)))]


@contextmanager
def served(*arguments: str) -> Iterator[Served]:
    """Run ``lobefit serve`` in a folder of its own until it is no longer needed.

    Parameters
    ----------
    *arguments : str
        Further options of the command.
    """
    folder = Path(tempfile.mkdtemp(prefix="lobefit-benchmark-"))
    command = [sys.executable, "-m", "lobefit.service.cli", "serve", "--port", "0"]
    command[1:3] = ["-c", "from lobefit.service.cli import main; main()"]
    log = folder / "log"
    start = time.perf_counter()
    with log.open("wb") as stream:
        process = subprocess.Popen(
            [*command, "--data-dir", str(folder / "data"), *arguments],
            stdout=subprocess.PIPE,
            stderr=stream,
        )
    try:
        assert process.stdout is not None
        if not select.select([process.stdout], [], [], 60)[0]:
            raise RuntimeError(f"the service did not start: {log.read_text()}")
        match = re.search(r"http://\S+", process.stdout.readline().decode())
        if match is None:
            raise RuntimeError(f"the service did not start: {log.read_text()}")
        found = Served(match[0], process.pid, log)
        with found.client() as client:
            found.answers = _until(client, "/healthz", start)
            found.ready = _until(client, "/readyz", start)
        yield found
    finally:
        process.send_signal(signal.SIGTERM)
        process.wait(60)
        shutil.rmtree(folder, ignore_errors=True)


def _until(client: httpx2.Client, path: str, start: float) -> float:
    while time.perf_counter() - start < 300:
        try:
            if client.get(path).status_code == 200:
                return time.perf_counter() - start
        except httpx2.TransportError:
            pass
        time.sleep(0.02)
    raise RuntimeError(f"{path} did not say yes in 300 s")
