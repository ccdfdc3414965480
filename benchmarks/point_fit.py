"""Fits of diffuse + one lobe to 100,000 samples, against `scipy.optimize.least_squares`.

Three channels; the truth is known, the noise is 1 % of it, and both sides are told so (sigma), so
that both minimise the same sum. Scipy starts once, from parameters in the middle of their range;
Lobefit is given no start. The sums of both sides' results are computed by the same numpy code.

Scipy's clock runs over the search only: its geometry is computed and its buffers are filled before.
"lobefit, search" is the same job: scan, NLopt and Gauss-Newton on uploaded data. "lobefit, fit()" is
all that a user gets: upload, search, standard errors, diagnostics by size and angle, albedo,
reciprocity and ranking.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.numpy_models import LOBES, Geometry, goniometer
from benchmarks.scipy_fit import METHODS, ScipyFit
from benchmarks.timing import cores, interleave, ratio
from lobefit.fitting import Measurement, fit
from lobefit.fitting.dataset import Dataset
from lobefit.fitting.point import fit_point
from lobefit.fitting.scale import canonical
from lobefit.kernels import candidate, get_device, get_model
from lobefit.kernels.parameters import linear_from_coefficients

__all__ = ["run", "table"]

Array = NDArray[np.float64]

SAMPLES = 10**5
CHANNELS = ("R", "G", "B")
NOISE = 0.01
SEARCH = "lobefit, search"
LOBEFIT = "lobefit, fit()"


@dataclass(frozen=True)
class Case:
    """A surface to recover: coefficients by channel, nonlinear parameters and scipy's start."""

    coefficients: dict[str, tuple[float, float, float]]
    nonlinear: dict[str, float]
    start: tuple[float, ...]

    @property
    def truth(self) -> Array:
        """All parameters in `ScipyFit`'s order."""
        rows = [*self.coefficients.values(), tuple(self.nonlinear.values())]
        return np.concatenate([np.array(row) for row in rows])

    @property
    def first_guess(self) -> Array:
        """One half for every coefficient, then the nonlinear start."""
        half = np.full(len(self.coefficients) * len(CHANNELS), 0.5)
        return np.concatenate([half, np.array(self.start)])

    @property
    def names(self) -> list[str]:
        """Names of all parameters, `k_d R` for those per channel."""
        linear = [f"{name} {channel}" for name in self.coefficients for channel in CHANNELS]
        return [*linear, *self.nonlinear]

    def flatten(self, params: dict[str, float | list[float]]) -> Array:
        """Lobefit's parameters in the same order."""
        linear = [np.broadcast_to(params[name], len(CHANNELS)) for name in self.coefficients]
        return np.concatenate([*linear, [float(np.ravel(params[n])[0]) for n in self.nonlinear]])


K_D = (0.3, 0.2, 0.1)
K_S = (0.2, 0.25, 0.3)
CASES = {
    "blinn_phong": Case({"k_d": K_D, "k_s": K_S}, {"n": 60.0}, (20.0,)),
    "cook_torrance": Case({"k_d": K_D, "k_s": K_S, "F0": (0.2, 0.5, 0.8)}, {"alpha": 0.2}, (0.4,)),
    "ward": Case(
        {"k_d": K_D, "k_s": K_S},
        {"alpha_x": 0.25, "alpha_y": 0.1, "phi_x": 0.6},
        (0.4, 0.3, 0.3),  # equal axes would leave phi_x without effect
    ),
}


def simulated(model: str) -> tuple[Measurement, ScipyFit]:
    """Make the measurement, with the numpy models, and scipy's problem on the same numbers."""
    angles = goniometer(SAMPLES)
    lobe = LOBES[model](Geometry.of(*angles))
    nothing = np.zeros((len(CHANNELS), SAMPLES))
    clean = ScipyFit(lobe, nothing, nothing + 1).residuals(CASES[model].truth)
    clean = clean.reshape(len(CHANNELS), SAMPLES)
    sigma = NOISE * clean
    values = clean + sigma * np.random.default_rng(7).standard_normal(clean.shape)
    return Measurement(*angles, values, CHANNELS, sigma), ScipyFit(lobe, values, sigma)


def run(rounds: int = 5) -> dict[str, Any]:
    """Fit every case with every method; returns a JSON-able record."""
    return {
        "samples": SAMPLES,
        "channels": len(CHANNELS),
        "noise": NOISE,
        "cores": cores(),
        "cases": {model: _run_case(model, rounds) for model in CASES},
    }


def _run_case(model: str, rounds: int) -> dict[str, Any]:
    case = CASES[model]
    measurement, problem = simulated(model)
    found: dict[str, Array] = {}

    def with_lobefit() -> None:
        found[LOBEFIT] = case.flatten(fit(measurement, models=[model]).best.params)

    dataset = Dataset(measurement, "chi2", get_device())

    def search() -> None:
        point = fit_point(candidate(model), dataset)
        free = point.problem.scale.to_parameters(point.polished.t)
        x = candidate(model).expand(canonical(candidate(model), free))
        full = dict(zip([p.name for p in get_model(model).nonlinear], x.tolist(), strict=True))
        linear = linear_from_coefficients(get_model(model), point.polished.c)
        full |= {name: values.tolist() for name, values in linear.items()}
        found[SEARCH] = case.flatten(full)

    def with_scipy(method: str) -> None:
        found[method] = problem.fit(method, case.first_guess)

    tasks: dict[str, Callable[[], object]] = {
        SEARCH: search,
        LOBEFIT: with_lobefit,
    }
    tasks |= {method: partial(with_scipy, method) for method in METHODS}
    timings = interleave(tasks, rounds=rounds)
    at_truth = problem.chi_square(case.truth)
    return {
        "truth": dict(zip(case.names, case.truth.tolist(), strict=True)),
        "chi_square_at_truth": at_truth,
        "residuals": problem.residuals(case.truth).size,
        "rows": [
            {
                "name": name,
                "search_faster": ratio(timing, timings[SEARCH]),
                "fit_faster": ratio(timing, timings[LOBEFIT]),
                "chi_square": problem.chi_square(found[name]),
                "params": dict(zip(case.names, found[name].tolist(), strict=True)),
                "largest_error": float(np.max(np.abs(found[name] / case.truth - 1))),
                **timing.to_dict(),
            }
            for name, timing in timings.items()
        ],
    }


def table(result: dict[str, Any]) -> str:
    """Lay out the result of `run` for reading."""
    samples, channels, noise = (result[key] for key in ("samples", "channels", "noise"))
    lines = [
        f"diffuse + lobe, {samples} samples x {channels} channels, {noise:.0%} noise",
        f"seconds: medians of warm, interleaved runs; each may use all {result['cores']} cores",
        "chi-square: less its value at the true parameters; lower is better",
    ]
    for model, case in result["cases"].items():
        at_truth = case["chi_square_at_truth"]
        lines.append(
            f"\n{model}: {case['residuals']} residuals, {len(case['truth'])} parameters,"
            f" chi-square {at_truth:.3f} at the truth"
        )
        heads = ("s", "CPU s", "search is", "fit() is", "chi-square", "worst error")
        lines.append(" " * 30 + "".join(f"{head:>12}" for head in heads))
        for row in case["rows"]:
            cpu = float(np.median(row["cpu_s"]))
            lines.append(
                f"{row['name']:<30}{row['median_s']:>12.3f}{cpu:>12.3f}"
                f"{row['search_faster']:>10.1f} x{row['fit_faster']:>10.1f} x"
                f"{row['chi_square'] - at_truth:>12.3f}"
                f"{row['largest_error']:>12.3%}"
            )
        scipy = next(iter(METHODS))
        ours, theirs = ({r["name"]: r["params"] for r in case["rows"]}[k] for k in (LOBEFIT, scipy))
        lines.append(f"{'parameter':<30}{'truth':>12}{'lobefit':>14}{scipy:>14}")
        lines += [
            f"{name:<30}{true:>12.6g}{ours[name]:>14.8g}{theirs[name]:>14.8g}"
            for name, true in case["truth"].items()
        ]
    return "\n".join(lines)
