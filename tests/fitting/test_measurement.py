"""The measurement record: validation, evidence of turning, span, grouping, writing."""

from __future__ import annotations

import gzip
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from lobefit.fitting.azimuth import count_axes
from lobefit.fitting.measurement import DIRECTION_COLUMNS, Dropped, Measurement
from lobefit.fitting.readers import read_measurement
from lobefit.fitting.writers import write_measurement
from lobefit.kernels.errors import MeasurementError


def measurement(
    theta_i: Any = (10, 10, 45, 45, 60),
    phi_i: Any = 0,
    theta_o: Any = (10, 20, 10, 45, 5),
    phi_o: Any = 180,
    values: Any = None,
    **others: Any,
) -> Measurement:
    """A small one; angles in degrees."""
    shape = np.shape(theta_i)
    degrees = zip(DIRECTION_COLUMNS, (theta_i, phi_i, theta_o, phi_o), strict=True)
    angles = {name: np.deg2rad(np.broadcast_to(angle, shape)) for name, angle in degrees}
    if values is None:
        values = 0.1 + 0.05 * np.arange(shape[0])[None, :]
    others.setdefault("channels", tuple(f"c{k}" for k in range(len(values))))
    return Measurement(**angles, values=values, **others)


def test_arrays_are_float64_read_only_and_leave_the_callers_alone() -> None:
    values = np.array([[1, 2, 3, 4, 5]], dtype=np.float32)
    made = measurement(values=values)
    assert made.values.dtype == np.float64
    with pytest.raises(ValueError, match="read-only"):
        made.values[0, 0] = 7
    with pytest.raises(ValueError, match="read-only"):
        made.theta_i[0] = 0
    values[0, 0] = 7  # still the caller's to change
    assert made.values[0, 0] == 1


def test_rows_from_no_file_count_as_read() -> None:
    made = measurement()
    assert (made.n_directions, made.n_channels) == (5, 1)
    assert (made.rows_read, made.n_dropped, made.n_merged) == (5, 0, 0)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            {"theta_i": (), "theta_o": 10, "values": np.ones((1, 0))},
            r"x.csv: needs directions, got an array of shape \(0,\)",
        ),
        ({"theta_i": (10, 20, 30, 40, 90)}, r"theta_i runs from 0.17.* to 1.57.* rad"),
        ({"theta_o": (-1, 20, 30, 40, 50)}, "theta_o runs from -0.0174533"),
        ({"phi_o": np.nan}, "phi_o contains a number that is not finite"),
        ({"values": np.ones((1, 4))}, r"values have shape \(1, 4\) \(expected \(1, 5\)\)"),
        ({"values": np.full((1, 5), np.inf)}, "values contain infinity"),
        ({"sigma": np.ones(5)}, r"sigma has shape \(5,\)"),
        ({"sigma": np.zeros((1, 5))}, "sigma is not positive and finite at every value"),
        ({"sigma": np.full((1, 5), np.nan)}, "sigma is not positive and finite"),
        ({"channels": ()}, "needs at least one channel"),
        ({"channels": ("R", "R"), "values": np.ones((2, 5))}, "channel names repeat: R, R"),
        ({"channels": ("theta_i",)}, "'theta_i' cannot name a channel"),
        ({"channels": ("a,b",)}, "'a,b' cannot name a channel"),
        ({"channels": ("sigma_R",)}, "'sigma_R' cannot name a channel"),
        ({"channels": ("",)}, "'' cannot name a channel"),
    ],
)
def test_what_no_fit_could_use_is_refused(change: dict[str, Any], message: str) -> None:
    with pytest.raises(MeasurementError, match=message) as caught:
        measurement(**change, source="x.csv")
    assert caught.value.file == "x.csv"


def test_angles_of_unequal_length_are_refused() -> None:
    with pytest.raises(MeasurementError, match=r"phi_i has shape \(2,\)"):
        Measurement(
            theta_i=np.zeros(3),
            phi_i=np.zeros(2),
            theta_o=np.zeros(3),
            phi_o=np.zeros(3),
            values=np.ones((1, 3)),
            channels=("f",),
        )


def test_a_missing_value_needs_no_sigma() -> None:
    values = np.array([[0.1, np.nan, 0.3, 0.4, 0.5]])
    made = measurement(values=values, sigma=np.where(np.isnan(values), np.nan, 0.01))
    assert made.positive_share == 1.0


def test_shares_count_present_values_only() -> None:
    made = measurement(values=[[0.1, -0.1, 0.0, np.nan, 0.2]])
    assert made.positive_share == 0.5
    assert made.negative_share == 0.25


@pytest.mark.parametrize(
    ("degrees", "count"),
    [
        ([], 0),
        ([0, 180, 360, -180], 1),
        ([0, 0.9], 1),
        ([0, 1.1], 2),
        ([0, 90, 180, 270], 2),
        ([0.2, 179.9], 1),  # across the end of the half turn
        (np.arange(0, 180, 0.4), 150),  # not chained into one: every third is beyond 1 degree
    ],
)
def test_axes_are_counted_modulo_a_half_turn(degrees: Any, count: int) -> None:
    assert count_axes(np.deg2rad(np.asarray(degrees, float)), np.deg2rad(1.0)) == count


PHIS = np.arange(0, 360, 30.0)


@pytest.mark.parametrize(
    ("angles", "evidence"),
    [
        # one incidence plane, views all round: an isotropic surface can look like this
        ((45, 0, 30, PHIS), False),
        ((45, 180, 30, PHIS), False),
        # the sample turned with the light and detector still
        ((45, PHIS, 30, PHIS + 180), True),
        # turned by half a turn only: the same axis
        ((45, [0, 180] * 6, 30, 90), False),
        # light along the normal: its azimuth says nothing, the detector's does
        ((0, PHIS, 30, 0), False),
        ((0, 0, 30, PHIS), True),
        ((0, 0, 30, [0, 90] * 6), False),
        ((0, 0, 5, PHIS), False),
    ],
)
def test_evidence_of_anisotropy_needs_a_turned_sample(angles: Any, evidence: bool) -> None:
    full: list[NDArray[np.float64]] = [np.broadcast_to(a, 12).astype(float) for a in angles]
    assert measurement(*full).has_azimuthal_evidence is evidence


def test_decades_are_the_span_of_the_values() -> None:
    theta = np.linspace(0, 80, 1000)
    values = np.logspace(-4, 3, 1000)[None, :]
    made = measurement(theta, 0, theta, 180, values)
    # Seven decades less half of the lowest ten of 1000 (0.0315) and the highest one (0.007).
    assert made.decades == pytest.approx(6.9615, abs=1e-4)


def test_decades_do_not_count_noise_around_zero() -> None:
    rng = np.random.default_rng(3)
    theta = np.linspace(0, 80, 2000)
    values = np.exp(-theta)[None, :] + rng.normal(0, 1e-3, (1, 2000))
    made = measurement(theta, 0, theta, 180, values)
    # From about 0.67 sigma, the median of noise's magnitude, to 1: log10(1 / 6.7e-4) = 3.17.
    assert made.decades == pytest.approx(3.1, abs=0.15)
    assert measurement(values=-np.ones((1, 5))).decades == 0.0


def test_incidences_are_groups_of_rows() -> None:
    made = measurement((45, 10, 45, 10, 10), (0, 0, 0, 90, 0))
    groups = made.distinct_incidences()
    degrees = [tuple(np.rint(np.rad2deg(key))) for key in groups]
    assert degrees == [(10, 0), (10, 90), (45, 0)]
    assert [rows.tolist() for rows in groups.values()] == [[1, 4], [3], [0, 2]]


def test_incidences_of_a_micro_radian_apart_are_one() -> None:
    made = measurement((10, 10 + 1e-6, 10 - 1e-6, 20, 30))
    assert [rows.tolist() for rows in made.distinct_incidences().values()] == [[0, 1, 2], [3], [4]]


@pytest.mark.parametrize(
    "index", [slice(1, 3), [1, 2], np.array([False, True, True, False, False])]
)
def test_select_keeps_rows_of_everything(index: Any) -> None:
    made = measurement(
        sigma=np.full((1, 5), 0.01),
        metadata={"material": "steel"},
        dropped=(Dropped("at or below the horizon", (7,), 1),),
        notes=("a note",),
        rows_read=6,
    )
    some = made.select(index)
    assert np.array_equal(some.theta_o, made.theta_o[1:3])
    assert np.array_equal(some.values, made.values[:, 1:3])
    assert some.sigma is not None and some.sigma.shape == (1, 2)
    assert some.metadata == {"material": "steel"} and some.notes == ("a note",)
    assert (some.rows_read, some.dropped, some.n_merged) == (2, (), 0)


@pytest.mark.parametrize("name", ["out.csv", "out.csv.gz"])
def test_a_written_measurement_reads_back(tmp_path: Path, name: str) -> None:
    rng = np.random.default_rng(1)
    values = rng.uniform(-0.01, 5, (2, 200))
    values[0, 7] = np.nan
    made = measurement(
        rng.uniform(0, 89, 200),
        rng.uniform(0, 360, 200),
        rng.uniform(0, 89, 200),
        rng.uniform(0, 360, 200),
        values,
        channels=("R", "550nm"),
        sigma=np.where(np.isnan(values), np.nan, 0.02),
        metadata={"material": "steel,\nbrushed", "seed": "1"},
    )
    write_measurement(made, tmp_path / name, {"seed": "2"})
    back = read_measurement(tmp_path / name)
    assert back.channels == made.channels
    assert back.metadata == {"material": "steel, brushed", "seed": "2"}
    for angle in ("theta_i", "phi_i", "theta_o", "phi_o"):
        # nine digits of up to 360 degrees
        np.testing.assert_allclose(getattr(back, angle), getattr(made, angle), rtol=6e-9)
    np.testing.assert_allclose(back.values, made.values, rtol=6e-7)  # seven digits
    assert made.sigma is not None and back.sigma is not None
    assert np.array_equal(np.isnan(back.sigma), np.isnan(made.sigma))
    assert (back.dropped, back.n_merged) == ((), 0)


def test_a_written_measurement_of_small_angles_says_so(tmp_path: Path) -> None:
    made = measurement((0.1, 0.2, 0.3, 0.4, 0.5), 0, 0.25, 3)
    write_measurement(made, tmp_path / "out.csv")
    np.testing.assert_allclose(read_measurement(tmp_path / "out.csv").theta_i, made.theta_i)


def test_writing_twice_gives_the_same_bytes(tmp_path: Path) -> None:
    for name in ("a.csv.gz", "b.csv.gz"):
        write_measurement(measurement(), tmp_path / name)
    assert (tmp_path / "a.csv.gz").read_bytes() == (tmp_path / "b.csv.gz").read_bytes()
    head = gzip.decompress((tmp_path / "a.csv.gz").read_bytes()).decode().splitlines()[:4]
    assert head == [
        "# quantity: brdf [1/sr]",
        "# angle_unit: deg",
        "theta_i,phi_i,theta_o,phi_o,c0",
        "10,0,10,180,0.1",
    ]


def test_within_leaves_out_grazing_directions_and_counts_them() -> None:
    theta = np.radians([10.0, 50.0, 85.0, 20.0])
    m = Measurement(theta, np.zeros(4), theta[::-1], np.zeros(4), np.ones((1, 4)), ("brdf",))
    kept = m.within(np.radians(80.0))
    assert kept.n_directions == 2
    assert kept.rows_read == 4
    assert [(d.rule, d.count) for d in kept.dropped] == [("theta above 80° (asked for)", 2)]
    assert m.within(np.radians(86.0)) is m
    with pytest.raises(MeasurementError, match="no row is left: all have theta above 5°"):
        m.within(np.radians(5.0))
