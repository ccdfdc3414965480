"""Texels per second with one worker and with two, and what the engine takes for itself."""

from __future__ import annotations

import json
import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

__all__ = ["child", "run"]

MODEL = "ggx:k_s=1"


def _cpu() -> float:
    """CPU seconds of this process and of children that ended."""
    return sum(
        u.ru_utime + u.ru_stime
        for u in (
            resource.getrusage(resource.RUSAGE_SELF),
            resource.getrusage(resource.RUSAGE_CHILDREN),
        )
    )


def child(path: str, out: str, workers: int) -> dict[str, float]:
    """Fit a file in this process (0 workers) or by the engine; the clock covers everything."""
    from benchmarks.texels import light_stage
    from lobefit.fitting.texel_batch import fit_texel_file
    from lobefit.fitting.texel_files import save_chunks
    from lobefit.fitting.texel_source import open_texels
    from lobefit.fitting.texels import fit_texel_chunks

    began, cpu = time.perf_counter(), _cpu()
    if not workers:
        source, fits = open_texels(path), 0.0

        def watched() -> Any:
            nonlocal fits
            for first, part in fit_texel_chunks(light_stage(), source, [MODEL]):
                fits += sum(part.seconds.values())
                yield first, part

        save_chunks(watched(), source.shape[0], out)
        chunks = 0
    else:
        done = fit_texel_file(path, out, [MODEL], directions=light_stage(), jobs=workers)
        fits, chunks = done.worked, done.chunks
    return {
        "wall_s": time.perf_counter() - began,
        "cpu_s": _cpu() - cpu,
        "fits_s": fits,
        "chunks": chunks,
    }


def run(texels: int, workers: list[int], rounds: int) -> dict[str, Any]:
    """Run in turns, and give medians."""
    from benchmarks.texels import simulate

    found: dict[int, list[dict[str, float]]] = {n: [] for n in (0, *workers)}
    with tempfile.TemporaryDirectory() as temporary:
        path = Path(temporary) / "texels.npy"
        simulate(path, texels)
        for k in range(rounds):
            for n, runs in found.items():
                out = Path(temporary) / f"out{k}-{n}"
                code = (
                    "import json; from benchmarks.batch_speed import child; "
                    f"print(json.dumps(child({str(path)!r}, {str(out)!r}, {n})))"
                )
                # One thread each: a single worker would else have all cores.
                threads = {"POCL_MAX_PTHREAD_COUNT": "1", "OPENBLAS_NUM_THREADS": "1"}
                done = subprocess.run(
                    [sys.executable, "-c", code],
                    env={**os.environ, **threads},
                    capture_output=True,
                    text=True,
                    check=True,
                )
                runs.append(json.loads(done.stdout.splitlines()[-1]))
    table: dict[str, Any] = {}
    for n, runs in found.items():
        middle = {key: statistics.median(r[key] for r in runs) for key in runs[0]}
        middle["texels_per_s"] = texels / middle["wall_s"]
        # Part of the workers' time that is not spent in fits: starting them included.
        middle["not_fits"] = 1.0 - middle["fits_s"] / (max(n, 1) * middle["wall_s"])
        table["in one process" if not n else f"{n} workers"] = middle
    base = table["in one process"]["cpu_s"]
    overhead = {
        name: row["cpu_s"] / base - 1.0 for name, row in table.items() if name != "in one process"
    }
    walls = {n: table[f"{n} workers"]["wall_s"] for n in workers}
    return {
        "texels": texels,
        "table": table,
        "cpu_overhead": overhead,
        "speed_up": {f"{n} over {workers[0]}": walls[workers[0]] / walls[n] for n in workers[1:]},
    }
