"""What is lost when processes of the service are killed: nothing, and here is the count.

``python -m benchmarks.kills --kills 100`` (fake jobs of 0.1 s; ``--fits`` real ones;
``--tmpfs`` with the data folder on a 16 MB disk that fills up, where mounting is possible)

Clients submit jobs over HTTP without pause, each with an Idempotency-Key, and try again until
they are answered. Meanwhile a worker, the desk, the server or the supervisor itself is killed with
SIGKILL at random moments, and the database is checked after each. In the end every job that was
acknowledged must be done once, with files of the stated digests, and no job must be there twice.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import random
import shutil
import signal
import socket
import sqlite3
import subprocess
import sys
import tempfile
import threading
import time
import urllib.error
import urllib.request
from collections import Counter
from contextlib import suppress
from pathlib import Path
from typing import Any

from benchmarks.kills_worker import made_of
from lobefit.service.rows import Limits, StoreError
from lobefit.service.settings import VARIABLE, Settings
from lobefit.service.store import Store

__all__ = ["main"]

# A job may meet several kills by chance, which is no fault of its own.
LIMITS = Limits(attempts=12, lease=4.0)
MEASUREMENT = b"theta_i,phi_i,theta_o,phi_o,brdf\n" + b"".join(
    b"%d,0,%d,180,%.4f\n" % (i, o, 0.3 + 0.0001 * ((7 * o + i) % 13))
    for i in (0, 30, 60)
    for o in range(0, 80, 4)
)


class Service:
    """The supervisor as a process, and the others as its children."""

    def __init__(self, folder: Path, workers: int, fits: bool) -> None:
        self.folder, self.workers = folder, workers
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            self.port = free.getsockname()[1]
        self.environment = dict(os.environ) | ({} if fits else {"LOBEFIT_FAKE": "1"})
        settings = Settings(data_dir=folder, port=self.port, limits=LIMITS)
        self.environment[VARIABLE] = settings.to_json()
        self.log = (folder.parents[1] / "log").open("ab")
        self.process = self._start()

    def _start(self) -> subprocess.Popen[bytes]:
        return subprocess.Popen(
            [sys.executable, "-m", "benchmarks.kills_supervisor", self.folder, str(self.workers)],
            env=self.environment,
            stdout=self.log,
            stderr=self.log,
        )

    def children(self) -> list[int]:
        """Give the processes of server and workers."""
        pid = self.process.pid
        with suppress(OSError):
            text = Path(f"/proc/{pid}/task/{pid}/children").read_text()
            return [int(child) for child in text.split()]
        return []

    def kill(self, chance: random.Random) -> str:
        """Kill one of the processes."""
        children = self.children()
        if not children:
            return ""
        servers = [pid for pid in children if _kind(pid) == "server"]
        workers = [pid for pid in children if pid not in servers]
        groups = [workers, servers, [self.process.pid]]
        # Server and supervisor take seconds to start; between them work must get on.
        (group,) = chance.choices(groups, (0.75, 0.17, 0.08))
        if not group:
            return ""
        victim = chance.choice(group)
        kind = "supervisor" if victim == self.process.pid else _kind(victim)
        with suppress(ProcessLookupError):
            os.kill(victim, signal.SIGKILL)
        if kind == "supervisor":
            self.process.wait()
            self.process = self._start()
        return kind

    def stop(self) -> None:
        """End it as a user would."""
        self.process.terminate()
        self.process.wait(60)
        self.log.close()


def _kind(pid: int) -> str:
    with suppress(OSError):
        words = Path(f"/proc/{pid}/cmdline").read_text().split("\0")
        if "--name" in words:
            return words[words.index("--name") + 1]
    return "server"


class Client(threading.Thread):
    """Submits jobs one after the other; knows which were acknowledged."""

    def __init__(self, service: Service, measurement: str, name: str, most: int) -> None:
        super().__init__(daemon=True)
        self.service, self.measurement, self.tag, self.most = service, measurement, name, most
        self.acknowledged: dict[str, str] = {}
        self.refused: Counter[int] = Counter()
        self.ended = False

    def run(self) -> None:
        count = 0
        while not self.ended:
            name = f"{self.tag}-{count}"
            id = self._submit(name)
            if id is not None:
                self.acknowledged[name] = id
                count += 1
            while not self.ended and self._waiting() > self.most:
                time.sleep(0.05)

    def _submit(self, name: str) -> str | None:
        body = {"measurement": self.measurement, "models": ["lambert"], "name": name}
        headers = {"Content-Type": "application/json", "Idempotency-Key": name}
        answer = self.ask("/v1/fits", json.dumps(body).encode(), headers)
        return None if answer is None else str(answer["id"])

    def ask(self, path: str, data: bytes | None, headers: dict[str, str]) -> Any:
        """Give the answer, or None where there was none."""
        url = f"http://127.0.0.1:{self.service.port}{path}"
        request = urllib.request.Request(url, data=data, headers=headers)
        try:
            with urllib.request.urlopen(request, timeout=20) as response:
                return json.load(response)
        except urllib.error.HTTPError as error:
            self.refused[error.code] += 1
        except (OSError, ValueError):
            self.refused[0] += 1
        time.sleep(0.05)
        return None

    def _waiting(self) -> int:
        answer = self.ask("/v1/fits?state=queued&limit=50", None, {})
        return len(answer["items"]) if answer else 0


def _sound(folder: Path) -> bool:
    with sqlite3.connect(folder / "store.sqlite", timeout=30) as connection:
        found: str = connection.execute("PRAGMA integrity_check").fetchone()[0]
    connection.close()
    return found == "ok"


def _wrong(store: Store, name: str, id: str, fits: bool) -> str:
    """Say what is wrong with a job that was acknowledged; nothing if all is well."""
    try:
        job = store.job(id)
    except StoreError:
        return "lost"
    if job.state != "done":
        return f"{job.state}: {(job.problem or {}).get('detail', '')}"
    ends = [e for e in store.events(id, 0, 1000) if e.type == "state" and e.data["state"] == "done"]
    if len(ends) != 1:
        return "duplicated"
    files = store.artefacts(id)
    for file in files:
        data = store.artefact_path(id, file.name).read_bytes()
        if len(data) != file.bytes or hashlib.sha256(data).hexdigest() != file.sha256:
            return "corrupt"
        if file.name == "report.json":
            report = json.loads(data)
            if report["best"] != "lambert" or (not fits and report != made_of(name)):
                return "corrupt"
    return "" if "report.json" in {f.name for f in files} else "corrupt"


def _fill(folder: Path, ended: threading.Event, chance: random.Random, times: list[int]) -> None:
    """Fill the disk to the last byte now and then, and give the space back."""
    ballast = folder.parent / "ballast"
    while not ended.wait(chance.uniform(1.0, 3.0)):
        with suppress(OSError), ballast.open("wb", buffering=0) as file:
            while True:
                file.write(b"x" * 65536)
        times[0] += 1
        ended.wait(chance.uniform(0.5, 2.0))
        ballast.unlink(missing_ok=True)


def main() -> None:
    """Kill, wait for the rest, count."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kills", type=int, default=100)
    parser.add_argument("--pause", type=float, default=1.5, help="mean seconds between kills")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--clients", type=int, default=3)
    parser.add_argument("--fits", action="store_true", help="real fits")
    parser.add_argument("--tmpfs", action="store_true", help="on a 16 MB disk that fills up")
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    root = Path(tempfile.mkdtemp(prefix="lobefit-kills-"))
    disk = root / "disk"
    disk.mkdir()
    if given.tmpfs:
        subprocess.run(["mount", "-t", "tmpfs", "-o", "size=16m", "none", disk], check=True)
    try:
        _run(given, disk / "data", root)
    finally:
        if given.tmpfs:
            subprocess.run(["umount", "-l", disk], check=True)
        shutil.rmtree(root, ignore_errors=True)


def _run(given: argparse.Namespace, folder: Path, root: Path) -> None:
    chance = random.Random(given.seed)
    began = time.monotonic()
    store = Store(folder, LIMITS)
    with store.upload() as upload:
        upload.write(MEASUREMENT)
        upload.finish()
        measurement, _ = store.adopt(upload, "m.csv", {})
    service = Service(folder, given.workers, given.fits)
    clients = [Client(service, measurement.id, f"c{k}", 8) for k in range(given.clients)]
    for client in clients:
        client.start()
    ended, filled = threading.Event(), [0]
    filler = threading.Thread(target=_fill, args=(folder, ended, chance, filled))
    if given.tmpfs:
        filler.start()
    killed: Counter[str] = Counter()
    unsound = 0
    while not any(client.acknowledged for client in clients):
        time.sleep(0.1)
    while sum(killed.values()) < given.kills:
        time.sleep(chance.expovariate(1.0 / given.pause))
        kind = service.kill(chance)
        if kind:
            killed[kind] += 1
            unsound += not _sound(folder)
    ended.set()
    for client in clients:
        client.ended = True
    for client in clients:
        client.join()
    if given.tmpfs:
        filler.join()
    until = time.monotonic() + 300.0
    while time.monotonic() < until and any(
        state in ("queued", "running") for kind, state in store.counts() if kind == "fit"
    ):
        time.sleep(0.2)
    acknowledged = {name: id for c in clients for name, id in c.acknowledged.items()}
    service.stop()
    wrong = Counter(
        fault for name, id in acknowledged.items() if (fault := _wrong(store, name, id, given.fits))
    )
    made = sum(n for (kind, _), n in store.counts().items() if kind == "fit")
    names = store.database.read("SELECT request FROM jobs WHERE kind = 'fit'")
    unique = len({json.loads(row["request"])["name"] for row in names})
    (again,) = store.database.read("SELECT sum(attempts) - count(*) FROM jobs WHERE kind = 'fit'")
    overlaps = folder / "overlaps"
    print(
        f"{time.monotonic() - began:.0f} s, killed: {dict(killed)}, disk filled {filled[0]} times"
    )
    print(f"refused or dropped requests: {dict(sum((c.refused for c in clients), Counter()))}")
    print(f"acknowledged {len(acknowledged)}, in the store {made}, under {unique} names")
    print(f"attempts besides the first: {again[0]}")
    print(f"wrong: {dict(wrong) or 'none'}")
    print(
        f"same job twice at once: {len(overlaps.read_text().split()) if overlaps.exists() else 0}"
    )
    print(
        f"integrity: {unsound} unsound after kills, {'ok' if _sound(folder) else 'BAD'} at the end"
    )
    known = {row["id"] for row in store.database.read("SELECT id FROM jobs")}
    left = [p.name for p in (folder / "jobs").iterdir() if p.name not in known]
    print(f"folders of no job: {len(left)}, uploads left: {len(list((folder / 'tmp').iterdir()))}")
    with suppress(OSError):
        print(f"processes left: {_strays(folder)}")
    store.close()


def _strays(folder: Path) -> int:
    """Count processes that still work for the folder."""
    found = 0
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit() and int(entry.name) != os.getpid():
            with suppress(OSError):
                found += str(folder).encode() in (entry / "cmdline").read_bytes()
    return found


if __name__ == "__main__":
    main()
