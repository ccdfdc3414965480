"""What `fit` and `sample` say of every real file: model, sentence, misfit, convergence, time.

``python -m benchmarks.real [FILE ...] [--max-steps 5000]``. The data are not part of the project:
../shared/data beside the checkout, where no files are named. Each file is fitted with the defaults
(the standard set) and the posterior of the recommended model is sampled with its defaults.

`narrowest` is the least ratio, over the parameters inside their bounds, of the posterior's standard
deviation to the point fit's standard error, which is scaled by the misfit. The two are found in
different ways, so ratios about 1 are expected; one far below it would be an interval narrower
than the misfit allows. Priors and bounds narrow posteriors too.

Figures go to ``results/real.json`` as they come; a file that is there already is not run again
with ``--resume``.
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path
from typing import Any

from benchmarks.timing import machine
from lobefit.fitting import fit, read_measurement, sample
from lobefit.fitting.posterior import Posterior
from lobefit.kernels import LobefitError

__all__ = ["main", "one", "table"]

DATA = Path(__file__).parents[2] / "shared" / "data"
RESULTS = Path(__file__).parent / "results"


def files() -> list[Path]:
    """Give the real files, and the approximations of MERL materials."""
    found = (p for p in DATA.rglob("*") if p.name.endswith((".csv", ".csv.gz")))
    return sorted(found, key=lambda p: (p.parent.name, p.name))


def narrowest(posterior: Posterior) -> tuple[float, str] | None:
    """Compare the posterior's widths with the point fit's errors."""
    ratios = []
    summary = posterior.summary()
    for e in posterior.result.estimates:
        label = e.name if e.channel is None else f"{e.name}[{e.channel}]"
        found = summary.get(label) or summary.get(e.name)
        if e.status == "free" and e.standard_error and found is not None:
            ratios.append((found.sd / e.standard_error, label))
    return min(ratios, default=None)


def one(path: Path, max_steps: int) -> dict[str, Any]:
    """Fit a file and sample its posterior."""
    m = read_measurement(path)
    began = time.perf_counter()
    report = fit(m)
    best = report.best
    row: dict[str, Any] = {
        "file": path.name,
        "directions": m.n_directions,
        "channels": m.n_channels,
        "chosen": best.candidate,
        "sentence": "" if report.choice is None else report.choice.sentence,
        "misfit_limited": best.diagnostics.misfit_limited,
        "misfit_reason": best.diagnostics.misfit_reason,
        "described": report.described,
        "flags": [c.name for c in report.checks.suspicious],
        "fit_seconds": time.perf_counter() - began,
    }
    began = time.perf_counter()
    try:
        p = sample(best, m, max_steps=max_steps)
    except LobefitError as error:
        return {**row, "converged": None, "reason": str(error)}
    thin = narrowest(p)
    return {
        **row,
        "numbers": len(p.labels),
        "converged": p.converged,
        "reason": p.reason,
        "power": p.power,
        "effective": p.effective,
        "narrowest": None if thin is None else thin[0],
        "narrowest_of": None if thin is None else thin[1],
        "posterior_seconds": time.perf_counter() - began,
    }


def table(rows: list[dict[str, Any]]) -> str:
    """Give a line for each file, then the sentences."""
    head = (
        f"{'file':<50} {'chosen':<22} {'fit s':>6} {'misfit':>6} {'numbers':>7} {'converged':>9} "
        f"{'post. s':>7} {'ESS':>7} {'narrowest':>9}"
    )
    lines = [head]
    for r in rows:
        thin = r.get("narrowest")
        lines.append(
            f"{r['file']:<50} {r['chosen']:<22} {r['fit_seconds']:>6.1f} "
            f"{'yes' if r['misfit_limited'] else 'no':>6} {r.get('numbers', 0):>7} "
            f"{ {True: 'yes', False: 'no', None: 'refused'}[r['converged']]:>9} "
            f"{r.get('posterior_seconds', 0.0):>7.1f} {r.get('effective', 0.0):>7.0f} "
            f"{'' if thin is None else format(thin, '.2f'):>9}"
        )
    lines.append("")
    for r in rows:
        lines.append(f"{r['file']}: {r['sentence']}")
        if r["converged"] is not True:
            lines.append(f"  not converged: {r['reason']}")
    return "\n".join(lines)


def main() -> None:
    """Run it, write figures, print the table."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.real", description=(__doc__ or "").partition("\n")[0]
    )
    parser.add_argument("files", nargs="*", type=Path, help=f"left out, those of {DATA.name}")
    parser.add_argument("--max-steps", type=int, default=5000, help="budget of each chain")
    parser.add_argument("--resume", action="store_true", help="keep what is there")
    asked = parser.parse_args()
    RESULTS.mkdir(exist_ok=True)
    out = RESULTS / "real.json"
    rows: list[dict[str, Any]] = []
    if asked.resume and out.exists():
        rows = json.loads(out.read_text(encoding="utf-8"))["rows"]
    there = {r["file"] for r in rows}
    for path in asked.files or files():
        if path.name in there:
            continue
        rows.append(one(path, asked.max_steps))
        print(table(rows[-1:]), flush=True)
        record = {"machine": machine(), "max_steps": asked.max_steps, "rows": rows}
        out.write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")
    print("\n" + table(rows))


if __name__ == "__main__":
    main()
