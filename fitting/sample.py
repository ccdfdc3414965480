"""Sample the posterior of a fitted model with emcee, the log-probability on the device."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from lobefit.fitting.likelihood import Censoring, Density
from lobefit.fitting.measurement import DIRECTION_COLUMNS, Measurement
from lobefit.fitting.noise import variance
from lobefit.fitting.posterior import Posterior
from lobefit.fitting.priors import Prior
from lobefit.fitting.result import FitResult
from lobefit.fitting.sampled_noise import Scales, decide_noise, likelihood_power, noise_scales
from lobefit.fitting.space import Space
from lobefit.kernels import Device, FitError, Model, candidate, get_device
from lobefit.kernels.evaluate import basis_values
from lobefit.kernels.geometry import Directions
from lobefit.kernels.parameters import complete, nonlinear_of
from lobefit.kernels.program import model_program

if TYPE_CHECKING:
    from lobefit.fitting.sampler import Outcome, SamplingProgress

__all__ = ["MAX_STEPS", "sample"]

Array = NDArray[np.float64]

MAX_STEPS = 10_000
# Estimates on their bounds start so far within, in the logistic coordinates of their priors.
INSIDE = 5.0
# Rows that say enough about which coefficients the data know.
ENOUGH = 8192
# More numbers than this are beyond what walkers explore.
MOST = 64


def sample(
    result: FitResult,
    measurement: Measurement,
    *,
    seed: int = 0,
    walkers: int | None = None,
    ensembles: int = 4,
    max_steps: int = MAX_STEPS,
    max_seconds: float | None = None,
    steps: int | None = None,
    noise: Literal["auto", "fit", "scaled", "given", "fixed"] = "auto",
    student: bool | None = None,
    correlation: Literal["auto", "ignore"] = "auto",
    saturation: float | None = None,
    floor: float | None = None,
    priors: Mapping[str, Prior] | None = None,
    progress: Callable[[SamplingProgress], None] | None = None,
    device: str | Device | None = None,
    file: str | Path | None = None,
    resume: bool = True,
) -> Posterior:
    """Sample the posterior of a fitted model.

    Parameters
    ----------
    result : FitResult
        The point fit, where it begins.
    measurement : Measurement
        What was fitted.
    seed : int
        Same seed, device and settings: same chain.
    walkers : int, optional
        In each ensemble; 4 times the numbers sampled, 32 at least, where left out.
    ensembles : int
        Independent ones, which must agree in the end.
    max_steps : int
        Budget, warm-up included. Sampling ends earlier once the chain is 50 autocorrelation
        times long, they are stable, and the ensembles agree to an R-hat below 1.01.
    max_seconds : float, optional
        Another budget; a run that it ends is marked as not repeatable.
    steps : int, optional
        Exactly so many steps after the warm-up, whether they are enough or not.
    noise : {"auto", "fit", "scaled", "given", "fixed"}
        "fit" samples both scales of ``sigma^2 = additive^2 + (relative f)^2`` in each
        channel, f the model's value; "given" takes the measurement's sigma, "scaled" times a
        factor in each channel that is sampled; "fixed" holds the noise that the point fit
        found. "auto": "given" where the fit weighed with sigma, "scaled" where residuals
        are larger than it says, else "fit"; where residuals are misfit rather than noise, what
        the point fit found is scaled.
    student : bool, optional
        Student's t instead of a Gaussian, for outliers; its nu is sampled. Left out, as the fit.
    correlation : {"auto", "ignore"}
        "auto": where residuals are correlated over more than 2 values, which is misfit, the
        log-likelihood is divided by that number, so that no interval is narrower
        than the misfit allows.
    saturation, floor : float, optional
        Readings at or above, or at or below it, in 1/sr, are known to lie beyond it only. The
        point fit is then made again without them.
    priors : mapping of str to Prior, optional
        In place of those of `lobefit.fitting.priors`, by parameter's name.
    progress : callable, optional
        Told a few times a second where the run stands.
    device : str, Device or None
        See `lobefit.kernels.get_device`.
    file : str or Path, optional
        HDF5 file of the chain, written while it grows. A run that was ended, by whatever,
        goes on from it, and ends with the chain that it would have given in one go.
    resume : bool
        False starts anew over an existing file.

    Returns
    -------
    Posterior
        `converged` says whether to trust it and `reason` why not; the chain is kept either way.

    Raises
    ------
    ModelError
        A prior that does not fit.
    FitError
        No finite log-probability or too few independent walkers about the point fit, a budget
        that ends within the warm-up, a chain file of another run.
    DeviceError
        No usable device.
    """
    # emcee takes time to import, which only sampling should.
    from lobefit.fitting.chain_file import ChainFile
    from lobefit.fitting.laplace import laplace, starts
    from lobefit.fitting.sampler import run

    chosen = candidate(result.candidate, result.options)
    _check(result, measurement, ensembles, walkers, max_steps, seed, correlation)
    opened = get_device(device)
    censoring = Censoring(saturation, floor)
    result = _without_censored(result, measurement, censoring, opened)
    scales = noise_scales(result, measurement)
    kind, sigma, notes = decide_noise(result, measurement, noise, scales)
    power = likelihood_power(result, correlation, notes)
    space = Space(
        chosen,
        measurement.channels,
        noise=kind,
        student=result.noise.nu is not None if student is None else student,
        priors=priors,
        centres={p.name: _number(result, p.name) for p in chosen.searched if p.period},
        levels=np.nanmedian(np.abs(scales[2]), axis=1),
        information=_information(opened, chosen.model, result, measurement, scales),
    )
    if space.size > MOST:
        raise FitError(
            f"{space.size} numbers are more than walkers explore ({MOST}); sample fewer channels"
            + ("" if noise == "fixed" else ', or hold the noise with noise="fixed"')
        )
    shape = (ensembles, _walkers(walkers, space.size))
    density = Density(space, measurement, opened, sigma=sigma, power=power, censoring=censoring)
    try:
        start = _start(space, result, measurement, scales)
        chain = ChainFile(
            None if file is None else Path(file),
            _fingerprint(measurement, space, result, shape, seed, power, censoring, sigma),
            shape[0] * shape[1],
            space.size,
            max_steps,
            resume=resume,
        )
        approximation = laplace(density, start)
        density.not_finite = 0
        outcome = run(
            density,
            approximation,
            lambda random: starts(density, approximation, shape, random),
            chain,
            shape=shape,
            seed=seed,
            labels=space.labels,
            max_steps=max_steps,
            max_seconds=max_seconds,
            until=steps,
            progress=progress,
        )
    finally:
        density.release()
    judgement = outcome.judgement
    counted = slice(outcome.warm_up, chain.iteration)
    return Posterior(
        result=result,
        measurement=measurement,
        space=space,
        chain=chain.chain[counted].reshape(-1, *shape, space.size),
        log_prob=chain.log_prob[counted].reshape(-1, *shape),
        converged=not judgement.reasons,
        reason=_reason(outcome, chain.iteration, density.not_finite),
        tau=dict(zip(space.labels, judgement.tau.tolist(), strict=True)),
        acceptance=outcome.acceptance,
        warm_up=outcome.warm_up,
        not_finite=density.not_finite,
        evaluations=density.sets,
        seconds=outcome.seconds,
        seed=seed,
        repeatable=not outcome.by_clock,
        device=str(opened.info),
        precision=density.directions.precision,
        power=power,
        notes=tuple(notes),
    )


def _check(
    result: FitResult,
    m: Measurement,
    ensembles: int,
    walkers: int | None,
    max_steps: int,
    seed: int,
    correlation: str,
) -> None:
    problem = None
    if not isinstance(result, FitResult) or not isinstance(m, Measurement):
        problem = "sample takes a FitResult and the Measurement that was fitted"
    elif result.channels != m.channels:
        problem = f"the fit has the channels {result.channels}, the measurement {m.channels}"
    elif result.instrument is not None:
        problem = "sampling accounts for no tilt, veil, gain or aperture; fit without an instrument"
    elif ensembles < 2:
        problem = "one ensemble cannot show that it is stuck; take 2 or more"
    elif walkers is not None and walkers < 4:
        problem = f"{walkers} walkers are too few"
    elif max_steps < 1:
        problem = f"max_steps is {max_steps}"
    elif not 0 <= seed < 2**32:
        problem = f"the seed is {seed}, not a whole number from 0 to 2^32 - 1"
    elif correlation not in ("auto", "ignore"):
        problem = f"correlation is 'auto' or 'ignore', not {correlation!r}"
    if problem:
        raise FitError(problem)


def _without_censored(
    result: FitResult, m: Measurement, censoring: Censoring, device: Device
) -> FitResult:
    """Fit again without readings beyond a level: they pull the start, and look like misfit."""
    _, sides = censoring.apply(m.values)
    if sides is None or not sides.any():
        return result
    from lobefit.fitting.fit import fit

    return fit(
        replace(m, values=np.where(sides == 0, m.values, np.nan)),
        [result.candidate],
        metric="chi2" if result.noise.given else "relative",
        options=result.options,
        device=device,
    ).best


def _walkers(wanted: int | None, size: int) -> int:
    walkers = max(32, 4 * size) if wanted is None else wanted
    walkers += walkers % 2
    if walkers < 2 * size:
        raise FitError(f"{walkers} walkers do not span {size} numbers; take {2 * size} or more")
    return walkers


def _information(
    device: Device, model: Model, result: FitResult, m: Measurement, scales: Scales
) -> Array:
    """Sum weighted products of the basis functions at the point fit, shape (C, K, K)."""
    additive, relative, values = scales
    rows = slice(None, None, -(-m.n_directions // ENOUGH))
    v = variance(values, additive, relative) if m.sigma is None else m.sigma**2
    weights = np.where(np.isfinite(m.values), 1.0 / np.maximum(v, 1e-300), 0.0)[:, rows]
    where = Directions(device, m.theta_i[rows], m.phi_i[rows], m.theta_o[rows], m.phi_o[rows])
    try:
        x = nonlinear_of(model, complete(model, result.params))
        basis = basis_values(model_program(model), where, x)
    finally:
        where.release()
    # Scaled to the largest, so that no product leaves the range of numbers.
    weights /= weights.max(axis=1, keepdims=True) + 1e-300
    return np.stack(
        [
            (b * w) @ b.T
            for b, w in zip(
                np.broadcast_to(basis, (len(v), *basis.shape[1:])), weights, strict=True
            )
        ]
    )


def _number(result: FitResult, name: str) -> float:
    return float(np.ravel(result.params[name])[0])


def _start(space: Space, result: FitResult, m: Measurement, found: Scales) -> Array:
    """Give the coordinates of the point fit, bounds and negligible noise a little inside."""
    theta = np.empty(space.size)
    loose = np.zeros(space.size, dtype=bool)
    estimates = {(e.name, e.channel): e for e in result.estimates}
    scales: dict[str, Array] = {"sigma_scale": np.ones(m.n_channels)}
    if space.noise == "fit":
        additive, relative, values = found
        size = np.nanmedian(np.abs(values), axis=1)
        typical = np.hypot(additive, relative * size)
        scales["noise_additive"] = np.maximum(additive, 0.05 * typical)
        scales["noise_relative"] = np.maximum(relative, 0.05 * typical / np.maximum(size, 1e-30))
    elif result.diagnostics.reduced_chi_square > 0.0:
        scales["sigma_scale"] *= np.sqrt(result.diagnostics.reduced_chi_square)
    for k, c in enumerate(space.coordinates):
        if c.parameter is None:
            theta[k] = (
                (result.noise.nu or 10.0) if c.name == "nu" else scales[c.name][c.channel or 0]
            )
            continue
        theta[k] = c.value_in(result.params)
        channel = None if c.channel is None else m.channels[c.channel]
        e = estimates.get((c.name, channel)) or estimates.get((c.name, None))
        loose[k] = e is None or e.status != "free" or abs(e.value) < (e.standard_error or 0.0)
    q = space.transforms.to_coordinates(theta[None])[0]
    angle = np.array([bool(c.parameter and c.parameter.period) for c in space.coordinates])
    return np.asarray(np.where(loose & ~angle, np.clip(q, -INSIDE, INSIDE), q))


def _fingerprint(
    m: Measurement,
    space: Space,
    result: FitResult,
    shape: tuple[int, int],
    seed: int,
    power: float,
    censoring: Censoring,
    sigma: Array | None,
) -> dict[str, str]:
    """Say what a chain belongs to, so that a file is not gone on with by another run."""
    digest = hashlib.sha256()
    for array in (*(getattr(m, name) for name in DIRECTION_COLUMNS), m.values, sigma):
        digest.update(b"" if array is None else np.ascontiguousarray(array).tobytes())
    return {
        "measurement": digest.hexdigest(),
        "candidate": result.candidate,
        "options": repr(sorted(result.options.items())),
        "parameters": ", ".join(space.labels),
        "priors": "; ".join(repr(c.prior) for c in space.coordinates),
        "ensembles and walkers": f"{shape[0]} x {shape[1]}",
        "seed": str(seed),
        "power of the likelihood": f"{power:.6g}",
        "censoring": repr(censoring),
    }


def _reason(outcome: Outcome, steps: int, not_finite: int) -> str:
    found = outcome.judgement
    parts = list(found.reasons)
    if not parts:
        parts.append(
            f"{steps - outcome.warm_up} steps are "
            f"{(steps - outcome.warm_up) / np.nanmax(found.tau):.0f} autocorrelation times, "
            f"R-hat of the ensembles is at most {np.nanmax(found.r_hat):.4f}"
        )
    elif outcome.by_clock:
        parts.insert(0, f"the time ended after {steps} steps")
    else:
        parts.insert(0, f"the budget ended after {steps} steps")
    if not_finite:
        parts.append(f"{not_finite} log-probabilities were not finite and count as -inf")
    return "; ".join(parts)
