"""Scattered incidences: pooled where that is allowed, and what the files of a fit then show."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from lobefit.fitting.bands import is_isotropic, is_scattered, pool
from lobefit.fitting.figure import draw_figure, write_figure
from lobefit.fitting.lobes import make_grid
from lobefit.fitting.measurement import Measurement
from lobefit.fitting.merl import SHAPE, cell_directions
from lobefit.fitting.panels import MAX_PANELS, Residuals, choose_panels
from lobefit.fitting.readers.merl import STRIDE
from lobefit.kernels import evaluate
from tests.fitting.reports import GLOSSY, hand_made_report, hand_made_result, simulated

GROOVED: dict[str, float | list[float]] = {
    "k_d": 0.1,
    "k_s": 0.3,
    "alpha_x": 0.3,
    "alpha_y": 0.1,
    "phi_x": 0.0,
}


def table(spread: float = 0.0) -> Measurement:
    """Read a MERL table of a glossy surface, its azimuths turned at random by up to `spread`."""
    starts = (0, STRIDE[1] // 2, STRIDE[2] // 2)
    runs = [np.arange(a, n, step) for a, n, step in zip(starts, SHAPE, STRIDE, strict=True)]
    theta_i, theta_o, phi_o = (a.ravel() for a in cell_directions(*np.ix_(*runs)))
    above = np.maximum(theta_i, theta_o) < np.pi / 2 - 1e-6
    theta_i, theta_o, phi_o = theta_i[above], theta_o[above], phi_o[above]
    phi_i = np.random.default_rng(3).uniform(0.0, spread, theta_i.size)
    values = evaluate("ggx", GLOSSY, theta_i, 0.0, theta_o, phi_o)
    return Measurement(theta_i, phi_i, theta_o, phi_o + phi_i, values, channels=("brdf",))


@pytest.fixture(scope="module")
def merl() -> Measurement:
    return table()


def test_picture_of_a_merl_table_shows_lobes(merl: Measurement, tmp_path: Path) -> None:
    assert max(len(rows) for rows in merl.distinct_incidences().values()) <= 2
    result = hand_made_result(merl, "ggx", GLOSSY)
    report = hand_made_report(merl, result)
    write_figure(tmp_path / "fit.png", report)
    with Image.open(tmp_path / "fit.png") as image:
        assert len(image.convert("RGB").getcolors(1 << 24) or []) > 100

    panels = choose_panels(merl, isotropic=True)
    assert panels.width == 5.0
    assert panels.total == 18
    assert len(panels.chosen) == MAX_PANELS
    figure = draw_figure(report)
    titled = [ax for ax in figure.axes if ax.get_title()]
    wanted = [(0, 5), (10, 15), (25, 30), (35, 40), (50, 55), (60, 65), (75, 80), (85, 90)]
    assert [ax.get_title() for ax in titled] == [rf"$\theta_i$ = {a}–{b}°" for a, b in wanted]
    for ax, panel, (low, high) in zip(titled, panels.chosen, wanted, strict=True):
        theta_i = np.rad2deg(merl.theta_i[panel.hemisphere])
        assert ((theta_i >= low) & (theta_i < high)).all()
        assert len(panel.hemisphere) > 100
        # A lobe, not a point: more than at the mirror direction.
        assert len(panel.rows) >= 20
        assert np.ptp(panel.angle) > 15.0
        dots = next(line for line in ax.lines if line.get_marker() == "o")
        np.testing.assert_array_equal(dots.get_ydata(), merl.values[0, panel.rows])
        lobe = next(line for line in ax.lines if line.get_linestyle() == "-")
        middle = np.deg2rad((low + high) / 2)
        signed = np.deg2rad(np.asarray(lobe.get_xdata()))
        drawn = result.predict(middle, 0.0, np.abs(signed), np.where(signed > 0, np.pi, 0.0))
        np.testing.assert_allclose(np.asarray(lobe.get_ydata()), drawn[0], rtol=1e-9)
        # Near the line: the lobe of alpha = 0.1 changes by less in 2.5 degrees of incidence.
        near = np.interp(panel.angle, panel.line_angle, np.log10(np.asarray(lobe.get_ydata())))
        off = np.log10(merl.values[0, panel.rows]) - near
        assert np.median(np.abs(off)) < 0.1
        assert np.abs(off).max() < 1.0
    texts = [t.get_text() for sub in figure.subfigs for t in sub.texts]
    assert any("scattered incidences pooled in bands of 5°" in text for text in texts)
    assert any("8 of 18 bands shown" in text for text in texts)


def test_residuals_of_a_band_are_taken_at_each_readings_own_directions(merl: Measurement) -> None:
    result = hand_made_result(merl, "ggx", GLOSSY)
    residuals = Residuals(merl, result)
    for panel in choose_panels(merl, isotropic=True).chosen:
        # The table is of this very model, and results are computed in double precision.
        assert np.abs(residuals.at(panel.hemisphere)).max() < 1e-9


def test_bands_turn_readings_to_one_azimuth(merl: Measurement) -> None:
    turned = table(spread=2 * np.pi)
    assert turned.has_azimuthal_evidence
    assert not merl.has_azimuthal_evidence
    same, pooled = choose_panels(merl), choose_panels(turned, isotropic=True)
    for a, b in zip(same.chosen, pooled.chosen, strict=True):
        assert a.band == b.band
        assert b.phi == 0.0
        np.testing.assert_array_equal(a.rows, b.rows)
        np.testing.assert_allclose(a.angle, b.angle, atol=1e-9)
        np.testing.assert_allclose(np.cos(a.turn), np.cos(b.turn), atol=1e-9)


def test_a_turned_sample_is_not_pooled_for_an_anisotropic_model(tmp_path: Path) -> None:
    m = table(spread=2 * np.pi).select(slice(None, None, 7))
    result = hand_made_result(m, "ward", GROOVED)
    assert not is_isotropic(result)
    assert is_isotropic(hand_made_result(m, "ggx", GLOSSY))
    panels = choose_panels(m)
    assert panels.width is None
    # Most panels have no view near the plane of incidence; their lines are finite all the same.
    assert any(panel.rows.size == 0 for panel in panels.chosen)
    for panel in panels.chosen:
        assert all(np.isfinite(axis).all() for axis in panel.line)
    write_figure(tmp_path / "fit.png", hand_made_report(m, result))
    assert make_grid(m).width is None


def test_an_unturned_sample_keeps_its_azimuth(merl: Measurement) -> None:
    m = replace(merl, phi_i=merl.phi_i + 0.7, phi_o=merl.phi_o + 0.7)
    for panel in choose_panels(m).chosen:
        assert panel.line[1] == pytest.approx(0.7)


@pytest.mark.parametrize("count", [5, 5000])
def test_pooling_starts_where_panels_run_out(merl: Measurement, count: int) -> None:
    m = merl.select(slice(0, count))
    assert (choose_panels(m).width is None) == (count <= MAX_PANELS)


def test_few_readings_take_wider_bands(merl: Measurement) -> None:
    panels = choose_panels(merl.select(slice(None, None, 8)))
    assert panels.width == 10.0
    assert panels.total == 9


def test_scattered_incidences_in_the_plane() -> None:
    generator = np.random.default_rng(4)
    theta_i, theta_o = np.deg2rad(generator.uniform([[5.0], [0.0]], [[70.0], [85.0]], (2, 2000)))
    phi_o = np.where(generator.uniform(size=2000) < 0.5, 0.0, np.pi)
    values = evaluate("ggx", GLOSSY, theta_i, 0.0, theta_o, phi_o)
    m = Measurement(theta_i, np.zeros(2000), theta_o, phi_o, values, channels=("brdf",))
    panels = choose_panels(m)
    assert panels.in_plane
    assert panels.total == 13
    assert all(len(p.rows) > 100 for p in panels.chosen)
    figure = draw_figure(hand_made_report(m, hand_made_result(m, "ggx", GLOSSY)))
    assert len([ax for ax in figure.axes if "–" in ax.get_title()]) == 8
    grid = make_grid(m)
    assert grid.layout == "in-plane"
    assert grid.width == 1.0
    np.testing.assert_allclose(np.rad2deg(grid.incidences)[:, 0], np.arange(5.5, 70.0))
    np.testing.assert_allclose(grid.theta, np.arange(-89.5, 90.0))


def test_encoder_noise_does_not_part_an_incidence() -> None:
    exact = simulated("hemisphere incidences=0,20,40,60 theta_step=10 phi_step=15", ["brdf"])
    noise = np.deg2rad(np.random.default_rng(6).normal(0.0, 0.02, exact.n_directions))
    m = replace(exact, theta_i=np.abs(exact.theta_i + noise))
    assert is_scattered(m, m.distinct_incidences(), isotropic=True)
    bands = pool(m, 5.0)
    middles = np.rad2deg([theta for theta, _ in bands.groups])
    np.testing.assert_allclose(middles, [0.0, 20.0, 40.0, 60.0], atol=1e-9)
    sizes = [len(rows) for rows in exact.distinct_incidences().values()]
    parts = [len(rows) for rows in bands.groups.values()]
    assert sum(parts) == sum(sizes) == m.n_directions
    assert parts[1:] == sizes[-3:]
    assert list(bands.edges.values())[:2] == [(0.0, 2.5), (17.5, 22.5)]


@pytest.mark.parametrize("shift", [0.0, 2.5])
def test_bands_end_at_the_horizon(shift: float) -> None:
    theta = np.deg2rad(np.append(np.arange(2.5 - shift, 90.0, 5.0), 90.0 - 1e-10))
    m = Measurement(
        theta, theta * 0, theta, theta * 0, np.ones((1, theta.size)), channels=("brdf",)
    )
    bands = pool(m, 5.0)
    assert all(theta < np.deg2rad(89.0) for theta, _ in bands.groups)
    assert sorted(np.concatenate(list(bands.groups.values()))) == list(range(theta.size))


def test_a_scattered_moving_lamp_has_a_panel_per_view() -> None:
    generator = np.random.default_rng(7)
    theta_i, phi_i = generator.uniform([[0.1], [0.0]], [[1.4], [6.2]], (2, 900))
    theta_o = np.repeat(np.deg2rad([10.0, 30.0, 50.0]), 300)
    values = evaluate("ggx", GLOSSY, theta_i, phi_i, theta_o, 0.0)
    m = Measurement(theta_i, phi_i, theta_o, theta_o * 0, values, channels=("brdf",))
    panels = choose_panels(m, isotropic=True)
    assert panels.by_view
    assert panels.width is None
    assert [round(p.theta) for p in panels.chosen] == [10, 30, 50]
    figure = draw_figure(hand_made_report(m, hand_made_result(m, "ggx", GLOSSY)))
    assert any("theta_i" in ax.get_xlabel() for ax in figure.axes)


def test_lobes_of_a_merl_table_are_tiles_of_bands(merl: Measurement) -> None:
    grid = make_grid(merl)
    assert grid.layout == "tiles"
    assert grid.width == 5.0
    assert grid.n_incidences == 18
    np.testing.assert_allclose(np.rad2deg(grid.incidences)[:, 0], np.arange(2.5, 90.0, 5.0))
    np.testing.assert_allclose(grid.theta, np.arange(2.5, 90.0, 5.0))
    np.testing.assert_allclose(grid.phi, np.arange(0.0, 360.0, 5.0))
    # Every reading is shown, in the cell that its own angles fall into.
    assert sorted(grid.rows) == list(range(merl.n_directions))
    row, column = np.divmod(grid.cell, len(grid.theta))
    tile, azimuth = np.divmod(row, len(grid.phi))
    degrees = np.rad2deg([merl.theta_i, merl.theta_o, merl.phi_o])[:, grid.rows]
    middles = np.rad2deg(grid.incidences)[:, 0]
    assert np.abs(degrees[0] - middles[tile]).max() <= 2.5 + 1e-9
    assert np.abs(degrees[1] - grid.theta[column]).max() <= 2.5 + 1e-9
    apart = np.mod(degrees[2] - grid.phi[azimuth] + 180.0, 360.0) - 180.0
    assert np.abs(apart).max() <= 2.5 + 1e-9
    # Readings lie on one side of the plane only; of that half every fifth cell has some.
    assert len(np.unique(grid.cell)) > grid.shape[0] * grid.shape[1] / 10
    turned = make_grid(table(spread=6.0), isotropic=True)
    assert turned.n_incidences == 18


def test_lobes_of_many_channels_stay_small(merl: Measurement) -> None:
    values = np.broadcast_to(merl.values, (300, merl.n_directions))
    m = replace(merl, values=values, channels=tuple(f"{k}nm" for k in range(400, 700)))
    grid = make_grid(m)
    assert grid.shape[0] * grid.shape[1] * 3 * 300 <= 6_000_000
    assert grid.n_incidences == 18
