"""Profile likelihood: hold one parameter, fit all others again, and see what that costs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from lobefit.fitting.information import labels, linear_value
from lobefit.fitting.point import PointFit
from lobefit.fitting.polish import polish
from lobefit.fitting.problem import Problem
from lobefit.fitting.projection import Coordinates

__all__ = ["LEVEL", "Profile", "restore_weights"]

Array = NDArray[np.float64]

LEVEL = 1.6449**2
"""Rise of -2 ln L at a one-sided limit of 95 %."""

# Steps of the search for a limit, each one fit of the other parameters.
WALK = 14
# How well its rise, as a root, is met.
CLOSE = 0.03


def restore_weights(fit: PointFit) -> None:
    """Put the weights back that a point was fitted with; other candidates had theirs since."""
    dataset = fit.problem.dataset
    if not dataset.has_likelihood:
        dataset.set_weights(np.ones(dataset.used.shape))
    elif dataset.uses_sigma:
        dataset.reset_weights()
    else:
        dataset.set_weights(1.0 / fit.sigma**2)


class Profile:
    """The rise of -2 ln L along one parameter, all others being fitted again.

    Parameters
    ----------
    fit : PointFit
        The best point; its dataset must have its weights, see `restore_weights`.
    name : str
        Which parameter, named as in the results.
    channel : int
        Of which channel, where it is not shared.
    scale : float
        Variance in units of the objective.

    Attributes
    ----------
    low, high, best : float
        Bounds and best point as positions: logarithms where the parameter is searched on
        that scale, roots likewise, else its values.
    """

    def __init__(self, fit: PointFit, name: str, channel: int, scale: float) -> None:
        self.fit, self.name, self.channel, self.scale = fit, name, channel, scale
        self.problem = Problem(fit.problem.candidate, fit.problem.dataset)
        self._t, self._c = fit.polished.t.copy(), fit.polished.c.copy()
        self._places: dict[float, tuple[float, Array, Array]] = {}
        self._lowest = fit.polished.value
        named = labels(self.problem, fit.polished.t)
        own = [p.name for p in self.problem.candidate.own]
        k = self.problem.program.n_basis
        self._bounds = (self.problem.scale.low.copy(), self.problem.scale.high.copy())
        if name in named:
            self._kind, self._index = "shared", named.index(name)
            self.low, self.high = (float(b[self._index]) for b in self._bounds)
            self.best = float(self._t[self._index])
        elif name in own:
            self._kind, self._index = "own", own.index(name)
            self.low = float(self.problem.own.low[self._index])
            self.high = float(self.problem.own.high[self._index])
            self.best = float(self._c[channel, k + self._index])
        else:
            self._kind, self._index = "linear", 0
            parameter = next(p for p in self.problem.candidate.solved if p.name == name)
            self.low, self.high = parameter.bounds
            self._make_coordinates()
            products = self.problem.candidate.model.coefficients
            self.best = linear_value(products, self._c[channel], name)

    def value(self, position: float) -> float:
        """Give the parameter at a position."""
        if self._kind == "linear":
            return position
        scale = self.problem.scale if self._kind == "shared" else self.problem.own
        t = np.zeros(len(scale.parameters))
        t[:] = np.where(scale.floor > 0.0, scale.low, t)
        t[self._index] = position
        return float(scale.to_parameters(t)[self._index])

    def _make_coordinates(self) -> None:
        """Choose coordinates one of which is the parameter, times a known factor."""
        problem, name = self.problem, self.name
        products = problem.candidate.model.coefficients
        alone = {names[0]: k for k, names in enumerate(products) if len(names) == 1}
        ratios = {names[1]: (names[0], k) for k, names in enumerate(products) if len(names) == 2}
        free = {p.name for p in problem.candidate.solved}
        self._ratio: tuple[int, int] | None = None
        self._factor = 1.0
        partner = next((r for r, (s, _) in ratios.items() if s == name and r in free), None)
        T = problem.linear.T
        if name in ratios and ratios[name][0] not in free:
            scale_name, k = ratios[name]
            self._factor = problem.candidate.fixed[scale_name]
            self._index = int(np.argmax(T[k] != 0.0))
            return
        if name not in ratios and partner is None:
            self._index = int(np.argmax(T[alone[name]] != 0.0))
            return
        # Scale and ratio are both free: columns a (their product) and b (the scale).
        a = ratios[name if name in ratios else str(partner)][1]
        b = alone[ratios[name][0] if name in ratios else name]
        pair = [j for j in range(T.shape[1]) if T[a, j] != 0.0 or T[b, j] != 0.0]
        self._index, self._ratio = pair[1], (a, b)
        self._pair = pair

    def _hold(self, position: float) -> None:
        """Set the bounds of the problem so that the parameter stays at a position."""
        problem, original = self.problem, self.fit.problem
        low, high = self._bounds[0].copy(), self._bounds[1].copy()
        if self._kind == "shared":
            low[self._index] = high[self._index] = position
            problem.scale.low, problem.scale.high = low, high
            return
        k = original.coordinates
        shape = (len(self._c), k.T.shape[1])
        below, above = (np.broadcast_to(b, shape).copy() for b in (k.low, k.high))
        column = self._index
        T = k.T
        if self._kind == "own":
            column += shape[1] - len(original.candidate.own)
        held = position * (self._factor if self._kind == "linear" else 1.0)
        if self._kind == "linear" and self._ratio is not None:
            a, b = self._ratio
            first, column = self._pair
            T = T.copy()
            T[:, self._pair] = 0.0
            is_ratio = original.candidate.model.coefficients[b] != (self.name,)
            # Other channels may leave the bounds of the ratio here, and lose nothing by it.
            below[:, self._pair], above[:, self._pair] = (0.0, 0.0), (np.inf, np.inf)
            if is_ratio:  # c_a = ratio c_b + the rest, which is 0
                T[b, first], T[a, first], T[a, column] = 1.0, position, 1.0
                below[:, column], held = -np.inf, 0.0
            else:  # c_b is the scale, and c_a at most M times it
                T[a, first], T[b, column] = 1.0, 1.0
                bound = k.T[a].max()
                above[self.channel, first] = bound * position
        below[self.channel, column] = above[self.channel, column] = held
        size = original.linear.T.shape[1]
        problem.coordinates = Coordinates(T, k.c0, below, above)
        problem.linear = replace(original.linear, T=T[: len(original.linear.T), :size])

    def rise(self, position: float) -> float:
        """Give the rise of -2 ln L at a position, from the nearest one that is known."""
        near = min(self._places, key=lambda p: abs(p - position), default=None)
        _, t, c = self._places[near] if near is not None else (0.0, self._t, self._c)
        if self._kind == "shared":
            t = t.copy()
            t[self._index] = position
        self._hold(position)
        # Far from the best point a coefficient may overflow; its rise is then no limit.
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            found = polish(self.problem, t, c, self.fit.dof)
        if not np.isfinite(found.value):
            return float("inf")
        self._places[position] = (found.value, found.t, found.c)
        self._lowest = min(self._lowest, found.value)
        return (found.value - self._lowest) / self.scale

    def changes(self, position: float) -> Array | None:
        """Give how far the model's values are from the best ones at a position tried, (C, N)."""
        if position not in self._places:
            return None
        _, t, c = self._places[position]
        moved: Array = self.problem.values(t, c) - self.fit.values
        return moved

    def limit(self, side: int, guess: float, level: float = LEVEL) -> float | None:
        """Find where -2 ln L has risen by a level.

        Parameters
        ----------
        side : {-1, 1}
            Below or above the best point.
        guess : float
            A likely distance from it, as a position.
        level : float
            The rise; more than `LEVEL` where the noise itself is hardly known.

        Returns
        -------
        float or None
            The position; None where the likelihood does not fall so far before the bound.
        """
        end = self.high if side > 0 else self.low
        target = float(np.sqrt(level))
        inner, outer = (self.best, 0.0), None
        for k in range(WALK):
            if outer is None:
                place = self.best + side * guess * 2.0**k
                if (place - end) * side >= 0.0:
                    place = end
            else:
                # The root of the rise is nearly a straight line.
                share = (target - inner[1]) / max(outer[1] - inner[1], 1e-12)
                place = inner[0] + float(np.clip(share, 0.1, 0.9)) * (outer[0] - inner[0])
            root = float(np.sqrt(max(self.rise(place), 0.0)))
            if abs(root - target) < CLOSE * target:
                return place
            if root > target:
                outer = (place, root)
            elif place == end:
                return None
            else:
                inner = (place, root)
        return None if outer is None else outer[0]
