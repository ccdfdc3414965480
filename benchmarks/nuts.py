"""Effective samples per second beside NUTS of numpyro: ``python -m benchmarks.nuts [SIZE ...]``.

The posterior is that of `benchmarks.posterior`: an anisotropic GGX surface, 8 numbers, one channel.
NUTS samples the same coordinates under the same priors, with the likelihood written in JAX (double
precision, compiled, gradients by differentiation); two chains, one on each of two devices that
JAX makes of the CPU. It gets what a careful user would give it: a dense mass matrix, a start at the
mode, and coordinates that Lobefit's Laplace approximation has made round and of size 1. (In the
others, whose deviations are 1e-3, its adaptation shrinks the mass matrix to a constant that is too
large for them, and each draw takes 4 to 10 times the gradients.) Both log-probabilities are
compared before anything is timed. The smallest bulk or tail effective sample size
of the 8 numbers comes from one estimator (`lobefit.fitting.chains`). Compilation is not counted
for either; ``with warm-up`` counts Lobefit's Laplace approximation and warm-up, and NUTS's adaptation.

numpyro and jax are no dependencies of the project: install them beside it to run this.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.numpy_models import Geometry
from benchmarks.posterior import SIZES, sampled, sizes_asked, tangents
from lobefit.fitting.chains import bulk_ess, tail_ess
from lobefit.fitting.laplace import Laplace, laplace
from lobefit.fitting.likelihood import Density
from lobefit.fitting.measurement import Measurement
from lobefit.fitting.space import Space
from lobefit.kernels import get_device

__all__ = ["main", "run", "table"]

Array = NDArray[np.float64]

CHAINS = 2
# Steps of adaptation and draws of a chain.
STEPS = {1_000: (500, 1000), 16_000: (400, 600), 160_000: (200, 200)}


def _log_density(space: Space, m: Measurement) -> Callable[[Any], Any]:
    """Write the log-probability of q, shape (8,), in JAX, up to a constant."""
    import jax.numpy as jnp
    from jax.nn import log_sigmoid, sigmoid

    g = Geometry.of(m.theta_i, m.phi_i, m.theta_o, m.phi_o)
    top = (1 + g.tan2_h) ** 2 / np.pi
    rows = (g.n_i, g.n_o, *tangents(g, m), top, g.schlick, m.values[0])
    planes = [jnp.asarray(row) for row in rows]
    place = {name: k for k, name in enumerate(space.labels)}
    along_and_beside, beside, level = _weights(space, place)
    low, high = np.log(1e-4), np.log(2.0)

    def log_density(q: Any) -> Any:
        by = {name: q[k] for name, k in place.items()}
        k_d, F0 = jnp.exp(by["k_d"]), sigmoid(by["F0"])
        made = beside + (along_and_beside - beside) * F0
        k_s = jnp.exp(by["k_s"]) / made
        alpha = {n: jnp.exp(low + (high - low) * sigmoid(by[n])) for n in ("alpha_x", "alpha_y")}
        share = by["noise_relative"]
        both = jnp.exp(by["noise_additive"])
        additive = both * jnp.sqrt(sigmoid(share))
        relative = both * jnp.sqrt(sigmoid(-share)) / level
        # Priors on the physical scale, times the Jacobian; the alphas' is that of a logistic.
        total = -2.0 * (jnp.log1p(k_d) + jnp.log1p(k_s)) + by["k_d"] + by["k_s"] - jnp.log(made)
        for name in ("F0", "alpha_x", "alpha_y"):
            total += log_sigmoid(by[name]) + log_sigmoid(-by[name])
        total -= 2.0 * (jnp.log(0.01 + additive) + jnp.log(0.05 + relative))
        total += 2.0 * by["noise_additive"] + 0.5 * (log_sigmoid(share) + log_sigmoid(-share))

        n_i, n_o, i_x, i_y, o_x, o_y, s_x, s_y, top, schlick, y = planes
        cos, sin = jnp.cos(by["phi_x"]), jnp.sin(by["phi_x"])
        a_x, a_y = alpha["alpha_x"], alpha["alpha_y"]

        def wide(x: Any, y: Any) -> Any:
            return ((cos * x + sin * y) * a_x) ** 2 + ((cos * y - sin * x) * a_y) ** 2

        e = ((cos * s_x + sin * s_y) / a_x) ** 2 + ((cos * s_y - sin * s_x) / a_y) ** 2
        masking = n_o * jnp.sqrt(n_i**2 + wide(i_x, i_y)) + n_i * jnp.sqrt(n_o**2 + wide(o_x, o_y))
        lobe = top / ((1.0 + e) ** 2 * (2.0 * a_x * a_y) * masking)
        f = k_d / np.pi + k_s * (F0 + (1.0 - F0) * schlick) * lobe
        v = additive**2 + (relative * f) ** 2
        return total - 0.5 * jnp.sum((y - f) ** 2 / v + jnp.log(v))

    return log_density


def _weights(space: Space, place: dict[str, int]) -> tuple[float, float, float]:
    """Read off the transform what k_s is made of at F0 = 1 and 0, and the noise's level."""
    q = np.zeros((2, space.size))
    q[:, place["F0"]] = 40.0, -40.0
    theta = space.transforms.to_parameters(q)
    k_s, relative = theta[:, place["k_s"]], theta[0, place["noise_relative"]]
    return float(1.0 / k_s[0]), float(1.0 / k_s[1]), float(np.sqrt(0.5) / relative)


def _least(chains: Array) -> float:
    """Give the smallest effective sample size of draws (M, N, n)."""
    columns = range(chains.shape[-1])
    return min(min(bulk_ess(chains[..., k]), tail_ess(chains[..., k])) for k in columns)


def _nuts(density: Density, near: Laplace, warm_up: int, draws: int) -> dict[str, Any]:
    import jax
    from numpyro.infer import MCMC, NUTS

    log_density = _log_density(density.space, density.measurement)
    rng = np.random.default_rng(2)
    mode, root = near.mode, near.root
    points = mode + rng.standard_normal((8, len(mode))) @ root.T
    offset = np.asarray(jax.jit(jax.vmap(log_density))(points)) - density(points)
    kernel = NUTS(potential_fn=lambda z: -log_density(mode + root @ z), dense_mass=True)
    mcmc = MCMC(
        kernel,
        num_warmup=warm_up,
        num_samples=draws,
        num_chains=CHAINS,
        chain_method="parallel",
        progress_bar=False,
    )
    begin = np.zeros((CHAINS, len(mode)))
    seconds = {}
    for key in (1, 2):  # the first round compiles
        began = time.perf_counter()
        mcmc.warmup(jax.random.PRNGKey(key), init_params=begin)
        np.asarray(mcmc.last_state.z)  # waits
        seconds["warm_up"] = time.perf_counter() - began
        began = time.perf_counter()
        mcmc.run(jax.random.PRNGKey(10 + key), extra_fields=("num_steps", "diverging"))
        chains = mode + np.asarray(mcmc.get_samples(group_by_chain=True)) @ root.T
        seconds["draws"] = time.perf_counter() - began
    extra = mcmc.get_extra_fields()
    effective = _least(chains)
    return {
        "effective": effective,
        "warm_up_s": seconds["warm_up"],
        "draws_s": seconds["draws"],
        "ess_per_s": effective / seconds["draws"],
        "ess_per_s_with_warm_up": effective / sum(seconds.values()),
        "gradients_per_draw": float(np.mean(extra["num_steps"])),
        "divergent": int(np.sum(extra["diverging"])),
        # Up to a constant: how far the two log-probabilities differ among points.
        "difference": float(np.ptp(offset)),
        "mean": chains.mean(axis=(0, 1)).tolist(),
        "sd": chains.std(axis=(0, 1)).tolist(),
    }


def run(sizes: tuple[int, ...] = SIZES) -> dict[str, Any]:
    """Measure every size; returns a JSON-able record.

    Raises
    ------
    ImportError
        numpyro or jax is not installed.
    """
    # Before jax is imported: as many devices as chains.
    os.environ.setdefault("XLA_FLAGS", f"--xla_force_host_platform_device_count={CHAINS}")
    os.environ.setdefault("JAX_ENABLE_X64", "1")
    import numpyro  # noqa: F401

    return {"sizes": {str(n): _run_size(n) for n in sizes}}


def _run_size(n: int) -> dict[str, Any]:
    m, posterior, seconds = sampled(n)
    counted = len(posterior.chain)
    after = posterior.seconds * counted / (counted + posterior.warm_up)
    density = Density(posterior.space, m, get_device(), precision="double")
    q = posterior.chain.reshape(-1, posterior.space.size)
    warm_up, draws = STEPS.get(n, (400, 600))
    nuts = _nuts(density, laplace(density, np.median(q, axis=0)), warm_up, draws)
    density.release()
    apart = np.abs(q.mean(axis=0) - nuts.pop("mean")) / q.std(axis=0)
    wider = np.array(nuts.pop("sd")) / q.std(axis=0)
    ours = {
        "effective": posterior.effective,
        "seconds": seconds,
        "ess_per_s": posterior.effective / after,
        "ess_per_s_with_warm_up": posterior.effective / seconds,
        "converged": posterior.converged,
    }
    return {
        "lobefit": ours,
        "nuts": nuts,
        "ratio": ours["ess_per_s"] / nuts["ess_per_s"],
        "ratio_with_warm_up": ours["ess_per_s_with_warm_up"] / nuts["ess_per_s_with_warm_up"],
        "means_apart_sd": float(apart.max()),
        "sd_ratios": [float(wider.min()), float(wider.max())],
    }


def table(record: dict[str, Any]) -> str:
    """Write the figures as Markdown."""
    head = (
        "samples",
        "effective samples/s: lobefit, after warm-up",
        "with warm-up",
        "NUTS, after warm-up",
        "with warm-up",
        "lobefit / NUTS: after, with warm-up",
        "gradients per draw",
        "means apart (sd), sd ratios",
        "log-probabilities differ by",
    )
    lines = [f"| {' | '.join(head)} |", "|" + "---|" * len(head)]
    for n, r in record["sizes"].items():
        a, b = r["lobefit"], r["nuts"]
        lines.append(
            f"| {int(n):,} | {a['ess_per_s']:,.0f} | {a['ess_per_s_with_warm_up']:,.0f} | "
            f"{b['ess_per_s']:,.1f} | {b['ess_per_s_with_warm_up']:,.1f} | "
            f"{r['ratio']:.1f}, {r['ratio_with_warm_up']:.1f} | {b['gradients_per_draw']:.1f} | "
            f"{r['means_apart_sd']:.2f}, {r['sd_ratios'][0]:.2f} to {r['sd_ratios'][1]:.2f} | "
            f"{b['difference']:.1e} |"
        )
    return "\n".join(lines)


def main() -> None:
    """Run the sizes that were asked for, or the two that take a minute."""
    sizes = sizes_asked("benchmarks.nuts", __doc__, SIZES[:2])
    try:
        print(table(run(sizes)))
    except ImportError as error:
        print(f"skipped: {error}; pip install numpyro")


if __name__ == "__main__":
    main()
