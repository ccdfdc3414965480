"""Run the benchmarks and print their tables: ``python -m benchmarks [NAME ...]``.

The figures behind each table go to ``benchmarks/results/NAME.json``.
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path

from benchmarks import fused_sum, models, point_fit, scaling
from benchmarks.timing import machine

__all__ = ["main"]

BENCHMARKS = {
    "fused_sum": fused_sum,
    "models": models,
    "point_fit": point_fit,
    "scaling": scaling,
}
RESULTS = Path(__file__).parent / "results"


def main() -> None:
    """Run what was asked for, or everything."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"of {', '.join(BENCHMARKS)}")
    names = parser.parse_args().names or list(BENCHMARKS)
    unknown = [name for name in names if name not in BENCHMARKS]
    if unknown:
        parser.error(f"no benchmark {', '.join(unknown)}; there are {', '.join(BENCHMARKS)}")
    here = machine()
    print("; ".join(f"{key} {value}" for key, value in here.items()))
    RESULTS.mkdir(exist_ok=True)
    for name in names:
        start = time.perf_counter()
        result = BENCHMARKS[name].run()
        text = BENCHMARKS[name].table(result)
        print(f"\n{name} ({time.perf_counter() - start:.0f} s)\n{text}", flush=True)
        record = json.dumps({"machine": here, **result}, indent=1)
        (RESULTS / f"{name}.json").write_text(record + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
