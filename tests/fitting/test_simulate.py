"""Simulated measurements: repeatable, with exactly the noise that was asked for."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import ArrayLike

from lobefit.fitting.measurement import DIRECTION_COLUMNS, Measurement
from lobefit.fitting.readers.csv import read_measurement
from lobefit.fitting.scan_patterns import Hemisphere, InPlane
from lobefit.fitting.simulate import Geometry, simulate
from lobefit.fitting.writers import write_measurement
from lobefit.kernels import (
    LobefitError,
    MeasurementError,
    ModelError,
    candidate,
    candidates,
    evaluate,
)
from lobefit.kernels.evaluate import Params

COPPER: Params = {"k_d": 0.02, "F0": [0.95, 0.64, 0.54], "alpha": 0.3}
EVERY_CANDIDATE = [candidate.name for candidate in candidates("all")]
# 5 standard deviations: one draw in 1.7 million; seeds are fixed, so that a pass stays one.
FAR = 5.0


def directions(m: Measurement) -> list[np.ndarray[tuple[int], np.dtype[np.float64]]]:
    return [getattr(m, name) for name in DIRECTION_COLUMNS]


def standardised(m: Measurement, relative: float, additive: float) -> Any:
    """Give the noise of a simulated measurement in units of its own sigma, shape (C, N)."""
    model = m.metadata["simulated_model"].partition(":")[0]
    clean = evaluate(model, json.loads(m.metadata["simulated_params"]), *directions(m))
    return (m.values - clean) / np.sqrt((relative * clean) ** 2 + additive**2)


@pytest.mark.parametrize("geometry", ["in-plane", "hemisphere"])
@pytest.mark.parametrize("name", EVERY_CANDIDATE)
def test_every_candidate_without_noise_is_the_model(name: str, geometry: str) -> None:
    m = simulate(name, {}, geometry, noise=(0, 0))
    model = candidate(name).model
    exact = evaluate(model, json.loads(m.metadata["simulated_params"]), *directions(m))
    assert m.channels == ("brdf",)
    assert np.array_equal(m.values, exact)


@pytest.mark.parametrize("name", EVERY_CANDIDATE)
def test_metadata_say_how_to_make_it_again(name: str) -> None:
    chosen = candidate(name)
    by_channel = next(
        p.name for p in chosen.model.parameters if p.per_channel and p.name not in chosen.fixed
    )
    first = simulate(
        name, {by_channel: [0.1, 0.2, 0.3]}, "in-plane step=10", (0.05, 0.002), seed=12
    )
    said = first.metadata
    relative, additive = map(float, said["simulated_noise"].split(","))
    again = simulate(
        said["simulated_model"],
        json.loads(said["simulated_params"]),
        said["simulated_geometry"],
        (relative, additive),
        int(said["simulated_seed"]),
    )
    assert again.values.tobytes() == first.values.tobytes()
    assert again.theta_o.tobytes() == first.theta_o.tobytes()
    assert again.metadata == first.metadata


def test_options_reach_the_model_and_the_record() -> None:
    options = {"masking": "smith_separable"}
    m = simulate("ggx", {"alpha": 0.6}, noise=(0, 0), options=options)
    exact = evaluate("ggx", {"alpha": 0.6}, *directions(m), options=options)
    assert np.array_equal(m.values, exact)
    assert not np.array_equal(m.values, evaluate("ggx", {"alpha": 0.6}, *directions(m)))
    assert json.loads(m.metadata["simulated_options"]) == options


def test_same_seed_same_bytes_another_seed_other_noise() -> None:
    first, again, other = (simulate("ggx:k_s=1", COPPER, seed=seed) for seed in (7, 7, 8))
    assert first.values.tobytes() == again.values.tobytes()
    # Continuous noise: not one value repeats.
    assert not np.any(first.values == other.values)
    assert first.theta_o.tobytes() == other.theta_o.tobytes()


@pytest.mark.parametrize(
    ("relative", "additive"), [(0.05, 0.0), (0.0, 0.01), (0.03, 0.002)], ids=str
)
def test_noise_has_the_stated_size_and_is_independent(relative: float, additive: float) -> None:
    m = simulate("ggx:k_s=1", COPPER, InPlane(step_deg=0.05), (relative, additive), seed=3)
    z = standardised(m, relative, additive)
    channels, n = z.shape
    assert (channels, n) == (3, 6 * 3201)
    by_brightness = np.argsort(simulate("ggx:k_s=1", COPPER, m, (0, 0)).values[0])
    # The dark end is where the additive part rules, the bright end where the relative one does.
    for part in (z, z[:, by_brightness[: n // 4]], z[:, by_brightness[-n // 4 :]]):
        chi_square, freedom = float(np.sum(part**2)), part.size
        assert abs(chi_square - freedom) < FAR * np.sqrt(2 * freedom)
    # Excess kurtosis and correlations of Gaussian noise have these standard errors.
    assert abs(float(np.mean(z**4)) - 3) < FAR * np.sqrt(96 / z.size)
    assert abs(float(np.mean(z[:, 1:] * z[:, :-1]))) < FAR / np.sqrt(z.size)
    assert abs(float(np.mean(z[0] * z[1]))) < FAR / np.sqrt(n)


def test_noise_has_no_bias() -> None:
    """The mean over seeds comes to the model like one over the root of their number."""
    seeds, noise = 400, (0.1, 0.005)
    scan = InPlane(incidences_deg=(20, 60), step_deg=10)
    z = np.stack(
        [
            standardised(simulate("blinn_phong", {}, scan, noise, seed), *noise)
            for seed in range(seeds)
        ]
    )
    mean = z.mean(axis=0) * np.sqrt(seeds)
    chi_square, freedom = float(np.sum(mean**2)), mean.size
    assert freedom == 2 * 17
    assert abs(chi_square - freedom) < FAR * np.sqrt(2 * freedom)
    assert np.abs(mean).max() < FAR


def test_negative_values_stay() -> None:
    dark = simulate("lambert", {"k_d": 0.001}, InPlane(step_deg=0.5), noise=(0.0, 0.01), seed=1)
    # The signal is 0.03 standard deviations: nearly half of the values are negative.
    assert 0.45 < dark.negative_share < 0.52


def test_sigma_is_the_true_one_and_survives_a_file(tmp_path: Path) -> None:
    m = simulate("ggx:k_s=1", COPPER, noise=(0.04, 0.003), seed=2, sigma=True)
    clean = simulate("ggx:k_s=1", COPPER, noise=(0, 0)).values
    assert m.sigma is not None
    # Two ways to write a root of a sum of squares differ by rounding.
    assert np.allclose(m.sigma, np.sqrt((0.04 * clean) ** 2 + 0.003**2), rtol=1e-14)
    write_measurement(m, tmp_path / "copper.csv")
    read = read_measurement(tmp_path / "copper.csv")
    assert read.sigma is not None
    assert np.allclose(read.sigma, m.sigma, rtol=1e-6)  # written to 7 digits
    assert simulate("lambert", {}).sigma is None


@pytest.mark.parametrize("name", ["ggx", "ward"])
@pytest.mark.parametrize("scan", ["in-plane blind=4", "hemisphere", "in-plane azimuths=0,45,90"])
def test_a_file_gives_every_row_back(name: str, scan: str, tmp_path: Path) -> None:
    """No direction is repeated, at the pole neither: the reader finds nothing to merge."""
    m = simulate(name, {}, scan, metadata={"material": "a test"})
    write_measurement(m, tmp_path / "m.csv")
    read = read_measurement(tmp_path / "m.csv")
    assert (read.n_directions, read.dropped, read.notes) == (m.n_directions, (), ())
    assert read.metadata["material"] == "a test"
    assert read.metadata["simulated_model"] == name
    for ours, theirs in zip(directions(m), directions(read), strict=True):
        assert np.allclose(ours, theirs, rtol=0, atol=1e-8)  # written to 9 digits of a degree
    assert np.allclose(m.values, read.values, rtol=1e-6, atol=0)


@pytest.mark.parametrize("scan", ["in-plane", "hemisphere"])
def test_an_anisotropic_sample_is_turned(scan: str) -> None:
    assert simulate("ward", {}, scan).has_azimuthal_evidence
    assert not simulate("ward:isotropic", {}, scan).has_azimuthal_evidence
    assert not simulate("ward", {}, f"{scan} azimuths=0").has_azimuthal_evidence
    assert not simulate("ward", {}, InPlane()).has_azimuthal_evidence


def test_given_angles_in_any_form_are_the_same() -> None:
    theta_o = np.deg2rad([0, 20, 40])
    columns: dict[str, ArrayLike] = {
        "theta_i": 0.5,
        "phi_i": 0.0,
        "theta_o": theta_o,
        "phi_o": np.pi,
    }
    first = simulate("ggx", {}, columns)
    forms: list[Geometry] = [(0.5, 0.0, theta_o, np.pi), [0.5, 0, list(theta_o), np.pi], first]
    for form in forms:
        again = simulate("ggx", {}, form)
        assert again.values.tobytes() == first.values.tobytes()
        assert again.theta_i.tolist() == [0.5] * 3
    assert first.metadata["simulated_geometry"] == "3 given directions"


def test_channels_take_usual_names_or_given_ones() -> None:
    small = Hemisphere(incidences_deg=(30,), theta_step_deg=40, phi_step_deg=90)
    two = {"k_d": [0.1, 0.2]}
    assert simulate("lambert", {"k_d": [0.1, 0.2, 0.3]}, small).channels == ("R", "G", "B")
    assert simulate("lambert", two, small).channels == ("c1", "c2")
    assert simulate("lambert", two, small, channels=("450nm", "532nm")).channels == (
        "450nm",
        "532nm",
    )
    shared = simulate("lambert", {}, small, channels="X,Y,Z")
    assert shared.channels == ("X", "Y", "Z")
    # One BRDF in three channels, but three readings.
    assert not np.any(shared.values[0] == shared.values[1])


def test_variants_hold_and_tie() -> None:
    held = json.loads(simulate("ggx:k_s=1", {}).metadata["simulated_params"])
    tied = json.loads(simulate("ward:isotropic", {"alpha_x": 0.07}).metadata["simulated_params"])
    assert held["k_s"] == 1
    assert (tied["alpha_x"], tied["alpha_y"], tied["phi_x"]) == (0.07, 0.07, 0)
    assert simulate("ggx:k_s=1", {"k_s": [1, 1, 1]}).channels == ("R", "G", "B")


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        ({"noise": (-0.1, 0)}, MeasurementError, "(relative, additive): two numbers, 0 or more"),
        ({"noise": (0.1, -1e-9)}, MeasurementError, "two numbers, 0 or more"),
        ({"noise": (float("nan"), 0)}, MeasurementError, "two numbers, 0 or more"),
        ({"noise": 0.1}, MeasurementError, "the noise is 0.1"),
        ({"noise": (0.1, 0.1, 0.1)}, MeasurementError, "two numbers"),
        ({"noise": ("a", "b")}, MeasurementError, "the noise is ('a', 'b')"),
        ({"noise": (0, 0), "sigma": True}, MeasurementError, "additive part, or sigma=False"),
        ({"seed": -1}, MeasurementError, "the seed is -1 (expected a whole number, 0 or more)"),
        ({"seed": None}, MeasurementError, "the seed is None"),
        ({"seed": 1.5}, MeasurementError, "the seed is 1.5"),
        ({"geometry": "hemispher"}, MeasurementError, "did you mean 'hemisphere'?"),
        ({"geometry": 3}, MeasurementError, "the geometry is int"),
        ({"geometry": (1, 2, 3)}, MeasurementError, "the geometry is tuple"),
        ({"geometry": {"theta_i": 0.1}}, MeasurementError, "expected theta_i, phi_i, theta_o"),
        ({"geometry": (0.1, 0, [0.1, 0.2], [1, 2, 3])}, MeasurementError, "do not fit together"),
        ({"geometry": (0.1, 0, "high", 0)}, MeasurementError, "do not fit together"),
        ({"geometry": (0.1, 0, [[0.1]], 0)}, MeasurementError, "has shape (1, 1)"),
        ({"geometry": (0.1, 0, [], 0)}, MeasurementError, "has shape (0,)"),
        (
            {"geometry": (0.1, 0, [0.2, 30], 0)},
            MeasurementError,
            "theta_o of direction 1 is 30 rad",
        ),
        ({"geometry": (-0.1, 0, 0.1, 0)}, MeasurementError, "theta_i of direction 0 is -0.1 rad"),
        ({"geometry": (0.1, float("inf"), 0, 0)}, MeasurementError, "phi_i of direction 0 is inf"),
        ({"channels": ("a", "b")}, ModelError, "lists for 3 channels, but 2 are named (a, b)"),
        ({"channels": ("a", "a", "b")}, MeasurementError, "channel names repeat"),
        ({"model": "ggy"}, ModelError, "did you mean 'ggx'?"),
        ({"model": "ggx:k_s=2"}, ModelError, "did you mean ggx:k_s=1?"),
        ({"params": {"k_s": 0.5}}, ModelError, "holds k_s at 1, not 0.5; leave it out, or use ggx"),
        ({"params": {"alfa": 0.5}}, ModelError, "did you mean 'alpha'?"),
        ({"params": {"alpha": 3}}, ModelError, "outside its range"),
        ({"options": {"masking": "none"}}, ModelError, "masking"),
        (
            {"model": "ward:isotropic", "params": {"alpha_x": 0.1, "alpha_y": 0.2}},
            ModelError,
            "alpha_y equals alpha_x (0.1), not 0.2",
        ),
    ],
)
def test_what_no_instrument_does_is_refused_with_a_remedy(
    arguments: dict[str, Any], error: type[LobefitError], message: str
) -> None:
    call = {"model": "ggx:k_s=1", "params": COPPER, **arguments}
    with pytest.raises(error) as caught:
        simulate(**call)
    assert message in str(caught.value)
