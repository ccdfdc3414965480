"""Directions and surfaces for the tests of many texels."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from lobefit.kernels import candidate, get_device
from lobefit.kernels.evaluate import basis_values
from lobefit.kernels.geometry import Directions
from lobefit.kernels.program import model_program

__all__ = ["directions", "surfaces"]

Array = NDArray[Any]


def directions(n: int, seed: int = 3) -> Array:
    """Give directions of which half lie about the mirror direction and some look back."""
    rng = np.random.default_rng(seed)
    theta_i, phi_i = rng.uniform(0.1, 1.2, n), rng.uniform(0, 2 * np.pi, n)
    theta_o, phi_o = rng.uniform(0.1, 1.2, n), rng.uniform(0, 2 * np.pi, n)
    mirror, back = slice(0, n // 2), slice(n // 2, n // 2 + n // 8)
    for rows, turn in ((mirror, np.pi), (back, 0.0)):
        count = len(theta_i[rows])
        theta_o[rows] = np.clip(theta_i[rows] + rng.normal(0, 0.25, count), 0, 1.3)
        phi_o[rows] = phi_i[rows] + turn + rng.normal(0, 0.25, count)
    return np.array([theta_i, phi_i, theta_o, phi_o])


def surfaces(name: str, angles: Array, texels: int, channels: int, seed: int) -> tuple[Array, Any]:
    """Give clean readings of a candidate, (T, N, C), and the parameters: near their defaults."""
    rng = np.random.default_rng(seed)
    c = candidate(name)
    truth: dict[str, Array] = {}
    for p in c.searched:
        low, high = p.bounds
        inside = low < p.default < high
        if p.scale == "log":
            middle = p.default if inside else np.sqrt(low * high)
            least, most = max(low, middle / 1.6), min(high, middle * 1.6)
            truth[p.name] = np.exp(rng.uniform(np.log(least), np.log(most), texels))
        else:
            middle = p.default if inside else 0.5 * (low + high)
            edge, width = 0.1 * (high - low), 0.2 * (high - low)
            least, most = max(low + edge, middle - width), min(high - edge, middle + width)
            truth[p.name] = rng.uniform(least, most, texels)
    for first, second in c.descending:  # far enough apart that neither label is in doubt
        truth[first], truth[second] = 1.5 * truth[first], truth[second] / 1.5
    linear = {
        p.name: np.full((texels, channels), c.fixed[p.name])
        if p.name in c.fixed
        else rng.uniform(0.3, 0.8, (texels, channels)) * (p.default or 1.0)
        for p in c.model.linear
    }
    truth |= {p.name: linear[p.name] for p in c.solved}
    x = np.array([truth[p.name] for p in c.searched]).reshape(len(c.searched), texels).T
    placed = Directions(get_device(), *angles)
    basis = basis_values(model_program(c.model), placed, c.expand(x))
    products = [
        np.prod([np.ones((texels, channels)), *(linear[n] for n in names)], axis=0)
        for names in c.model.coefficients
    ]
    if not c.searched:
        basis = np.broadcast_to(basis, (texels, *basis.shape[1:]))
    return np.einsum("tkn,ktc->tnc", basis, np.array(products)), truth
