"""F2, F3, F8, F9, F22: metrics, local minima, two lobes, coloured metals."""

from __future__ import annotations

from dataclasses import dataclass, replace

import nlopt
import numpy as np
import pytest
from scipy.optimize import least_squares as scipy_least_squares

from lobefit.fitting import FitReport, Measurement, fit, simulate
from lobefit.fitting.space import Space
from lobefit.kernels import candidate
from tests.stability.modes import measured
from tests.stability.naive import Array, angles, errors, ggx, ggx_of_scale_1, least_squares
from tests.truth import deviations


def test_weights_of_a_bright_peak() -> None:
    truth = {"k_d": 0.1, "k_s": 1.0, "F0": 0.6, "alpha": 0.02}
    off = []
    for seed in range(12):
        scan = "in-plane incidences=10,30,50,70 step=0.5"
        m = simulate("ggx", truth, scan, (0.02, 1e-4), seed=seed)
        found, _ = least_squares(ggx_of_scale_1, m, [0.2, 0.3, 0.03])
        result = fit(m, "ggx:k_s=1").best
        k_d = result.params["k_d"]
        assert isinstance(k_d, float)
        off.append([found[0] / 0.1 - 1, k_d / 0.1 - 1])
        assert max(map(abs, deviations(result, truth).values())) < 4
    plain, own = np.sqrt(np.mean(np.square(off), axis=0))
    measured("F2", rel=0.3, plain=plain, own=own)


NARROW = {"k_d": 0.05, "k_s": 1.0, "F0": 0.2, "alpha": 0.05}
BROAD = {"k_d": 0.0, "k_s": 1.0, "F0": 0.2, "alpha": 0.4}
# Of k_d, the two k_s, and the logarithms of the two alpha; F0 is held at the truth.
LOW, HIGH = np.array([0, 0, 0, -7.0, -7.0]), np.array([1, 3, 3, 0.0, 0.0])


def two_lobes(x: Array, p: Array) -> Array:
    with np.errstate(all="ignore"):
        return ggx(x, p[0], p[1], 0.2, np.exp(p[3])) + ggx(x, 0.0, p[2], 0.2, np.exp(p[4]))


@pytest.fixture(scope="module")
def surface() -> Measurement:
    """Give a surface of two lobes with 2 % of noise."""
    scan = "in-plane incidences=10,40,70 step=4"
    m = simulate("ggx", NARROW, scan, (0, 0))
    clean = m.values + simulate("ggx", BROAD, scan, (0, 0)).values
    noise = np.random.default_rng(0).standard_normal(clean.shape)
    return replace(m, values=clean * (1 + 0.02 * noise))


@dataclass
class Runs:
    """Searches from random starts: points and the metric there."""

    points: Array
    values: Array


@pytest.fixture(scope="module")
def runs(surface: Measurement) -> Runs:
    """Minimise squared differences of cube roots from 12 random starts."""
    x, root = angles(surface), np.cbrt(surface.values[0])

    def objective(p: Array, _gradient: Array) -> float:
        return float(((np.cbrt(two_lobes(x, p)) - root) ** 2).sum())

    rng = np.random.default_rng(3)
    points, values = [], []
    for _ in range(12):
        opt = nlopt.opt(nlopt.LN_BOBYQA, 5)
        opt.set_lower_bounds(LOW)
        opt.set_upper_bounds(HIGH)
        opt.set_min_objective(objective)
        opt.set_xtol_rel(1e-6)
        opt.set_maxeval(1000)
        points.append(opt.optimize(rng.uniform(LOW, HIGH)))
        values.append(opt.last_optimum_value())
    return Runs(np.array(points), np.array(values))


@pytest.fixture(scope="module")
def by_roots(surface: Measurement) -> FitReport:
    return fit(surface, ["ggx+ggx"], metric="cube_root")


def test_local_minima(runs: Runs, by_roots: FitReport) -> None:
    best = runs.values.min()
    measured(
        "F3",
        rel=0.3,
        stuck=float((runs.values > 1.1 * best).sum()),
        least=float(runs.values[runs.values > 1.1 * best].min() / best),
    )
    assert by_roots.best.objective <= 1.001 * best


def test_labels(surface: Measurement, runs: Runs, by_roots: FitReport) -> None:
    good = runs.points[runs.values < 1.1 * runs.values.min()]
    widths = np.exp(good[:, 3:])
    first = int((widths[:, 0] < widths[:, 1]).sum())
    measured("F8", good=len(good), first=first, mean=float(widths[:, 0].mean()))
    for report in (by_roots, fit(surface, ["ggx+ggx"])):
        params = report.best.params
        assert params["alpha_1"] == pytest.approx(0.05, rel=0.05)
        assert params["alpha_2"] == pytest.approx(0.4, rel=0.1)
    # And in what is sampled.
    space = Space(candidate("ggx+ggx"), surface.channels)
    drawn = space.draw(np.random.default_rng(1), 100)
    names = [c.name for c in space.coordinates]
    assert (drawn[:, names.index("alpha_1")] <= drawn[:, names.index("alpha_2")]).all()


def test_residual_of_the_first_lobe(surface: Measurement) -> None:
    x, y = angles(surface), surface.values[0]

    def off(f: Array) -> float:
        return float(np.sqrt(np.mean(np.log10(f / y) ** 2)))

    def one(p: Array) -> Array:
        return ggx(x, p[0], p[1], 0.2, np.exp(p[2]))

    first = scipy_least_squares(
        lambda p: np.log(np.maximum(one(p), 1e-300) / y),
        [0.1, 1, -2],
        bounds=([0, 0, -7], [1, 5, 0]),
    ).x
    left = y - one(first)
    second = scipy_least_squares(
        lambda p: ggx(x, 0.0, p[0], 0.2, np.exp(p[1])) - left,
        [0.5, -1],
        bounds=([0, -7], [5, 0]),
    ).x
    greedy = one(first) + ggx(x, 0.0, second[0], 0.2, np.exp(second[1]))
    measured("F9", one=off(one(first)), greedy=off(greedy))
    report = fit(surface, ["ggx", "ggx+ggx"])
    assert report.best.candidate == "ggx+ggx"
    assert report.best.diagnostics.log10_rms is not None
    assert report.best.diagnostics.log10_rms < 0.01
    assert report.described


def test_reflectance_above_one() -> None:
    """Gold in linear sRGB: 1.022 in the red channel."""
    scan = "in-plane incidences=10,30,50,70 step=2"
    m = simulate("ggx", {"k_d": 0.0, "F0": 0.9, "alpha": 0.3}, scan, (0.01, 1e-3), seed=1)
    m = replace(m, values=m.values * 1.022 / 0.9)
    found, covariance = least_squares(
        ggx_of_scale_1,
        m,
        [0.1, 0.5, 0.3],
        bounds=([0, 0, 0.01], [1, 1, 1]),
        sigma=0.01 * m.values[0] + 1e-3,
    )
    measured("F22", rel=0.2, sigmas=(0.3 - found[2]) / errors(covariance)[2])
    report = fit(m, ["ggx:k_s=1", "ggx"])
    assert report.best.candidate == "ggx"
    k_s, F0 = (report.best.params[name] for name in ("k_s", "F0"))
    assert isinstance(k_s, float)
    assert isinstance(F0, float)
    assert k_s * F0 == pytest.approx(1.022, rel=0.01)
    assert report.best.params["alpha"] == pytest.approx(0.3, rel=0.01)
    held = report.results[1]
    assert {e.name: e.status for e in held.estimates}["F0"] == "upper"
    assert held.diagnostics.misfit_limited
