"""Each check of the data, with the fault put in and without it."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from lobefit.fitting import DataChecks, Measurement, check, fit, read_measurement, simulate
from lobefit.fitting.checks.azimuths import check_anisotropy
from lobefit.fitting.checks.duplicates import check_duplicates
from lobefit.fitting.checks.grazing import check_grazing
from lobefit.fitting.checks.mirror import check_mirror
from lobefit.fitting.checks.negative import check_negative
from lobefit.fitting.checks.peak import check_peak
from lobefit.fitting.checks.pi_factor import check_pi_factor
from lobefit.fitting.checks.retro import check_retro
from lobefit.fitting.checks.saturation import check_saturation
from lobefit.fitting.checks.surface import Surface
from lobefit.fitting.checks.units import check_units
from lobefit.fitting.checks.view import View
from lobefit.fitting.document import to_json
from lobefit.fitting.plausibility import model_checks
from lobefit.kernels.errors import MeasurementError
from tests.fitting.check_cases import GLOSSY, HEMISPHERE, IN_PLANE, ROUGH, glossy, rough, times
from tests.fitting.reports import strict

COARSE = "in-plane incidences=0,35,65 step=5 max=60"


def lambert(k_d: float, factor: float = 1.0) -> tuple[View, Surface]:
    m = simulate("lambert", {"k_d": k_d}, IN_PLANE, noise=(0.01, 0.0), seed=1)
    surface = Surface("lambert", "lambert", {"k_d": k_d * factor}, {}, m.channels)
    return View(m), surface


def verdict(m: Measurement, one: Any) -> str:
    found = one(View(m)).verdict
    assert isinstance(found, str)
    return found


# -- a factor pi ----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("k_d", "factor", "expected"),
    [
        (0.8, 1.0, "cannot tell"),
        (0.8, np.pi, "suspicious"),
        (0.1, np.pi, "cannot tell"),  # a dark sample hides it
        (0.5, 100.0, "suspicious"),
    ],
)
def test_a_factor_pi_shows_where_the_albedo_exceeds_1(
    k_d: float, factor: float, expected: str
) -> None:
    m = simulate("lambert", {"k_d": k_d}, IN_PLANE, noise=(0.01, 0.0), seed=1)
    found = check(times(m, factor))["pi factor"]
    assert found.verdict == expected
    # 1 %: the noise of some hundred values and the other candidates' own shape.
    assert found.figures["albedo"] == pytest.approx(k_d * factor, rel=0.02)
    if factor == 100.0:
        assert "percent" in found.remedy
    elif expected == "suspicious":
        assert "radiance factor" in found.remedy


def test_a_white_standard_is_not_flagged() -> None:
    for k_d in (0.99, 1.0):
        assert check_pi_factor(*lambert(k_d)).verdict == "cannot tell"
    assert check_pi_factor(*lambert(1.0, 1.05)).verdict == "suspicious"
    assert check_pi_factor(lambert(0.5)[0], None).verdict == "cannot tell"


# -- units ----------------------------------------------------------------------------------


def test_units() -> None:
    m = glossy()
    assert verdict(m, check_units) == "ok"
    angles = {n: getattr(m, n) for n in ("theta_i", "phi_i", "theta_o", "phi_o")}
    twice = replace(m, **{n: np.deg2rad(a) for n, a in angles.items()})
    assert verdict(twice, check_units) == "suspicious"
    declared = replace(twice, metadata={"small_angles": "yes"})
    assert verdict(declared, check_units) == "ok"
    azimuths = replace(m, phi_o=np.deg2rad(m.phi_o))
    assert verdict(azimuths, check_units) == "suspicious"
    degrees = replace(m, phi_o=np.rad2deg(m.phi_o))
    assert verdict(degrees, check_units) == "suspicious"
    narrow = replace(m, phi_o=np.deg2rad(np.where(m.phi_o > 1.0, 3.0, 0.0)))
    assert verdict(narrow, check_units) == "cannot tell"


def test_what_the_reader_lets_pass_is_flagged(tmp_path: Any) -> None:
    """Azimuths in radians beside polar angles in degrees are valid numbers."""
    rows = [
        f"{i},0,{abs(o)},{np.pi if o > 0 else 0.0},{0.1 + 0.01 * abs(o)}"
        for i in (20, 40, 60)
        for o in range(-70, 75, 5)
    ]
    path = tmp_path / "mixed.csv"
    path.write_text("theta_i,phi_i,theta_o,phi_o,brdf\n" + "\n".join(rows) + "\n")
    assert verdict(read_measurement(path), check_units) == "suspicious"


# -- the mirror direction -------------------------------------------------------------------


@pytest.mark.parametrize("surface", [glossy, rough])
@pytest.mark.parametrize("geometry", [IN_PLANE, HEMISPHERE])
def test_the_mirror_convention(surface: Any, geometry: str) -> None:
    m = surface(geometry)
    assert verdict(m, check_mirror) == "ok"
    assert verdict(replace(m, phi_o=m.phi_o + np.pi), check_mirror) == "suspicious"


def test_the_mirror_convention_of_a_scan_of_one_side() -> None:
    m = glossy()
    m = m.select(np.cos(m.phi_o - m.phi_i) < 0)
    assert verdict(m, check_mirror) == "ok"
    assert verdict(replace(m, phi_o=m.phi_i), check_mirror) == "suspicious"


def test_a_matte_surface_has_no_mirror_side() -> None:
    m = simulate("lambert", {"k_d": 0.5}, IN_PLANE, seed=1)
    assert verdict(m, check_mirror) == "cannot tell"
    assert verdict(m, check_peak) == "cannot tell"


@pytest.mark.parametrize("shift_deg", [-2.0, 2.0])
def test_a_shifted_peak(shift_deg: float) -> None:
    fine = simulate("ggx", GLOSSY | {"alpha": 0.05}, "in-plane step=1", noise=(0.02, 1e-4), seed=3)
    found = check_peak(View(fine))
    assert found.verdict == "ok"
    assert abs(float(found.figures["shift_deg"] or 0.0)) < 0.2
    sign = np.where(np.cos(fine.phi_o - fine.phi_i) < 0, 1.0, -1.0)
    signed = sign * fine.theta_o + np.deg2rad(shift_deg)
    turn = np.where(signed > 0, np.pi, 0.0)
    moved = replace(fine, theta_o=np.abs(signed), phi_o=fine.phi_i + turn)
    found = check_peak(View(moved))
    assert found.verdict == "suspicious"
    assert found.figures["shift_deg"] == pytest.approx(shift_deg, abs=0.3)


@pytest.mark.parametrize(
    ("alpha", "step", "shift_deg", "expected"),
    [
        (0.05, 2, -1.0, "suspicious"),  # half a step, of which seven are across the peak
        (0.1, 1, 1.0, "suspicious"),
        (0.1, 2, -1.0, "suspicious"),
        (0.1, 2, 0.0, "ok"),
        (0.16, 1, 3.0, "suspicious"),
        (0.16, 2, 1.0, "cannot tell"),  # a lobe so wide may shift by itself
        (0.16, 2, 0.0, "ok"),
    ],
)
def test_a_wide_peak(alpha: float, step: int, shift_deg: float, expected: str) -> None:
    scan = f"in-plane incidences=10,20,30,40,50,60,70 step={step}"
    m = simulate("ggx", GLOSSY | {"alpha": alpha}, scan, noise=(0.02, 1e-4), seed=3)
    sign = np.where(np.cos(m.phi_o - m.phi_i) < 0, 1.0, -1.0)
    signed = sign * m.theta_o + np.deg2rad(shift_deg)
    turn = np.where(signed > 0, np.pi, 0.0)
    found = check_peak(View(replace(m, theta_o=np.abs(signed), phi_o=m.phi_i + turn)))
    assert found.verdict == expected
    assert found.figures["shift_deg"] == pytest.approx(shift_deg, abs=0.3)
    assert bool(found.remedy) == (expected != "ok")


# -- values ---------------------------------------------------------------------------------


def test_negative_values() -> None:
    dark = simulate("ggx", GLOSSY | {"k_d": 0.0, "F0": 0.04}, IN_PLANE, noise=(0.02, 2e-3), seed=1)
    assert dark.negative_share > 0.05  # noise about zero, as a dark surface has
    assert verdict(glossy(), check_negative) == "ok"
    assert verdict(replace(dark, values=dark.values + 1e-3), check_negative) == "ok"
    m = glossy()
    dark_level = 1.2 * float(np.median(m.values))
    assert verdict(replace(m, values=m.values - dark_level), check_negative) == "suspicious"
    noise = replace(m, values=np.where(np.arange(m.n_directions) % 5 < 2, -m.values, m.values))
    assert verdict(noise, check_negative) == "suspicious"


def test_saturation() -> None:
    m = glossy()
    assert verdict(m, check_saturation) == "ok"
    assert verdict(times(rough(), 1.0), check_saturation) == "ok"
    top = float(m.values.max())
    clipped = replace(m, values=np.minimum(m.values, 0.5 * top))
    assert verdict(clipped, check_saturation) == "suspicious"
    # A detector's limit is one of radiance over the irradiance of each incidence.
    radiance = m.values * np.cos(m.theta_i)
    limit = 0.3 * float(radiance.max())
    limited = replace(m, values=np.minimum(radiance, limit) / np.cos(m.theta_i))
    assert verdict(limited, check_saturation) == "suspicious"


@pytest.mark.parametrize("model", ["lambert", "ggx"])
@pytest.mark.parametrize("geometry", [IN_PLANE, HEMISPHERE])
def test_values_without_noise_and_rounded_values_are_not_saturated(
    model: str, geometry: str
) -> None:
    truth = {"k_d": 0.3} if model == "lambert" else ROUGH
    m = simulate(model, truth, geometry, noise=(0.0, 0.0))
    assert verdict(m, check_saturation) == "ok"
    assert verdict(replace(m, values=np.round(m.values, 3)), check_saturation) == "ok"


def test_repeated_directions(tmp_path: Any) -> None:
    m = glossy()
    assert verdict(m, check_duplicates) == "cannot tell"
    twice = np.concatenate([np.arange(m.n_directions), np.arange(40)])
    again = m.select(twice)
    values = again.values.copy()
    values[:, m.n_directions :] *= 1.03
    assert verdict(replace(again, values=values), check_duplicates) == "ok"
    values[:, -1] *= 2.0
    assert verdict(replace(again, values=values), check_duplicates) == "suspicious"
    # From a file, where the reader averages them, its note tells.
    for factor, expected in ((1.02, "ok"), (3.0, "suspicious")):
        rows = [f"30,0,{t},180,{0.1 + 0.001 * t}" for t in range(0, 60, 5)]
        rows.append(f"30,0,20,180,{0.12 * factor}")
        path = tmp_path / "twice.csv"
        path.write_text("theta_i,phi_i,theta_o,phi_o,brdf\n" + "\n".join(rows) + "\n")
        found = check_duplicates(View(read_measurement(path)))
        assert (found.verdict, found.figures["repeated"]) == (expected, 1)


# -- geometry -------------------------------------------------------------------------------


def test_anisotropy() -> None:
    turned = "in-plane incidences=20,45 azimuths=0,45,90 step=4"
    assert verdict(glossy(), check_anisotropy) == "cannot tell"
    found = check_anisotropy(View(glossy(turned)))
    assert found.verdict == "ok" and "is isotropic" in found.sentence
    truth = {"k_d": 0.05, "F0": 0.5, "alpha_x": 0.1, "alpha_y": 0.4}
    brushed = simulate("ggx_anisotropic", truth, turned, noise=(0.02, 1e-4), seed=1)
    found = check_anisotropy(View(brushed))
    assert found.verdict == "ok" and "anisotropic" in found.sentence


def test_left_and_right_of_an_untilted_isotropic_sample_are_equal() -> None:
    assert verdict(rough(HEMISPHERE), check_anisotropy) == "cannot tell"
    truth = {"k_d": 0.05, "F0": 0.5, "alpha_x": 0.15, "alpha_y": 0.5, "phi_x": 0.6}
    grain = simulate(
        "ggx_anisotropic", truth, HEMISPHERE + " azimuths=0", noise=(0.02, 1e-4), seed=1
    )
    assert verdict(grain, check_anisotropy) == "suspicious"


def test_the_direction_of_the_light() -> None:
    m = rough()
    assert verdict(m, check_retro) == "ok"
    near = View(m).to_source < np.deg2rad(7.0)
    assert verdict(m.select(~near), check_retro) == "cannot tell"
    one_side = m.select(np.cos(m.phi_o - m.phi_i) < 0)
    assert verdict(one_side, check_retro) == "cannot tell"
    shade = np.where(View(m).to_source < np.deg2rad(3.0), 0.2, 1.0)
    assert verdict(times(m, shade), check_retro) == "suspicious"


def test_grazing_angles() -> None:
    wide = rough("in-plane incidences=10,30,50,70 step=1 max=89")
    assert verdict(rough(), check_grazing) == "ok"
    assert verdict(wide, check_grazing) == "ok"
    floor = np.where(wide.theta_o > np.deg2rad(84.5), 1e-4, wide.values)
    found = check_grazing(View(replace(wide, values=floor)))
    assert found.verdict == "suspicious" and "equal" in found.sentence
    noise = np.random.default_rng(1).normal(size=wide.n_directions)
    rattle = np.exp(np.where(wide.theta_o > np.deg2rad(80.0), 0.3, 0.0) * noise)
    found = check_grazing(View(times(wide, rattle)))
    assert found.verdict == "suspicious" and "rough" in found.sentence


# -- all of them ----------------------------------------------------------------------------


NAMES = [
    "degrees or radians",
    "mirror convention",
    "reciprocity",
    "cosine factor",
    "pi factor",
    "peak position",
    "negative values",
    "saturation",
    "repeated directions",
    "anisotropy",
    "retro gap",
    "grazing angles",
]


def complete(found: DataChecks) -> None:
    assert [c.name for c in found] == NAMES
    assert [c["name"] for c in strict(to_json(found.to_dict()))["checks"]] == NAMES
    for c in found:
        assert c.verdict in ("ok", "suspicious", "cannot tell")
        assert c.sentence.endswith(".") and len(c.sentence) > 20
        assert c.remedy or c.verdict != "suspicious"
        assert found[c.name] is c
        assert c.sentence in found.table()


def test_a_clean_measurement_has_no_finding() -> None:
    for m in (glossy(), rough(HEMISPHERE), rough("in-plane")):
        found = check(m)
        complete(found)
        assert found.suspicious == ()


def test_with_a_result_nothing_is_fitted(monkeypatch: pytest.MonkeyPatch) -> None:
    m = rough(COARSE)
    best = fit(m, models="ggx").best
    monkeypatch.setattr("lobefit.fitting.checks.run.fitted_surface", lambda *_: pytest.fail("fit"))
    found = check(m, best)
    complete(found)
    assert found["pi factor"].figures["model"] == "ggx"


def test_little_and_strange_data_give_verdicts_not_errors() -> None:
    m = rough()
    for rows in (slice(0, 1), slice(0, 5), slice(0, 12)):
        complete(check(m.select(rows)))
    nothing = np.zeros_like(m.values)
    complete(check(replace(m, values=nothing)))
    complete(check(replace(m, values=nothing - 1.0)))
    gaps = np.where(np.arange(m.n_directions) % 3 == 0, np.nan, m.values)
    complete(check(replace(m, values=gaps)))
    with pytest.raises(MeasurementError, match="takes a Measurement"):
        check("file.csv")  # type: ignore[arg-type]
    with pytest.raises(KeyError):
        check(m.select(slice(0, 5)))["nothing"]


def test_channels_are_named() -> None:
    truth = ROUGH | {"k_d": [0.3, 0.2, 0.1]}
    m = simulate("ggx", truth, IN_PLANE, noise=(0.02, 1e-4), seed=1)
    assert check(m).suspicious == ()
    values = m.values.copy()
    values[1] = np.minimum(values[1], 0.5 * values[1].max())
    values[2] -= np.quantile(values[2], 0.2)
    found = check(replace(m, values=values))
    assert "of G" in found["saturation"].sentence
    assert found["negative values"].figures["channel"] == "B"


def test_a_fitted_models_energy_is_judged_by_channel() -> None:
    m = simulate("lambert", {"k_d": [0.3, 0.9]}, COARSE, noise=(0.01, 0.0), seed=1)
    for factor, expected in ((1.0, "ok"), (np.pi, "suspicious")):
        found = model_checks(fit(times(m, factor), models="lambert").best)
        assert found["energy"].verdict == expected
        assert found["model reciprocity"].verdict == "ok"
        assert found["energy"].figures["channels_above_1"] == (1 if factor > 1 else 0)
    assert "c2" in found["energy"].sentence and "pi" in found["energy"].remedy
