"""Whether a fitted model can be a surface: energy and reciprocity, by computation."""

from __future__ import annotations

from functools import partial

import numpy as np
from numpy.typing import NDArray

from lobefit.fitting.checks.finding import DataCheck, DataChecks
from lobefit.fitting.problem import Problem
from lobefit.fitting.result import FitResult, Plausibility
from lobefit.kernels.albedo import (
    azimuth_refinement,
    basis_albedo,
    coarse_grid,
    directional_albedo,
)
from lobefit.kernels.geometry import Directions

__all__ = ["model_checks", "plausibility"]

Array = NDArray[np.float64]

INCIDENCES = np.radians([0.0, 15.0, 30.0, 45.0, 60.0, 75.0, 85.0])
# Error of the coarse quadrature; an albedo above 1 by less is no verdict.
ALBEDO_ERROR = 2e-3
# Largest asymmetry that rounding alone produces.
RECIPROCITY_ERROR = 1e-9
# Incidences that goniometers reach; more energy beyond them only is the model's own.
STEEP = np.radians([0.0, 30.0, 60.0])


def plausibility(problem: Problem, t: Array, c: Array) -> Plausibility:
    """Integrate the albedo at seven incidences and swap directions on a grid.

    Parameters
    ----------
    problem : Problem
        The fitted candidate.
    t : ndarray, shape (n,)
        Its search coordinates.
    c : ndarray, shape (C, K)
        Its coefficients.
    """
    x = np.atleast_2d(problem.parameters(t, c))
    coefficients = c[:, : problem.program.n_basis]
    device = problem.dataset.device
    refine = azimuth_refinement(problem.candidate.model, x[0])
    azimuths = (
        (0.0,) if problem.candidate.isotropic else tuple(np.radians([0.0, 45.0, 90.0, 135.0]))
    )
    albedo = np.stack(
        [
            np.max(
                [
                    (
                        coefficients
                        * basis_albedo(
                            problem.program, partial(coarse_grid, device, theta, phi, refine), x
                        )
                    ).sum(axis=1)
                    for phi in azimuths
                ],
                axis=0,
            )
            for theta in INCIDENCES
        ]
    )  # (incidences, C)
    where = np.argmax(albedo, axis=0)
    largest = albedo.max(axis=0)

    theta_i, theta_o, phi_o = (
        a.ravel()
        for a in np.meshgrid(
            np.radians(np.arange(5.0, 80.0, 10.0)),
            np.radians(np.arange(0.0, 80.0, 10.0)),
            np.radians(np.arange(0.0, 360.0, 45.0)),
            indexing="ij",
        )
    )
    zero = np.zeros_like(theta_i)
    f, g = (
        problem.values_at(directions, t, c)
        for directions in (
            Directions(device, theta_i, zero, theta_o, phi_o),
            Directions(device, theta_o, phi_o, theta_i, zero),
        )
    )
    total = f + g
    error = np.abs(f - g) / np.where(total > 0.0, total, 1.0)
    worst = float(error.max(initial=0.0))
    return Plausibility(
        albedo_max=tuple(float(a) for a in largest),
        albedo_max_theta_i=tuple(float(INCIDENCES[k]) for k in where),
        conserves_energy=bool((largest <= 1.0 + ALBEDO_ERROR).all()),
        reciprocity_error=worst,
        reciprocal=worst < RECIPROCITY_ERROR,
    )


def model_checks(result: FitResult) -> DataChecks:
    """Say of a fitted model what `lobefit.fitting.check` says of data: verdict and remedy.

    Parameters
    ----------
    result : FitResult
        One candidate.

    Returns
    -------
    DataChecks
        "energy", with the albedo of each channel, and "model reciprocity".
    """
    return DataChecks((_energy(result), _exchange(result)))


def _energy(result: FitResult) -> DataCheck:
    p = result.plausibility
    limit = 1.0 + ALBEDO_ERROR
    over = [k for k, albedo in enumerate(p.albedo_max) if not albedo <= limit]
    largest = int(np.argmax(p.albedo_max))
    theta = float(np.degrees(p.albedo_max_theta_i[largest]))
    figures: dict[str, float | int | str] = {
        f"albedo_{c}": a for c, a in zip(result.channels, p.albedo_max, strict=True)
    }
    figures |= {"channels_above_1": len(over), "theta_i_deg": theta}
    top = f"{p.albedo_max[largest]:.3g} (theta_i {theta:.0f}°"
    top += f", {result.channels[largest]})" if len(result.channels) > 1 else ")"
    if not over:
        return DataCheck(
            name="energy",
            verdict="ok",
            figures=figures,
            sentence=f"The model gives out at most {top} of what arrives.",
        )
    names = ", ".join(result.channels[k] for k in over[:4]) + (", ..." if len(over) > 4 else "")
    where = f" in {names}" if len(result.channels) > 1 else ""
    steep = directional_albedo(result.model, result.params, STEEP, options=result.options)
    if not (steep > limit).any():
        remedy = (
            "only at grazing incidence: use the model within the measured angles, or one that "
            "conserves energy"
        )
    else:
        remedy = (
            "check the quantity of the data (a factor pi, percent, a cosine), or hold k_s at 1 "
            "(a variant such as ggx:k_s=1)"
        )
    return DataCheck(
        name="energy",
        verdict="suspicious",
        figures=figures,
        sentence=f"The model gives out more than arrives{where}: up to {top}.",
        remedy=remedy,
    )


def _exchange(result: FitResult) -> DataCheck:
    p = result.plausibility
    figures = {"reciprocity_error": p.reciprocity_error}
    if p.reciprocal:
        return DataCheck(
            name="model reciprocity",
            verdict="ok",
            figures=figures,
            sentence="The model is the same with light and detector exchanged.",
        )
    return DataCheck(
        name="model reciprocity",
        verdict="suspicious",
        figures=figures,
        sentence="The model changes by up to "
        f"{100 * p.reciprocity_error:.2g} % of the sum when light and detector are exchanged.",
        remedy="bidirectional light transport needs a reciprocal model: take another candidate",
    )
