"""The same inputs on three executors: are the files the same?"""

from __future__ import annotations

import re
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.batch_cluster import Cluster

__all__ = ["run"]

MODELS = ("lambert", "ggx:k_s=1", "cook_torrance:k_s=1", "phong")
SCAN = "in-plane incidences=10,40,65 step=8"
TEXELS = 20_000
TIMES = re.compile(r'"(created|seconds)": [^,\n]+')


def inputs(folder: Path, items: int) -> None:
    """Simulate measurements of random surfaces, a tenth of them in three channels."""
    from lobefit.fitting import simulate, write_measurement

    rng = np.random.default_rng(11)
    for k in range(items):
        channels = 3 if k % 10 == 0 else 1
        params = {
            "k_d": rng.uniform(0.02, 0.5, channels).tolist(),
            "F0": rng.uniform(0.04, 0.9, channels).tolist(),
            "alpha": float(rng.uniform(0.1, 0.6)),
        }
        m = simulate("ggx:k_s=1", params, SCAN, noise=(0.01, 1e-4), seed=k)
        write_measurement(m, folder / f"surface{k:03}.csv")


def files_of(folder: Path) -> dict[str, bytes]:
    """Read all files of reports, times taken out."""
    found = {}
    for path in sorted(folder.glob("*/*")):
        data = path.read_bytes()
        if path.name == "report.json":
            data = TIMES.sub("", data.decode()).encode()
        found[str(path.relative_to(folder))] = data
    return found


def maps_of(folder: Path) -> dict[str, bytes]:
    """Read all arrays of texels."""
    return {p.name: p.read_bytes() for p in folder.iterdir() if p.suffix in (".npy", ".json")}


def run(items: int) -> dict[str, Any]:
    """Fit on each, compare with the first."""
    from benchmarks.texels import light_stage
    from benchmarks.texels import simulate as simulate_texels
    from lobefit.fitting import fit_many, fit_texel_file

    seconds: dict[str, float] = {}
    different: dict[str, list[str]] = {}
    with tempfile.TemporaryDirectory() as temporary, Cluster() as cluster:
        place = Path(temporary)
        (place / "in").mkdir()
        inputs(place / "in", items)
        simulate_texels(place / "texels.npy", TEXELS)
        first: tuple[dict[str, bytes], dict[str, bytes]] | None = None
        ways: dict[str, dict[str, Any]] = {
            "processes": {"jobs": 2, "pool": "processes"},
            "loky": {"jobs": 2, "pool": "loky"},
            "dask": {"scheduler": cluster.address},
        }
        for name, way in ways.items():
            began = time.perf_counter()
            fit_many(str(place / "in" / "*.csv"), place / name, MODELS, **way)
            seconds[name] = time.perf_counter() - began
            fit_texel_file(
                place / "texels.npy",
                place / f"{name}-texels",
                "quick",
                directions=light_stage(),
                **way,
            )
            found = (files_of(place / name), maps_of(place / f"{name}-texels"))
            if first is None:
                first = found
            different[name] = sorted(
                file
                for mine, theirs in zip(first, found, strict=True)
                for file in {*mine, *theirs}
                if mine.get(file) != theirs.get(file)
            )
        assert first is not None
        return {
            "files": sum(len(part) for part in first),
            "bytes": sum(len(data) for part in first for data in part.values()),
            "different": different,
            "seconds": seconds,
        }
