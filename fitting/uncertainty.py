"""First-order standard errors: from the curvature in (t, d) to the model's parameters."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lobefit.fitting.information import labels
from lobefit.fitting.point import PointFit
from lobefit.fitting.polish import Curvature, eliminate
from lobefit.fitting.problem import Problem
from lobefit.fitting.result import ParameterEstimate, Status
from lobefit.fitting.scale import canonical
from lobefit.kernels import Parameter
from lobefit.kernels.parameters import linear_from_coefficients

__all__ = ["Estimates", "estimates", "joint_covariance"]

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

# A searched parameter this close to its bound, relatively, is said to lie on it.
AT_BOUND = 0.01
# A standard error of so much of the whole range says that nothing is known.
KNOWS_NOTHING = 0.25


@dataclass(frozen=True, slots=True)
class Estimates:
    """Parameters of a fit by name, with their errors and covariance.

    `tilt_covariance` is that of the sample's tilt in radians squared; empty where not fitted.
    """

    params: dict[str, float | list[float]]
    rows: tuple[ParameterEstimate, ...]
    covariance: Array
    tilt_covariance: Array


def joint_covariance(curvature: Curvature, n: int, free: Mask) -> Array:
    """Invert the arrowhead over (t, all channels' d); rows of held coefficients are 0."""
    H = curvature.matrix
    channels, size = free.shape
    schur, _, inverse = eliminate(H, curvature.gradient, n, free)
    diagonal = np.diag(schur).copy() if n else np.zeros(0)
    scale = np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))
    # A direction without information gets a huge variance, not a zero one.
    scaled = schur / np.outer(scale, scale) + np.eye(n) * np.where(diagonal > 0.0, 1e-12, 1e-24)
    tt = np.linalg.inv(scaled) / np.outer(scale, scale) if n else np.zeros((0, 0))
    full = np.zeros((n + channels * size, n + channels * size))
    full[:n, :n] = tt
    lever = np.einsum("cde,cne->cdn", inverse, H[:, :n, n:])  # dd/dt, with the sign turned
    for a in range(channels):
        rows = slice(n + a * size, n + (a + 1) * size)
        full[rows, :n] = -lever[a] @ tt
        full[:n, rows] = full[rows, :n].T
        for b in range(channels):
            columns = slice(n + b * size, n + (b + 1) * size)
            full[rows, columns] = lever[a] @ tt @ lever[b].T
        full[rows, rows] += inverse[a]
    return full


def _sandwich(bread: Array, meat: Array | None, n: int) -> Array:
    """Give the covariance H^-1 M H^-1 of residuals whose scatter is not what weights say."""
    if meat is None:
        return bread
    channels, size = len(meat), meat.shape[1] - n
    full = np.zeros_like(bread)
    full[:n, :n] = meat[:, :n, :n].sum(axis=0)
    for channel in range(channels):
        rows = slice(n + channel * size, n + (channel + 1) * size)
        full[rows, rows] = meat[channel, n:, n:]
        full[rows, :n] = meat[channel, n:, :n]
        full[:n, rows] = meat[channel, :n, n:]
    covariance: Array = bread @ full @ bread
    return covariance


def _widened(fit: PointFit, bread: Array, variance_scale: float) -> Array:
    """Add what the metric and the instrument do to a covariance."""
    n = len(fit.polished.t)
    if fit.nuisance is None:
        return _sandwich(bread, fit.meat, n)
    return fit.nuisance.widened(bread, variance_scale)


def _linear_jacobian(problem: Problem, c: Array, name: str) -> Array:
    """Differentiate a linear parameter with respect to d, shape (C, D)."""
    T = problem.coordinates.T
    products = problem.candidate.model.coefficients
    alone = {names[0]: k for k, names in enumerate(products) if len(names) == 1}
    if name in alone:
        return np.broadcast_to(T[alone[name]], (len(c), T.shape[1])).copy()
    a, scale_name = next((k, n[0]) for k, n in enumerate(products) if len(n) == 2 and n[1] == name)
    b = alone[scale_name]
    scale = np.where(c[:, b] > 0.0, c[:, b], np.nan)[:, None]
    ratio = c[:, a][:, None] / scale
    jacobian: Array = (T[a] - ratio * T[b]) / scale
    return jacobian


def _linear_variances(problem: Problem, c: Array, covariance: Array, n: int, name: str) -> Array:
    """Give the variance of a linear parameter in each channel, shape (C,)."""
    per_d = _linear_jacobian(problem, c, name)
    size = per_d.shape[1]
    parts = (slice(n + k * size, n + (k + 1) * size) for k in range(len(c)))
    return np.array([J @ covariance[p, p] @ J for J, p in zip(per_d, parts, strict=True)])


def estimates(fit: PointFit, channels: tuple[str, ...], variance_scale: float) -> Estimates:
    """Give the parameters with first-order standard errors.

    Parameters
    ----------
    fit : PointFit
        The best point with its curvature.
    channels : tuple of str
        Names.
    variance_scale : float
        What covariances are multiplied with: the reduced chi-square where
        sigma was not given, and the correlation of the residuals.

    Returns
    -------
    Estimates
    """
    problem, point = fit.problem, fit.polished
    candidate, model = problem.candidate, problem.candidate.model
    n, count = len(point.t), len(channels)
    d = problem.coordinates.coordinates(point.c)
    size = d.shape[1]
    inside = (d > problem.coordinates.low) & (d < problem.coordinates.high)
    everything = joint_covariance(point.curvature, n, np.ones_like(inside))
    crossing = _widened(fit, everything, variance_scale)
    # A ratio (F0) on its bound that the data do not determine must not lend its bound's
    # firmness to its scale (k_s): there the bound is crossed for both.
    ratios = [names for names in model.coefficients if len(names) == 2]
    for scale_name, name in ratios:
        span = next(p.bounds[1] - p.bounds[0] for p in model.linear if p.name == name)
        variances = variance_scale * _linear_variances(problem, point.c, crossing, n, name)
        concerned = (_linear_jacobian(problem, point.c, name) != 0.0) | (
            _linear_jacobian(problem, point.c, scale_name) != 0.0
        )
        inside |= concerned & ~(variances < (KNOWS_NOTHING * span) ** 2)[:, None]
    alone = joint_covariance(point.curvature, n, inside)
    held = _widened(fit, alone, variance_scale)
    vague = _vague_scales(problem, point.c, held, n, variance_scale)

    x = problem.scale.to_parameters(point.t)
    slope = problem.scale.slope(x)
    labelled = canonical(candidate, x)
    names = labels(problem, point.t)
    own = [p.name for p in candidate.own]
    own_x = problem.own.to_parameters(point.c[:, problem.program.n_basis :])
    own_slope = problem.own.slope(own_x)
    shared_x = np.broadcast_to(labelled, (count, n))
    full_x = candidate.expand(np.concatenate([shared_x, own_x], axis=1)[:, problem.order])
    linear = linear_from_coefficients(model, point.c)

    params: dict[str, float | list[float]] = {}
    rows: list[ParameterEstimate] = []
    jacobians: list[Array] = []
    for p in model.parameters:
        fixed: Status | None = None
        if p.name in candidate.fixed or p.name in candidate.tied:
            fixed = "fixed" if p.name in candidate.fixed else "tied"
        if p.linear:
            values = linear[p.name]
            per_d = _linear_jacobian(problem, point.c, p.name)
            one = not p.per_channel or (fixed is not None and len(set(values)) == 1)
            params[p.name] = float(values[0]) if one or count == 1 else [float(v) for v in values]
            for channel in range(1 if one else count):
                J = np.zeros(n + count * size)
                J[n + channel * size : n + (channel + 1) * size] = per_d[channel]
                label = None if one else channels[channel]
                if any(name == p.name and vague[s][channel] for s, name in ratios):
                    J *= np.nan
                rows.append(
                    _row(p, label, float(values[channel]), J, held, crossing, fixed, variance_scale)
                )
                jacobians.append(J)
            continue
        k = [q.name for q in model.nonlinear].index(p.name)
        one = p.name not in own and candidate.tied.get(p.name) not in own
        params[p.name] = float(full_x[0, k]) if one or count == 1 else full_x[:, k].tolist()
        for channel in range(1 if one else count):
            J = np.zeros(n + count * size)
            if p.name in own:
                m = size - len(own) + own.index(p.name)
                J[n + channel * size + m] = own_slope[channel, own.index(p.name)]
            elif not fixed:
                m = names.index(p.name)
                J[m] = slope[m]
            label = None if one else channels[channel]
            value = float(full_x[channel, k])
            rows.append(_row(p, label, value, J, held, crossing, fixed, variance_scale))
            jacobians.append(J)
    free = [k for k, row in enumerate(rows) if not row.held]
    J = np.stack([np.nan_to_num(jacobians[k]) for k in free]) if free else np.zeros((0, len(held)))
    tilt = np.zeros((0, 0))
    if fit.nuisance is not None:
        tilt = fit.nuisance.tilt_covariance(alone, variance_scale)
    return Estimates(params, tuple(rows), variance_scale * (J @ crossing @ J.T), tilt)


def _vague_scales(
    problem: Problem, c: Array, held: Array, n: int, variance_scale: float
) -> dict[str, Mask]:
    """Tell, per channel, which scales of ratios are not distinct from 0.

    What is divided by such a scale has no first-order error that means anything.
    """
    products = problem.candidate.model.coefficients
    found = {}
    for scale_name in {names[0] for names in products if len(names) == 2}:
        variances = _linear_variances(problem, c, held, n, scale_name)
        error = np.sqrt(variance_scale * np.maximum(variances, 0.0))
        found[scale_name] = ~(3.0 * error < c[:, products.index((scale_name,))])
    return found


def _row(
    p: Parameter,
    channel: str | None,
    value: float,
    jacobian: Array,
    held: Array,
    crossing: Array,
    fixed: Status | None,
    variance_scale: float,
) -> ParameterEstimate:
    status: Status = "free"
    error: float | None = None
    low, high = p.bounds
    if fixed:
        status = fixed
    elif not np.isfinite(jacobian).all():
        status = "undetermined"  # a ratio whose scale is 0
    else:
        margin = 0.0 if p.linear else AT_BOUND
        if p.period is None and value <= low + margin * abs(low):
            status = "lower"
        elif p.period is None and value >= high - margin * abs(high):
            status = "upper"
        covariance = crossing if status in ("lower", "upper") else held
        variance = variance_scale * float(jacobian @ covariance @ jacobian)
        error = float(np.sqrt(variance)) if np.isfinite(variance) and variance > 0.0 else None
        span = np.log(high / low) * value if p.scale == "log" else (p.period or high - low)
        exact = variance_scale == 0.0  # no residual to judge by
        if not exact and (error is None or error > KNOWS_NOTHING * span):
            status, error = ("undetermined" if status == "free" else status), None
    return ParameterEstimate(
        name=p.name,
        channel=channel,
        value=value,
        standard_error=error,
        status=status,
        unit=p.unit,
        meaning=p.meaning,
    )
