"""Posteriors against each other: moves, walkers and length, and how far quantiles are off."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lobefit.fitting.fit import fit
from lobefit.fitting.laplace import laplace, starts
from lobefit.fitting.likelihood import Density
from lobefit.fitting.measurement import Measurement
from lobefit.fitting.posterior import Posterior
from lobefit.fitting.sample import sample
from lobefit.fitting.sampler import SamplingProgress
from lobefit.fitting.tradeoff_points import Panel, Point, Spread
from lobefit.fitting.tradeoff_subject import every
from lobefit.fitting.tradeoff_timing import Clock
from lobefit.kernels import Device, candidate

__all__ = ["posterior_panel", "quantile_error"]

Array = NDArray[np.float64]

QUANTILES = (0.05, 0.5, 0.95)
# Steps that count, of the run that the others are held against.
LONG = 1500
# Steps after the program's own warm-up, and steps in all of emcee's moves.
OWN_LENGTHS = (50, 200, 800)
LENGTHS = (100, 300, 900)
WALKERS = (32, 96)
# Share of emcee's steps that does not count.
WARM_UP = 0.25
# More numbers take longer than this panel should, and more rows say no more about sampling.
MOST_SIZE, MOST_ROWS = 10, 2000
MOST_REPEATS = 5


def quantile_error(draws: Array, reference: Array) -> float:
    """Give how far the 5, 50 and 95 % quantiles are off.

    Parameters
    ----------
    draws, reference : ndarray, shapes (M, n) and (L, n)
        Of n parameters.

    Returns
    -------
    float
        Root mean square over quantiles and parameters, in the reference's standard deviations.
    """
    off = np.quantile(draws, QUANTILES, axis=0) - np.quantile(reference, QUANTILES, axis=0)
    scale = reference.std(axis=0)
    return float(np.sqrt(np.mean((off / np.where(scale > 0.0, scale, 1.0)) ** 2)))


def _smaller(m: Measurement, size: Callable[[Measurement], int]) -> tuple[Measurement, str]:
    """Keep what a quick panel needs: few rows, and one channel where several are too many."""
    notes = []
    step = -(-m.n_directions // MOST_ROWS)
    thinned = every(m, step) if step > 1 else m
    if thinned is not m:
        m = m.select(slice(None, None, step)) if thinned is None else thinned
        notes.append(f"{m.n_directions:,} of its directions")
    if m.n_channels > 1 and size(m) > MOST_SIZE:
        sigma = None if m.sigma is None else m.sigma[:1]
        m = replace(m, values=m.values[:1], channels=m.channels[:1], sigma=sigma)
        notes.append(f"the channel {m.channels[0]} only")
    return m, ", ".join(notes)


def _draws(posterior: Posterior, coordinates: Array) -> Array:
    flat = coordinates.reshape(-1, coordinates.shape[-1])
    return np.asarray(posterior.space.transforms.to_parameters(flat))


def posterior_panel(
    name: str,
    measurement: Measurement,
    device: Device,
    *,
    repeats: int,
    seed: int,
    clock: Clock,
    tell: Callable[[int, int, str], None],
) -> Panel:
    """Measure ways to sample one model's posterior.

    Parameters
    ----------
    name : str
        A candidate.
    measurement : Measurement
    device : Device
    repeats : int
        Runs of each way, with seeds of their own.
    seed : int
        Of the long run; the others count on from it.
    clock, tell : callable
        Gives seconds; is told (done, total, label).

    Returns
    -------
    Panel
    """

    def size(m: Measurement) -> int:
        noise = 0 if m.sigma is not None else 2
        return candidate(name).n_parameters(m.n_channels) + noise * m.n_channels

    data, kept = _smaller(measurement, size)
    result = fit(data, [name], device=device).best
    noise: Any = "given" if result.noise.given else "fit"
    settings: dict[str, Any] = {"noise": noise, "correlation": "ignore", "device": device}

    def stands(state: SamplingProgress) -> None:
        tell(0, repeats, f"a long posterior of {name}, step {state.steps:,}")

    long = sample(
        result, data, seed=seed, steps=LONG, max_steps=10 * LONG, progress=stands, **settings
    )
    reference = _draws(long, long.chain)
    repeats = min(repeats, MOST_REPEATS)
    found: dict[tuple[str, int, int], list[tuple[float, float]]] = {}
    for repeat in range(repeats):
        tell(repeat, repeats, f"posteriors of {name}")
        own = seed + 1 + repeat
        for length in OWN_LENGTHS:
            began = clock()
            made = sample(result, data, seed=own, steps=length, ensembles=2, **settings)
            took = clock() - began
            error = quantile_error(_draws(made, made.chain), reference)
            key = ("mixed", made.chain.shape[1] * made.chain.shape[2], length)
            found.setdefault(key, []).append((took, error))
        for moves in ("stretch", "DE"):
            for walkers in WALKERS:
                taken = _emcee(moves, walkers, own, long, data, device, clock)
                for length, (took, chain) in taken.items():
                    error = quantile_error(_draws(long, chain), reference)
                    found.setdefault((moves, walkers, length), []).append((took, error))
    return Panel(
        name="posterior",
        title=f"How to sample {name}",
        seconds_label="time of the run, warm-up included [s]",
        error_label="error of the quantiles [posterior sd]",
        points=tuple(
            Point(
                label=_label(*key),
                group=key[0],
                seconds=Spread(tuple(took for took, _ in runs)),
                error=Spread(tuple(error for _, error in runs)),
                settings={
                    "candidate": name,
                    "moves": key[0],
                    "walkers": key[1],
                    "steps": key[2],
                    "noise": noise,
                    "seeds": [seed + 1 + k for k in range(repeats)],
                },
                usual=key[0] == "mixed" and key[2] == OWN_LENGTHS[-1],
            )
            for key, runs in found.items()
        ),
        notes=(
            (
                "error: root mean square over the parameters of the 5, 50 and 95 % quantiles' errors "
                f"against {len(reference):,} draws, of which {long.effective:,.0f} count as independent "
                f"(seed {seed}); bars: other seeds"
            ),
            (
                "mixed: the program's own moves after its warm-up; stretch and DE: emcee's, "
                f"{WARM_UP:.0%} of the steps do not count{'; ' + kept if kept else ''}"
            ),
        ),
    )


def _label(moves: str, walkers: int, length: int) -> str:
    return f"{moves}, {walkers} walkers x {length} steps"


def _emcee(
    moves: str,
    walkers: int,
    seed: int,
    long: Posterior,
    data: Measurement,
    device: Device,
    clock: Clock,
) -> dict[int, tuple[float, Array]]:
    """Run emcee's own moves; gives seconds and steps that count by length of the run."""
    import emcee

    n = long.space.size
    walkers = max(walkers, 2 * n + 2)
    chosen: Any = [(emcee.moves.StretchMove(), 1.0)]
    if moves == "DE":
        chosen = [(emcee.moves.DEMove(), 0.8), (emcee.moves.DESnookerMove(), 0.2)]
    density = Density(long.space, data, device, sigma=data.sigma, power=long.power)
    best = long.chain.reshape(-1, n)[int(np.argmax(long.log_prob))]
    found: dict[int, tuple[float, Array]] = {}
    try:
        approximation = laplace(density, best)
        random = np.random.RandomState(seed)
        points, values = starts(density, approximation, (1, walkers), random)
        sampler = emcee.EnsembleSampler(walkers, n, density, moves=chosen, vectorize=True)
        state = emcee.State(points[0], log_prob=values[0], random_state=random.get_state())
        began = clock()
        for made, _ in enumerate(sampler.sample(state, iterations=max(LENGTHS)), start=1):
            if made in LENGTHS:
                took = clock() - began
                found[made] = (took, np.array(sampler.get_chain()[int(WARM_UP * made) :]))
    finally:
        density.release()
    return found
