"""fit.png: the data are in it, for every kind of measurement."""

from __future__ import annotations

import subprocess
import sys
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from lobefit.fitting.figure import channel_colours, draw_figure, write_figure
from lobefit.fitting.panels import choose_panels
from lobefit.fitting.simulate import simulate
from tests.fitting.reports import (
    GLOSSY,
    SCANS,
    hand_made_report,
    hand_made_result,
    simulated,
)

BANDS = [f"{400 + 10 * k}nm" for k in range(31)]


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
            drawn = np.asarray(line.get_ydata())
            assert np.isin(drawn, m.values).all()
            assert drawn.size >= 8
    texts = " ".join(t.get_text() for sub in figure.subfigs for t in sub.texts)
    assert "ggx: GGX" in texts
    assert "alpha\u00a0=\u00a00.1000\u00a0±\u00a00.0010" in texts
    assert ("5 of 31 channels shown" in texts) == (len(channels) == 31)


def test_figure_is_deterministic(tmp_path: Path) -> None:
    m = simulated("in-plane", ["R", "G", "B"])
    report = hand_made_report(m, hand_made_result(m, "ggx", GLOSSY))
    for name in ("a.png", "b.png"):
        write_figure(tmp_path / name, report)
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()


def test_figure_leaves_pyplot_alone() -> None:
    program = (
        "import sys; from tests.fitting.test_figure import *; m = simulated('in-plane', ['R']);"
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


def test_figure_without_a_view_near_the_plane(tmp_path: Path) -> None:
    """Each incidence has views, none within 10 degrees of its plane; the lobe is drawn there."""
    scan = simulated("hemisphere incidences=20,50 theta_step=10 phi_step=90", ["brdf"])
    m = replace(scan, phi_i=scan.phi_i + np.deg2rad(45.0))
    m = m.select(m.theta_o > 0.01)
    panels = choose_panels(m)
    assert panels.width is None
    for panel in panels.chosen:
        assert panel.rows.size == 0
        assert all(np.isfinite(axis).all() for axis in panel.line)
        assert np.rad2deg(panel.line[3] - panel.line[1]) % 180 == pytest.approx(0.0, abs=1e-9)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
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
