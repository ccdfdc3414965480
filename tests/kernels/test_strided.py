"""The way work is shared out on a GPU, run on whatever device there is.

A GPU gets vectors of one direction, neighbours reading neighbours. No GPU is needed to
see that the sums are the same.
"""

from __future__ import annotations

import numpy as np
import pytest

from lobefit.kernels import Device, get_device, get_model, models
from lobefit.kernels.evaluate import basis_values
from lobefit.kernels.geometry import Directions
from lobefit.kernels.program import model_program
from lobefit.kernels.sums import Observations, normal_equations


class AsOnAGpu(Device):
    """The same device, which says that it is no CPU."""

    @property
    def is_cpu(self) -> bool:
        return False


@pytest.fixture(scope="module")
def other() -> Device:
    here = get_device()
    return AsOnAGpu(here.info, here.context.devices[0])


@pytest.mark.parametrize("name", list(models()))
@pytest.mark.parametrize("count", [5, 1000, 20_000])
def test_strided_sums_agree(name: str, count: int, other: Device) -> None:
    model = get_model(name)
    program = model_program(model)
    rng = np.random.default_rng(3)
    theta_i, theta_o = rng.uniform(0.0, 1.4, (2, count))
    phi_i, phi_o = rng.uniform(0.0, 6.2, (2, count))
    values, weights = rng.uniform(0.1, 1.0, (2, 2, count))
    x = np.array([[p.default for p in model.nonlinear]] * 3)
    coefficients = rng.uniform(0.1, 0.5, (3, 2, program.n_basis))
    sums = []
    for device in (get_device(), other):
        directions = Directions(device, theta_i, phi_i, theta_o, phi_o)
        observations = Observations(directions, values, weights)
        sums.append(normal_equations(program, observations, x, coefficients))
        basis = basis_values(program, directions, x)
        assert basis.shape == (3, program.n_basis, count)
    for field in ("chi_square", "rhs", "gram"):
        ours, theirs = (getattr(s, field) for s in sums)
        # Double precision in another order of addition.
        np.testing.assert_allclose(theirs, ours, rtol=1e-11, atol=1e-12 * np.abs(ours).max())
