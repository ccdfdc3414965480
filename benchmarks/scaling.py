"""Time and memory of a fit as the measurement grows: 10^3 to 10^6 samples of 3 channels.

Each size runs in a process of its own that reads the CSV and fits it, so that the peak memory is
what a user's process needs, libraries, file and all.
"""

from __future__ import annotations

import argparse
import json
import math
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.numpy_models import Geometry, ggx_lobe, goniometer
from benchmarks.timing import cores
from lobefit.fitting import Measurement, fit, read_measurement, write_measurement

__all__ = ["run", "table"]

SIZES = (10**3, 10**4, 10**5, 10**6)
MODEL = "ggx"
CHANNELS = ("R", "G", "B")
WARM_RUNS = 3
LIMIT_MB = 500
MB = 1e6


def simulated(n: int) -> Measurement:
    """Diffuse + GGX with 1 % noise, from this folder's own numpy model."""
    angles = goniometer(n)
    g = Geometry.of(*angles)
    lobe, s = ggx_lobe(g, 0.2), g.schlick
    clean = np.stack(
        [
            k_d / np.pi + k_s * lobe * (F0 + (1 - F0) * s)
            for k_d, k_s, F0 in ((0.3, 0.2, 0.2), (0.2, 0.25, 0.5), (0.1, 0.3, 0.8))
        ]
    )
    sigma = 0.01 * clean
    noise = np.random.default_rng(11).standard_normal(clean.shape)
    return Measurement(*angles, clean + sigma * noise, CHANNELS, sigma)


def peak_mb() -> float:
    """Largest resident memory of this process so far, in 10^6 bytes.

    Linux keeps the parent's peak in `ru_maxrss` across a start, so its own count of this program's
    memory is read where there is one.
    """
    status = Path("/proc/self/status")
    if status.exists():
        for line in status.read_text().splitlines():
            if line.startswith("VmHWM:"):
                return int(line.split()[1]) * 1024 / MB
    unit = 1 if sys.platform == "darwin" else 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit / MB


def child(path: Path, models: str | list[str]) -> dict[str, float]:
    """Read and fit one file in this process: seconds of each step and peak memory after it."""
    imported = peak_mb()
    start = time.perf_counter()
    measurement = read_measurement(path)
    read = time.perf_counter() - start
    after_reading = peak_mb()
    seconds = []
    peaks = []
    for _ in range(1 + WARM_RUNS):  # the first compiles the kernels
        start = time.perf_counter()
        fit(measurement, models=models)
        seconds.append(time.perf_counter() - start)
        peaks.append(peak_mb())
    return {
        "read_s": read,
        "first_fit_s": seconds[0],
        "fit_s": statistics.median(seconds[1:]),
        "imported_mb": imported,
        "after_reading_mb": after_reading,
        "first_fit_mb": peaks[0],
        "peak_mb": peaks[-1],
    }


def run() -> dict[str, Any]:
    """Measure every size in a process of its own; returns a JSON-able record."""
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for n in SIZES:
            path = Path(folder) / f"{n}.csv"
            write_measurement(simulated(n), path)
            command = [sys.executable, "-m", "benchmarks.scaling", str(path), MODEL]
            done = subprocess.run(
                command, cwd=Path(__file__).parents[1], check=True, capture_output=True, text=True
            )
            rows.append({"samples": n, **json.loads(done.stdout)})
            path.unlink()
    for before, row in pairwise(rows):
        decades = math.log(row["samples"] / before["samples"])
        row["slope"] = math.log(row["fit_s"] / before["fit_s"]) / decades
    return {"model": MODEL, "channels": len(CHANNELS), "cores": cores(), "rows": rows}


def table(result: dict[str, Any]) -> str:
    """Lay out the result of `run` for reading."""
    heads = (
        "samples",
        "read s",
        "first fit s",
        "fit s",
        "slope",
        "imports",
        "+ read",
        "+ fit",
        f"+ {WARM_RUNS} fits",
    )
    lines = [
        f"{result['model']}, {result['channels']} channels with sigma, {result['cores']} cores",
        "slope: exponent of the fit's time from one size to the next, 1 is linear",
        "last four: peak memory of the process so far, MB of 10^6 bytes",
        "".join(f"{head:>12}" for head in heads),
    ]
    for row in result["rows"]:
        slope = f"{row['slope']:.2f}" if "slope" in row else "-"
        lines.append(
            f"{row['samples']:>12}{row['read_s']:>12.3f}{row['first_fit_s']:>12.3f}"
            f"{row['fit_s']:>12.3f}{slope:>12}{row['imported_mb']:>12.0f}"
            f"{row['after_reading_mb']:>12.0f}{row['first_fit_mb']:>12.0f}{row['peak_mb']:>12.0f}"
        )
    worst = max(row["peak_mb"] for row in result["rows"])
    lines.append(f"peak memory {worst:.0f} MB, limit {LIMIT_MB} MB")
    return "\n".join(lines)


if __name__ == "__main__":
    arguments = argparse.ArgumentParser()
    arguments.add_argument("file", type=Path)
    arguments.add_argument("models", nargs="+")
    given = arguments.parse_args()
    print(json.dumps(child(given.file, given.models)))
