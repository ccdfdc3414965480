"""Scan patterns: which directions they visit, and their text form."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lobefit.fitting.scan_patterns import Hemisphere, InPlane, Pattern, pattern
from lobefit.kernels import MeasurementError

incidences = st.lists(st.integers(0, 89), min_size=1, max_size=4, unique=True)
azimuths = st.lists(st.integers(0, 179), min_size=1, max_size=3, unique=True)
shared = {
    "incidences_deg": incidences,
    "azimuths_deg": azimuths,
    "max_deg": st.floats(5, 89),
    "blind_deg": st.floats(0, 4),
}
patterns = st.one_of(
    st.builds(InPlane, **shared, step_deg=st.floats(2, 20)),
    st.builds(
        Hemisphere, **shared, theta_step_deg=st.floats(10, 20), phi_step_deg=st.floats(20, 90)
    ),
)


def degrees(scan: Pattern) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    return np.rad2deg(np.stack(scan.angles()))


def test_in_plane_runs_through_the_plane_of_incidence_on_both_sides() -> None:
    theta_i, phi_i, theta_o, phi_o = degrees(InPlane(incidences_deg=(30,), step_deg=10))
    assert np.allclose(theta_i, 30, rtol=1e-14)  # a degree and back is one rounding
    assert not phi_i.any()
    signed = np.where(phi_o == 180, theta_o, -theta_o)
    assert np.allclose(signed, np.arange(-80, 81, 10), rtol=1e-14)
    assert set(phi_o) == {0.0, 180.0}


def test_in_plane_turns_with_the_sample() -> None:
    scan = InPlane(incidences_deg=(30, 60), azimuths_deg=(0, 30, 200), step_deg=20)
    theta_i, phi_i, theta_o, phi_o = degrees(scan)
    assert theta_i.size == 2 * 3 * 9
    across = np.mod(phi_o - phi_i, 360)[theta_o > 0]
    assert np.allclose(np.minimum(np.abs(across), np.abs(across - 180)), 0, atol=1e-11)
    assert np.allclose(np.unique(phi_i.round(9)), (0, 30, 200))


def test_hemisphere_is_a_full_grid() -> None:
    scan = Hemisphere(
        incidences_deg=(20, 60),
        azimuths_deg=(0, 90),
        theta_step_deg=20,
        phi_step_deg=30,
        max_deg=60,
    )
    theta_i, phi_i, theta_o, phi_o = degrees(scan)
    # The pole once and 3 rings of 12, for 2 x 2 incidences.
    assert theta_i.size == 4 * (1 + 3 * 12)
    here = (theta_i.round(6) == 60) & (phi_i.round(6) == 90) & (theta_o.round(6) == 40)
    assert sorted(phi_o[here].round(6)) == list(range(0, 360, 30))


def test_normal_incidence_is_seen_from_everywhere_but_never_twice() -> None:
    """At the pole all azimuths of incidence are one; the views of each are not."""
    scan = InPlane(incidences_deg=(0,), azimuths_deg=(0, 90), step_deg=40)
    theta_i, phi_i, theta_o, phi_o = degrees(scan)
    assert not theta_i.any() and not phi_i.any()
    assert sorted(zip(theta_o.round(6), phi_o.round(6), strict=True)) == [
        (0, 0),
        *((t, p) for t in (40, 80) for p in (0, 90, 180, 270)),
    ]


@pytest.mark.parametrize(("last", "step"), [(80, 0.1), (66, 1.1), (55, 2.2), (89.6, 1.6)])
def test_the_largest_angle_is_reached_although_steps_round(last: float, step: float) -> None:
    """66/1.1 is 59.99999999999999 in floating point."""
    seen = degrees(InPlane(incidences_deg=(10,), step_deg=step, max_deg=last))[2]
    assert float(seen.max()) == pytest.approx(last, abs=1e-9)


def test_a_step_that_does_not_divide_the_range_ends_below_it() -> None:
    seen = degrees(InPlane(incidences_deg=(10,), step_deg=30))[2]
    assert float(seen.max()) == pytest.approx(60, abs=1e-9)


def test_views_behind_the_detector_are_left_out() -> None:
    whole = InPlane(incidences_deg=(30,), step_deg=2)
    theta_i, _, theta_o, phi_o = degrees(InPlane(incidences_deg=(30,), step_deg=2, blind_deg=4))
    signed = np.where(phi_o == 180, theta_o, -theta_o)
    kept = [angle for angle in range(-80, 81, 2) if abs(angle + 30) >= 4]
    assert np.allclose(np.sort(signed), kept)
    assert degrees(whole)[0].size - theta_i.size == 3  # 28, 30 and 32 degrees


@given(patterns)
@settings(max_examples=60, deadline=None, derandomize=True, database=None)
def test_every_pattern_is_a_set_of_directions_above_the_surface(scan: Pattern) -> None:
    theta_i, phi_i, theta_o, phi_o = scan.angles()
    for theta, phi in ((theta_i, phi_i), (theta_o, phi_o)):
        assert np.all((theta >= 0) & (theta < np.pi / 2))
        assert np.all((phi >= 0) & (phi < 2 * np.pi))
        assert not phi[theta == 0].any()
    assert theta_o.max(initial=0) <= np.deg2rad(scan.max_deg) + 1e-12
    keys = np.round(np.stack([theta_i, phi_i, theta_o, phi_o]), 9)
    assert np.unique(keys, axis=1).shape == keys.shape


@given(patterns)
@settings(max_examples=60, deadline=None, derandomize=True, database=None)
def test_text_and_pattern_are_one(scan: Pattern) -> None:
    again = pattern(str(scan))
    assert type(again) is type(scan)
    assert str(again) == str(scan)
    assert pattern(str(again)) == again


def test_text_may_leave_everything_out() -> None:
    assert pattern("in-plane") == InPlane()
    assert pattern("hemisphere") == Hemisphere()
    assert pattern("in-plane  step=5 incidences=10,20") == InPlane(
        incidences_deg=(10, 20), step_deg=5
    )


def test_turned_changes_the_azimuths_only() -> None:
    scan = InPlane(step_deg=7)
    assert scan.turned() == InPlane(step_deg=7, azimuths_deg=(0, 45, 90, 135))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "'' is no scan pattern"),
        ("inplane", "'inplane' is no scan pattern; did you mean 'in-plane'?"),
        ("in-plane steps=2", "in-plane has no parameter 'steps'"),
        ("in-plane theta_step=2", "in-plane has no parameter 'theta_step'"),
        ("in-plane step=two", "step is not a number: 'two'"),
        ("in-plane step", "step is not a number: ''"),
        ("in-plane step=1,2", "step is one number"),
        ("in-plane step=0", "step_deg is 0.0"),
        ("in-plane step=-2", "step_deg is -2.0"),
        ("in-plane step=nan", "step_deg is nan"),
        ("in-plane step=1e-7", "expected at most 10,000,000 directions"),
        ("in-plane max=90", "max_deg is 90.0"),
        ("in-plane blind=-1", "blind_deg is -1.0"),
        ("in-plane incidences=30,95", "expected angles from 0 to below 90"),
        ("in-plane incidences=-30", "expected angles from 0 to below 90"),
        ("in-plane incidences=nan", "incidences_deg is (nan,)"),
        ("in-plane azimuths=inf", "azimuths_deg is (inf,)"),
        ("hemisphere phi_step=0", "phi_step_deg is 0.0"),
        ("hemisphere theta_step=1e-4 phi_step=1e-4", "expected at most 10,000,000 directions"),
    ],
)
def test_what_is_no_scan_is_refused_with_a_reason(text: str, message: str) -> None:
    with pytest.raises(MeasurementError) as caught:
        pattern(text)
    assert message in str(caught.value)
