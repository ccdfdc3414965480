"""Parameters by name -> the arrays that kernels take, and back.

Coefficients are products of linear parameters (``k_s F0`` and ``k_s`` for a
Schlick lobe), so both directions are fixed by the record.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from difflib import get_close_matches

import numpy as np
from numpy.typing import NDArray

from lobefit.kernels.errors import ModelError
from lobefit.kernels.registry import Model

__all__ = ["coefficients_of", "complete", "linear_from_coefficients", "nonlinear_of"]

Array = NDArray[np.float64]


def complete(model: Model, params: Mapping[str, float | Sequence[float]]) -> dict[str, Array]:
    """Check parameters and fill in the record's defaults.

    Parameters
    ----------
    model : Model
        Whose parameters they are.
    params : mapping of str to float or sequence of float
        What was given.

    Returns
    -------
    dict of str to ndarray
        Every parameter: shape (1,) or (channels,).

    Raises
    ------
    ModelError
        Unknown name, a value that is not finite or outside its bounds, a list
        for a shared parameter, lists of different lengths.
    """
    known = {p.name: p for p in model.parameters}
    for name in params:
        if name not in known:
            near = get_close_matches(name, known, n=1)
            hint = f"; did you mean {near[0]!r}?" if near else "."
            raise ModelError(
                f"{model.name} has no parameter {name!r}{hint} It has {', '.join(known)}"
            )
    full: dict[str, Array] = {}
    for name, p in known.items():
        try:
            value = np.atleast_1d(np.asarray(params.get(name, p.default), dtype=np.float64))
        except (TypeError, ValueError) as error:
            raise ModelError(f"{model.name}: {name} is not a number: {params[name]!r}") from error
        low, high = p.bounds
        if not p.per_channel and value.size != 1:
            raise ModelError(f"{model.name}: {name} is one number for all channels, not a list")
        if value.ndim != 1 or value.size == 0:
            raise ModelError(f"{model.name}: {name} is a number or a list with one per channel")
        outside = ~np.isfinite(value)
        if p.period is None:  # an angle is taken modulo its period
            outside |= (value < low) | (value > high)
        if outside.any():
            raise ModelError(
                f"{model.name}: {name} = {value[outside][0]:g} is outside its range "
                f"{low:g} to {high:g}"
            )
        full[name] = value
    sizes = {value.size for value in full.values()} - {1}
    if len(sizes) > 1:
        raise ModelError(f"{model.name}: lists for {sorted(sizes)} channels do not fit together")
    return full


def nonlinear_of(model: Model, full: Mapping[str, Array]) -> Array:
    """Stack the nonlinear parameters, shape (1 or channels, n_x)."""
    columns = [full[p.name] for p in model.nonlinear]
    if not columns:
        return np.zeros((1, 0))
    return np.stack(np.broadcast_arrays(*columns), axis=-1)


def coefficients_of(model: Model, full: Mapping[str, Array]) -> Array:
    """Multiply linear parameters out to coefficients, shape (channels, n_basis)."""
    products = [
        math.prod((full[n] for n in names), start=np.ones(1)) for names in model.coefficients
    ]
    return np.stack(np.broadcast_arrays(*products), axis=-1)


def linear_from_coefficients(model: Model, coefficients: Array) -> dict[str, Array]:
    """Recover linear parameters from coefficients of shape (channels, n_basis).

    A ratio such as ``F0 = c_a / c_b`` whose scale is 0 has no value; it becomes
    the lower bound, which gives the same BRDF.
    """
    found: dict[str, Array] = {}
    for k, names in sorted(enumerate(model.coefficients), key=lambda item: len(item[1])):
        column = coefficients[:, k]
        if len(names) == 1:
            found[names[0]] = column
        elif len(names) == 2:
            scale = found[names[0]]
            ratio = np.divide(column, scale, out=np.zeros_like(column), where=scale > 0.0)
            # Rounding must not carry it past its bound.
            bounds = next(p.bounds for p in model.linear if p.name == names[1])
            found[names[1]] = np.clip(ratio, *bounds)
    return found
