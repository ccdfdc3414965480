"""The metrics of a fit: what they find, what they report, and that they reach their optimum."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest
from scipy.optimize import least_squares

from lobefit.fitting import Measurement, fit, simulate
from lobefit.kernels import candidate
from tests.fitting.test_fit import FEW, GLOSSY, SCAN
from tests.kernels.transcriptions import load
from tests.truth import deviations

Array = npt.NDArray[np.float64]


@pytest.mark.parametrize("metric", ["auto", "chi2", "relative", "log", "cube_root", "cosine_log"])
@pytest.mark.parametrize("stated", [False, True])
def test_every_metric_finds_the_surface(metric: str, stated: bool) -> None:
    m = simulate("ggx", GLOSSY, SCAN, (0.02, 1e-3), seed=3, sigma=stated)
    found = fit(m, ["lambert", "ggx", "ggx:k_s=1"], metric=metric)
    auto = "chi2" if stated else "relative"
    assert found.metric == (auto if metric == "auto" else metric)
    assert found.best.candidate == "ggx"
    if found.metric == "relative" or found.best.noise.given:
        off = {k: z for k, z in deviations(found.best, GLOSSY).items() if not abs(z) < 3.5}
        assert off == {}
    for name, expected in GLOSSY.items():
        # Constant weights look at the peak alone, where 2 % of it is 20 % of k_s and F0.
        assert found.best.params[name] == pytest.approx(expected, rel=0.3)
    assert found.best.noise.given == (stated and found.metric == "chi2")
    for result in found.results:
        likely = found.metric in ("chi2", "relative")
        assert (result.bic is not None) == likely
        assert (result.log_likelihood is not None) == likely
    sizes = [r.n_parameters for r in found.results]
    assert sizes[0] == 4


def test_metrics_without_a_likelihood_rank_by_their_residuals() -> None:
    glossy = simulate("ggx", GLOSSY, SCAN, (0.02, 1e-3), seed=1)
    for metric in ("log", "cube_root", "cosine_log"):
        found = fit(glossy, FEW, metric=metric)
        rest = [r.objective for r in found.results[1:]]
        assert rest == sorted(rest)
        assert "BIC" not in found.verdict


@pytest.mark.parametrize("metric", ["log", "cube_root", "cosine_log"])
def test_errors_without_a_likelihood_are_the_scatter(metric: str) -> None:
    """Noise is 5 % of each value, which none of the metrics knows; 40 seeds give 11 %."""
    found = [
        fit(simulate("ggx", GLOSSY, SCAN, (0.05, 0.0), seed=seed), "ggx", metric=metric).best
        for seed in range(40)
    ]
    for k, name in enumerate(e.name for e in found[0].estimates):
        values = [r.estimates[k].value for r in found]
        errors = [r.estimates[k].standard_error for r in found]
        assert np.std(values) == pytest.approx(np.median(np.array(errors, float)), rel=0.4), name


def wide_range(alpha: float, seed: int) -> Measurement:
    """Eight decades: a mirror over next to nothing, with 20 % of noise at every size."""
    truth = {"k_d": 1e-5, "k_s": 1.0, "F0": 0.9, "alpha": alpha}
    m = simulate("ggx", truth, "in-plane incidences=5,25,45,65 step=1", (0.0, 0.0))
    factor = np.exp(0.2 * np.random.default_rng(seed).standard_normal(m.values.shape))
    return replace(m, values=m.values * factor)


@pytest.mark.parametrize("name", ["ggx", "cook_torrance", "ward:isotropic", "blinn_phong"])
def test_the_logarithm_over_eight_decades_as_scipy(name: str) -> None:
    """Three of the four models misfit, which is when local minima appear."""
    m = wide_range(0.004, seed=4)
    assert m.decades > 7.5
    result = fit(m, [name], metric="log").best
    brdf = load(result.model)
    chosen = candidate(name)
    spans = {p.name: p.bounds for p in chosen.model.parameters}
    free = [p.name for p in (*chosen.solved, *chosen.searched)]
    measured = np.log10(m.values[0])

    def parameters(x: Array) -> dict[str, float]:
        params: dict[str, float] = {}
        for parameter, t in zip(free, x, strict=True):
            low, high = spans[parameter]
            t = np.clip(t, -300.0, 300.0)  # far beyond the bounds
            inside = 1 / (1 + np.exp(-t)) if parameter == "F0" else np.exp(t)
            params[parameter] = float(np.clip(inside, low, high))
        tied = {f: params[leader] for f, leader in chosen.tied.items()}
        return {**params, **chosen.fixed, **tied}

    def residuals(x: Array) -> Array:
        f = np.asarray(
            brdf(m.theta_i, m.phi_i, m.theta_o, m.phi_o, **parameters(x)), dtype=np.float64
        )[0]
        r: Array = np.log10(np.maximum(f, 1e-300)) - measured
        return r

    shape = chosen.searched[0].name
    best = np.inf
    for start in np.geomspace(3.0, 1e4, 6) if shape == "n" else np.geomspace(0.002, 0.3, 6):
        for k_d in (1e-5, 1e-3):
            x = [
                {"k_d": np.log(k_d), "F0": 1.0, shape: np.log(start)}.get(parameter, -1.0)
                for parameter in free
            ]
            best = min(best, least_squares(residuals, x, x_scale="jac").cost)
    expected = np.sqrt(2 * best / measured.size)
    assert result.diagnostics.log10_rms == pytest.approx(expected, rel=1e-4)


@pytest.mark.parametrize("name", ["ggx", "cook_torrance", "modified_phong"])
def test_cosine_log_as_scipy(name: str) -> None:
    """Peaks of 50/sr over a dark base; two of the models misfit. Some values are negative."""
    truth = {"k_d": 0.02, "k_s": 0.6, "F0": 0.5, "alpha": 0.05}
    m = simulate("ggx", truth, SCAN, (0.05, 0.01), seed=6)
    assert np.any(m.values < 0.0)
    result = fit(m, name, metric="cosine_log").best
    model = candidate(name).model
    brdf, n_i = load(name), np.cos(m.theta_i)
    positive = [p.name for p in model.parameters if p.name != "F0"]

    def residuals(x: Array) -> Array:
        params: dict[str, float] = dict(zip(positive, np.exp(x).tolist(), strict=False))
        if "F0" in (p.name for p in model.parameters):
            params["F0"] = float(0.5 + np.arctan(x[-1]) / np.pi)
        f = brdf(m.theta_i, m.phi_i, m.theta_o, m.phi_o, **params)
        r: Array = np.log1p(m.values[0] * n_i) - np.log1p(f[0] * n_i).astype(np.float64)
        return r

    start = {"k_d": 0.02, "k_s": 0.5}
    costs = []
    for width in (0.02, 0.06, 0.2):
        x = [np.log(start.get(p, 2 / width**2 if p == "n" else width)) for p in positive]
        costs.append(least_squares(residuals, [*x, 0.0][: len(model.parameters)]).cost)
    assert result.objective == pytest.approx(2 * min(costs), rel=1e-4)
