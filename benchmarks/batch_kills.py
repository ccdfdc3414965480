"""Kill a worker, the driver or the scheduler at random moments, and count what is lost."""

from __future__ import annotations

import os
import random
import signal
import sqlite3
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from contextlib import nullcontext, suppress
from pathlib import Path
from typing import Any

from benchmarks.batch_cluster import Cluster
from lobefit.fitting.engine import Ledger, open_crew
from lobefit.fitting.engine import run as run_work
from tests.fitting.engine_cases import Squares, squares

__all__ = ["SCENES", "drive", "run"]

# Seconds of a unit, and between kills: a chunk takes half a second.
PAUSE, CHUNK, BETWEEN = 0.02, 0.5, (1.0, 3.0)
POISON = 1234


def drive(folder: str, units: int, address: str | None, killers: tuple[int, ...] = ()) -> None:
    """Do all units; run in a process of its own, which may be killed."""
    place = Path(folder)
    opener = Squares(PAUSE, frozenset(killers))
    work = squares(place / "out", units, opener, seconds=CHUNK)
    with Ledger(place / "ledger.sqlite") as ledger:
        crew = open_crew(None if address else 2, address)
        run_work(
            work,
            ledger,
            crew,
            progress=lambda s: print(s.message, flush=True) if s.message else None,
        )


class Driver:
    """The driver as a process."""

    def __init__(self, folder: Path, units: int, address: str | None) -> None:
        self.code = (
            "from benchmarks.batch_kills import drive\n"
            f"if __name__ == '__main__':\n    drive({str(folder)!r}, {units}, {address!r})\n"
        )
        self.script = folder / "driver.py"
        self.script.write_text(self.code)
        self.log = (folder / "log").open("ab")
        self.start()

    def start(self) -> None:
        """Start it, again."""
        self.process = subprocess.Popen(
            [sys.executable, self.script],
            env={**os.environ, "PYTHONPATH": os.getcwd()},  # noqa: PTH109
            stdout=self.log,
            stderr=self.log,
        )

    def children(self) -> list[int]:
        """Give its workers; loky's and Python's trackers of resources are none."""
        pid, found = self.process.pid, []
        with suppress(OSError):
            for child in Path(f"/proc/{pid}/task/{pid}/children").read_text().split():
                if b"tracker" not in Path(f"/proc/{child}/cmdline").read_bytes():
                    found.append(int(child))
        return found


def _kill_worker(driver: Driver, cluster: Cluster | None, chance: random.Random) -> bool:
    children = driver.children()
    if not children:
        return False
    with suppress(ProcessLookupError):
        os.kill(chance.choice(children), signal.SIGKILL)
        return True
    return False


def _kill_driver(driver: Driver, cluster: Cluster | None, chance: random.Random) -> bool:
    driver.process.kill()
    driver.process.wait()
    driver.start()
    return True


def _kill_scheduler(driver: Driver, cluster: Cluster | None, chance: random.Random) -> bool:
    assert cluster is not None
    cluster.kill_scheduler()
    return True


Kill = Callable[[Driver, Cluster | None, random.Random], bool]
SCENES: dict[str, tuple[Kill, bool]] = {
    "worker": (_kill_worker, False),
    "driver": (_kill_driver, False),
    "scheduler": (_kill_scheduler, True),
}
# Seconds until a run counts as stuck: a cluster on a busy machine takes long to be back.
LONGEST = 60.0


def scene(name: str, kills: int, chance: random.Random) -> dict[str, Any]:
    """Kill until it was so many times, wait for the rest, count."""
    kill, clustered = SCENES[name]
    with (
        tempfile.TemporaryDirectory() as temporary,
        Cluster() if clustered else nullcontext() as cluster,
    ):
        place = Path(temporary)
        # Work of two workers for as long as there will be kills, and some more.
        units = int(2 * sum(BETWEEN) / 2 * (kills + 3) / PAUSE)
        began, killed = time.monotonic(), 0
        driver = Driver(place, units, cluster.address if cluster else None)
        try:
            until, wait, before = began + LONGEST * (kills + 2), 0.0, 0
            while time.monotonic() < until and driver.process.poll() is None:
                time.sleep(0.2)
                if cluster:
                    cluster.mend()
                done = len(list((place / "out").glob("*.txt")))
                if done == before or killed == kills:
                    continue  # between kills something must get done
                wait = wait or time.monotonic() + chance.uniform(*BETWEEN)
                if time.monotonic() > wait and kill(driver, cluster, chance):
                    killed, wait, before = killed + 1, 0.0, len(list((place / "out").glob("*.txt")))
            code = driver.process.poll()
        finally:
            driver.process.kill()
            driver.process.wait()
            driver.log.close()
        return {"kills": killed, "units": units, "exit": code, **count(place, units)} | {
            "seconds": round(time.monotonic() - began, 1),
            # For whoever has to find out why; of no use where all went well.
            "log": (place / "log").read_text(errors="replace").splitlines()[-3:] if code else [],
        }


def count(place: Path, units: int) -> dict[str, Any]:
    """Count units that are lost, wrong, or in the ledger twice."""
    found = {int(p.stem): int(p.read_text()) for p in (place / "out").glob("*.txt")}
    with sqlite3.connect(place / "ledger.sqlite") as db:
        rows = db.execute("SELECT first, stop, state FROM chunks").fetchall()
        sound = db.execute("PRAGMA integrity_check").fetchone()[0]
    db.close()
    noted = [unit for first, stop, _ in rows for unit in range(first, stop)]
    return {
        "chunks": len(rows),
        "lost": units - len(set(noted)),
        "without_output": len(set(noted) - set(found)),
        "wrong": sum(value != unit * unit for unit, value in found.items()),
        "twice": len(noted) - len(set(noted)),
        "failed": [first for first, _, state in rows if state == "failed"],
        "ledger": sound,
    }


def run(kills: int, seed: int, of: list[str]) -> dict[str, Any]:
    """Run the scenes, and a unit that kills its worker among 3,000."""
    chance = random.Random(seed)
    result: dict[str, Any] = {name: scene(name, kills, chance) for name in of}
    with tempfile.TemporaryDirectory() as temporary:
        began = time.monotonic()
        drive(temporary, 3000, None, (POISON,))
        result["poison"] = count(Path(temporary), 3000) | {
            "killer": POISON,
            "seconds": round(time.monotonic() - began, 1),
        }
    return result
