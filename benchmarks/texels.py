"""A million texels, diffuse + GGX, beside `scipy.optimize.least_squares` on each.

``python -m benchmarks.texels --texels 1000000``: 64 light directions above one view, 3 channels, 1 %
noise, simulated with this folder's own numpy model and written to disk; read, fitted and written
chunk by chunk in a process of its own, whose peak memory is shown. Scipy fits up to 1,000 of the
same texels in the same run: relative residuals with bounds and a Jacobian by hand, from a
guess (k_d from the dark readings) or, a second time, from the truth, which no user has. Figures go to
``results/texels.json``.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from benchmarks.numpy_models import Geometry, ggx_lobe
from benchmarks.scaling import peak_mb
from benchmarks.timing import machine

__all__ = ["run"]

Array = NDArray[np.float64]

SAMPLES, CHANNELS, NOISE = 64, 3, 0.01
MODEL = "ggx:k_s=1"
MOST_SCIPY = 1000
BLOCK = 16_384
RESULT = Path(__file__).parent / "results" / "texels.json"


def light_stage(n: int = SAMPLES) -> Array:
    """Give n lights spread evenly over the hemisphere to 75 degrees, one view; radians, (4, n)."""
    k = np.arange(n) + 0.5
    theta = np.arccos(1.0 - k / n * (1.0 - np.cos(np.deg2rad(75.0))))
    phi = np.mod(k * np.pi * (3.0 - np.sqrt(5.0)), 2 * np.pi)
    return np.array([theta, phi, np.full(n, np.deg2rad(30.0)), np.zeros(n)])


def truth_of(texels: int, rng: np.random.Generator) -> dict[str, NDArray[np.float32]]:
    """Draw the surfaces' parameters."""
    return {
        "k_d": rng.uniform(0.02, 0.6, (texels, CHANNELS)).astype(np.float32),
        "F0": rng.uniform(0.03, 0.9, (texels, CHANNELS)).astype(np.float32),
        "alpha": np.exp(rng.uniform(np.log(0.1), np.log(0.8), texels)).astype(np.float32),
    }


def lobes(g: Geometry, alpha: Array) -> Array:
    """Evaluate GGX without its Fresnel term for each alpha, (T, N)."""
    return np.stack([ggx_lobe(g, a) for a in alpha.tolist()])


def simulate(path: Path, texels: int) -> tuple[Array, dict[str, NDArray[np.float32]]]:
    """Write readings to disk, block by block; returns directions and truth."""
    rng = np.random.default_rng(7)
    angles, truth = light_stage(), truth_of(texels, rng)
    g = Geometry.of(*angles)
    s = g.schlick
    stored = np.lib.format.open_memmap(path, "w+", np.float32, (texels, SAMPLES, CHANNELS))
    for first in range(0, texels, BLOCK):
        rows = slice(first, min(first + BLOCK, texels))
        lobe = lobes(g, truth["alpha"][rows].astype(np.float64))[:, :, None]
        F0, k_d = (truth[name][rows, None, :].astype(np.float64) for name in ("F0", "k_d"))
        clean = k_d / np.pi + lobe * (F0 + (1 - F0) * s[:, None])
        stored[rows] = clean * (1 + NOISE * rng.standard_normal(clean.shape, dtype=np.float32))
    stored.flush()
    return angles, truth


def child(path: Path, folder: Path) -> dict[str, Any]:
    """Fit a file in this process; the kernels are compiled before the clock starts."""
    from lobefit.fitting.texel_files import save_chunks
    from lobefit.fitting.texel_source import open_texels
    from lobefit.fitting.texels import fit_texel_chunks, fit_texels

    source, angles = open_texels(path), light_stage()
    before = time.perf_counter()
    fit_texels(angles, next(source.chunks(8))[1], [MODEL])
    compiled = time.perf_counter() - before
    seconds: dict[str, float] = {}
    start = time.perf_counter()

    def watched() -> Any:
        for first, part in fit_texel_chunks(angles, source, [MODEL]):
            for stage, spent in part.seconds.items():
                seconds[stage] = seconds.get(stage, 0.0) + spent
            yield first, part

    save_chunks(watched(), source.shape[0], folder)
    wall = time.perf_counter() - start
    seconds["disk"] = wall - sum(seconds.values())
    return {"wall_s": wall, "compile_s": compiled, "stages_s": seconds, "peak_mb": peak_mb()}


class ScipyTexel:
    """Residuals of one texel for `least_squares`, written to be fast."""

    def __init__(self, angles: Array, values: Array) -> None:
        g = Geometry.of(*angles)
        self.t2, self.s = g.tan2_h, g.schlick
        self.tan2_i, self.tan2_o = 1 / g.n_i**2 - 1, 1 / g.n_o**2 - 1
        self.shape = (1 + self.t2) ** 2 / (4 * np.pi * g.n_i * g.n_o)
        self.values = values.T.astype(np.float64)
        # Close to the truth for 1 % noise, and constant, so that the sum of squares is one.
        self.weight = 1 / np.maximum(self.values, 0.01 * self.values.mean(axis=1)[:, None])

    def lobe(self, alpha: float) -> Array:
        """GGX without Fresnel."""
        a2 = alpha * alpha
        masking = np.sqrt(1 + a2 * self.tan2_i) + np.sqrt(1 + a2 * self.tan2_o)
        lobe: Array = self.shape * (2 * a2) / ((a2 + self.t2) ** 2 * masking)
        return lobe

    def residuals(self, p: Array) -> Array:
        """(model - value) weight of p = (k_d per channel, F0 per channel, log alpha)."""
        lobe = self.lobe(float(np.exp(p[6])))
        f = p[:3, None] / np.pi + lobe * (p[3:6, None] * (1 - self.s) + self.s)
        residuals: Array = ((f - self.values) * self.weight).ravel()
        return residuals

    def jacobian(self, p: Array) -> Array:
        """Derivatives of `residuals`; along log alpha by a central difference of the lobe."""
        J = np.zeros((3, len(self.s), 7))
        lobe = self.lobe(float(np.exp(p[6])))
        slope = (
            self.lobe(float(np.exp(p[6] + 1e-5))) - self.lobe(float(np.exp(p[6] - 1e-5)))
        ) / 2e-5
        for c in range(3):
            J[c, :, c] = self.weight[c] / np.pi
            J[c, :, 3 + c] = lobe * (1 - self.s) * self.weight[c]
            J[c, :, 6] = slope * (p[3 + c] * (1 - self.s) + self.s) * self.weight[c]
        return J.reshape(-1, 7)

    def fit(self, start: Array) -> Array:
        """Fit inside the same bounds as Lobefit's."""
        low = np.r_[np.zeros(6), np.log(1e-4)]
        high = np.r_[np.full(3, np.inf), np.ones(3), np.log(2.0)]
        p = least_squares(
            self.residuals, start, jac=self.jacobian, bounds=(low, high), x_scale="jac"
        ).x
        p[6] = np.exp(p[6])
        return np.asarray(p)


def errors(found: dict[str, Array], truth: dict[str, Any], failed: NDArray[np.bool_]) -> Any:
    """Give median and 95th percentile of each parameter's relative error, and the failures.

    A fit has failed too where alpha is off by more than a fifth.
    """
    alpha = np.abs(found["alpha"] / truth["alpha"] - 1)
    table: dict[str, Any] = {"failures": float((failed | ~(alpha < 0.2)).mean())}
    for name, rows in found.items():
        kept = np.abs(rows / truth[name] - 1)[~failed]
        table[name] = [float(np.quantile(kept, q)) for q in (0.5, 0.95)]
    return table


def run(texels: int, scipy_texels: int = MOST_SCIPY) -> dict[str, Any]:
    """Simulate, fit with both, compare."""
    from lobefit.fitting.texel_files import load_texels

    with tempfile.TemporaryDirectory() as temporary:
        path, folder = Path(temporary) / "readings.npy", Path(temporary) / "fits"
        angles, truth = simulate(path, texels)
        command = [sys.executable, "-m", "benchmarks.texels", "--child", str(path), str(folder)]
        done = subprocess.run(command, capture_output=True, text=True, check=True)
        lobefit = json.loads(done.stdout.splitlines()[-1])
        fit = load_texels(folder)
        lobefit["counts"] = fit.counts
        lobefit["texels_per_s"] = texels / lobefit["wall_s"]
        found = {name: np.array(fit.params[name], np.float64) for name in truth}
        failed = np.asarray(fit.reason) > 0
        lobefit["errors"] = errors(found, truth, failed)
        z = {
            name: (np.asarray(fit.params[name]) - truth[name]) / np.asarray(fit.errors[name])
            for name in truth
        }
        lobefit["z_std"] = {name: float(np.nanstd(rows)) for name, rows in z.items()}
        count = min(scipy_texels, texels)
        readings = np.array(np.load(path, mmap_mode="r")[:count])
    few = {name: rows[:count] for name, rows in truth.items()}
    lobefit["errors_of_scipys_texels"] = errors(
        {name: rows[:count] for name, rows in found.items()}, few, failed[:count]
    )
    # What a careful user would guess: the dark readings are diffuse, the rest is unknown.
    dark = np.pi * np.quantile(readings, 0.2, axis=1)
    unknown = np.broadcast_to(np.r_[np.full(3, 0.4), np.log(0.3)], (count, 4))
    starts = {
        "from a guess": np.column_stack([np.maximum(dark, 0.01), unknown]),
        "from the truth": np.column_stack([few["k_d"], few["F0"], np.log(few["alpha"])]),
    }
    others: dict[str, Any] = {}
    for name, start in starts.items():
        began = time.perf_counter()
        p = np.stack(
            [
                ScipyTexel(angles, y).fit(s)
                for y, s in zip(readings, start.astype(float), strict=True)
            ]
        )
        seconds = (time.perf_counter() - began) / count
        got = {"k_d": p[:, :3], "F0": p[:, 3:6], "alpha": p[:, 6]}
        others[name] = {
            "us_per_texel": 1e6 * seconds,
            "times": seconds * lobefit["texels_per_s"],
            "errors": errors(got, few, np.zeros(count, bool)),
        }
    return {
        "texels": texels, "scipy_texels": count, "lobefit": lobefit, "scipy": others,
        "machine": machine(),
    }  # fmt: skip


def table(result: dict[str, Any]) -> str:
    """Lay the figures out."""
    mine = result["lobefit"]
    stages = ", ".join(f"{k} {v:.1f}" for k, v in mine["stages_s"].items())
    rate = f"{mine['texels_per_s']:.0f} texels/s, peak {mine['peak_mb']:.0f} MB"
    lines = [
        f"lobefit: {result['texels']} texels in {mine['wall_s']:.1f} s ({stages}), {rate}",
        f"  {mine['counts']}",
        f"  z-scores' standard deviations {mine['z_std']}",
    ]

    def row(title: str, e: dict[str, Any]) -> str:
        cells = [
            f"{n} {100 * v[0]:.3f} / {100 * v[1]:.3f} %" for n, v in e.items() if n != "failures"
        ]
        return f"  {title}: median / 95th percentile of the error: {'; '.join(cells)}; failures {e['failures']:.2%}"

    lines.append(row("all", mine["errors"]))
    lines.append(row(f"the first {result['scipy_texels']}", mine["errors_of_scipys_texels"]))
    for name, other in result["scipy"].items():
        lines.append(
            f"scipy {name}: {other['us_per_texel']:.0f} us/texel, {other['times']:.0f} times as long"
        )
        lines.append(row(name, other["errors"]))
    return "\n".join(lines)


def main() -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.texels", description=__doc__)
    parser.add_argument("--texels", type=int, default=100_000)
    parser.add_argument("--scipy-texels", type=int, default=MOST_SCIPY)
    parser.add_argument("--child", nargs=2, type=Path, metavar=("FILE", "FOLDER"))
    arguments = parser.parse_args()
    if arguments.child:
        print(json.dumps(child(*arguments.child)))
        return
    result = run(arguments.texels, arguments.scipy_texels)
    RESULT.write_text(json.dumps(result, indent=1) + "\n")
    print(table(result))


if __name__ == "__main__":
    main()
