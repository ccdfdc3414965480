"""Make the sample measurements again: every NAME.json here gives NAME.csv.

Run as ``python samples/make.py [NAME ...]``; without a name it makes all of them. The JSON
holds the truth and is written by hand; `README.md` beside this file says what its fields mean.
"""

from __future__ import annotations

import argparse
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

from lobefit.fitting.measurement import Measurement
from lobefit.fitting.simulate import simulate
from lobefit.fitting.writers import write_measurement

__all__ = ["FOLDER", "load", "measure", "names", "write"]

FOLDER = Path(__file__).parent
Spec = dict[str, Any]


def names() -> list[str]:
    """List the samples."""
    return sorted(path.stem for path in FOLDER.glob("*.json"))


def load(name: str) -> Spec:
    """Read what is known about a sample."""
    spec: Spec = json.loads((FOLDER / f"{name}.json").read_text(encoding="utf-8"))
    return spec


def measure(spec: Spec, seed: int | None = None) -> Measurement:
    """Simulate a sample.

    Parameters
    ----------
    spec : dict
        From `load`.
    seed : int, optional
        Another seed than the sample's own, for statistics over many.

    Returns
    -------
    Measurement
        With the header of a laboratory: what it was made from stays in the JSON.
    """
    truth, noise = spec["truth"], spec["noise"]
    measurement = simulate(
        truth["candidate"],
        truth["params"],
        spec["geometry"],
        (noise["relative"], noise["additive"]),
        spec["seed"] if seed is None else seed,
        channels=spec["channels"],
        options=truth["options"],
        sigma=spec["sigma_columns"],
    )
    return replace(measurement, metadata=spec["header"])


def write(spec: Spec, path: Path) -> None:
    """Write the CSV, if asked for with semicolons and decimal commas."""
    write_measurement(measure(spec), path)
    if spec["separator"] == ";":
        lines = path.read_text(encoding="utf-8").splitlines(keepends=True)
        table = str.maketrans(",.", ";,")
        path.write_text(
            "".join(line if line.startswith("#") else line.translate(table) for line in lines),
            encoding="utf-8",
        )


def main() -> None:
    """Write the CSVs named on the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("name", nargs="*", choices=[*names(), []], help="which; all by default")
    for name in parser.parse_args().name or names():
        write(load(name), FOLDER / f"{name}.csv")
        print(f"samples/{name}.csv")


if __name__ == "__main__":
    main()
