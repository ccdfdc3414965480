"""Moves of several independent ensembles at once, as one of emcee's: one launch for all of them.

Each ensemble is split in two at random; one half moves by the other, then the other way round, as
Goodman & Weare 2010 and Foreman-Mackey et al. 2013 do. In steps that count, ensembles do not see
one another.

- stretch: along the line through a walker of the other half (Goodman & Weare 2010).
- differential evolution: by the difference of two walkers of the other half (ter Braak 2006), one
  time in ten by all of it, which leads from mode to mode.
- independent: a draw from a distribution like the one seen in the warm-up, fixed before the steps
  that count begin. A walker forgets in a few steps where it was; where the posterior is not
  like that distribution, the other two moves remain.
"""

from __future__ import annotations

from statistics import NormalDist
from typing import Any

import numpy as np
from emcee.moves import Move
from numpy.typing import NDArray

__all__ = ["EnsembleMove", "Proposal"]

Array = NDArray[np.float64]

# Shares of stretch, differential evolution and independent moves.
SHARES = (0.2, 0.4, 0.4)
STRETCH = 2.0
WHOLE_DIFFERENCE = 0.1
JITTER = 1e-4
# Degrees of freedom of the independent moves: tails heavier than a posterior's.
FREEDOM = 8.0
# Where coordinates are bent, in standard deviations and as probabilities.
NODES = np.linspace(-2.5, 2.5, 11)
PROBABILITIES = np.array([NormalDist().cdf(z) for z in NODES])


class Proposal:
    """A distribution like that of a chain, to draw from: a t copula with the chain's marginals.

    Each coordinate is bent, piecewise linearly, so that its quantiles are those of a normal
    distribution; the bent coordinates have a multivariate t distribution. So one-sided tails
    (a noise that may be zero) and bends of scale are proposed as they are. Beyond the outermost
    quantiles tails are exponential: no posterior's are heavier, in coordinates whose priors are
    logistic, and a tail that is too light would hold walkers for thousands of steps.

    Parameters
    ----------
    knots : ndarray, shape (n, K)
        Where the bends are, ascending.
    nodes : ndarray, shape (K,)
        The bent coordinate there.
    mean, root : ndarray, shapes (n,) and (n, n)
        Of the bent coordinates; scale matrix = root root^T, root lower triangular.
    """

    def __init__(self, knots: Array, nodes: Array, mean: Array, root: Array) -> None:
        self._knots, self._nodes = knots, nodes
        self._slopes = np.diff(nodes) / np.diff(knots, axis=1)
        self._mean, self._root, self._inverse = mean, root, np.linalg.inv(root)
        self._columns = np.arange(len(knots))
        self._edge = float(nodes[-1])

    @classmethod
    def normal(cls, mode: Array, root: Array) -> Proposal:
        """Take a normal distribution's place and covariance; nothing is bent."""
        size = np.sqrt((root * root).sum(axis=1))
        scaled = root / size[:, None]
        ends = NODES[[0, -1]]
        knots = mode[:, None] + size[:, None] * ends
        lower = np.linalg.cholesky(scaled @ scaled.T + 1e-12 * np.eye(len(mode)))
        return cls(knots, ends, np.zeros(len(mode)), lower)

    @classmethod
    def of(cls, chain: Array) -> Proposal:
        """Follow a chain, shape (steps, E, W, n), all ensembles together."""
        seen = chain.reshape(-1, chain.shape[-1])
        n = seen.shape[1]
        knots = np.quantile(seen, PROBABILITIES, axis=0).T
        # No two knots in one place, where nothing moved.
        least = 1e-9 * (knots[:, -1:] - knots[:, :1]) + 1e-12 * (1.0 + np.abs(knots[:, :1]))
        knots = knots[:, :1] + np.concatenate(
            [np.zeros((n, 1)), np.cumsum(np.maximum(np.diff(knots, axis=1), least), axis=1)], axis=1
        )
        plain = cls(knots, NODES, np.zeros(n), np.eye(n))
        bent, _ = plain._bend(seen)
        mean = bent.mean(axis=0)
        offsets = bent - mean
        covariance = offsets.T @ offsets / len(seen) + 1e-9 * np.eye(n)
        return cls(knots, NODES, mean, np.linalg.cholesky(covariance))

    def _bend(self, q: Array) -> tuple[Array, Array]:
        """Give the bent coordinates of q (P, n), and the log of the Jacobian (P,)."""
        inside = np.clip(q, self._knots[:, 0], self._knots[:, -1])
        k = (inside[:, :, None] > self._knots[:, 1:-1]).sum(axis=2)
        slope = self._slopes[self._columns, k]
        z = self._nodes[k] + slope * (inside - self._knots[self._columns, k])
        beyond = q - inside
        far = np.sqrt(self._edge**2 + 2.0 * self._edge * slope * np.abs(beyond))
        z = np.where(beyond == 0.0, z, np.sign(beyond) * far)
        return z, self._log_slope(slope, z)

    def _log_slope(self, slope: Array, z: Array) -> Array:
        """Give the log of the Jacobian dz/dq at bent coordinates z."""
        flatter = self._edge / np.maximum(np.abs(z), self._edge)
        total: Array = np.log(slope * flatter).sum(axis=1)
        return total

    def draw(self, random: Any, count: int) -> tuple[Array, Array]:
        """Draw points, shape (count, n), with their log-densities up to a constant."""
        n = len(self._knots)
        t = random.standard_normal((count, n))
        t *= np.sqrt(FREEDOM / random.chisquare(FREEDOM, (count, 1)))
        z = self._mean + t @ self._root.T
        inside = np.clip(z, -self._edge, self._edge)
        k = (inside[:, :, None] > self._nodes[1:-1]).sum(axis=2)
        slope = self._slopes[self._columns, k]
        q = self._knots[self._columns, k] + (inside - self._nodes[k]) / slope
        q += np.sign(z) * (z * z - inside * inside) / (2.0 * self._edge * slope)
        return q, self._heavy(t) + self._log_slope(slope, z)

    def log_density(self, q: Array) -> Array:
        """Give the log-density of points (P, n) up to the same constant."""
        z, jacobian = self._bend(q)
        return np.asarray(self._heavy((z - self._mean) @ self._inverse.T) + jacobian)

    @staticmethod
    def _heavy(t: Array) -> Array:
        n = t.shape[1]
        density: Array = -0.5 * (FREEDOM + n) * np.log1p((t * t).sum(axis=1) / FREEDOM)
        return density


class EnsembleMove(Move):  # type: ignore[misc]
    """One step of all ensembles, whose walkers stand behind one another in emcee's state.

    Parameters
    ----------
    ensembles : int
        How many.
    proposal : Proposal
        Of the independent moves; may be replaced between steps that do not count.
    """

    def __init__(self, ensembles: int, proposal: Proposal) -> None:
        self.ensembles, self.proposal = ensembles, proposal

    def propose(self, model: Any, state: Any) -> tuple[Any, NDArray[np.bool_]]:
        """Move every walker once; emcee's interface."""
        random = model.random
        total, n = state.coords.shape
        walkers = total // self.ensembles
        half = walkers // 2
        accepted = np.zeros(total, dtype=bool)
        order = np.argsort(random.random_sample((self.ensembles, walkers)), axis=1)
        order += walkers * np.arange(self.ensembles)[:, None]
        share = random.random_sample()
        for movers, others in (
            (order[:, :half], order[:, half:]),
            (order[:, half:], order[:, :half]),
        ):
            q, factors = self._proposed(random, share, state.coords[movers], state.coords[others])
            flat = movers.ravel()
            log_prob, _ = model.compute_log_prob_fn(q.reshape(-1, n))
            with np.errstate(invalid="ignore"):
                ratio = factors.ravel() + log_prob - state.log_prob[flat]
            taken = ratio > np.log(1.0 - random.random_sample(len(flat)))
            moved = flat[taken]
            state.coords[moved] = q.reshape(-1, n)[taken]
            state.log_prob[moved] = log_prob[taken]
            accepted[moved] = True
        return state, accepted

    def _proposed(self, random: Any, share: float, q: Array, others: Array) -> tuple[Array, Array]:
        """Propose for q (E, W, n) by the other half; returns log factors (E, W) too."""
        ensembles, walkers, n = q.shape
        rows = np.arange(ensembles)[:, None]
        count = others.shape[1]
        if share < SHARES[0]:
            z = (1.0 + (STRETCH - 1.0) * random.random_sample((ensembles, walkers))) ** 2 / STRETCH
            partner = others[rows, random.randint(count, size=(ensembles, walkers))]
            return partner + z[:, :, None] * (q - partner), (n - 1.0) * np.log(z)
        if share < SHARES[0] + SHARES[1]:
            first = random.randint(count, size=(ensembles, walkers))
            second = (first + random.randint(1, count, size=(ensembles, walkers))) % count
            whole = random.random_sample((ensembles, walkers, 1)) < WHOLE_DIFFERENCE
            gamma = np.where(whole, 1.0, 2.38 / np.sqrt(2.0 * n))
            gamma = gamma * (1.0 + JITTER * random.standard_normal((ensembles, walkers, 1)))
            step = gamma * (others[rows, first] - others[rows, second])
            return q + step, np.zeros((ensembles, walkers))
        flat = q.reshape(-1, n)
        new, density = self.proposal.draw(random, len(flat))
        factors = self.proposal.log_density(flat) - density
        return new.reshape(q.shape), factors.reshape(ensembles, walkers)
