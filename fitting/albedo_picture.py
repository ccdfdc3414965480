"""Directional albedo of fitted models as an OpenEXR picture.

A column is a theta_i, a row a phi_i (one row where all models are isotropic); channel C of a model
M is named ``M.C``: the share of light from that direction that leaves the surface, in 32-bit
floats. Above 1 a model gives out more than it receives.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from lobefit.fitting.exr import exr_header, exr_name, write_exr
from lobefit.kernels.albedo import azimuth_refinement, model_albedo
from lobefit.kernels.candidates import candidate
from lobefit.kernels.device import get_device
from lobefit.kernels.parameters import complete, nonlinear_of
from lobefit.kernels.registry import get_model

__all__ = ["SCHEMA", "Described", "write_albedo"]

SCHEMA = "lobefit.albedo/1"
THETA = (0.0, 10.0, 20.0, 30.0, 40.0, 50.0, 60.0, 70.0, 75.0, 80.0, 85.0)
PHI = (0.0, 30.0, 60.0, 90.0, 120.0, 150.0)
# Order and azimuths of the grids. Six rows on the finer one would take a second and more; all
# registered models agree on both to 1e-4 of their albedo, most to 1e-5.
FINE, COARSE = (8, 256), (4, 128)


class Described(Protocol):
    """What there is to know of a fitted model, as `FitResult` and `Fitted` have it."""

    @property
    def candidate(self) -> str:
        """The form that was fitted."""

    @property
    def model(self) -> str:
        """Its registered model."""

    @property
    def options(self) -> Mapping[str, str]:
        """What it was compiled with."""

    @property
    def params(self) -> Mapping[str, float | list[float]]:
        """All parameters."""

    @property
    def channels(self) -> tuple[str, ...]:
        """Their names."""


def write_albedo(path: Path, models: Sequence[Described], *, device: str | None = None) -> None:
    """Integrate every model at every incidence and write the picture.

    Parameters
    ----------
    path : Path
        An ``.exr`` file; replaced if it exists.
    models : sequence of Described
        Fitted models of the same channels.
    device : str, optional
        See `lobefit.kernels.get_device`.
    """
    isotropic = [candidate(m.candidate, dict(m.options)).isotropic for m in models]
    phi = PHI[:1] if all(isotropic) else PHI
    planes = {}
    for m, once in zip(models, isotropic, strict=True):
        rows = _rows(m, phi[:1] if once else phi, device)
        wide = np.broadcast_to(rows, (len(m.channels), len(phi), len(THETA)))
        for channel, plane in zip(m.channels, wide, strict=True):
            planes[f"{exr_name(m.candidate)}.{exr_name(channel)}"] = plane
    about = {
        "axes": "rows from the top: phi_i; columns from the left: theta_i; degrees",
        "theta_i_deg": json.dumps(THETA),
        "phi_i_deg": json.dumps(phi),
    }
    write_exr(path, planes, exr_header(SCHEMA, __doc__, about))


def _rows(m: Described, phi: Sequence[float], device: str | None) -> NDArray[np.float64]:
    """Integrate at every theta_i of every phi_i in degrees; shape (C, phi, theta)."""
    model = get_model(m.model).choose(m.options)
    full = complete(model, m.params)
    order, azimuths = FINE if len(phi) == 1 else COARSE
    azimuths *= max(azimuth_refinement(model, nonlinear_of(model, full)[0]) // 2, 1)
    opened, theta = get_device(device), np.deg2rad(THETA)
    rows = [model_albedo(model, full, theta, t, opened, order, azimuths) for t in np.deg2rad(phi)]
    return np.stack(rows, axis=1)
