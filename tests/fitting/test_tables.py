"""Tables that people read: what stands in them, and that nothing in them misleads."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from lobefit.fitting.measurement import Measurement
from lobefit.fitting.simulate import simulate
from lobefit.fitting.tables import cautions, flags, parameters, ranking, with_error
from tests.fitting.reports import Params, hand_made_report, hand_made_result


def copper() -> Measurement:
    params: Params = {"k_d": 0.0, "F0": [0.95, 0.64, 0.54]}
    return simulate("ggx:k_s=1", params, "in-plane incidences=30")


def plastic() -> Measurement:
    return simulate("ggx", {"k_d": 0.2}, "in-plane incidences=30")


def test_ranking() -> None:
    best = hand_made_result(copper(), "ggx:k_s=1", {"k_d": 0.1, "F0": [0.9, 0.6, 0.5]}, bic=-1000.0)
    second = hand_made_result(copper(), "ggx", {"k_d": 0.0, "F0": 0.5}, bic=-1004.25)
    report = hand_made_report(copper(), best, second)

    lines = ranking(report).splitlines()

    assert [" ".join(line.split()) for line in lines] == [
        "candidate parameters BIC diff rmse [1/sr] log10 rms max albedo flags",
        "1 ggx:k_s=1 7 4.2 0.0123 0.021 0.910",
        "2 ggx 10 0.0 0.0123 0.021 0.910 k_d at lower bound",
        "not fitted: ward: the sample was not turned",
    ]
    # Columns line up: every cell ends (or the last begins) where its heading does.
    assert lines[0].index("BIC diff") + len("BIC diff") == lines[1].index("4.2") + len("4.2")
    assert lines[0].index("flags") == lines[2].index("k_d at lower bound")
    assert report.table() == ranking(report)


def test_ranking_without_likelihood() -> None:
    best = hand_made_result(plastic(), "ggx", {}, bic=None)
    blind = replace(best, diagnostics=replace(best.diagnostics, log10_rms=None))

    row = ranking(hand_made_report(plastic(), blind)).splitlines()[1]

    assert row.split() == ["1", "ggx", "4", "-", "0.0123", "-", "0.910"]


def test_flags_and_cautions_name_every_trouble() -> None:
    good = hand_made_result(copper(), "ggx", {"k_d": 0.3, "k_s": 0.5, "F0": 0.2})
    assert flags(good) == []
    assert cautions(good) == []

    alpha = next(e for e in good.estimates if e.name == "alpha")
    f0 = next(e for e in good.estimates if e.name == "F0" and e.channel == "G")
    bad = replace(
        good,
        estimates=(replace(alpha, status="upper"), replace(f0, status="undetermined")),
        diagnostics=replace(
            good.diagnostics, misfit_limited=True, misfit_reason="residuals follow each other"
        ),
        plausibility=replace(
            good.plausibility,
            albedo_max=(0.9, 1.234, 1.1),
            albedo_max_theta_i=(0.0, np.deg2rad(85.0), 0.0),
            conserves_energy=False,
            reciprocal=False,
            reciprocity_error=0.25,
        ),
        stop=replace(good.stop, converged=False, reason="out of evaluations"),
    )

    assert flags(bad) == [
        "misfit-limited",
        "albedo > 1",
        "not reciprocal",
        "alpha at upper bound",
        "F0 undetermined",
        "not converged",
    ]
    said = cautions(bad)
    for text in (
        "albedo 1.234 above 1 in G at theta_i 85 deg",
        "differ by up to 25 %",
        "alpha = 0.2 lies on its upper bound",
        "F0[G] is not determined",
        "did not converge: out of evaluations",
    ):
        assert any(text in line for line in said), text
    assert len(said) == 5


def test_many_channels_on_a_bound_are_one_caution() -> None:
    names = [f"{400 + 10 * k}nm" for k in range(31)]
    m = simulate("lambert", {"k_d": 0.2}, "in-plane incidences=30 step=20", channels=names)
    assert cautions(hand_made_result(m, "lambert", {"k_d": 0.0})) == ["k_d at lower bound"]


@pytest.mark.parametrize(
    ("value", "error", "text"),
    [
        (0.21304, 0.00213, "0.2130 ± 0.0021"),
        (0.3, 0.0996, "0.30 ± 0.10"),  # the error rounds up a digit
        (1234.5, 67.8, "1234 ± 68"),
        (98765.0, 1234.0, "98765 ± 1234"),
        (-0.00042, 0.0021, "-0.0004 ± 0.0021"),
        (0.0, 0.002, "0.0000 ± 0.0020"),
        (1.2345678e-9, 2.1e-11, "1.235e-09 ± 2.1e-11"),
        (0.5, None, "0.5"),
        (0.123456789, float("nan"), "0.123457"),
        (7.0, 0.0, "7"),
        (0.1, float("inf"), "0.1"),
    ],
)
def test_with_error(value: float, error: float | None, text: str) -> None:
    assert with_error(value, error) == text


def test_parameters_of_one_channel_are_a_list() -> None:
    lines = parameters(hand_made_result(plastic(), "ggx:k_s=1", {"k_d": 0.2})).splitlines()
    assert [line.split()[0] for line in lines] == ["k_d", "k_s", "F0", "alpha"]
    assert " ".join(lines[0].split()) == "k_d 0.2000 ± 0.0020 albedo of the diffuse term"
    assert "1 (held)" in lines[1]


def test_parameters_of_channels_are_a_table() -> None:
    result = hand_made_result(copper(), "ggx", {"k_d": [0.0, 0.1, 0.2], "k_s": 0.5, "F0": 0.2})
    lines = parameters(result).splitlines()
    assert lines[0].startswith("alpha")
    assert lines[1].split() == ["channel", "k_d", "k_s", "F0"]
    assert [line.split()[0] for line in lines[2:]] == ["R", "G", "B"]
    assert "(lower bound)" in lines[2]
    assert "0.1000 ± 0.0010" in lines[3]
