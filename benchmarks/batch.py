"""One fit, the same bytes everywhere; what the engine costs; what is lost when processes are killed.

``python -m benchmarks.batch same --items 100``
    Simulated measurements fitted on a process pool, on loky and on a Dask cluster of two
    processes; every file compared, times in reports left out. Texels too.
``python -m benchmarks.batch speed --texels 1000000 --workers 1 2``
    Texels per second with one worker and with two, in turns, and the engine's overhead: what of
    the workers' time is not spent in fits, in the clock and in CPU time beside fits in one process.
``python -m benchmarks.batch kills --kills 20``
    A worker, the driver, and the scheduler of a Dask cluster, each killed so many times at random
    moments; in the end every unit must be there once. Then a unit that kills its worker.
``python -m benchmarks.batch wire``
    Bytes that travel for a chunk of texels and for a report, and seconds that a chunk takes
    besides its fit: the executor's, the driver's, the disk's. Input of ``docs/clusters.md``.

Figures go to ``results/batch_NAME.json``.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from benchmarks import batch_kills, batch_same, batch_speed, batch_wire
from benchmarks.timing import machine

__all__ = ["main"]

RESULTS = Path(__file__).parent / "results"


def main(arguments: Sequence[str] | None = None) -> None:
    """Run one of them from the command line."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.batch", description=__doc__)
    commands = parser.add_subparsers(dest="name", required=True)
    same = commands.add_parser("same")
    same.add_argument("--items", type=int, default=100)
    speed = commands.add_parser("speed")
    speed.add_argument("--texels", type=int, default=1_000_000)
    speed.add_argument("--workers", type=int, nargs="+", default=[1, 2])
    speed.add_argument("--rounds", type=int, default=3)
    kills = commands.add_parser("kills")
    kills.add_argument("--kills", type=int, default=20)
    kills.add_argument("--seed", type=int, default=0)
    kills.add_argument("--of", nargs="+", default=list(batch_kills.SCENES))
    wire = commands.add_parser("wire")
    wire.add_argument("--chunk", type=int, default=10_000)
    asked = vars(parser.parse_args(arguments))
    name: str = asked.pop("name")
    runs: dict[str, Callable[..., dict[str, Any]]] = {
        "same": batch_same.run,
        "speed": batch_speed.run,
        "kills": batch_kills.run,
        "wire": batch_wire.run,
    }
    result = {"machine": machine(), "settings": asked, **runs[name](**asked)}
    RESULTS.mkdir(exist_ok=True)
    text = json.dumps(result, indent=1)
    (RESULTS / f"batch_{name}.json").write_text(text + "\n", encoding="utf-8")
    print(text)


if __name__ == "__main__":
    main()
