"""The Laplace approximation of a posterior: its mode and curvature in the sampled coordinates.

Gradient and curvature come from differences along the axes of the last approximation, a step of
which changes the log-probability by about one half: so rounding of the sums does not matter, and
ridges that are a thousand times longer than wide are found in a few rounds. All points of a
round are one launch.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lobefit.kernels import FitError

__all__ = ["Laplace", "laplace", "starts"]

Array = NDArray[np.float64]
LogProbability = Callable[[Array], Array]

ROUNDS = 40
# First guess of a standard deviation in q, and the longest that is believed: priors are that wide.
FIRST_SD = 0.03
LONGEST_SD = 4.0
# The step of the differences, in standard deviations.
STEP = 0.8
# The longest move of a round, in the same.
FARTHEST = 4.0
# A round may correct an axis by these factors of its variance.
STEEPEST, FLATTEST = 1e4, 0.02
# Close enough: the gradient in standard deviations, the curvature as a share.
GRADIENT, CURVATURE = 0.05, 0.3


@dataclass(frozen=True, slots=True)
class Laplace:
    """A normal distribution about the mode.

    Attributes
    ----------
    mode : ndarray, shape (n,)
    root : ndarray, shape (n, n)
        Covariance = root root^T.
    log_probability : float
        At the mode.
    converged : bool
        Whether the gradient vanished and the curvature was reproduced.
    """

    mode: Array
    root: Array
    log_probability: float
    converged: bool

    @property
    def covariance(self) -> Array:
        """Covariance in q."""
        return np.asarray(self.root @ self.root.T)


def laplace(density: LogProbability, start: Array) -> Laplace:
    """Find the mode and the curvature of a density.

    Parameters
    ----------
    density : callable
        Log-probabilities (W,) of points (W, n).
    start : ndarray, shape (n,)
        Where to start; the log-probability must be finite there.

    Raises
    ------
    FitError
        The log-probability is not finite at the start.
    """
    n = len(start)
    mode, root = start.copy(), FIRST_SD * np.eye(n)
    best = float(density(mode[None])[0])
    if not np.isfinite(best):
        raise FitError("the log-probability at the point fit is not finite: nowhere to start from")
    converged = False
    for _ in range(ROUNDS):
        gradient, curvature = _differences(density, mode, root, best)
        values, vectors = np.linalg.eigh(curvature)
        # An axis along which it is not concave, or flat, is made longer: a round at a time.
        clipped = np.clip(values, FLATTEST, STEEPEST)
        axes = vectors / np.sqrt(clipped)
        move = axes @ (axes.T @ gradient)
        length = float(np.linalg.norm(axes.T @ gradient))
        if length > FARTHEST:
            move *= FARTHEST / length
        at_ease = length < GRADIENT and bool((np.abs(values - 1.0) < CURVATURE).all())
        mode, best, gained = _along(density, mode, root @ move, best)
        root = _limited(root @ axes)
        if at_ease or (length < GRADIENT and not gained and _settled(values, root)):
            converged = True
            break
    if not np.isfinite(root).all() or np.linalg.matrix_rank(root / _sizes(root)[:, None]) < n:
        raise FitError("the curvature at the point fit has no full rank: nothing to start from")
    return Laplace(mode, root, best, converged)


def _sizes(root: Array) -> Array:
    return np.asarray(np.sqrt((root * root).sum(axis=1)))


def _limited(root: Array) -> Array:
    """Shrink coordinates whose standard deviation no prior would allow."""
    limited: Array = root * np.minimum(1.0, LONGEST_SD / _sizes(root))[:, None]
    return limited


def _settled(values: Array, root: Array) -> bool:
    """Tell whether only axes at the limit are still flat."""
    flat = bool((values < 1.0 - CURVATURE).any())
    return not flat or bool((_sizes(root) > 0.99 * LONGEST_SD).any())


def _differences(
    density: LogProbability, mode: Array, root: Array, best: float
) -> tuple[Array, Array]:
    """Give the gradient and minus the curvature along the columns of `root`."""
    n = len(mode)
    i, j = np.triu_indices(n, 1)
    unit = STEP * np.eye(n)
    z = np.concatenate([unit, -unit, unit[i] + unit[j], -unit[i] - unit[j]])
    value = density(mode + z @ root.T) - best
    # Beyond an edge it is taken as far down as a distant tail.
    value = np.where(np.isfinite(value), np.maximum(value, -1e6), -50.0)
    up, down = value[:n], value[n : 2 * n]
    both = value[2 * n :].reshape(2, -1)
    gradient = (up - down) / (2.0 * STEP)
    straight = -(up + down) / STEP**2
    curvature = np.diag(straight)
    # The sum of the two diagonal neighbours is even: no odd terms.
    cross = -both.sum(axis=0) / STEP**2 - straight[i] - straight[j]
    curvature[i, j] = curvature[j, i] = 0.5 * cross
    return gradient, curvature


def _along(
    density: LogProbability, mode: Array, move: Array, best: float
) -> tuple[Array, float, bool]:
    """Try shares of a move in one launch; returns the best point."""
    shares = 0.5 ** np.arange(-1, 7)
    points = mode + shares[:, None] * move
    value = density(points)
    k = int(np.argmax(np.where(np.isfinite(value), value, -np.inf)))
    if not value[k] > best:
        return mode, best, False
    return points[k], float(value[k]), bool(value[k] > best + 1e-3)


def starts(
    density: LogProbability,
    approximation: Laplace,
    shape: tuple[int, int],
    random: np.random.RandomState,
) -> tuple[Array, Array]:
    """Draw the walkers of several ensembles about the mode, wider than the approximation.

    Parameters
    ----------
    density : callable
        Log-probabilities of points.
    approximation : Laplace
    shape : (int, int)
        Ensembles, and walkers in each.
    random : numpy.random.RandomState
        Where the numbers come from.

    Returns
    -------
    points : ndarray, shape (E, W, n)
        All with finite log-probability; those of each ensemble span the space.
    log_probability : ndarray, shape (E, W)

    Raises
    ------
    FitError
        No such points are found.
    """
    n = len(approximation.mode)
    total = shape[0] * shape[1]
    points = np.tile(approximation.mode, (total, 1))
    value = np.full(total, -np.inf)
    spread = 1.5
    # A walker outside the prior, or far down a tail that is thinner than thought, never comes back.
    lowest = approximation.log_probability - 20.0 - 5.0 * n
    for _ in range(30):
        bad = np.flatnonzero(~(value > lowest))
        if not len(bad):
            break
        drawn = random.standard_normal((total, n))[bad]
        points[bad] = approximation.mode + spread * drawn @ approximation.root.T
        value[bad] = density(points[bad])
        spread *= 0.8
    if not np.isfinite(value).all():
        raise FitError("no walkers with a finite log-probability were found about the point fit")
    ensembles = points.reshape(*shape, n)
    for ensemble in ensembles:
        offsets = (ensemble - ensemble.mean(axis=0)) / _sizes(approximation.root)
        if np.linalg.matrix_rank(offsets) < n:
            raise FitError("the walkers about the point fit do not span the parameters")
    return ensembles, value.reshape(shape)
