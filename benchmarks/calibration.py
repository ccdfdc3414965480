"""Whether posteriors are calibrated: truths drawn from the prior must rank evenly among draws.

``python -m benchmarks.calibration --simulations 256 --draws 63 --processes 2``. Simulation-based
calibration after Talts, Betancourt, Simpson, Vehtari & Gelman 2018 (arXiv 1804.06788): parameters
are drawn from the prior that the sampler is given, a measurement is simulated from them, its
posterior is sampled as a user would (point fit, then `sample` with its defaults), and the true
value is ranked among 63 draws that are picked evenly over steps and walkers. Over many simulations
the ranks of a right sampler are uniform.

- chi-square: of the ranks in 16 bins (fewer below 80 simulations, see `bins_for`), beside the 99 %
  line for as many tests as there are parameters in the table.
- 50 %, 90 %: how often the central interval of the whole chain holds the truth; three binomial
  standard errors are allowed.
- z: of the mean rank; positive where the posterior lies too low.
- at bound: share of simulations whose point fit ended on a bound of the parameter. Parameters for
  which that is more than one in twenty are listed apart.

One channel, 212 directions in the plane of incidence. The noise is so strong that the prior matters
as much as the data in many simulations, and little in others: a mistake in the prior or in a
Jacobian is seen only where the prior matters. Priors are the defaults but for `n` and `alpha`,
which are restricted to lobes that 3 degree steps resolve (with two lobes, to a broad and a
narrow one); `sample` is given the same priors as truths are drawn from.
Where the uncertainty is given it is the same for all values, because a sigma that depends on the
truth would tell it.

A simulation that fails, or whose chain does not converge within the budget, is counted and shown;
ranks of chains that did not converge count like all others.

``--break jacobian`` drops the Jacobian of the transforms, which the table must show.

Rows are kept in ``results/calibration.partial.jsonl`` as they come; ``--resume`` goes on from
there. Figures go to ``results/calibration.json``, by case: cases can be run one by one, and
``--report`` prints the table of all that were.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import as_completed
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from benchmarks.long_runs import KeptRows, single_core_processes
from benchmarks.timing import machine
from lobefit.fitting.priors import LogUniform, Prior
from lobefit.fitting.space import NoiseModel

__all__ = ["CASES", "HARD", "Case", "calibrate", "main", "one", "summarise", "table"]

Array = NDArray[np.float64]
Row = dict[str, Any]

RESULTS = Path(__file__).parent / "results"
GEOMETRY = "in-plane incidences=10,30,50,70 step=3"
MAX_STEPS = 4000
# Above this share of point fits on a bound, a parameter is listed apart.
OFTEN = 0.05
COVERAGE = (0.5, 0.9)


@dataclass(frozen=True, slots=True)
class Case:
    """What is simulated and sampled.

    Attributes
    ----------
    model : str
    noise : {"given", "fit"}
        The uncertainty is given with the data, or its two scales are drawn from their priors
        and sampled with the rest.
    sigma : float
        In 1/sr, where given.
    priors : mapping of str to Prior
        In place of the default ones, for truths and for the sampler.
    """

    model: str
    noise: NoiseModel = "given"
    sigma: float = 0.1
    priors: Mapping[str, Prior] = field(default_factory=dict)


RESOLVED = LogUniform(0.05, 1.0)
CASES: dict[str, Case] = {
    "lambert": Case("lambert", sigma=2.0),
    "oren_nayar": Case("oren_nayar", sigma=0.3),
    "modified_phong": Case("modified_phong", priors={"n": LogUniform(2.0, 200.0)}),
    "ggx": Case("ggx", priors={"alpha": RESOLVED}),
    "modified_phong+ggx": Case(
        "modified_phong+ggx",
        sigma=0.03,
        priors={"n_1": LogUniform(2.0, 20.0), "alpha_2": LogUniform(0.05, 0.2)},
    ),
    "modified_phong, noise sampled": Case(
        "modified_phong", noise="fit", priors={"n": LogUniform(2.0, 200.0)}
    ),
}
# Left out unless asked for by name: such data have several explanations by two like lobes, between
# which walkers seldom pass; most chains do not converge within the budget, and say so.
HARD: dict[str, Case] = {
    "ggx+ggx": Case("ggx+ggx", priors={"alpha_1": RESOLVED, "alpha_2": RESOLVED}),
}
KNOWN = {**CASES, **HARD}
BREAKS = ("jacobian",)


def rank(truth: float, draws: Array, rng: np.random.Generator) -> int:
    """Count the draws below the truth; among equal ones its place is random."""
    below, equal = int((draws < truth).sum()), int((draws == truth).sum())
    return below + int(rng.integers(equal + 1))


def bins_for(simulations: int, draws: int) -> int:
    """Give the number of bins: 16, or so few that each expects 5 ranks, among divisors."""
    fit = [b for b in (16, 8, 4, 2) if (draws + 1) % b == 0 and simulations >= 5 * b]
    return fit[0] if fit else 1


def chi_square(ranks: Sequence[int], draws: int, bins: int) -> float:
    """Compare how often ranks from 0 to `draws` fall in equal bins with the same for all."""
    counts = np.bincount(np.asarray(ranks) * bins // (draws + 1), minlength=bins)
    expected = len(ranks) / bins
    return float(((counts - expected) ** 2).sum() / expected)


def line(tests: int, bins: int, level: float = 0.99) -> float:
    """Give what the largest of so many chi-squares stays below with this probability."""
    return float(chi2.ppf(1.0 - (1.0 - level) / max(tests, 1), bins - 1))


def broken(kind: str | None) -> AbstractContextManager[object]:
    """Make the sampler wrong, while the context lasts."""
    if kind is None:
        return nullcontext()
    if kind != "jacobian":
        raise ValueError(f"the sampler can be broken by {', '.join(BREAKS)}; not {kind!r}")
    from lobefit.fitting.transforms import Transforms

    return patch.object(Transforms, "log_jacobian", lambda self, q, theta: np.zeros(len(q)))


def one(
    name: str, number: int, draws: int = 63, kind: str | None = None, max_steps: int = MAX_STEPS
) -> Row:
    """Simulate one measurement, sample its posterior, rank the truth."""
    from lobefit.fitting import fit, sample, simulate
    from lobefit.fitting.space import Space
    from lobefit.kernels import LobefitError, candidate

    case = KNOWN[name]
    rng = np.random.default_rng([number, *name.encode()])
    space = Space(candidate(case.model), ("brdf",), noise=case.noise, priors=case.priors)
    truth = space.draw(rng, 1)[0]
    noise = (0.0, case.sigma)
    if case.noise == "fit":
        scales = dict(zip(space.labels, truth.tolist(), strict=True))
        noise = (scales["noise_relative"], scales["noise_additive"])
    m = simulate(
        case.model,
        space.params(truth),
        GEOMETRY,
        noise,
        seed=int(rng.integers(2**31)),
        sigma=case.noise == "given",
    )
    row: Row = {"case": name, "number": number, "truth": truth.tolist(), "labels": space.labels}
    began = time.perf_counter()
    try:
        result = fit(m, models=[case.model]).best
        with broken(kind):
            p = sample(result, m, seed=number, priors=case.priors, max_steps=max_steps)
    except LobefitError as error:
        return {**row, "failed": str(error), "seconds": time.perf_counter() - began}
    seconds = time.perf_counter() - began
    picked = p.draws(draws)
    ranks, inside = [], []
    for label, true in zip(space.labels, truth.tolist(), strict=True):
        k = p.labels.index(label)
        ranks.append(rank(true, picked[:, k], rng))
        ends = [np.quantile(p[label], [0.5 - 0.5 * c, 0.5 + 0.5 * c]) for c in COVERAGE]
        inside.append([bool(low <= true <= high) for low, high in ends])
    return {
        **row,
        "ranks": ranks,
        "inside": inside,
        "bound": [e.name for e in result.estimates if e.status != "free"],
        "converged": p.converged,
        "effective": p.effective,
        # What `sample` decides by itself where residuals look like misfit; here they are none.
        "misfit": bool(p.power < 1.0 or "sigma_scale" in p.labels),
        "steps": len(p.chain) + p.warm_up,
        "seconds": seconds,
    }


def summarise(rows: Iterable[Row], draws: int) -> dict[str, Any]:
    """Give the figures of one case."""
    rows = sorted(rows, key=lambda r: r["number"])
    good = [r for r in rows if "ranks" in r]
    n, bins = len(good), bins_for(len(good), draws)
    parameters = {}
    for k, label in enumerate(good[0]["labels"] if good else ()):
        ranks = [r["ranks"][k] for r in good]
        mean = (float(np.mean(ranks)) + 0.5) / (draws + 1.0) - 0.5
        parameters[label] = {
            "chi_square": chi_square(ranks, draws, bins),
            "coverage": [float(np.mean([r["inside"][k][c] for r in good])) for c in (0, 1)],
            "z": mean * float(np.sqrt(12.0 * n)),
            "at_bound": float(np.mean([label in r["bound"] for r in good])),
            "ranks": ranks,
        }
    effective = np.array([r["effective"] for r in good])
    return {
        "simulations": n,
        "draws": draws,
        "bins": bins,
        "parameters": parameters,
        "failed": {str(r["number"]): r["failed"] for r in rows if "failed" in r},
        "not_converged": [r["number"] for r in good if not r["converged"]],
        "taken_for_misfit": [r["number"] for r in good if r["misfit"]],
        "least_effective": float(np.nanmin(effective)) if n else None,
        "seconds_each": float(np.median([r["seconds"] for r in rows])) if rows else None,
        "seconds_mean": float(np.mean([r["seconds"] for r in rows])) if rows else None,
    }


def judge(entry: Mapping[str, Any], simulations: int, limit: float) -> list[str]:
    """Say what speaks against a parameter's posteriors; nothing where they are calibrated."""
    wrong = ["chi-square"] if entry["chi_square"] > limit else []
    for share, found in zip(COVERAGE, entry["coverage"], strict=True):
        allowed = 3.0 * np.sqrt(share * (1.0 - share) / simulations)
        if abs(found - share) > allowed:
            wrong.append(f"{share:.0%} interval")
    return wrong


def table(cases: Mapping[str, Mapping[str, Any]]) -> str:
    """Lay out figures by case for reading."""
    tests = sum(len(c["parameters"]) for c in cases.values())
    head = f"{'case':<30} {'parameter':<15} {'n':>4} {'bins':>4} {'chi2':>6} {'line':>5}"
    lines = [f"{head} {'50 %':>6} {'90 %':>6} {'z':>5} {'at bound':>8}"]
    for apart in (False, True):
        if apart:
            lines.append(
                f"\nparameters of which more than {OFTEN:.0%} of point fits are on a bound"
            )
        for name, c in cases.items():
            limit = line(tests, max(c["bins"], 2))
            for label, e in c["parameters"].items():
                if (e["at_bound"] > OFTEN) != apart:
                    continue
                wrong = judge(e, c["simulations"], limit)
                low, high = e["coverage"]
                lines.append(
                    f"{name:<30} {label:<15} {c['simulations']:>4} {c['bins']:>4} "
                    f"{e['chi_square']:>6.1f} {limit:>5.1f} {100 * low:>6.1f} {100 * high:>6.1f} "
                    f"{e['z']:>+5.1f} {100 * e['at_bound']:>6.0f} %"
                    + (f"  FAILS: {', '.join(wrong)}" if wrong else "")
                )
    lines.append("")
    for name, c in cases.items():
        if c["seconds_each"] is None:
            continue
        least = "none" if c["least_effective"] is None else f"{c['least_effective']:.0f}"
        lines.append(
            f"{name}: {c['seconds_each']:.2f} s a simulation (median), {c['seconds_mean']:.2f} s "
            f"(mean); {len(c['failed'])} failed, {len(c['not_converged'])} not converged, "
            f"{len(c['taken_for_misfit'])} taken for misfit; fewest effective samples {least}"
        )
    return "\n".join(lines)


def calibrate(
    names: Sequence[str],
    simulations: int,
    draws: int = 63,
    processes: int = 2,
    kind: str | None = None,
    max_steps: int = MAX_STEPS,
    *,
    done: Iterable[Row] = (),
    told: Callable[[Row, int, int], None] | None = None,
) -> list[Row]:
    """Run all simulations that are not done yet.

    Parameters
    ----------
    names : sequence of str
        Cases.
    simulations, draws, processes : int
    kind : str, optional
        How the sampler is broken.
    max_steps : int
        Budget of each chain.
    done : iterable of dict
        Rows of an earlier run with the same settings.
    told : callable, optional
        Called with every new row, the number of rows, and how many there will be.
    """
    rows = [r for r in done if r["case"] in names and r["number"] < simulations]
    there = {(r["case"], r["number"]) for r in rows}
    jobs = [(name, k) for k in range(simulations) for name in names if (name, k) not in there]
    total = len(rows) + len(jobs)
    with single_core_processes(processes) as pool:
        made = [pool.submit(one, name, k, draws, kind, max_steps) for name, k in jobs]
        try:
            for future in as_completed(made):
                rows.append(future.result())
                if told is not None:
                    told(rows[-1], len(rows), total)
        except KeyboardInterrupt:
            pool.shutdown(cancel_futures=True)
            print("\ninterrupted: what follows is of the simulations that were done")
    return rows


def main() -> None:
    """Run it, write figures, print the table."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.calibration", description=(__doc__ or "").partition("\n")[0]
    )
    parser.add_argument("cases", nargs="*", metavar="CASE", help=f"of {'; '.join(KNOWN)}")
    parser.add_argument("--simulations", type=int, default=256, help="for each case")
    parser.add_argument("--draws", type=int, default=63)
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--max-steps", type=int, default=MAX_STEPS, help="budget of a chain")
    parser.add_argument("--break", dest="kind", choices=BREAKS, help="make the sampler wrong")
    parser.add_argument("--resume", action="store_true", help="go on from an unfinished run")
    parser.add_argument("--report", action="store_true", help="print the table of earlier runs")
    asked = parser.parse_args()
    names = asked.cases or list(CASES)
    if unknown := [name for name in names if name not in KNOWN]:
        parser.error(f"no case {', '.join(unknown)}; there are {'; '.join(KNOWN)}")
    RESULTS.mkdir(exist_ok=True)
    file = RESULTS / f"calibration{f'_{asked.kind}' if asked.kind else ''}.json"
    record = json.loads(file.read_text(encoding="utf-8")) if file.exists() else {}
    if asked.report:
        print(table({name: record[name] for name in KNOWN if name in record}))
        return
    settings = {"draws": asked.draws, "broken": asked.kind, "max_steps": asked.max_steps}
    kept = KeptRows(file.with_suffix(".partial.jsonl"), settings, resume=asked.resume)
    began = time.perf_counter()
    old = len([r for r in kept.before if r["case"] in names and r["number"] < asked.simulations])

    def told(row: Row, count: int, total: int) -> None:
        kept.add(row)
        if count % 16 == 0 or count == total:
            pace = (time.perf_counter() - began) / max(count - old, 1)
            print(f"{count} of {total}, {pace * (total - count):.0f} s left", flush=True)

    budget = (asked.simulations, asked.draws, asked.processes, asked.kind, asked.max_steps)
    rows = calibrate(names, *budget, done=kept.before, told=told)
    found = {name: summarise([r for r in rows if r["case"] == name], asked.draws) for name in names}
    print(table(found), flush=True)
    here = machine()
    for name, figures in found.items():
        record[name] = {"machine": here, "settings": repr(KNOWN[name]), **figures}
    file.write_text(json.dumps(record) + "\n", encoding="utf-8")
    if len(rows) == len(names) * asked.simulations:
        kept.finish(r for r in kept.before if r["case"] not in names)


if __name__ == "__main__":
    main()
