"""Sums of two lobes, and nonlinear parameters that differ by channel."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from lobefit.fitting import Measurement, fit, simulate
from lobefit.kernels import LobefitError, ModelError, candidate, get_model
from tests.truth import deviations

Truth = dict[str, float | list[float]]

NARROW: Truth = {"k_d": 0.0, "k_s": 1.0, "F0": 0.3, "alpha": 0.03}
BROAD: Truth = {"k_d": 0.0, "k_s": 1.0, "F0": 0.5, "alpha": 0.5}
BOTH: Truth = {"k_d": 0.0}
BOTH |= {f"{n}_1": v for n, v in NARROW.items() if n != "k_d"}
BOTH |= {f"{n}_2": v for n, v in BROAD.items() if n != "k_d"}
SCAN = "in-plane incidences=10,30,50,70 step=1"
COPPER: dict[str, list[float]] = {"eta": [0.25, 1.07, 1.16], "k": [3.38, 2.59, 2.46]}


@pytest.fixture(scope="module")
def both() -> Measurement:
    """Give two lobes, summed from two measurements and not by the model of a sum."""
    first, second = (simulate("ggx", lobe, SCAN, (0.0, 0.0)) for lobe in (NARROW, BROAD))
    noise = 1 + 0.01 * np.random.default_rng(10).standard_normal(first.values.shape)
    return replace(first, values=(first.values + second.values) * noise)


def test_two_lobes_are_described_by_no_single_one(both: Measurement) -> None:
    found = fit(both, "quick")
    assert not found.described
    assert found.verdict.startswith("No candidate describes this surface")
    assert found.best.diagnostics.misfit_limited
    assert found.best.diagnostics.worst[0] in found.verdict
    assert "°" in found.best.diagnostics.worst[0]


def test_two_lobes_are_described_by_their_sum(both: Measurement) -> None:
    summed = fit(both, ["ggx", "ggx+ggx"])
    assert summed.best.candidate == "ggx+ggx"
    assert summed.described
    assert max(map(abs, deviations(summed.best, BOTH).values())) < 3.5


@pytest.mark.parametrize("seed", range(6))
def test_labels_of_two_equal_lobes_do_not_switch(both: Measurement, seed: int) -> None:
    """F8: whatever the order of the rows and the noise, the narrower lobe is the first."""
    rng = np.random.default_rng(seed)
    noisy = both.values * (1 + 0.02 * rng.standard_normal(both.values.shape))
    m = replace(both, values=noisy).select(rng.permutation(both.n_directions))
    params = fit(m, ["ggx+ggx"]).best.params
    assert params["alpha_1"] == pytest.approx(0.03, rel=0.05)
    assert params["alpha_2"] == pytest.approx(0.5, rel=0.1)


def test_a_sum_with_another_diffuse_term() -> None:
    truth: Truth = {"rho": [0.3, 0.6], "r": 0.6, "k_s": 1.0, "F0": 0.05, "alpha": 0.1}
    m = simulate("eon+ggx", truth, "in-plane step=2", (0.005, 1e-4), seed=3)
    found = fit(m, ["ggx", "oren_nayar+ggx", "eon+ggx"])
    assert found.best.candidate == "eon+ggx"
    assert max(map(abs, deviations(found.best, truth).values())) < 3.5


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("ggx+ggx+ggx", "at most two lobes"),
        ("eon+lambert", "one diffuse term"),
        ("ggx+ggy", "did you mean 'ggx'"),
        ("ggx+ggx:k_s=1", "no variant"),
    ],
)
def test_sums_that_cannot_be(name: str, said: str) -> None:
    with pytest.raises(ModelError, match=said):
        candidate(name)


def test_parameters_of_a_sum_are_told_apart() -> None:
    model = get_model("ggx+retro")
    assert [p.name for p in model.parameters] == (
        ["k_d", "k_s_1", "F0_1", "alpha_1", "k_s_2", "alpha_2"]
    )
    assert [p.name for p in get_model("oren_nayar+ggx").parameters] == (
        ["k_d", "sigma", "k_s", "F0", "alpha"]
    )


def test_the_index_of_copper_is_found_in_each_channel() -> None:
    truth: Truth = {"k_d": 0.0, "k_s": 1.0, "alpha": 0.25, **COPPER}
    m = simulate("ggx:conductor", truth, "in-plane step=5", (0.01, 1e-4), seed=3)
    found = fit(m, ["ggx:k_s=1", "ggx:conductor"])
    assert found.best.candidate == "ggx:conductor"
    assert found.best.options["fresnel"] == "conductor"
    errors = {n: z for n, z in deviations(found.best, truth).items() if "k_d" not in n}
    assert len(errors) == 7
    assert max(map(abs, errors.values())) < 3.5


def test_one_channel_alone_is_fitted_as_among_others() -> None:
    """What a channel has for itself does not depend on the others, given what they share."""
    truth: Truth = {"k_d": 0.02, "k_s": 1.0, "alpha": 0.2, **COPPER}
    m = simulate("ggx:conductor", truth, "in-plane step=5", (0.0, 0.0))
    together = fit(m, ["ggx:conductor"]).best
    for channel in range(3):
        alone = replace(m, values=m.values[[channel]], channels=("one",))
        single = fit(alone, ["ggx:conductor"]).best
        for name in ("eta", "k", "k_d"):
            values = together.params[name]
            assert isinstance(values, list)
            assert single.params[name] == pytest.approx(values[channel], rel=1e-4)


def test_a_choice_that_one_candidate_lacks_leaves_the_others(both: Measurement) -> None:
    found = fit(both, ["ggx", "blinn"], options={"masking": "smith_separable"})
    assert [r.candidate for r in found.results] == ["ggx"]
    assert "blinn has no masking 'smith_separable'" in found.failed[0].reason
    with pytest.raises(LobefitError):
        fit(both, ["blinn"], options={"masking": "smith_separable"})
