"""Whether two runs of one chart agree on the Pareto front, up to its stated spread.

``python -m benchmarks.chart_twice FILE [--repeats 5] [--groups fit,evaluation]`` makes the chart
of a measurement twice, in one process, and compares them; status 1 where they disagree.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from lobefit.fitting import read_measurement
from lobefit.fitting.tradeoff import GROUPS, chart
from lobefit.fitting.tradeoff_compare import Agreement, compare
from lobefit.fitting.tradeoff_subject import held_out

__all__ = ["main", "twice"]


def twice(file: Path, *, repeats: int, groups: list[str], models: str) -> list[Agreement]:
    """Make a chart twice and compare."""
    subject = held_out(read_measurement(file))
    first, second = (
        chart(subject, models=models, repeats=repeats, groups=groups) for _ in range(2)
    )
    return compare(first, second)


def main() -> None:
    """Run it on the files that were named."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.chart_twice", description=__doc__)
    parser.add_argument("files", nargs="+", type=Path, metavar="FILE")
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--groups", default=",".join(GROUPS))
    parser.add_argument("--models", default="all")
    asked = parser.parse_args()
    disputed = 0
    for file in asked.files:
        found = twice(
            file, repeats=asked.repeats, groups=asked.groups.split(","), models=asked.models
        )
        for agreement in found:
            print(f"{file.name}: {agreement}")
            for sentence in agreement.disputed:
                print(f"  {sentence}")
            disputed += len(agreement.disputed)
    raise SystemExit(1 if disputed else 0)


if __name__ == "__main__":
    main()
