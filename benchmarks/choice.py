"""How often `fit` chooses the model that simulated data were made from.

``python -m benchmarks.choice --sets 200 --processes 2``: for each of eight models, and 1 % and 5 %
noise, so many measurements with parameters drawn at random; all candidates of the standard set are
fitted to each. A choice is right if it is the true model, or a simpler one whose predictions agree
with the true values within 1 % (2 % at 5 % noise): root mean square of the relative difference over
the measured directions. The rate of the true model alone stands beside it, and the rate with the
agreement asked for at each incidence by itself.

Parameters are drawn where data of this kind can tell them: uniformly on a linear or logarithmic scale
within `RANGES`. Figures go to ``results/choice.json``, the confusion matrices to
``results/choice.png``.
"""

from __future__ import annotations

import argparse
import json
import time
from collections import Counter
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.long_runs import KeptRows, single_core_processes
from benchmarks.timing import machine

__all__ = ["draw", "main", "picture", "run", "table"]

RESULTS = Path(__file__).parent / "results"
GEOMETRY = "in-plane incidences=0,10,20,30,40,50,60,70 step=2.5"
# Relative noise -> agreement of predictions that counts.
NOISES = {0.01: 0.01, 0.05: 0.02}
ADDITIVE = 1e-4

# name -> (low, high, whether on a logarithmic scale)
Ranges = dict[str, tuple[float, float, bool]]
DIFFUSE = {"k_d": (0.1, 0.6, False)}
STRENGTH = {"k_s": (0.1, 0.4, True)}
FRESNEL = {"F0": (0.1, 0.8, False)}
ALPHA = {"alpha": (0.08, 0.4, True)}
RANGES: dict[str, Ranges] = {
    "lambert": DIFFUSE,
    "oren_nayar": {**DIFFUSE, "sigma": (0.2, 0.7, False)},
    "modified_phong": {**DIFFUSE, **STRENGTH, "n": (10.0, 200.0, True)},
    "blinn_phong": {**DIFFUSE, **STRENGTH, "n": (20.0, 400.0, True)},
    "ward:isotropic": {**DIFFUSE, **STRENGTH, "alpha_x": (0.08, 0.4, True)},
    "cook_torrance": {**DIFFUSE, "k_s": (0.2, 0.7, True), **FRESNEL, **ALPHA},
    "ggx": {**DIFFUSE, "k_s": (0.2, 0.7, True), **FRESNEL, **ALPHA},
    "ggx+ggx": {
        **DIFFUSE,
        "k_s_1": (0.2, 0.5, False),
        "F0_1": (0.2, 0.8, False),
        "alpha_1": (0.06, 0.15, True),
        "k_s_2": (0.2, 0.5, False),
        "F0_2": (0.2, 0.8, False),
        "alpha_2": (0.3, 0.6, True),
    },
}


def draw(model: str, seed: int) -> dict[str, float]:
    """Draw the parameters of one surface."""
    rng = np.random.default_rng([seed, *model.encode()])
    found = {}
    for name, (low, high, logarithmic) in RANGES[model].items():
        u = float(rng.uniform())
        found[name] = low * (high / low) ** u if logarithmic else low + (high - low) * u
    return found


def one(
    job: tuple[str, float, int], tolerance: float | None = None, geometry: str = GEOMETRY
) -> dict[str, Any]:
    """Simulate one measurement, fit it and judge the choice."""
    from lobefit.fitting import fit, simulate
    from lobefit.fitting.blocks import find_blocks
    from lobefit.fitting.selection import relative_change
    from lobefit.kernels import candidate

    model, noise, seed = job
    params = draw(model, seed)
    began = time.perf_counter()
    m = simulate(model, params, geometry, (noise, ADDITIVE), seed=seed)
    report = fit(m, tolerance=tolerance)
    seconds = time.perf_counter() - began
    exact = simulate(model, params, geometry, (0.0, 0.0)).values
    best = report.best
    f = best.predict(m.theta_i, m.phi_i, m.theta_o, m.phi_o)
    cosines, there = np.cos(m.theta_i), np.isfinite(m.values)
    everywhere = np.zeros(m.n_directions, dtype=np.intp)
    lowest = min(report.results, key=lambda r: r.bic if r.bic is not None else np.inf)
    return {
        "model": model,
        "noise": noise,
        "seed": seed,
        "params": params,
        "chosen": best.candidate,
        "lowest_bic": lowest.candidate,
        "by": None if report.choice is None else report.choice.by,
        "sizes": [candidate(model).n_parameters(1), best.n_parameters],
        "difference": relative_change(f, exact, cosines, everywhere, there),
        "worst_incidence": relative_change(f, exact, cosines, find_blocks(m).labels, there),
        "seconds": seconds,
    }


def run(
    sets: int = 10,
    processes: int = 2,
    tolerance: float | None = None,
    geometry: str = GEOMETRY,
    *,
    done: Sequence[dict[str, Any]] = (),
    told: Callable[[dict[str, Any], int, int], None] | None = None,
) -> dict[str, Any]:
    """Fit so many sets of every model and noise; returns a JSON-able record.

    `done` are rows of an earlier run with the same settings; `told` is given each new row, the
    number of rows and how many there will be.
    """
    wanted = [(model, noise, seed) for seed in range(sets) for noise in NOISES for model in RANGES]
    there = {(r["model"], r["noise"], r["seed"]): r for r in done}
    rows = [there[job] for job in wanted if job in there]
    jobs = [job for job in wanted if job not in there]
    began = time.perf_counter()
    with single_core_processes(processes) as pool:
        for row in pool.map(partial(one, tolerance=tolerance, geometry=geometry), jobs):
            rows.append(row)
            if told is not None:
                told(row, len(rows), len(wanted))
    seconds = time.perf_counter() - began
    return {
        "sets": sets,
        "processes": processes,
        "tolerance": tolerance,
        "geometry": geometry,
        "additive_noise": ADDITIVE,
        "ranges": RANGES,
        "seconds": seconds,
        "rows": rows,
    }


def rates(rows: list[dict[str, Any]]) -> dict[str, float]:
    """Judge the choices for one model, or several."""
    true = [r["chosen"] == r["model"] for r in rows]
    limits = [NOISES[r["noise"]] for r in rows]
    simpler = [r["sizes"][1] < r["sizes"][0] for r in rows]
    alike = [r["sizes"][1] <= r["sizes"][0] for r in rows]

    def share(who: list[bool], key: str) -> float:
        right = [
            t or (w and r[key] <= limit)
            for t, w, r, limit in zip(true, who, rows, limits, strict=True)
        ]
        return float(np.mean(right))

    return {
        "right": share(simpler, "difference"),
        "true": float(np.mean(true)),
        "right_everywhere": share(simpler, "worst_incidence"),
        "right_or_of_equal_size": share(alike, "difference"),
        "lowest_bic": float(np.mean([r["lowest_bic"] == r["model"] for r in rows])),
        "richer": float(np.mean([r["sizes"][1] > r["sizes"][0] for r in rows])),
    }


def table(result: dict[str, Any]) -> str:
    """Lay out the result of `run` for reading."""
    lines = [
        (
            f"{result['sets']} simulated sets per model and noise, {result['geometry']}, one channel,"
            f" tolerance {result['tolerance']}"
        ),
        (
            f"{result['seconds']:.0f} s with {result['processes']} processes,"
            f" {np.median([r['seconds'] for r in result['rows']]):.2f} s a fit (median)"
        ),
    ]
    heads = ("right", "true", "strict", "or equal", "BIC alone", "richer")
    for noise, limit in NOISES.items():
        lines.append(f"\n{noise:.0%} noise, agreement within {limit:.0%}")
        lines.append(f"{'model':<18}" + "".join(f"{h:>11}" for h in heads) + "   instead")
        at = [r for r in result["rows"] if r["noise"] == noise]
        for model in (*RANGES, "all"):
            rows = [r for r in at if model in ("all", r["model"])]
            others = Counter(r["chosen"] for r in rows if r["chosen"] != r["model"])
            said = ", ".join(f"{name} {count}" for name, count in others.most_common(4))
            figures = "".join(f"{100 * rate:>9.1f} %" for rate in rates(rows).values())
            lines.append(f"{model:<18}{figures}   {'' if model == 'all' else said}")
    lines.append(
        "\nright: the true model, or a simpler one that agrees; strict: that agrees at every"
        " incidence;\nor equal: or one of as many parameters that agrees; BIC alone: the lowest BIC"
        " is the true model's;\nricher: has more parameters than the true one"
    )
    return "\n".join(lines)


def picture(result: dict[str, Any], path: Path) -> None:
    """Draw the confusion matrices, one for each noise."""
    from matplotlib.figure import Figure

    chosen = list(RANGES)
    chosen += sorted({r["chosen"] for r in result["rows"]} - set(chosen))
    figure = Figure(figsize=(4 + 0.9 * len(chosen), 5.5), layout="constrained")
    axes = figure.subplots(1, len(NOISES), sharey=True)
    for axis, (noise, limit) in zip(axes, NOISES.items(), strict=True):
        share = np.zeros((len(RANGES), len(chosen)))
        for r in result["rows"]:
            if r["noise"] == noise:
                share[list(RANGES).index(r["model"]), chosen.index(r["chosen"])] += 1
        share /= share.sum(axis=1, keepdims=True)
        axis.imshow(share, cmap="Blues", vmin=0, vmax=1)
        for row, column in np.argwhere(share > 0):
            value = share[row, column]
            color = "white" if value > 0.5 else "black"
            text = f"{100 * value:.0f}"
            axis.text(column, row, text, ha="center", va="center", color=color, fontsize=8)
        axis.set_xticks(range(len(chosen)), chosen, rotation=90)
        axis.set_yticks(range(len(RANGES)), list(RANGES))
        right = rates([r for r in result["rows"] if r["noise"] == noise])["right"]
        axis.set_title(
            f"{100 * noise:.0f} % noise: {100 * right:.1f} % true, or simpler within"
            f" {100 * limit:.0f} %",
            fontsize=10,
        )
        axis.set_xlabel("chosen")
    axes[0].set_ylabel("true")
    figure.suptitle(f"Choice of model, percent of {result['sets']} simulated sets each")
    figure.savefig(path, dpi=120)


def main() -> None:
    """Run it and write table, figures and picture."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.choice", description=__doc__)
    parser.add_argument("--sets", type=int, default=10, help="measurements per model and noise")
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--tolerance", type=float, default=None, help="what fit is given")
    parser.add_argument("--geometry", default=GEOMETRY, help="scan that is simulated")
    parser.add_argument("--resume", action="store_true", help="go on from an unfinished run")
    asked = parser.parse_args()
    RESULTS.mkdir(exist_ok=True)
    settings = {"tolerance": asked.tolerance, "geometry": asked.geometry}
    kept = KeptRows(RESULTS / "choice.partial.jsonl", settings, resume=asked.resume)

    def told(row: dict[str, Any], count: int, total: int) -> None:
        kept.add(row)
        if count % 80 == 0:
            print(f"{count} of {total}", flush=True)

    limits = (asked.tolerance, asked.geometry)
    result = run(asked.sets, asked.processes, *limits, done=kept.before, told=told)
    kept.finish()
    print(table(result), flush=True)
    record = json.dumps({"machine": machine(), **result}, indent=1)
    (RESULTS / "choice.json").write_text(record + "\n", encoding="utf-8")
    picture(result, RESULTS / "choice.png")


if __name__ == "__main__":
    main()
