"""Blocks of a measurement, and the prediction of what was left out."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
import pytest

from lobefit.fitting import Measurement, simulate
from lobefit.fitting.blocks import find_blocks
from lobefit.fitting.dataset import Dataset
from lobefit.fitting.left_out import block_scores
from lobefit.fitting.point import fit_point
from lobefit.kernels import candidate, get_device

Array = npt.NDArray[np.float64]

EIGHT = "in-plane incidences=0,10,20,30,40,50,60,70 step=5"


def scan(pattern: str, model: str = "lambert", **settings: object) -> Measurement:
    return simulate(model, {"k_d": 0.4}, pattern, (0.02, 1e-3), seed=3, **settings)  # type: ignore[arg-type]


def scattered(count: int) -> Measurement:
    rng = np.random.default_rng(4)
    theta_i, theta_o = (np.arccos(np.sqrt(rng.uniform(0.05, 1, count))) for _ in range(2))
    phi_i, phi_o = (rng.uniform(0, 2 * math.pi, count) for _ in range(2))
    return simulate("lambert", {"k_d": 0.4}, [theta_i, phi_i, theta_o, phi_o], seed=4)


# The blocks


def test_eight_incidences_are_eight_blocks() -> None:
    m = scan(EIGHT)
    blocks = find_blocks(m)
    assert blocks.kind == "incidences"
    assert blocks.count == 8
    assert blocks.note == "8 angles of incidence"
    for k, theta in enumerate(np.radians(np.arange(0, 80, 10))):
        assert m.theta_i[blocks.labels == k] == pytest.approx(theta)


def test_the_jitter_of_a_goniometer_makes_no_incidences() -> None:
    m = scan(EIGHT)
    jitter = np.radians(0.02) * np.random.default_rng(1).uniform(0, 1, m.n_directions)
    jittered = Measurement(
        m.theta_i + jitter, m.phi_i, m.theta_o, m.phi_o, m.values, m.channels, m.sigma
    )
    assert np.array_equal(find_blocks(jittered).labels, find_blocks(m).labels)


def test_a_turned_sample_has_directions_of_incidence() -> None:
    m = scan("in-plane incidences=30,60 azimuths=0,45,90,135 step=5")
    blocks = find_blocks(m)
    assert blocks.note == "8 directions of incidence"
    for k in range(8):
        rows = blocks.labels == k
        assert np.ptp(m.theta_i[rows]) == np.ptp(m.phi_i[rows]) == 0.0


@pytest.mark.parametrize(("incidences", "count"), [("30", 8), ("10,50", 8), ("0,30,60", 9)])
def test_few_incidences_are_cut_along_theta_o(incidences: str, count: int) -> None:
    m = scan(f"in-plane incidences={incidences} step=2")
    blocks = find_blocks(m)
    assert blocks.kind == "ranges of theta_o"
    assert blocks.count == count
    assert "too few to leave out one at a time" in blocks.note
    assert f"{count} contiguous ranges of theta_o instead" in blocks.note
    signed = np.where(np.cos(m.phi_o - m.phi_i) < 0, m.theta_o, -m.theta_o)
    for k in range(count):
        rows = np.flatnonzero(blocks.labels == k)
        assert np.ptp(m.theta_i[rows]) == 0.0
        within = (signed >= signed[rows].min()) & (signed <= signed[rows].max())
        same = within & (m.theta_i == m.theta_i[rows[0]])
        assert np.array_equal(np.flatnonzero(same), np.sort(rows))


def test_many_incidences_are_pooled() -> None:
    m = scan("in-plane incidences=" + ",".join(str(k) for k in range(0, 80, 2)) + " step=10")
    blocks = find_blocks(m)
    assert blocks.kind == "bands of incidence"
    assert blocks.note == "40 angles of incidence in 24 bands of neighbouring ones"
    for theta in np.unique(m.theta_i):  # no incidence is torn
        assert len(set(blocks.labels[m.theta_i == theta])) == 1


def test_scattered_incidences_are_pooled() -> None:
    blocks = find_blocks(scattered(6000))
    assert blocks.kind == "bands of incidence"
    assert np.bincount(blocks.labels).tolist() == [250] * 24


@pytest.mark.parametrize("pattern", [EIGHT, "in-plane incidences=30 step=4", "hemisphere"])
def test_every_row_is_in_one_block(pattern: str) -> None:
    blocks = find_blocks(scan(pattern))
    assert np.bincount(blocks.labels).min() >= 1
    assert blocks.labels.min() == 0


# What is left out


def test_lambert_is_predicted_as_in_closed_form() -> None:
    """A mean with known weights: what is left out is predicted by the mean of the rest."""
    m = simulate("lambert", {"k_d": 0.4}, EIGHT, (0.05, 1e-3), seed=5, sigma=True)
    dataset, blocks = Dataset(m, "chi2", get_device()), find_blocks(m)
    found = block_scores(fit_point(candidate("lambert"), dataset), blocks)
    assert m.sigma is not None
    y, sigma = m.values[0], m.sigma[0]
    expected = []
    for k in range(blocks.count):
        out = blocks.labels == k
        mean = np.average(y[~out], weights=sigma[~out] ** -2)
        z = (y[out] - mean) / sigma[out]
        expected.append(float(np.sum(-0.5 * z**2 - np.log(math.sqrt(2 * math.pi) * sigma[out]))))
    assert found == pytest.approx(expected, rel=1e-9)
    # Less than the density of what was fitted: each value pays for its own share in the mean.
    mean = np.average(y, weights=sigma**-2)
    within = np.sum(-0.5 * ((y - mean) / sigma) ** 2 - np.log(math.sqrt(2 * math.pi) * sigma))
    assert found.sum() < within


@pytest.mark.parametrize("metric", ["chi2", "log"])
def test_a_refit_is_a_fit_of_the_rest(metric: str) -> None:
    params = {"k_d": 0.2, "k_s": 0.6, "F0": 0.3, "alpha": 0.25}
    m = simulate("ggx", params, EIGHT, (0.03, 1e-4), seed=6, sigma=True)
    dataset, blocks = Dataset(m, metric, get_device()), find_blocks(m)
    found = block_scores(fit_point(candidate("ggx"), dataset), blocks)
    assert m.sigma is not None
    for k in (0, 3, 7):
        out = blocks.labels == k
        alone = fit_point(candidate("ggx"), Dataset(m.select(~out), metric, get_device()))
        f = alone.problem.values_at(dataset.full.directions, alone.polished.t, alone.polished.c)
        y, f = m.values[0, out], f[0, out]
        sigma = m.sigma[0, out]
        if metric == "chi2":
            each = -0.5 * ((y - f) / sigma) ** 2 - np.log(math.sqrt(2 * math.pi) * sigma)
        else:
            each = -(np.log(y / f) ** 2)
        # Both searches stop within a hundredth of a standard error.
        assert found[k] == pytest.approx(float(each.sum()), abs=0.02, rel=1e-3)


def test_values_that_are_missing_are_not_predicted() -> None:
    m = simulate("lambert", {"k_d": [0.4, 0.2]}, EIGHT, (0.05, 1e-3), seed=7, channels=["a", "b"])
    first = find_blocks(m).labels == 0
    holes = np.where(first, np.nan, m.values)
    some = Measurement(m.theta_i, m.phi_i, m.theta_o, m.phi_o, holes, m.channels)
    dataset = Dataset(some, "relative", get_device())
    found = block_scores(fit_point(candidate("lambert"), dataset), find_blocks(some))
    assert found[0] == 0.0
    assert np.isfinite(found).all()
