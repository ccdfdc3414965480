"""How many residuals count as independent, for the ways in which goniometers scan."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest

from lobefit.fitting.correlation import find_scans
from lobefit.fitting.measurement import Measurement
from lobefit.fitting.simulate import simulate
from tests.fitting.processes import autoregressive

Array = npt.NDArray[np.float64]


def directions(theta_i: Array, phi_i: Array, theta_o: Array, phi_o: Array) -> Measurement:
    angles = np.radians(np.broadcast_arrays(theta_i, phi_i, theta_o, phi_o))
    i, o = (angles[0], angles[1]), (angles[2], angles[3])
    return Measurement(*i, *o, values=np.ones((1, angles.shape[1])), channels=("brdf",))


def grid(*axes: npt.ArrayLike) -> list[Array]:
    return [a.ravel() for a in np.meshgrid(*(np.asarray(a, float) for a in axes), indexing="ij")]


def detector_scan(step: float = 0.5) -> Measurement:
    """The detector runs through the plane of incidence, at six incidences."""
    theta_i, signed = grid([0, 15, 30, 45, 60, 75], np.arange(-80, 80.1, step))
    return directions(theta_i, np.zeros(1), np.abs(signed), np.where(signed < 0, 0.0, 180.0))


def time_of(m: Measurement, z: Array) -> float:
    return find_scans(m).autocorrelation_time(np.atleast_2d(z))


@pytest.mark.parametrize("seed", range(5))
def test_white_noise_is_independent(seed: int) -> None:
    m = detector_scan()
    z = np.random.default_rng(seed).standard_normal((3, m.n_directions))
    # Correlations below three standard deviations are not believed: nothing remains of these.
    assert time_of(m, z) == 1.0


@pytest.mark.parametrize("rho", [0.5, 0.8, 0.95])
def test_autoregressive_noise(rho: float) -> None:
    """Its autocorrelation time is known: (1 + rho)/(1 - rho), 3 to 39 steps."""
    m = detector_scan(step=0.05)
    n = m.n_directions // 6
    found = [time_of(m, autoregressive(rho, 6, n, seed=seed).ravel()) for seed in range(5)]
    # 19,000 values hold 500 or more independent ones, and the sum is cut where noise begins.
    assert np.mean(found) == pytest.approx((1 + rho) / (1 - rho), rel=0.15)


def test_the_order_of_the_rows_does_not_matter() -> None:
    m = detector_scan()
    z = autoregressive(0.8, 6, m.n_directions // 6, seed=1).ravel()
    order = np.random.default_rng(2).permutation(m.n_directions)
    assert time_of(m.select(order), z[order]) == pytest.approx(time_of(m, z), rel=1e-12)
    assert time_of(m, z) > 4


def test_a_scan_goes_on_through_the_pole() -> None:
    """At normal view phi jumps by 180 degrees; the detector does not."""
    theta_i, signed = grid([30.0], np.arange(-2, 2.1, 0.002))
    m = directions(theta_i, np.zeros(1), np.abs(signed), np.where(signed < 0, 0.0, 180.0))
    z = autoregressive(0.9, 1, m.n_directions, seed=3).ravel()
    whole = time_of(m, z)
    z_broken = z.copy()
    half = m.n_directions // 2
    z_broken[half:] = autoregressive(0.9, 1, m.n_directions - half, seed=4).ravel()
    assert whole > 10
    # A cross-over to other noise in the middle costs next to nothing, unlike a fold.
    assert time_of(m, z_broken) == pytest.approx(whole, rel=0.5)


def test_lines_do_not_touch() -> None:
    """Where one line ends another begins; their values are no neighbours."""
    m = detector_scan(step=80.0)  # three values a line
    by_line = np.array([1.0, -1.0, 1.0, -1.0, 1.0, -1.0])
    z = np.outer(by_line, [-1.0, 2.0, 1.0]).ravel()  # the last is like the next line's first
    assert time_of(m, z) == 1.0
    constant = np.repeat(by_line, 3)  # on each line, which is a correlation
    assert time_of(m, constant) > 1.5


def test_scattered_points_are_followed_from_neighbour_to_neighbour() -> None:
    """They form no scan lines; noise is independent there too, and a misfit is not."""
    rng = np.random.default_rng(5)
    theta = np.degrees(np.arccos(rng.uniform(0.2, 1, (2, 2000))))
    phi = rng.uniform(0, 360, (2, 2000))
    m = directions(theta[0], phi[0], theta[1], phi[1])
    assert time_of(m, rng.standard_normal(2000)) == 1.0
    misfit = np.cos(4.0 * m.theta_i) * np.cos(4.0 * m.theta_o)
    assert time_of(m, misfit) > 2.0


@pytest.mark.parametrize("name", ["in-plane", "in-plane azimuths=0,30,60,90", "hemisphere"])
def test_a_misfit_is_correlated_and_noise_is_not(name: str) -> None:
    noise = simulate("ggx", {"alpha": 0.2}, name, noise=(0.0, 1.0), seed=6)
    smooth = simulate("ggx", {"alpha": 0.2}, name, noise=(0.0, 0.0)).values
    scans = find_scans(noise)
    assert scans.autocorrelation_time(noise.values - smooth) < 1.2
    misfit = np.log(smooth / simulate("ggx", {"alpha": 0.3}, name, noise=(0.0, 0.0)).values)
    assert scans.autocorrelation_time(misfit - misfit.mean()) > 5


def test_a_scan_over_azimuths() -> None:
    """Rings: theta_o stands still while phi_o runs."""
    theta_i, theta_o, phi_o = grid([30, 60], [20, 50], np.arange(0, 360, 0.5))
    m = directions(theta_i, np.zeros(1), theta_o, phi_o)
    z = autoregressive(0.9, 4, 720, seed=7).ravel()
    assert time_of(m, z) == pytest.approx(19.0, rel=0.5)  # 150 independent values only


def test_a_scan_of_the_light() -> None:
    """Where the light runs and the detector stands still, lines run along theta_i."""
    theta_o, signed = grid([0, 15, 30, 45, 60, 75], np.arange(-80, 80.1, 0.05))
    m = directions(np.abs(signed), np.where(signed < 0, 180.0, 0.0), theta_o, np.zeros(1))
    z = autoregressive(0.8, 6, m.n_directions // 6, seed=1).ravel()
    assert time_of(m, z) == pytest.approx(9.0, rel=0.3)  # one draw, of a mean good to 15 %
    white = np.random.default_rng(2).standard_normal(m.n_directions)
    assert time_of(m, white) == 1.0


def test_azimuths_may_be_given_with_more_turns() -> None:
    theta_i, theta_o, phi_o = grid([30, 60], [20, 50], np.arange(0, 360, 0.5))
    m = directions(theta_i, np.zeros(1), theta_o, phi_o)
    z = autoregressive(0.9, 4, 720, seed=7).ravel()
    for turns in (-1, 1, 2):
        turned = directions(theta_i, np.zeros(1), theta_o, phi_o + 360.0 * turns)
        assert time_of(turned, z) == pytest.approx(time_of(m, z), rel=1e-3)


def test_missing_values_do_not_matter() -> None:
    m = detector_scan(step=0.05)
    z = autoregressive(0.8, 6, m.n_directions // 6, seed=8).ravel()
    z[np.random.default_rng(9).uniform(size=z.size) < 0.05] = np.nan
    assert time_of(m, z) == pytest.approx(9.0, rel=0.3)
    assert time_of(m, np.full(m.n_directions, np.nan)) == 1.0
    assert time_of(m, np.zeros(m.n_directions)) == 1.0


def test_channels_are_averaged() -> None:
    m = detector_scan(step=0.05)
    n = m.n_directions // 6
    correlated = autoregressive(0.8, 6, n, seed=10).ravel()
    white = np.random.default_rng(11).standard_normal(m.n_directions)
    both = time_of(m, np.stack([correlated, white]))
    assert 1.5 < both < 0.7 * time_of(m, correlated)


def test_a_few_rows() -> None:
    for n in (1, 2, 3, 5):
        m = directions(np.full(n, 30.0), np.zeros(1), np.linspace(0, 60, n), np.zeros(1))
        assert time_of(m, np.ones(n)) >= 1.0
