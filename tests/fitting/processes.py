"""Random processes whose autocorrelation is known."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


def autoregressive(rho: float, chains: int, steps: int, seed: int = 1) -> Array:
    """Give stationary AR(1) chains, shape (chains, steps), whose correlations are rho^lag.

    Their autocorrelation time is (1 + rho) / (1 - rho).
    """
    rng = np.random.default_rng(seed)
    x = np.empty((chains, steps))
    x[:, 0] = rng.standard_normal(chains)
    for t in range(1, steps):
        x[:, t] = rho * x[:, t - 1] + np.sqrt(1 - rho**2) * rng.standard_normal(chains)
    return x
