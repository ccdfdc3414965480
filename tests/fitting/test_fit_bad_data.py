"""What a fit does with measurements that it should not, or hardly, trust."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from lobefit.fitting import fit, simulate
from lobefit.kernels import MeasurementError

GLOSSY = {"k_d": 0.2, "k_s": 0.6, "F0": 0.3, "alpha": 0.15}
SCAN = "in-plane incidences=10,30,50,70 step=2"
PEAK = "ggx:k_s=1"
SHINY = {"k_d": 0.2, "F0": 0.3, "alpha": 0.15}


def test_a_black_channel_is_refused_by_name() -> None:
    """As the reader refuses it in a file."""
    m = simulate("ggx", {**GLOSSY, "k_d": [0.2, 0.3]}, SCAN, (0.02, 1e-3), seed=9)
    values = m.values.copy()
    values[1] = 0.0
    with pytest.raises(MeasurementError, match="no value above zero") as caught:
        fit(replace(m, values=values), ["ggx"])
    assert caught.value.column == m.channels[1]


def test_a_path_is_not_a_measurement() -> None:
    with pytest.raises(MeasurementError, match="read a file with read_measurement first"):
        fit("samples/glossy_plastic.csv")  # type: ignore[arg-type]


@pytest.mark.parametrize("factor", [1e4, 1e6])
def test_one_wrong_reading_is_named(factor: float) -> None:
    m = simulate("ggx", GLOSSY, SCAN, (0.02, 1e-3), seed=1)
    values = m.values.copy()
    row = int(np.argmin(np.abs(m.theta_o - 1.0)))
    values[0, row] *= factor
    found = fit(replace(m, values=values), ["ggx"])
    assert found.best.diagnostics.outliers.count == 1
    assert (
        f"theta_o {np.degrees(m.theta_o[row]):.4g}°" in found.best.diagnostics.outliers.examples[0]
    )
    assert "1 value lies far outside the scatter of the others" in found.verdict


def test_an_undone_reweighing_leaves_errors_of_the_weights_in_force() -> None:
    """Whenever the noise is estimated the objective is about the degrees of freedom."""
    m = simulate("ggx", {**GLOSSY, "alpha": 0.02}, SCAN, (0.02, 1e-3), seed=3)
    for result in fit(m).results:
        dof = result.diagnostics.samples - result.n_parameters
        # Gross misfits are weighed by capped levels, and rounds end before the last digit.
        assert 0.5 < result.objective / dof < 2.0, result.candidate


@pytest.mark.parametrize(
    ("model", "params", "views", "repeats", "said"),
    [
        ("lambert", {"k_d": 0.3}, 5, 1, "5 directions leave 4 degrees of freedom, "),
        (PEAK, SHINY, 5, 1, "5 directions leave 2 degrees of freedom, "),
        # As many readings again, in other colours or of the same directions, test no other shape.
        (
            PEAK,
            {**SHINY, "k_d": [0.2, 0.3, 0.4]},
            5,
            1,
            "5 directions leave 2.7 degrees of freedom in each channel, ",
        ),
        ("lambert", {"k_d": 0.3}, 5, 5, "5 directions leave 4 degrees of freedom, "),
        ("lambert", {"k_d": 0.3}, 20, 1, ""),
        (PEAK, {**SHINY, "k_d": [0.2, 0.3, 0.4]}, 20, 1, ""),
    ],
)
def test_a_verdict_says_how_little_it_was_tested_on(
    model: str, params: dict[str, float | list[float]], views: int, repeats: int, said: str
) -> None:
    theta_o = np.repeat(np.linspace(0.0, 1.2, views), repeats)
    rows = (0.5 + 0.0 * theta_o, 0.0 * theta_o, theta_o, np.pi + 0.0 * theta_o)
    found = fit(simulate(model, params, rows, (0.01, 1e-4), seed=2), model)
    assert found.described
    assert said in found.verdict
    assert ("tests it little" in found.verdict) == bool(said)
    assert ("describes this surface to within its noise" in found.verdict) != bool(said)
