"""Posteriors of an anisotropic GGX surface, 8 numbers, against emcee with a numpy likelihood.

``python -m benchmarks.posterior [SIZE ...]`` prints the table; `benchmarks.nuts` has NUTS beside it.

One channel; the noise's two scales are sampled. Both sides sample the same coordinates under the
same priors. The numpy likelihood is vectorised over directions in blocks that stay in the
second-level cache, into buffers allocated once; its quadratic forms are products of matrices.
emcee has its defaults (stretch moves, 32 walkers).

- "log-probabilities": a batch of 64 sets of parameters, interleaved rounds; rates by the fastest
  round, which neighbours on the machine disturb least, ratios as medians of rounds.
- "error": how far single precision is off the double one among the 64, after their mean: what
  moves of the sampler feel.
- "effective samples": the smallest bulk or tail size of the 8 numbers per second. Lobefit's is that of
  `sample` as a user calls it, approximation and warm-up included. For emcee it is 32 walkers over
  the autocorrelation time of stretch moves on this posterior, times the steps that its
  likelihood allows per second: no burn-in is counted.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence
from typing import Any

import emcee
import numpy as np
from numpy.typing import DTypeLike, NDArray

from benchmarks.numpy_models import Geometry
from benchmarks.timing import cores, interleave, ratio
from lobefit.fitting import Measurement, fit, sample
from lobefit.fitting.chains import autocorrelation_time
from lobefit.fitting.likelihood import Density
from lobefit.fitting.posterior import Posterior
from lobefit.kernels import evaluate, get_device

__all__ = ["NumpyDensity", "main", "run", "sampled", "sizes_asked", "table", "tangents"]

Array = NDArray[np.float64]

MODEL = "ggx_anisotropic"
TRUTH = {
    "k_d": 0.1,
    "k_s": 0.5,
    "F0": 0.3,
    "alpha_x": 0.3,
    "alpha_y": 0.12,
    "phi_x": 0.6,
}
SIZES = (1_000, 16_000, 160_000)
SETS = 64
BLOCK = 8192
NOISE = (0.02, 1e-3)
WALKERS = 32
STEPS = 4000


def simulated(n: int) -> Measurement:
    """Scatter directions over the hemisphere to 80 degrees, half of them near the mirror."""
    rng = np.random.default_rng(11)
    top = np.cos(np.radians(80.0))
    theta_i, theta_o = np.arccos(rng.uniform(top, 1.0, (2, n)))
    phi_i, phi_o = rng.uniform(0.0, 2 * np.pi, (2, n))
    near = rng.uniform(size=n) < 0.5
    theta_o[near] = np.clip(theta_i[near] + 0.2 * rng.standard_normal(near.sum()), 0.0, 1.4)
    phi_o[near] = phi_i[near] + np.pi + 0.2 * rng.standard_normal(near.sum())
    clean = evaluate(MODEL, TRUTH, theta_i, phi_i, theta_o, phi_o)
    noise = np.hypot(NOISE[0] * clean, NOISE[1])
    return Measurement(
        theta_i,
        phi_i,
        theta_o,
        phi_o,
        clean + noise * rng.standard_normal(clean.shape),
        ("brdf",),
    )


def tangents(g: Geometry, m: Measurement) -> tuple[Array, ...]:
    """Give the tangential parts of both directions, and the half vector's slopes: i, o, s."""
    i_x, i_y = np.sin(m.theta_i) * np.cos(m.phi_i), np.sin(m.theta_i) * np.sin(m.phi_i)
    o_x, o_y = np.sin(m.theta_o) * np.cos(m.phi_o), np.sin(m.theta_o) * np.sin(m.phi_o)
    return i_x, i_y, o_x, o_y, g.h_x / g.n_h, g.h_y / g.n_h


def sampled(n: int) -> tuple[Measurement, Posterior, float]:
    """Sample the posterior of so many values as a user would; gives the seconds it took too."""
    m = simulated(n)
    result = fit(m, MODEL).best
    sample(result, m, seed=1, steps=20)  # compiles
    began = time.perf_counter()
    posterior = sample(result, m, seed=1)
    return m, posterior, time.perf_counter() - began


def sizes_asked(module: str, doc: str | None, usual: Sequence[int]) -> tuple[int, ...]:
    """Read the sizes from the command line."""
    parser = argparse.ArgumentParser(prog=f"python -m {module}", description=doc)
    parser.add_argument("sizes", nargs="*", type=int, metavar="SIZE", help="numbers of samples")
    return tuple(parser.parse_args().sizes) or tuple(usual)


class NumpyDensity:
    """The same log-probability in numpy, for emcee's ``vectorize=True``.

    Parameters
    ----------
    density : Density
        Whose space it has.
    dtype : dtype
        Precision of everything over directions.
    """

    def __init__(self, density: Density, dtype: DTypeLike) -> None:
        self._space, m = density.space, density.measurement
        g = Geometry.of(m.theta_i, m.phi_i, m.theta_o, m.phi_o)
        i_x, i_y, o_x, o_y, s_x, s_y = tangents(g, m)

        def kept(*rows: Array) -> NDArray[Any]:
            return np.ascontiguousarray(np.stack(rows), dtype=dtype)

        self._i = kept(g.n_i**2, i_x**2, 2 * i_x * i_y, i_y**2)
        self._o = kept(g.n_o**2, o_x**2, 2 * o_x * o_y, o_y**2)
        self._s = kept(np.ones_like(s_x), s_x**2, 2 * s_x * s_y, s_y**2)
        self._rows = kept(2 * g.n_o, 2 * g.n_i, (1 + g.tan2_h) ** 2 / np.pi, g.schlick, m.values[0])
        self._buffers = np.empty((3, BLOCK), dtype=dtype)
        self._count = m.n_directions

    def __call__(self, q: Array) -> Array:
        """Give the log-probabilities of q, shape (W, n)."""
        space = self._space
        theta = space.transforms.to_parameters(q)
        total = space.log_prior(q, theta)
        columns = [space.labels.index(n) for n in (*TRUTH, "noise_additive", "noise_relative")]
        for w in np.flatnonzero(np.isfinite(total)):
            total[w] += self._log_likelihood(*theta[w, columns])
        return total

    def _log_likelihood(
        self,
        k_d: float,
        k_s: float,
        F0: float,
        alpha_x: float,
        alpha_y: float,
        phi_x: float,
        additive: float,
        relative: float,
    ) -> float:
        cos, sin = np.cos(phi_x), np.sin(phi_x)

        def form(x: float, y: float) -> NDArray[Any]:
            both = [1.0, x * cos**2 + y * sin**2, (x - y) * cos * sin, x * sin**2 + y * cos**2]
            return np.array(both, dtype=self._rows.dtype)

        wide, narrow = form(alpha_x**2, alpha_y**2), form(alpha_x**-2.0, alpha_y**-2.0)
        scale = k_s / (alpha_x * alpha_y)
        total = 0.0
        for first in range(0, self._count, BLOCK):
            rows = slice(first, min(first + BLOCK, self._count))
            a, b, c = self._buffers[:, : rows.stop - first]
            n_o2, n_i2, top, s, y = self._rows[:, rows]
            np.dot(wide, self._i[:, rows], out=a)
            np.sqrt(a, out=a)
            a *= n_o2
            np.dot(wide, self._o[:, rows], out=b)
            np.sqrt(b, out=b)
            b *= n_i2
            a += b  # the divisor of masking
            np.dot(narrow, self._s[:, rows], out=b)
            b *= b
            b *= a
            np.multiply(s, scale * (1.0 - F0), out=a)
            a += scale * F0
            a *= top
            a /= b
            a += k_d / np.pi  # the model
            np.multiply(a, relative, out=b)
            b *= b
            b += additive**2  # the variance
            np.subtract(y, a, out=a)
            a *= a
            np.divide(a, b, out=c)
            np.log(b, out=b)
            c += b
            total += float(c.sum(dtype=np.float64))
        return -0.5 * (total + self._count * float(np.log(2 * np.pi)))


def run(rounds: int = 7, sizes: tuple[int, ...] = SIZES) -> dict[str, Any]:
    """Measure every size; returns a JSON-able record."""
    return {"cores": cores(), "sizes": {str(n): _run_size(n, rounds) for n in sizes}}


def _run_size(n: int, rounds: int) -> dict[str, Any]:
    m, posterior, seconds = sampled(n)
    density = Density(posterior.space, m, get_device())
    double = NumpyDensity(density, np.float64)
    single = NumpyDensity(density, np.float32)
    q = posterior.chain[-1].reshape(-1, posterior.space.size)[:SETS]
    theta = posterior.space.transforms.to_parameters(q)
    difference = density(q) - double(q)
    tasks = {
        "lobefit": lambda: density(q),
        "on the device": lambda: density.log_likelihood(theta),
        "numpy double": lambda: double(q),
        "numpy single": lambda: single(q),
    }
    times = interleave(tasks, rounds=rounds, least_s=0.02)
    stretch = _stretch(density, posterior)
    density.release()
    rates = {name: SETS / min(t.wall) for name, t in times.items()}
    ess = posterior.effective / seconds
    plain = {
        name: WALKERS / stretch / (WALKERS / rates[name])
        for name in ("numpy double", "numpy single")
    }
    launched = posterior.evaluations / rates["on the device"]
    return {
        "log_probabilities_per_s": rates,
        "ratio_double": ratio(times["numpy double"], times["lobefit"]),
        "ratio_single": ratio(times["numpy single"], times["lobefit"]),
        "largest_difference": float(np.max(np.abs(difference))),
        "error": float(np.max(np.abs(difference - difference.mean()))),
        "converged": posterior.converged,
        "reason": posterior.reason,
        "steps": len(posterior.chain),
        "warm_up": posterior.warm_up,
        "tau": max(posterior.tau.values()),
        "tau_stretch": stretch,
        "precision": posterior.precision,
        "effective": posterior.effective,
        "seconds": seconds,
        "ess_per_s": ess,
        "ess_per_s_numpy": plain,
        "ess_ratio": {name: ess / rate for name, rate in plain.items()},
        "share_of_launches": min(launched / seconds, 1.0),
    }


def _stretch(density: Density, posterior: Posterior) -> float:
    """Measure the longest autocorrelation time of emcee's default moves, from a warm start."""
    n = posterior.space.size
    start = posterior.chain[-1].reshape(-1, n)[:WALKERS]
    sampler = emcee.EnsembleSampler(WALKERS, n, density, vectorize=True)
    sampler.random_state = np.random.RandomState(1).get_state()
    steps = STEPS if density.measurement.n_directions < 50_000 else STEPS // 2
    sampler.run_mcmc(start, steps)
    chain = sampler.get_chain()[:, None]
    return max(autocorrelation_time(chain[..., k]) for k in range(n))


def table(record: dict[str, Any]) -> str:
    """Write the figures as Markdown."""
    head = (
        "samples",
        "log-probabilities/s: lobefit",
        "numpy double",
        "numpy single",
        "ratio to double, single",
        "error",
        "effective samples/s: lobefit",
        "emcee, numpy double",
        "numpy single",
        "ratio to double, single",
        "tau: lobefit, stretch",
        "in launches",
    )
    lines = [f"| {' | '.join(head)} |", "|" + "---|" * len(head)]
    for n, r in record["sizes"].items():
        rate, plain, more = (
            r["log_probabilities_per_s"],
            r["ess_per_s_numpy"],
            r["ess_ratio"],
        )
        lines.append(
            f"| {int(n):,} | {rate['lobefit']:,.0f} | {rate['numpy double']:,.0f} | "
            f"{rate['numpy single']:,.0f} | {r['ratio_double']:.1f}, {r['ratio_single']:.1f} | "
            f"{r['error']:.1e} | "
            f"{r['ess_per_s']:,.0f} | {plain['numpy double']:,.1f} | {plain['numpy single']:,.1f} | "
            f"{more['numpy double']:.0f}, {more['numpy single']:.0f} | "
            f"{r['tau']:.1f}, {r['tau_stretch']:.0f} | {100 * r['share_of_launches']:.0f} % |"
        )
    return "\n".join(lines)


def main() -> None:
    """Run the sizes that were asked for, or all."""
    print(table(run(sizes=sizes_asked("benchmarks.posterior", __doc__, SIZES))))


if __name__ == "__main__":
    main()
