"""Whether the readings around the mirror direction resolve the fitted peak."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lobefit.fitting.information import labels
from lobefit.fitting.point import PointFit
from lobefit.kernels.geometry import Directions

__all__ = ["Peak", "unresolved_peak"]

Array = NDArray[np.float64]

# Distances from the mirror direction at which the model is looked at, in radians.
OFFSETS = np.concatenate([[0.0], np.geomspace(1e-6, 1.0, 600)])
# Half the step, in units of ln(parameter), of the question what makes the peak narrower.
STEP = 0.1
# The surroundings of a peak, in units of its width.
AROUND = 1.5


@dataclass(frozen=True, slots=True)
class Peak:
    """A peak that is narrower than the distances of the readings.

    Attributes
    ----------
    width : float
        Full width at half maximum along theta_o, in radians.
    nearest : tuple of float
        The smallest distances of readings from the mirror direction, in radians.
    narrowing : dict of str to int
        Parameters that decide the width: 1 where it grows with them, else -1.
    raising : tuple of str
        Other parameters that decide the height. Of a peak that is not resolved little more
        is known than a product of height and width.
    sampled : bool
        Whether any reading lies above half the height.
    """

    width: float
    nearest: tuple[float, ...]
    narrowing: dict[str, int]
    raising: tuple[str, ...]
    sampled: bool


def unresolved_peak(fit: PointFit) -> Peak | None:
    """Find out whether fewer than two readings at different distances lie on the peak.

    Within one full width either side of the mirror direction; a lobe's width then follows from
    its tails alone, that is from the model's shape.

    Returns
    -------
    Peak or None
        None where the peak is resolved, or the model has none.
    """
    problem, t, c = fit.problem, fit.polished.t, fit.polished.c
    widths: list[tuple[int | None, int | None]] = [
        (j, None) for j, p in enumerate(problem.candidate.shared) if p.scale == "log"
    ]
    k = problem.program.n_basis
    widths += [(None, k + j) for j, p in enumerate(problem.candidate.own) if p.scale == "log"]
    if not widths:
        return None
    # Angle between the mirror direction and the view: twice the half angle.
    log2_cos_h = problem.dataset.full.directions.plane("log2_cos_h").astype(np.float64)
    used = problem.dataset.used.any(axis=0)
    slope2 = np.expm1(np.maximum(-2.0 * np.log(2.0) * log2_cos_h[used], 0.0))
    offset = 2.0 * np.arctan(np.sqrt(slope2))
    directions = _across(fit)
    width = _width(fit, directions, t, c)
    if width is None:
        return None
    # Distances that differ by less than a tenth of the width count once.
    _, first = np.unique(np.round(offset * (10.0 / width)), return_index=True)
    steps = offset[first]
    if np.count_nonzero(steps < width) >= 2:
        return None
    names, own, narrowing = labels(problem, t), problem.candidate.own, {}
    for j, column in widths:
        places = [_moved(t, c, j, column, sign * STEP) for sign in (1.0, -1.0)]
        wide, narrow = (_width(fit, directions, *place) for place in places)
        if wide and narrow and abs(np.log(wide / narrow)) > 0.2 * STEP:
            name = names[j] if j is not None else own[(column or 0) - k].name
            narrowing[name] = 1 if wide > narrow else -1
    if not narrowing:
        return None
    shown = tuple(float(s) for s in steps[:3])
    raising = tuple(n for n in _raising(fit, directions, width) if n not in narrowing)
    return Peak(width, shown, narrowing, raising, bool(steps[0] < 0.5 * width))


def _moved(
    t: Array, c: Array, shared: int | None, column: int | None, step: float
) -> tuple[Array, Array]:
    """Move one search coordinate: of all channels, or in each channel's own row."""
    t, c = t.copy(), c.copy()
    if shared is not None:
        t[shared] += step
    if column is not None:
        c[:, column] += step
    return t, c


def _raising(fit: PointFit, directions: Directions, width: float) -> list[str]:
    """Name the parameters that the height of the peak above its surroundings depends on."""
    problem, t, c = fit.problem, fit.polished.t, fit.polished.c
    k = problem.program.n_basis
    far = int(np.searchsorted(OFFSETS, AROUND * width))

    def height(t: Array, c: Array) -> float:
        f = problem.values_at(directions, t, c).sum(axis=0)
        return float(f[0] - f[min(far, len(f) - 1)])

    now, found = height(t, c), []
    changed: dict[str, list[tuple[Array, Array]]] = {}
    products = problem.candidate.model.coefficients
    for p in problem.candidate.solved:
        less = c.copy()
        for j, names in enumerate(products):
            if p.name in names:
                # Where all of it is 0, what a tenth of it would do.
                other = c[:, products.index(names[:1])] if len(names) == 2 else np.ones(len(c))
                less[:, j] = np.where(c[:, j] > 0.0, np.exp(-STEP) * c[:, j], STEP * other)
        changed[p.name] = [(t, less)]
    for j, p in enumerate(problem.candidate.shared):
        step = STEP * float(problem.scale.units[j])
        if not p.period:
            changed[labels(problem, t)[j]] = [_moved(t, c, j, None, s * step) for s in (1.0, -1.0)]
    for j, p in enumerate(problem.candidate.own):
        step = STEP * float(problem.own.units[j])
        changed[p.name] = [_moved(t, c, None, k + j, s * step) for s in (1.0, -1.0)]
    for name, places in changed.items():
        if any(abs(height(*place) - now) > 0.2 * STEP * now for place in places):
            found.append(name)
    return found


def _across(fit: PointFit) -> Directions:
    """Lay a line of views from the mirror direction towards the normal and beyond."""
    m = fit.problem.dataset.measurement
    # The lobe is plain at moderate incidences; at grazing ones its peak is elsewhere.
    k = int(np.argmin(np.abs(m.theta_i - np.radians(30.0))))
    signed = m.theta_i[k] - OFFSETS
    phi_o = m.phi_i[k] + np.where(signed >= 0.0, np.pi, 0.0)
    device, precision = fit.problem.dataset.device, fit.problem.dataset.precision
    zero = np.zeros(len(OFFSETS))
    return Directions(
        device, zero + m.theta_i[k], zero + m.phi_i[k], np.abs(signed), phi_o, precision=precision
    )


def _width(fit: PointFit, directions: Directions, t: Array, c: Array) -> float | None:
    """Give the full width at half maximum of all channels' sum; None without a peak."""
    f = fit.problem.values_at(directions, t, c).sum(axis=0)
    f = f - f[-1]
    below = np.flatnonzero(f < 0.5 * f[0])
    if not f[0] > 0.0 or not below.size or below[0] == 0:
        return None
    return 2.0 * float(OFFSETS[below[0]])
