"""Whether a fitted model can be a surface: energy and reciprocity, by computation."""

from __future__ import annotations

from functools import partial

import numpy as np
from numpy.typing import NDArray

from lobefit.fitting.problem import Problem
from lobefit.fitting.result import Plausibility
from lobefit.kernels.albedo import azimuth_refinement, basis_albedo, coarse_grid
from lobefit.kernels.geometry import Directions

__all__ = ["plausibility"]

Array = NDArray[np.float64]

INCIDENCES = np.radians([0.0, 15.0, 30.0, 45.0, 60.0, 75.0, 85.0])
# Error of the coarse quadrature; an albedo above 1 by less is no verdict.
ALBEDO_ERROR = 2e-3
# Largest asymmetry that rounding alone produces.
RECIPROCITY_ERROR = 1e-9


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
