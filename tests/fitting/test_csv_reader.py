"""What the reader makes of good files: dialects, units, quantities, and the stated rules."""

from __future__ import annotations

import gzip
from pathlib import Path

import numpy as np
import pytest

from lobefit.fitting.measurement import Measurement
from lobefit.fitting.readers import read_measurement
from lobefit.kernels.errors import MeasurementError
from tests.fitting.shared_data import DATA, needs_data

HEAD = "theta_i,phi_i,theta_o,phi_o,brdf"
ROWS = (
    "10,0,10,180,0.31",
    "10,0,20,180,0.28",
    "10,0,30,180,0.26",
    "45,0,10,180,0.25",
    "45,0,45,180,0.35",
    "45,0,60,180,0.24",
)
VALUES = [0.31, 0.28, 0.26, 0.25, 0.35, 0.24]


class Reader:
    """Writes a file and reads it."""

    def __init__(self, folder: Path) -> None:
        self.path = folder / "sample.csv"

    def data(self, content: bytes) -> Measurement:
        self.path.write_bytes(content)
        return read_measurement(self.path)

    def __call__(self, *rows: str, head: str = HEAD, meta: str = "") -> Measurement:
        return self.data((meta + "\n".join([head, *rows]) + "\n").encode())


@pytest.fixture
def read(tmp_path: Path) -> Reader:
    return Reader(tmp_path)


def test_a_plain_file(read: Reader) -> None:
    made = read(*ROWS, meta="# material: steel\n# source: lab: room 2\n# measured on Monday\n")
    assert made.channels == ("brdf",)
    assert made.values.tolist() == [VALUES]
    assert made.sigma is None
    assert np.array_equal(made.theta_o, np.deg2rad([10, 20, 30, 10, 45, 60]))
    assert np.array_equal(made.phi_o, np.full(6, np.pi))
    assert made.metadata == {
        "material": "steel",
        "source": "lab: room 2",
        "comment": "measured on Monday",
    }
    assert (made.source, made.rows_read) == ("sample.csv", 6)
    assert (made.dropped, made.notes) == ((), ())


TEXT = "\n".join([HEAD, *ROWS]) + "\n"


@pytest.mark.parametrize(
    "content",
    [
        pytest.param(TEXT.encode().rstrip(), id="no line end at the end"),
        pytest.param(b"\xef\xbb\xbf" + TEXT.encode(), id="byte order mark"),
        pytest.param(TEXT.replace("\n", "\r\n").encode(), id="CRLF"),
        pytest.param(TEXT.replace(",", ";").encode(), id="semicolons"),
        pytest.param(TEXT.replace(",", ";").replace(".", ",").encode(), id="decimal commas"),
        pytest.param(TEXT.replace(",", "\t").encode(), id="tabs"),
        pytest.param(TEXT.replace(",", "\t").replace(".", ",").encode(), id="tabs, commas"),
        pytest.param(TEXT.replace(",", " ,  ").encode(), id="spaces"),
        pytest.param(TEXT.replace("0.", "+.").encode(), id="signs, no leading zero"),
        pytest.param(TEXT.replace("0.31", "31E-02").encode(), id="exponents"),
        pytest.param(('"' + HEAD.replace(",", '","') + TEXT[len(HEAD) :]).replace("brdf", 'brdf"').encode(), id="quoted names"),
        pytest.param(gzip.compress(TEXT.encode()), id="gzip whatever the name"),
        pytest.param(gzip.compress(TEXT[:50].encode()) + gzip.compress(TEXT[50:].encode()), id="gzip in parts"),
        pytest.param(b"\n \n# a: b,,,,\n,,,,\n" + TEXT.encode(), id="spreadsheet padding"),
    ],
)  # fmt: skip
def test_dialects_read_alike(read: Reader, content: bytes) -> None:
    made = read.data(content)
    assert made.values.tolist() == [VALUES]
    assert made.channels == ("brdf",)
    assert (made.dropped, made.notes) == ((), ())


def test_columns_in_any_order(read: Reader) -> None:
    rows = [f"0.02,0.5,180,{k}0.5,0.01,45,{k},0" for k in range(1, 7)]
    made = read(*rows, head="sigma_R,R,phi_o,theta_o,sigma_550nm,theta_i,550nm,phi_i")
    assert made.channels == ("R", "550nm")
    assert made.values.tolist() == [[0.5] * 6, [1, 2, 3, 4, 5, 6]]
    assert made.sigma is not None and made.sigma.tolist() == [[0.02] * 6, [0.01] * 6]
    assert np.array_equal(made.theta_o, np.deg2rad([10.5, 20.5, 30.5, 40.5, 50.5, 60.5]))


@pytest.mark.parametrize("unit", ["rad", "radians", "Radian"])
def test_radians(read: Reader, unit: str) -> None:
    rows = [f"0.5,-1.5707963267948966,{k / 10},3.5,0.2" for k in range(1, 7)]
    made = read(*rows, meta=f"# Angle unit: {unit}\n")
    # to degrees and back: two roundings
    np.testing.assert_allclose(made.theta_o, np.arange(1, 7) / 10, rtol=4e-16)
    np.testing.assert_allclose(made.phi_i, 1.5 * np.pi, rtol=4e-16)


def test_angles_that_look_like_radians_are_read_if_the_file_insists(read: Reader) -> None:
    rows = [f"0.5,0,{k / 10},3,0.2" for k in range(1, 7)]
    with pytest.raises(MeasurementError, match="look like radians"):
        read(*rows)
    made = read(*rows, meta="# small_angles: yes\n")
    assert made.theta_i[0] == np.deg2rad(0.5)


def test_small_polar_angles_beside_azimuths_in_degrees_are_noted(read: Reader) -> None:
    made = read(*[f"0.5,0,{k / 10},180,0.2" for k in range(1, 7)])
    assert made.notes == (
        (
            "all polar angles are at most 0.6 degrees; azimuths up to 180 degrees say that they are "
            "not radians"
        ),
    )


@pytest.mark.parametrize(
    ("quantity", "factor"),
    [
        ("brdf [1/sr]", 1.0),
        ("BRDF", 1.0),
        ("brdf (sr^-1)", 1.0),
        ("cosine-weighted brdf", 1 / np.cos(np.deg2rad([10, 20, 30, 10, 45, 60]))),
        ("Cosine weighted BRDF [1/sr]", 1 / np.cos(np.deg2rad([10, 20, 30, 10, 45, 60]))),
        ("radiance factor", 1 / np.pi),
    ],
)
def test_quantities_become_brdf(read: Reader, quantity: str, factor: float) -> None:
    rows = [f"{row},0.01" for row in ROWS]
    made = read(*rows, head=HEAD + ",sigma_brdf", meta=f"# quantity: {quantity}\n")
    np.testing.assert_allclose(made.values[0], np.array(VALUES) * factor, rtol=4e-16)
    assert made.sigma is not None
    np.testing.assert_allclose(made.sigma[0], np.full(6, 0.01) * factor, rtol=4e-16)
    converted = [note for note in made.notes if "converted to brdf [1/sr]" in note]
    assert len(converted) == (0 if quantity.lower()[:4] == "brdf" else 1)
    assert "quantity" not in made.metadata


def test_rows_below_the_horizon_are_dropped_and_counted(read: Reader) -> None:
    made = read(*ROWS, "90,0,10,0,1", "10,0,89.9996,0,1", "10,0,120,0,1", "10,0,89.99,0,1")
    assert made.n_directions == 7
    (dropped,) = made.dropped
    assert (dropped.rule, dropped.rows, dropped.count) == (
        "at or below the horizon",
        (8, 9, 10),
        3,
    )


@pytest.mark.parametrize("half_pi", ["1.5708", "1.57079", "1.5707963267948966", "1.571"])
def test_a_rounded_right_angle_in_radians_is_the_horizon(read: Reader, half_pi: str) -> None:
    rows = [f"0.5,0,{k / 10},0,0.2" for k in range(1, 7)]
    made = read(*rows, f"0.5,0,{half_pi},0,0.2", meta="# angle_unit: rad\n")
    assert made.n_directions == 6


def test_only_the_first_twenty_lines_of_a_rule_are_kept(read: Reader) -> None:
    made = read(*ROWS, *["10,0,95,0,1"] * 30)
    assert made.dropped[0].count == 30
    assert made.dropped[0].rows == tuple(range(8, 28))


def test_missing_values_and_angles(read: Reader) -> None:
    made = read(
        *[f"{row},1.5" for row in ROWS],
        "10,0,50,180,,2.5",
        "10,0,55,180,NaN,-nan",
        "nan,0,60,180,1,1",
        "10,0,65,180, ,3.5",
        head=HEAD + ",G",
    )
    assert made.values[1].tolist() == [1.5] * 6 + [2.5, 3.5]
    assert np.flatnonzero(np.isnan(made.values[0])).tolist() == [6, 7]
    assert [(d.rule, d.rows, d.count) for d in made.dropped] == [
        ("with nan in an angle", (10,), 1),
        ("without a value in any channel", (9,), 1),
    ]
    assert made.notes == (
        "channel brdf: 3 values missing (lines 8, 9, 11)",
        "channel G: 1 value missing (line 9)",
    )


def test_a_missing_value_takes_its_sigma_along(read: Reader) -> None:
    rows = [f"{row},0.01" for row in ROWS]
    made = read(*rows, "10,0,50,180,,0.5", "10,0,55,180,0.2,0.1", head=HEAD + ",sigma_brdf")
    assert made.sigma is not None
    assert (made.n_directions, made.sigma[0].tolist()) == (7, [0.01] * 6 + [0.1])


def test_blank_lines_are_skipped_and_noted(read: Reader) -> None:
    made = read(*ROWS[:3], "", ",,,,", *ROWS[3:], "", "nan,0,1,0,1")
    assert made.values.tolist() == [VALUES]
    assert made.notes == ("blank lines skipped: lines 5, 6, 10",)
    assert made.dropped[0].rows == (11,)


def test_repeated_directions_are_averaged(read: Reader) -> None:
    """The mean of independent readings has sigma sqrt(sum s²) / n; of copies, that of one."""
    rows = [f"{row},0.01" for row in ROWS]
    made = read(
        *rows,
        "10,0,10,-180,0.33,0.03",  # -180 is 180
        "10,360,20,180,0.28,0.02",  # a copy of line 3, but for its sigma
        head=HEAD + ",sigma_brdf",
    )
    assert made.n_directions == 6
    assert made.values[0].tolist() == pytest.approx([0.32, *VALUES[1:]], rel=1e-15)
    assert made.sigma is not None
    expected = [np.hypot(0.01, 0.03) / 2, 0.02, *[0.01] * 4]
    assert made.sigma[0].tolist() == pytest.approx(expected, rel=1e-15)
    assert (made.rows_read, made.n_merged, made.n_dropped) == (8, 2, 0)
    assert made.notes == (
        (
            "4 rows of equal direction averaged into 2 (the first of each: lines 2, 3); values differ "
            "by up to 6.06 % of the larger"
        ),
    )


def test_averaging_leaves_missing_values_out(read: Reader) -> None:
    rows = [f"{row},1" for row in ROWS]
    made = read(*rows, "10,0,10,180,,3", "10,0,70,180,,1", "10,0,70,180,,2", head=HEAD + ",G")
    assert made.values[0].tolist()[:6] == VALUES
    assert np.isnan(made.values[0, 6])
    assert made.values[1].tolist() == [2, 1, 1, 1, 1, 1, 1.5]


def test_the_pole_is_one_direction_whatever_its_azimuth(read: Reader) -> None:
    made = read(
        *ROWS,
        "30,0,0,0,0.1",  # seen along the normal: phi_o says nothing
        "30,0,0,90,0.3",
        "30,45,0,0,0.5",  # another incidence
        "0,0,30,0,0.6",  # lit along the normal: phi_i says nothing, phi_o does
        "0,70,30,0,0.8",
        "0,0,30,90,0.9",
        "0,10,0,20,1.5",  # both
        "0,30,0,40,2.5",
    )
    assert made.values[0, 6:].tolist() == pytest.approx([0.2, 0.5, 0.7, 0.9, 2.0], rel=1e-15)
    assert np.rad2deg(made.phi_o[6:]).tolist() == [0, 0, 0, 90, 0]
    assert np.rad2deg(made.phi_i[6:]).tolist() == [0, 45, 0, 0, 0]
    assert made.notes == (
        (
            "6 rows at the pole, whatever the azimuth, averaged into 3 (the first of each: lines 8, "
            "11, 14); values differ by up to 66.7 % of the larger"
        ),
    )


def noisy(*fill: str, scale: float = 0.01) -> list[str]:
    """Rows around zero, as dark subtraction leaves them, and some fill values."""
    rng = np.random.default_rng(5)
    values = [f"{value:.6f}" for value in rng.normal(0.5 * scale, scale, 60)]
    values[5:5] = fill
    return [f"10,0,{k},180,{value}" for k, value in enumerate(values, start=1)]


def test_negative_values_from_dark_subtraction_stay(read: Reader) -> None:
    made = read(*noisy())
    assert made.n_directions == 60
    assert made.negative_share > 0.2
    assert made.notes == ()


@pytest.mark.parametrize("fill", ["-1", "-1.0", "-999", "-9999", "-1e3", "-1e30", "9.96921e36"])
def test_a_fill_value_is_missing(read: Reader, fill: str) -> None:
    made = read(*noisy(fill, fill))
    assert made.n_directions == 60
    assert made.dropped[0].rule == "without a value in any channel"
    assert made.dropped[0].rows == (7, 8)
    first = made.notes[0]
    assert first == (
        f"channel brdf: 2 cells with the fill value {float(fill):.7g} taken as missing (lines 7, 8)"
    )


def test_two_kinds_of_fill_value(read: Reader) -> None:
    assert read(*noisy("-1", "-2", "-1", "-2")).n_directions == 60
    assert read(*noisy("-1", "-999")).n_directions == 60


@pytest.mark.parametrize(
    ("fills", "scale"),
    [
        (["-1", "-1"], 1.0),  # within the scatter of the others
        (["-3"], 0.01),  # once only, and not a customary one
        (["-0.5", "-0.5"], 0.01),  # not whole
    ],
)
def test_an_outlier_is_no_fill_value(read: Reader, fills: list[str], scale: float) -> None:
    assert read(*noisy(*fills, scale=scale)).n_directions == 60 + len(fills)


def test_counts_below_the_dark_level_are_no_fill_values(read: Reader) -> None:
    rows = [f"10,0,{k},180,{k % 4 - 1}" for k in range(1, 41)]
    made = read(*rows)
    assert made.n_directions == 40
    assert made.notes == (
        (
            "channel brdf: 10 cells are exactly -1, the only negative value; kept (write nan if it "
            "means missing)"
        ),
    )


def test_a_suspicious_ceiling_is_noted_and_kept(read: Reader) -> None:
    made = read(*ROWS, "10,0,50,180,9999", "10,0,55,180,9999")
    assert made.n_directions == 8
    assert made.notes == (
        (
            "channel brdf: 2 cells exactly 9999, far above the rest; kept (write nan if it means "
            "missing)"
        ),
    )


def test_metadata_keys_repeat_or_stand_empty(read: Reader) -> None:
    made = read(*ROWS, meta="# note: a\n# note: b\n# empty:\n#\n# angle_unit: deg\n")
    assert made.metadata == {"note": "a; b"}


def test_line_numbers_count_metadata_and_survive_blocks(read: Reader) -> None:
    rows = [f"{k % 80},{k % 360}.{k:06d},{k % 70}.5,0,0.25" for k in range(120_000)]
    rows[100_000] = "95,0,10,180,0.2"
    made = read(*rows, meta="# a: b\n# c: d\n")
    assert made.dropped[0].rows == (100_004,)
    assert made.rows_read == 120_000


# file: rows read, used, dropped, merged, channels, azimuthal evidence
REAL = {
    "carpaint_blue_rgb.csv.gz": (182250, 182250, 0, 0, 3, False),
    "cornell_garnet_red_31_wavelengths.csv": (1439, 1439, 0, 0, 31, False),
    "merl_aluminium_slice.csv": (1785, 1785, 0, 0, 1, False),
    "merl_like/chrome.csv.gz": (3854, 3627, 0, 227, 3, True),
    "mtmrt_aluminium.csv": (890, 890, 0, 0, 1, False),
    "starlink_chassis_532nm.csv": (724, 716, 8, 0, 1, False),
    "vegetation_cars_479nm.csv": (14500, 14330, 66, 104, 1, False),
}


@needs_data
@pytest.mark.parametrize("name", REAL)
def test_real_measurements(name: str) -> None:
    made = read_measurement(DATA / name)
    found = (made.rows_read, made.n_directions, made.n_dropped, made.n_merged, made.n_channels)
    assert (*found, made.has_azimuthal_evidence) == REAL[name]
    assert made.positive_share > 0.8
    assert made.decades > 1


@needs_data
def test_every_real_file_reads() -> None:
    files = sorted(DATA.rglob("*.csv*"))
    assert len(files) > 20
    for file in files:
        made = read_measurement(file)
        assert made.n_directions + made.n_dropped + made.n_merged == made.rows_read
        assert made.n_directions > 500
