"""Whether 90 % intervals hold the truth nine times of ten, over hundreds of seeds of every sample."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import pytest

from lobefit.fitting import fit
from lobefit.kernels import get_model
from samples.make import load, measure, names
from tests.truth import deviations

pytestmark = pytest.mark.slow

SEEDS = range(1000, 1400)
# Quantiles of the normal distribution: 90 % between -a and a, 90 % below b.
TWO_SIDED, ONE_SIDED = 1.6449, 1.2816


@dataclass(frozen=True)
class Row:
    """One parameter of one sample over all seeds."""

    sample: str
    parameter: str
    on_bound: bool
    z: npt.NDArray[np.float64]

    @property
    def covered(self) -> npt.NDArray[np.bool_]:
        """Where the interval holds the truth; a missing standard error (NaN) does not."""
        if self.on_bound:  # the truth cannot lie below the estimate's range: one side only
            return self.z <= ONE_SIDED
        return np.abs(self.z) <= TWO_SIDED

    def __str__(self) -> str:
        return (
            f"{self.sample:<18} {self.parameter:<10} {100 * self.covered.mean():6.1f} % "
            f"{self.z.mean():+7.3f} {self.z.std():6.3f}{'  one-sided' if self.on_bound else ''}"
        )


@pytest.fixture(scope="module")
def rows() -> list[Row]:
    """Fit every sample's own candidate to every seed."""
    table = []
    for name in names():
        spec = load(name)
        truth = spec["truth"]
        trials = [
            deviations(fit(measure(spec, seed), models=[truth["candidate"]]).best, truth["params"])
            for seed in SEEDS
        ]
        lower = {p.name: p.bounds[0] for p in get_model(truth["model"]).parameters}
        for parameter in trials[0]:
            own = parameter.partition("[")[0]
            at_zero = np.min(truth["params"][own]) == lower[own] and own != "phi_x"
            z = np.array([trial[parameter] for trial in trials])
            table.append(Row(name, parameter, bool(at_zero), z))
    return table


def test_intervals_cover_the_truth(rows: list[Row], capsys: pytest.CaptureFixture[str]) -> None:
    pooled = float(np.mean([row.covered for row in rows]))
    with capsys.disabled():
        print("\nsample             parameter   covered   mean z  std z")
        print("\n".join(map(str, rows)))
        print(f"pooled over {len(rows)} parameters and {len(SEEDS)} seeds: {100 * pooled:.2f} %")
    # 400 draws at 90 % scatter by 1.5 %: 84 % is four of those below, while an error
    # estimate that is 15 % too small would cover 83.8 %.
    assert [str(row) for row in rows if row.covered.mean() < 0.84] == []
    assert 0.88 <= pooled <= 0.92


def test_estimates_are_unbiased(rows: list[Row]) -> None:
    """The mean of 400 deviations scatters by 0.05 standard errors, so 0.15 is three of those.

    Weighing by measured instead of modelled values, the classical mistake, moves k_d by 1
    standard error on two of these samples and F0 by 0.5 on a third.
    """
    bounded = {row.sample for row in rows if row.on_bound}
    free = [row for row in rows if row.sample not in bounded]
    assert len(free) > 20
    assert [str(row) for row in free if abs(row.z.mean()) > 0.15] == []


def test_a_bound_moves_estimates_as_far_as_it_must(rows: list[Row]) -> None:
    """Held above its true value 0, k_d errs upwards by E[max(0, z)] = 0.40.

    The others inherit that times their correlation: the linearised fit of `blasted_aluminium`
    with its three bounds gives +0.42 for k_d, -0.09 for F0 and -0.32 for alpha.
    """
    expected = {"k_d": 0.42, "F0": -0.09, "alpha": -0.32}
    bounded = {row.sample for row in rows if row.on_bound}
    assert bounded == {"blasted_aluminium"}
    means = {row.parameter: row.z.mean() for row in rows if row.sample in bounded}
    assert len(means) == 7
    for parameter, mean in means.items():
        assert abs(mean - expected[parameter.partition("[")[0]]) < 0.15, (parameter, mean)
