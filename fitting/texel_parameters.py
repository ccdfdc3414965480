"""From coordinates and variances of texels to the model's parameters and standard errors."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lobefit.fitting.texel_model import TexelModel
from lobefit.fitting.texel_solve import Solution

__all__ = ["Found", "parameters_of"]

Numbers = NDArray[np.floating]
Mask = NDArray[np.bool_]

# A searched parameter this close to its bound on its search scale is said to lie on it
# (1 % on a logarithmic one), and a solved one, relative to its own size.
AT_BOUND = 0.01
AT_SOLVED_BOUND = 1e-6


@dataclass(frozen=True, slots=True)
class Found:
    """Parameters of T texels by name, shape (T,) or (T, C), beside their standard errors.

    An error is NaN where the parameter is on its bound or the readings do not determine it.
    """

    params: dict[str, Numbers]
    errors: dict[str, Numbers]
    on_bound: Mask


def _searched(model: TexelModel, solution: Solution, scatter: Numbers) -> Found:
    scale, candidate = model.scale, model.candidate
    t = solution.t.astype(np.float64)
    x = scale.to_parameters(t)
    variances = np.einsum("tjj->tj", solution.along_t) * scatter[:, None]
    errors = np.sqrt(np.where(variances > 0.0, variances, np.nan)) * scale.slope(x)
    near = (t - scale.low < AT_BOUND) | (scale.high - t < AT_BOUND)
    on_bound = (near & ~scale.periodic).any(axis=1)
    names = [p.name for p in candidate.searched]
    for axes in candidate.model.axes:  # unique labels: the wider axis first
        if not all(name in names for name in axes):
            continue
        a, b, phi = (names.index(name) for name in axes)
        turn = x[:, a] < x[:, b]
        for rows in (x, errors):
            rows[turn, a], rows[turn, b] = rows[turn, b], rows[turn, a].copy()
        x[turn, phi] += 0.5 * np.pi
    for k, p in enumerate(candidate.searched):
        if p.period:
            x[:, k] = p.bounds[0] + np.mod(x[:, k] - p.bounds[0], p.period)
    return Found(
        {name: x[:, k] for k, name in enumerate(names)},
        {name: errors[:, k] for k, name in enumerate(names)},
        on_bound,
    )


def parameters_of(model: TexelModel, solution: Solution, scatter: Numbers) -> Found:
    """Give the free parameters of a solution.

    Parameters
    ----------
    model : TexelModel
    solution : Solution
        Of T texels.
    scatter : ndarray, shape (T,)
        Reduced chi-square, which the variances are multiplied with.
    """
    found = _searched(model, solution, scatter)
    linear, candidate = model.linear, model.candidate
    d = np.clip(solution.d.astype(np.float64), linear.low, linear.high)
    c = linear.coefficients(d)
    covariance = solution.of_d.astype(np.float64) * scatter[:, None, None, None]
    products = candidate.model.coefficients
    alone = {names[0]: k for k, names in enumerate(products) if len(names) == 1}
    for p in candidate.solved:
        if p.name in alone:
            value = c[:, :, alone[p.name]]
            slope = np.broadcast_to(linear.T[alone[p.name]], d.shape)
        else:  # a ratio such as F0 = c_a / c_b
            a, scale_name = next(
                (k, n[0]) for k, n in enumerate(products) if len(n) == 2 and n[1] == p.name
            )
            b = alone[scale_name]
            size = c[:, :, b]
            there = size > 0.0
            value = np.divide(c[:, :, a], size, out=np.zeros_like(size), where=there)
            value = np.clip(value, *p.bounds)
            per = np.where(there, size, np.nan)[:, :, None]
            slope = (linear.T[a] - value[:, :, None] * linear.T[b]) / per
        variance = np.einsum("tcd,tcde,tce->tc", slope, covariance, slope)
        found.params[p.name] = value
        found.errors[p.name] = np.sqrt(np.where(variance > 0.0, variance, np.nan))
    span = AT_SOLVED_BOUND * (1.0 + np.abs(d))
    low, high = np.abs(d - linear.low) <= span * (linear.low != 0.0), d >= linear.high - span
    held = (d <= linear.low) | low | high
    return Found(found.params, found.errors, found.on_bound | held.any(axis=(1, 2)))
