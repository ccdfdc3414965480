"""Files of a fit: strict JSON, EXR that reads back, pictures with the data in them, whole or none."""

from __future__ import annotations

import json
import math
import subprocess
import sys
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from PIL import Image

from lobefit import __version__
from lobefit.fitting import artefacts
from lobefit.fitting.document import SCHEMA, report_document, to_json
from lobefit.fitting.figure import channel_colours, draw_figure, write_figure
from lobefit.fitting.lobes import LAYERS, MAX_INCIDENCES, MAX_NUMBERS, make_grid, write_lobes
from lobefit.fitting.measurement import Dropped, Measurement
from lobefit.fitting.panels import choose_panels
from lobefit.fitting.readers import read_measurement
from lobefit.fitting.result import FitResult
from lobefit.fitting.simulate import simulate
from lobefit.kernels import evaluate, get_model
from lobefit.kernels.errors import LobefitError
from tests.fitting.reports import Params, hand_made_report, hand_made_result

Array = NDArray[np.float64]
GLOSSY: Params = {"k_d": 0.2, "F0": 0.05, "alpha": 0.2}
BANDS = [f"{400 + 10 * k}nm" for k in range(31)]
# Few directions: the tests look at files, not at fits.
SCANS = {
    "in-plane": "in-plane incidences=0,30,60 step=5",
    "hemisphere": "hemisphere incidences=20,50 theta_step=10 phi_step=30",
}


def simulated(scan: str, channels: list[str], **settings: Any) -> Measurement:
    return simulate(
        "ggx", GLOSSY, SCANS.get(scan, scan), channels=channels, noise=(0.01, 1e-4), **settings
    )


def read_exr(path: Path) -> tuple[dict[str, NDArray[np.float32]], dict[str, Any]]:
    with OpenEXR.File(str(path), separate_channels=True) as file:
        return {name: c.pixels for name, c in file.channels().items()}, dict(file.header())


def strict(text: str) -> Any:
    """Parse JSON without the extensions that Python's parser allows."""

    def refuse(constant: str) -> None:
        raise AssertionError(f"{constant} is not JSON")

    return json.loads(text, parse_constant=refuse)


# --- report.json ------------------------------------------------------------------------------


def test_document_is_complete_and_survives_json() -> None:
    m = replace(
        simulated("in-plane", ["R", "G", "B"]),
        source="copper.csv",
        rows_read=200,
        dropped=(Dropped("at or below the horizon", (8, 11), 2),),
        notes=("two rows averaged",),
    )
    best = hand_made_result(m, "ggx:k_s=1", GLOSSY)
    report = hand_made_report(
        m,
        best,
        hand_made_result(m, "lambert", {}, bic=-1000.0),
        settings={"models": "ggx:k_s=1,lambert", "metric": "auto", "device": None, "sha256": "ab"},
    )

    document = report_document(report)
    back = strict(to_json(document))

    assert back == document
    assert back["schema"] == SCHEMA == "lobefit.report/1"
    assert back["best"] == "ggx:k_s=1"
    assert back["settings"] == {"models": "ggx:k_s=1,lambert", "metric": "auto", "device": None}
    assert back["versions"]["lobefit"] == __version__
    for package in ("numpy", "nlopt", "pyopencl"):
        assert back["versions"][package] == version(package)
    assert back["device"] == "a device"
    measured = back["measurement"]
    assert (measured["file"], measured["sha256"]) == ("copper.csv", "ab")
    assert [c["name"] for c in measured["channels"]] == ["R", "G", "B"]
    assert measured["rows"] == {
        "read": 200,
        "used": m.n_directions,
        "dropped": 2,
        "merged": 198 - m.n_directions,
    }
    assert measured["dropped"] == [
        {"rule": "at or below the horizon", "count": 2, "first_lines": [8, 11]}
    ]
    assert measured["notes"] == ["two rows averaged"]
    assert measured["metadata"] == m.metadata
    first, second = back["results"]
    assert first["params"] == best.params
    assert first["convention"] == get_model("ggx").lobe.convention
    assert len(first["estimates"]) == len(best.estimates)
    assert first["covariance"] == best.covariance.tolist()
    assert first["plausibility"]["albedo_max_theta_i_deg"] == pytest.approx([85.0] * 3)
    assert second["bic_difference"] - first["bic_difference"] == 234.5
    assert back["failed"] == [{"candidate": "ward", "reason": "the sample was not turned"}]
    # A fit can be repeated from the document alone: the same parameters, the same values.
    again = evaluate(first["model"], first["params"], 0.5, 0.0, 0.3, 3.0, options=first["options"])
    np.testing.assert_array_equal(again, best.predict(0.5, 0.0, 0.3, 3.0))


def test_document_has_null_for_what_is_no_number() -> None:
    m = simulated("in-plane", ["brdf"])
    result = hand_made_result(
        m,
        "lambert",
        {},
        rmse=math.inf,
        bic=None,
        objective=math.nan,
        covariance=np.full((1, 1), np.nan),
    )
    text = to_json(report_document(hand_made_report(m, result)))
    found = strict(text)["results"][0]
    assert found["rmse"] is found["bic"] is found["bic_difference"] is found["objective"] is None
    assert found["covariance"] == [[None]]
    assert "NaN" not in text
    assert "Infinity" not in text


def test_document_of_a_channel_without_values() -> None:
    m = simulated("in-plane", ["a", "b"])
    values = m.values.copy()
    values[1] = np.nan
    blind = replace(m, values=values)
    document = report_document(hand_made_report(blind, hand_made_result(blind, "lambert", {})))
    assert document["measurement"]["channels"][1] == {
        "name": "b",
        "values": 0,
        "negative": 0,
        "lowest": None,
        "highest": None,
    }


LEAVES = (
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False, allow_infinity=False)
)
TEXTS = st.text() | st.sampled_from(["[ 1,  2 ]", "[\n1,\n2\n]", "\\[\n 1\n]"])


@given(
    st.dictionaries(
        TEXTS,
        st.recursive(
            LEAVES | TEXTS,
            lambda inner: st.lists(inner) | st.dictionaries(TEXTS, inner),
            max_leaves=12,
        ),
    )
)
def test_compact_lists_change_nothing(document: dict[str, Any]) -> None:
    assert strict(to_json(document)) == document


def test_lists_of_numbers_take_one_line() -> None:
    text = to_json({"a": [1, -2.5, None, 1e-9], "b": ["x", 1], "c": [[1, 2], [3, 4]]})
    assert '"a": [1, -2.5, null, 1e-09],' in text
    assert "[3, 4]" in text


# --- lobes.exr --------------------------------------------------------------------------------


@pytest.mark.parametrize("channels", [["brdf"], ["R", "G", "B"], ["450.5nm", "550nm"]])
@pytest.mark.parametrize("scan", list(SCANS))
def test_lobes_hold_the_measurement_and_the_model(
    tmp_path: Path, scan: str, channels: list[str]
) -> None:
    m = simulated(scan, channels)
    result = hand_made_result(m, "ggx", GLOSSY)
    write_lobes(tmp_path / "lobes.exr", result, m)
    pixels, header = read_exr(tmp_path / "lobes.exr")

    names = [name.replace(".", ",") for name in channels]
    assert set(pixels) == {f"{layer}.{name}" for layer in LAYERS for name in names}
    assert all(p.dtype == np.float32 for p in pixels.values())

    # Decode the axes from the file alone, as its reader has to.
    theta = np.array(json.loads(header["lobefit:theta_o_deg"]))
    phi = np.array(json.loads(header["lobefit:phi_deg"]))
    incidences = np.array(json.loads(header["lobefit:incidences_deg"]))
    assert header["lobefit:layout"] == ("in-plane" if scan == "in-plane" else "tiles")
    assert pixels[f"fitted.{names[0]}"].shape == (len(incidences) * len(phi), len(theta))
    i, p, t = np.meshgrid(range(len(incidences)), phi, theta, indexing="ij")
    theta_i, phi_i = incidences[i.ravel()].T
    turn = p.ravel() + np.where(t.ravel() < 0, 180.0, 0.0)
    directions = np.deg2rad([theta_i, phi_i, np.abs(t.ravel()), phi_i + turn])
    expected = result.predict(*directions)
    for c, name in enumerate(names):
        # A float32 has 6e-8 of relative precision; the axes are written to 1e-9 degrees.
        np.testing.assert_allclose(pixels[f"fitted.{name}"].ravel(), expected[c], rtol=1e-6)

    # The scan's steps are those of the grid: every reading has a cell of its own.
    for c, name in enumerate(names):
        measured = pixels[f"measured.{name}"]
        assert np.count_nonzero(~np.isnan(measured)) == m.n_directions
        stored = np.sort(measured[~np.isnan(measured)])
        np.testing.assert_array_equal(stored, np.sort(m.values[c].astype(np.float32)))
        left = measured - pixels[f"fitted.{name}"]
        largest = float(np.nanmax(np.abs(measured)))
        np.testing.assert_allclose(pixels[f"residual.{name}"], left, atol=1e-6 * largest)


def test_a_reading_is_where_its_angles_say(tmp_path: Path) -> None:
    m = simulated("in-plane", ["brdf"])
    write_lobes(tmp_path / "lobes.exr", hand_made_result(m, "ggx", GLOSSY), m)
    pixels, header = read_exr(tmp_path / "lobes.exr")
    theta = json.loads(header["lobefit:theta_o_deg"])
    rows = json.loads(header["lobefit:incidences_deg"])
    degrees = np.rad2deg([m.theta_i, m.theta_o, m.phi_o - m.phi_i])
    at = int(np.flatnonzero(np.all(np.isclose(degrees.T, [60, 40, 180]), axis=1))[0])
    row = int(np.argmin([abs(incidence[0] - 60) for incidence in rows]))
    mirror_side = pixels["measured.brdf"][row, int(np.argmin(np.abs(np.array(theta) - 40)))]
    assert mirror_side == np.float32(m.values[0, at])


def test_normal_incidence_on_a_turned_sample_has_a_row_for_each_plane() -> None:
    m = simulate("ward", {"alpha_x": 0.3, "alpha_y": 0.1}, "in-plane incidences=0,40 step=10")
    grid = make_grid(m)
    assert grid.layout == "in-plane"
    degrees = [(round(math.degrees(t)), round(math.degrees(p))) for t, p in grid.incidences]
    assert degrees == [(t, p) for t in (0, 40) for p in (0, 45, 90, 135)]
    # No two views of one plane share a cell.
    assert len(np.unique(grid.cell)) == m.n_directions


def test_strided_values_are_stored_in_order(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """OpenEXR stores strided arrays wrongly without an error; models may give such arrays."""
    m = simulated("in-plane", ["R", "G", "B"])
    result = hand_made_result(m, "ggx", GLOSSY)
    plain = FitResult.predict

    def strided(self: FitResult, *directions: Any) -> Array:
        values = plain(self, *directions)
        holder = np.full((values.shape[1], 2 * len(values)), -1.0)
        holder[:, ::2] = values.T
        return holder[:, ::2].T

    write_lobes(tmp_path / "plain.exr", result, m)
    monkeypatch.setattr(FitResult, "predict", strided)
    write_lobes(tmp_path / "strided.exr", result, m)
    expected, _ = read_exr(tmp_path / "plain.exr")
    found, _ = read_exr(tmp_path / "strided.exr")
    assert expected.keys() == found.keys()
    for name, values in expected.items():
        np.testing.assert_array_equal(found[name], values)


def test_a_file_that_reads_back_differently_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    m = simulated("in-plane", ["brdf"])
    honest = OpenEXR.File

    def forgetful(*arguments: Any, **settings: Any) -> Any:
        if len(arguments) == 2:  # writing: header and channels
            header, channels = arguments
            # What the library does with strided arrays.
            arguments = header, {n: np.zeros_like(c) + c.flat[0] for n, c in channels.items()}
        return honest(*arguments, **settings)

    monkeypatch.setattr(OpenEXR, "File", forgetful)
    with pytest.raises(LobefitError, match="does not read back"):
        write_lobes(tmp_path / "lobes.exr", hand_made_result(m, "ggx", GLOSSY), m)


def test_missing_readings_are_nan_and_shared_cells_are_averaged(tmp_path: Path) -> None:
    angles = np.deg2rad([[30.0, 0, 40, 180], [30, 0, 40.001, 180], [30, 0, 50, 180]])
    values = np.array([[1.0, 3.0, np.nan], [5.0, np.nan, 7.0]])
    m = Measurement(*angles.T, values=values, channels=("a", "b"))
    write_lobes(tmp_path / "lobes.exr", hand_made_result(m, "lambert", {"k_d": 0.0}), m)
    pixels, _ = read_exr(tmp_path / "lobes.exr")
    assert pixels["measured.a"][~np.isnan(pixels["measured.a"])].tolist() == [2.0]
    assert pixels["residual.b"][~np.isnan(pixels["residual.b"])].tolist() == [5.0, 7.0]
    assert not np.isnan(pixels["fitted.a"]).any()


def test_a_picture_of_scattered_directions_stays_small() -> None:
    generator = np.random.default_rng(5)
    count = 5000
    angles = generator.uniform([0, 0, 0, 0], [1.5, 6.2, 1.5, 6.2], (count, 4)).T
    m = Measurement(*angles, values=np.ones((2, count)), channels=("a", "b"))
    grid = make_grid(m)
    assert len(grid.incidences) == MAX_INCIDENCES
    assert grid.n_incidences > 4900
    assert grid.shape[0] * grid.shape[1] * 3 * 2 <= MAX_NUMBERS
    assert grid.cell.max() < grid.shape[0] * grid.shape[1]


# --- fit.png ----------------------------------------------------------------------------------


@pytest.mark.parametrize("channels", [["brdf"], ["R", "G", "B"], BANDS])
@pytest.mark.parametrize("scan", list(SCANS))
def test_figure_shows_measured_and_fitted(tmp_path: Path, scan: str, channels: list[str]) -> None:
    m = simulated(scan, channels)
    report = hand_made_report(m, hand_made_result(m, "ggx", GLOSSY))
    write_figure(tmp_path / "fit.png", report)

    with Image.open(tmp_path / "fit.png") as image:
        assert image.format == "PNG"
        assert image.width >= 900
        assert len(image.convert("RGB").getcolors(1 << 24) or []) > 100

    figure = draw_figure(report)
    shown = min(len(channels), 5)
    panels = [ax for ax in figure.axes if ax.get_title()]
    assert len(panels) == len(choose_panels(m).chosen)
    for ax in panels:
        assert ax.get_yscale() == "log"
        dots = [line for line in ax.lines if line.get_marker() == "o"]
        lobes = [line for line in ax.lines if line.get_linestyle() == "-"]
        assert len(dots) == len(lobes) == shown
        for line in dots:
            assert np.isin(np.asarray(line.get_ydata()), m.values).all()
            assert len(line.get_xdata()) >= 8
    texts = " ".join(t.get_text() for sub in figure.subfigs for t in sub.texts)
    assert "ggx: GGX" in texts
    assert "alpha\u00a0=\u00a00.2000\u00a0±\u00a00.0020" in texts
    assert ("5 of 31 channels shown" in texts) == (len(channels) == 31)


def test_figure_is_deterministic(tmp_path: Path) -> None:
    m = simulated("in-plane", ["R", "G", "B"])
    report = hand_made_report(m, hand_made_result(m, "ggx", GLOSSY))
    for name in ("a.png", "b.png"):
        write_figure(tmp_path / name, report)
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()


def test_figure_leaves_pyplot_alone() -> None:
    program = (
        "import sys; from tests.fitting.test_artefacts import *; m = simulated('in-plane', ['R']);"
        "draw_figure(hand_made_report(m, hand_made_result(m, 'lambert', {})));"
        "sys.exit('matplotlib.pyplot' in sys.modules)"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], cwd=Path(__file__).parents[2], check=False
    )
    assert done.returncode == 0


def test_figure_of_flat_data_has_a_linear_axis_and_residuals_in_per_cent() -> None:
    m = simulate("lambert", {"k_d": 0.5}, SCANS["in-plane"])
    figure = draw_figure(hand_made_report(m, hand_made_result(m, "lambert", {"k_d": 0.5})))
    assert {ax.get_yscale() for ax in figure.axes} == {"linear"}
    assert "residual [%]" in {ax.get_ylabel() for ax in figure.axes}


def test_figure_weighs_residuals_by_sigma_where_it_is_given() -> None:
    m = simulated("in-plane", ["brdf"], sigma=True)
    figure = draw_figure(hand_made_report(m, hand_made_result(m, "ggx", GLOSSY)))
    strip = next(ax for ax in figure.axes if ax.get_ylabel() == "residual / σ")
    drawn = next(line for line in strip.lines if line.get_marker() == ".")
    # The simulated noise has the stated sigma.
    assert np.nanstd(np.asarray(drawn.get_ydata())) == pytest.approx(1.0, abs=0.4)
    assert any(ax.containers or ax.collections for ax in figure.axes)  # error bars


def test_figure_of_a_moving_lamp_has_a_panel_per_view() -> None:
    scan = simulated("in-plane incidences=15,45 step=2", ["brdf"])
    m = replace(
        scan, theta_i=scan.theta_o, phi_i=scan.phi_o, theta_o=scan.theta_i, phi_o=scan.phi_i
    )
    panels = choose_panels(m)
    assert panels.by_view
    assert [round(p.theta) for p in panels.chosen] == [15, 45]
    figure = draw_figure(hand_made_report(m, hand_made_result(m, "ggx", GLOSSY)))
    assert any("theta_i" in ax.get_xlabel() for ax in figure.axes)


def test_figure_chooses_eight_incidences_evenly() -> None:
    scan = "in-plane step=20 incidences=" + ",".join(map(str, range(0, 80, 5)))
    panels = choose_panels(simulated(scan, ["brdf"]))
    assert panels.total == 16
    assert [round(p.theta) for p in panels.chosen] == [0, 10, 20, 30, 45, 55, 65, 75]


@pytest.mark.parametrize("scan", list(SCANS))
def test_figure_of_hard_data(tmp_path: Path, scan: str) -> None:
    """Negative and missing values, a model that is zero, a title with a dollar sign."""
    m = simulated(scan, ["a", "b"], metadata={"material": "a $5 paint_{x}, $\\frac{"})
    values = m.values.copy()
    values[0, ::3] *= -1
    values[1, :] = np.nan
    hard = replace(m, values=values)
    report = hand_made_report(hard, hand_made_result(hard, "lambert", {"k_d": 0.0}))
    write_figure(tmp_path / "fit.png", report)
    assert (tmp_path / "fit.png").stat().st_size > 10_000


def test_figure_of_a_single_direction(tmp_path: Path) -> None:
    m = simulated("in-plane", ["brdf"]).select([3])
    write_figure(tmp_path / "fit.png", hand_made_report(m, hand_made_result(m, "ggx", GLOSSY)))
    assert (tmp_path / "fit.png").stat().st_size > 10_000


def test_channel_colours() -> None:
    red, green, blue = channel_colours(("R", "G", "B"))
    assert channel_colours(("blue", "green")) == [blue, green]
    assert len({red, green, blue}) == 3
    assert len(set(channel_colours(tuple(BANDS)))) == 31
    assert len(set(channel_colours(("x", "y", "z")))) == 3
    assert len(set(channel_colours(tuple("abcdefghij")))) == 10
    # A map of wavelengths follows the wavelength, not the order of the columns.
    assert channel_colours(("700nm", "400nm")) == channel_colours(("400nm", "700nm"))[::-1]


# --- all together -----------------------------------------------------------------------------


def test_save(tmp_path: Path) -> None:
    m = simulated("in-plane", ["R", "G", "B"])
    report = hand_made_report(m, hand_made_result(m, "ggx", GLOSSY))
    folder = tmp_path / "new" / "folder"
    for _ in range(2):  # the second time over the files of the first
        written = report.save(folder)
    assert {kind: path.name for kind, path in written.items()} == {
        "report": "report.json",
        "fit": "fit.png",
        "lobes": "lobes.exr",
        "samples": "samples.csv",
    }
    assert set(folder.iterdir()) == set(written.values())
    document = strict(written["report"].read_text(encoding="utf-8"))
    expected = report.to_dict()
    assert {**document, "created": None} == {**expected, "created": None}
    back = read_measurement(written["samples"])
    assert back.channels == m.channels
    np.testing.assert_allclose(back.values, m.values, rtol=1e-6)  # written to 7 digits


@pytest.mark.parametrize("trouble", [LobefitError("no"), KeyboardInterrupt()])
def test_an_interrupted_save_leaves_what_was_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, trouble: BaseException
) -> None:
    m = simulated("in-plane", ["brdf"])
    report = hand_made_report(m, hand_made_result(m, "ggx", GLOSSY))
    old = report.save(tmp_path / "old")
    before = {path: path.read_bytes() for path in old.values()}

    def fail(*_: object) -> None:
        raise trouble

    monkeypatch.setattr(artefacts, "write_measurement", fail)
    other = hand_made_report(m, hand_made_result(m, "lambert", {}))
    for folder in (tmp_path / "old", tmp_path / "new"):
        with pytest.raises(type(trouble)):
            other.save(folder)
    assert {path: path.read_bytes() for path in (tmp_path / "old").iterdir()} == before
    assert not (tmp_path / "new").exists()


def test_a_folder_that_cannot_be_written_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("here")
    m = simulated("in-plane", ["brdf"])
    report = hand_made_report(m, hand_made_result(m, "ggx", GLOSSY))
    for folder in (tmp_path / "file", tmp_path / "file" / "below"):
        with pytest.raises(LobefitError, match=r"cannot write to the folder .*file"):
            report.save(folder)
    assert (tmp_path / "file").read_text() == "here"
