"""What travels for a chunk, and what a chunk costs besides its fit."""

from __future__ import annotations

import pickle
import statistics
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.batch_cluster import Cluster

__all__ = ["run"]

MODEL = "ggx:k_s=1"
TASKS = 100


def _nothing(sent: object) -> None:
    return None


def _round_trip(crew: Any, payload: object = None) -> float:
    """Give the median seconds from handing over a task to its answer, one at a time."""
    crew.submit(_nothing, None).result()
    times = []
    for _ in range(TASKS):
        began = time.perf_counter()
        crew.submit(_nothing, payload).result()
        times.append(time.perf_counter() - began)
    return statistics.median(times)


def _stream(crew: Any) -> float:
    """Give the seconds a task when many are under way."""
    began = time.perf_counter()
    for future in [crew.submit(_nothing, None) for _ in range(5 * TASKS)]:
        future.result()
    return (time.perf_counter() - began) / (5 * TASKS)


def run(chunk: int) -> dict[str, Any]:
    """Measure with a chunk of 64 readings of 3 channels, and with one report."""
    from benchmarks.texels import light_stage, simulate
    from lobefit.fitting import simulate as simulate_measurement
    from lobefit.fitting import write_measurement
    from lobefit.fitting.batch_inputs import Item, items_of
    from lobefit.fitting.batch_item import fit_item
    from lobefit.fitting.engine import Ledger, Row, open_crew
    from lobefit.fitting.texel_batch import OpenTexels
    from lobefit.fitting.texel_files import TexelFolder
    from lobefit.fitting.texels import fit_texels

    result: dict[str, Any] = {}
    with tempfile.TemporaryDirectory() as temporary:
        place = Path(temporary)
        simulate(place / "texels.npy", chunk)
        readings = np.load(place / "texels.npy")
        opener = OpenTexels(
            path=None,
            array="",
            angles=light_stage().tobytes(),
            channels=3,
            models=(MODEL,),
            noise="relative",
            options=(),
            precision="single",
            device=None,
        )
        fit = fit_texels(light_stage(), readings[:64], [MODEL])  # compiles
        began = time.perf_counter()
        fit = fit_texels(light_stage(), readings, [MODEL])
        result["fit_us_per_texel_all_cores"] = 1e6 * (time.perf_counter() - began) / chunk
        result["bytes"] = {
            "description of the work, with each chunk": len(pickle.dumps(opener)),
            "readings, a texel": len(pickle.dumps(readings)) / chunk,
            "results, a texel": len(pickle.dumps(fit)) / chunk,
        }
        written, noted = [], []
        with Ledger(place / "ledger.sqlite") as ledger:
            stored = TexelFolder(place / "out", 20 * chunk)
            for k in range(20):
                began = time.perf_counter()
                stored.write(k * chunk, fit)
                written.append(time.perf_counter() - began)
                began = time.perf_counter()
                stored.sync()
                ledger.settle([Row(k * chunk, (k + 1) * chunk)])
                noted.append(time.perf_counter() - began)
        # All chunks that are back at the same time are noted together.
        result["driver_ms"] = {
            "writing a chunk": 1e3 * statistics.median(written),
            "noting chunks": 1e3 * statistics.median(noted),
        }
        m = simulate_measurement("ggx:k_s=1", {"k_d": 0.1, "F0": 0.5, "alpha": 0.3})
        write_measurement(m, place / "surface.csv")
        (item,) = items_of(place / "surface.csv", Item(models=MODEL))
        result["bytes"]["a measurement of this size"] = (place / "surface.csv").stat().st_size
        result["bytes"]["its report, picture and lobes"] = len(pickle.dumps(fit_item(item)))
    result["ms_per_task"] = {}
    with Cluster() as cluster:
        for name, crew in {
            "loky": open_crew(2),
            "processes": open_crew(2, kind="processes"),
            "dask": open_crew(scheduler=cluster.address),
        }.items():
            try:
                result["ms_per_task"][name] = {
                    "alone": 1e3 * _round_trip(crew),
                    "alone, with the readings": 1e3 * _round_trip(crew, readings),
                    "in a stream": 1e3 * _stream(crew),
                }
            finally:
                crew.close()
    return {"texels": chunk, "samples": 64, "channels": 3, **result}
