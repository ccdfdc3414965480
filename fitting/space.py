"""The space that a posterior is sampled in: free parameters, noise, priors, coordinates."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from lobefit.fitting.priors import (
    NOISE_PRIORS,
    HalfNormal,
    LogNormal,
    LogUniform,
    Lomax,
    Normal,
    Prior,
    Uniform,
    default_prior,
)
from lobefit.fitting.transforms import Lever, NoisePair, Transforms, Way
from lobefit.kernels import Candidate, ModelError, Parameter

__all__ = ["Arguments", "Coordinate", "NoiseModel", "Space"]

Array = NDArray[np.float64]
NoiseModel = Literal["fit", "scaled", "given"]
NOISE_NAMES: dict[NoiseModel, tuple[str, ...]] = {
    "fit": ("noise_additive", "noise_relative"),
    "scaled": ("sigma_scale",),
    "given": (),
}
# Priors whose densities of several coordinates are computed together.
STACKED = (Uniform, LogUniform, Lomax, LogNormal, Normal, HalfNormal)


@dataclass(frozen=True, slots=True)
class Coordinate:
    """One number that is sampled.

    Attributes
    ----------
    name : str
        Of the model's parameter, or "noise_relative", "noise_additive", "sigma_scale", "nu".
    channel : int or None
        The channel it belongs to; None for one of all channels.
    label : str
        Such as ``alpha``, or ``k_d[R]`` where there are several channels.
    prior : Prior
    parameter : Parameter or None
        Of the model; None for the noise.
    """

    name: str
    channel: int | None
    label: str
    prior: Prior
    parameter: Parameter | None = None

    def value_in(self, params: Mapping[str, float | list[float]]) -> float:
        """Give this number of a fitted model's parameters."""
        value = np.ravel(params[self.name])
        return float(value[self.channel or 0] if len(value) > 1 else value[0])


@dataclass(frozen=True, slots=True)
class Arguments:
    """What the likelihood takes, for W walkers; see `lobefit.kernels.likelihood.Likelihood`."""

    x: Array
    coefficients: Array
    additive: Array | None = None
    relative: Array | None = None
    scale: Array | None = None
    nu: Array | None = None


class Space:
    """The free parameters of a candidate and of the noise.

    Parameters
    ----------
    candidate : Candidate
        What is sampled; held and tied parameters stay so.
    channels : sequence of str
        Names.
    noise : {"fit", "scaled", "given"}
        Scales of the noise in each channel; a factor on given sigmas; or nothing.
    student : bool
        Student's t, whose nu is sampled.
    priors : mapping of str to Prior, optional
        In place of the default ones, by parameter's name.
    centres : mapping of str to float, optional
        Where angles are centred; the middle of their range where left out.
    information : ndarray, shape (C, K, K), optional
        What the data know of the coefficients: sums of weighted products of the basis
        functions. With them a ratio such as F0 that the data leave open is sampled well.
    levels : ndarray, shape (C,), optional
        Typical values in 1/sr. With them scales of noise that cannot be told apart are.

    Attributes
    ----------
    coordinates : tuple of Coordinate
        In the order of the columns of q and theta.
    transforms : Transforms

    Raises
    ------
    ModelError
        A prior for what is not sampled, or one that leaves nothing of a parameter's range.
    """

    def __init__(
        self,
        candidate: Candidate,
        channels: Sequence[str],
        *,
        noise: NoiseModel = "fit",
        student: bool = False,
        priors: Mapping[str, Prior] | None = None,
        centres: Mapping[str, float] | None = None,
        information: Array | None = None,
        levels: Array | None = None,
    ) -> None:
        self.candidate, self.channels, self.noise = candidate, tuple(channels), noise
        self.student = student
        own = dict(priors or {})
        found: list[Coordinate] = []
        ways: list[Way] = []
        for p in (*candidate.searched, *candidate.solved):
            prior = own.pop(p.name, None) or default_prior(p)
            ways += [_way(p, prior, centres or {})] * (len(self.channels) if p.per_channel else 1)
            found += self._coordinates(p.name, prior, p, each=p.per_channel)
        for name in NOISE_NAMES[noise]:
            prior = own.pop(name, NOISE_PRIORS[name])
            ways += [Way(max(prior.support[0], 0.0), prior.support[1])] * len(self.channels)
            found += self._coordinates(name, prior, None, each=True)
        if student:
            prior = own.pop("nu", NOISE_PRIORS["nu"])
            ways.append(Way(max(prior.support[0], 0.0), prior.support[1]))
            found += self._coordinates("nu", prior, None, each=False)
        if own:
            names = ", ".join(dict.fromkeys(c.name for c in found))
            raise ModelError(
                f"a prior is given for {next(iter(own))!r}, which is not sampled; these are: {names}"
            )
        self.coordinates = tuple(found)
        self._index = {(c.name, c.channel): k for k, c in enumerate(found)}
        pairs = []
        for c, level in enumerate(levels if levels is not None and noise == "fit" else ()):
            a, r = (self._index[name, c] for name in NOISE_NAMES["fit"])
            if ways[a] == ways[r] == Way(0.0, np.inf) and level > 0.0:
                pairs.append(NoisePair(a, r, float(level)))
        self.transforms = Transforms(ways, self._levers(ways, information), pairs)
        self._stack_priors()
        self._gather()
        self._order = [
            (self._index[a, None], self._index[b, None])
            for a, b in candidate.descending
            if (a, None) in self._index and (b, None) in self._index
        ]

    def _coordinates(
        self, name: str, prior: Prior, parameter: Parameter | None, *, each: bool
    ) -> list[Coordinate]:
        if not each:
            return [Coordinate(name, None, name, prior, parameter)]
        several = len(self.channels) > 1
        return [
            Coordinate(name, c, f"{name}[{channel}]" if several else name, prior, parameter)
            for c, channel in enumerate(self.channels)
        ]

    @property
    def size(self) -> int:
        """Number of coordinates."""
        return len(self.coordinates)

    @property
    def labels(self) -> tuple[str, ...]:
        """Labels of the coordinates."""
        return tuple(c.label for c in self.coordinates)

    def column(self, name: str, channel: int | None) -> int | None:
        """Find the column of a parameter (in a channel); None where it is not sampled."""
        own = self._index.get((name, channel))
        return self._index.get((name, None)) if own is None else own

    def _levers(self, ways: Sequence[Way], information: Array | None) -> list[Lever]:
        """Pair scales with their ratios, by the combination that the data know best."""
        if information is None:
            return []
        products = self.candidate.model.coefficients
        levers = []
        for k, names in enumerate(products):
            if len(names) < 2:
                continue
            for c in range(len(self.channels)):
                scale, ratio = self._index.get((names[0], c)), self._index.get((names[1], c))
                if scale is None or ratio is None or ways[scale] != Way(0.0, np.inf):
                    continue
                pair = np.ix_([c], [k, products.index(names[:1])], [k, products.index(names[:1])])
                along, beside = np.abs(np.linalg.eigh(information[pair][0])[1][:, -1])
                levers.append(Lever(scale, ratio, float(along), float(beside)))
        return levers

    def _stack_priors(self) -> None:
        """Put priors of one kind together, so that their densities are one operation."""
        groups: dict[type, list[int]] = {}
        self._densities: list[tuple[NDArray[np.intp], Prior]] = []
        for k, c in enumerate(self.coordinates):
            if type(c.prior) in STACKED:
                groups.setdefault(type(c.prior), []).append(k)
            else:
                self._densities.append((np.array([k]), c.prior))
        for kind, columns in groups.items():
            members = [self.coordinates[k].prior for k in columns]
            fields = dataclasses.fields(kind)
            stacked = kind(*(np.array([getattr(p, f.name) for p in members]) for f in fields))
            self._densities.append((np.array(columns), stacked))

    def _gather(self) -> None:
        """Note where the likelihood's arguments stand among theta, held values and 1."""
        model, n = self.candidate.model, self.size
        held = [1.0]

        def place(name: str, channel: int) -> int:
            column = self.column(self.candidate.tied.get(name, name), channel)
            if column is None:
                held.append(self.candidate.fixed[name])
                return n + len(held) - 1
            return column

        channels = range(len(self.channels))
        products = [(*names, *[""] * (2 - len(names))) for names in model.coefficients]
        self._factors = np.array(
            [[[place(m, c) if m else n for m in pair] for pair in products] for c in channels]
        )
        rows = [[place(p.name, c) for p in model.nonlinear] for c in channels]
        same = all(row == rows[0] for row in rows)
        self._x = np.array(rows[0] if same else rows, dtype=np.intp)
        self._held = np.array(held)
        self._noise = {
            name: np.array([self._index[name, c] for c in channels])
            for name in NOISE_NAMES[self.noise]
        }

    def log_prior(self, q: Array, theta: Array) -> Array:
        """Give the logarithm of the prior density of q, shape (W,); -inf where it is 0."""
        total = self.log_density(theta) + self.transforms.log_jacobian(q, theta)
        total[~self.transforms.inside(q)] = -np.inf
        return total

    def log_density(self, theta: Array) -> Array:
        """Give the logarithm of the prior density of theta (W, n), shape (W,)."""
        total = np.zeros(len(theta))
        for columns, prior in self._densities:
            total += prior.log_density(theta[:, columns]).sum(axis=1)
        for larger, smaller in self._order:
            total[theta[:, larger] < theta[:, smaller]] = -np.inf
        return total

    def arguments(self, theta: Array) -> Arguments:
        """Give the likelihood's arguments for theta of shape (W, n)."""
        every = np.concatenate(
            [theta, np.broadcast_to(self._held, (len(theta), len(self._held)))], 1
        )
        pairs = every[:, self._factors]
        noise = {name: theta[:, columns] for name, columns in self._noise.items()}
        return Arguments(
            x=every[:, self._x],
            coefficients=pairs[..., 0] * pairs[..., 1],
            additive=noise.get("noise_additive"),
            relative=noise.get("noise_relative"),
            scale=noise.get("sigma_scale"),
            nu=theta[:, self._index["nu", None]] if self.student else None,
        )

    def draw(self, rng: np.random.Generator, size: int) -> Array:
        """Draw theta from the prior, shape (size, n): bounds and the order of labels hold."""
        kept: list[Array] = []
        while sum(map(len, kept)) < size:
            theta = np.stack([c.prior.draw(rng, size) for c in self.coordinates], axis=1)
            good = np.isfinite(self.log_density(theta))
            for k, c in enumerate(self.coordinates):
                low, high = c.parameter.bounds if c.parameter else (0.0, np.inf)
                good &= (theta[:, k] >= low) & (theta[:, k] <= high)
            kept.append(theta[good])
        return np.concatenate(kept)[:size]

    def params(self, theta: Array) -> dict[str, float | list[float]]:
        """Give the model's parameters by name for one theta, shape (n,), as `evaluate` takes them."""
        found: dict[str, float | list[float]] = {}
        for p in self.candidate.model.parameters:
            leader = self.candidate.tied.get(p.name, p.name)
            if leader in self.candidate.fixed:
                found[p.name] = self.candidate.fixed[leader]
                continue
            columns = [self.column(leader, c) for c in range(len(self.channels))]
            values = [float(theta[k]) for k in columns if k is not None]
            own = p.per_channel and len(values) > 1
            value = values if own else values[0]
            if p.period:
                low = p.bounds[0]
                value = low + float(np.mod(values[0] - low, p.period))
            found[p.name] = value
        return found


def _way(p: Parameter, prior: Prior, centres: Mapping[str, float]) -> Way:
    """Choose the transform of a model's parameter under a prior."""
    if p.period:
        return Way(centre=centres.get(p.name, p.bounds[0] + 0.5 * p.period), period=p.period)
    low, high = (f(a, b) for f, a, b in zip((max, min), p.bounds, prior.support, strict=True))
    if not low < high:
        raise ModelError(f"the prior of {p.name} leaves nothing of its range {p.bounds}")
    return Way(float(low), float(high), logarithmic=p.scale == "log")
