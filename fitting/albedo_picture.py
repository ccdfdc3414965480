"""Directional albedo of fitted models as an OpenEXR picture.

A column is a theta_i, a row a phi_i (one row where all models are isotropic); channel C of a model
M is named ``M.C``: the share of light from that direction that leaves the surface, in 32-bit
floats. Above 1 a model gives out more than it receives.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from lobefit.fitting.export.fitted import Fitted
from lobefit.fitting.lobes import write_exr
from lobefit.kernels.albedo import directional_albedo

__all__ = ["SCHEMA", "write_albedo"]

SCHEMA = "lobefit.albedo/1"
THETA = (0.0, 10.0, 20.0, 30.0, 40.0, 50.0, 60.0, 70.0, 75.0, 80.0, 85.0)
PHI = (0.0, 30.0, 60.0, 90.0, 120.0, 150.0)


def write_albedo(path: Path, models: Sequence[Fitted], *, device: str | None = None) -> None:
    """Integrate every model at every incidence and write the picture.

    Parameters
    ----------
    path : Path
        An ``.exr`` file; replaced if it exists.
    models : sequence of Fitted
        See `lobefit.fitting.export.fitted.read_fitted`.
    device : str, optional
        See `lobefit.kernels.get_device`.
    """
    isotropic = all(m.isotropic for m in models)
    phi = PHI[:1] if isotropic else PHI
    theta = np.deg2rad(THETA)
    planes = {}
    for m in models:
        rows = [
            directional_albedo(
                m.model, m.params, theta, float(turn), options=m.options, device=device
            )
            for turn in np.deg2rad(phi[:1] if m.isotropic else phi)
        ]
        albedo = np.stack(rows * (len(phi) if m.isotropic else 1), axis=1)
        albedo = np.broadcast_to(albedo, (len(m.channels), *albedo.shape[1:]))
        for channel, plane in zip(m.channels, albedo, strict=True):
            # A dot would open a layer.
            planes[f"{_plain(m.candidate)}.{_plain(channel)}"] = plane
    attributes = {
        "lobefit:schema": SCHEMA,
        "lobefit:axes": "rows from the top: phi_i; columns from the left: theta_i; degrees",
        "lobefit:theta_i_deg": json.dumps(THETA),
        "lobefit:phi_i_deg": json.dumps(phi),
        "comments": (__doc__ or "").partition("\n\n")[2].strip(),
    }
    write_exr(path, planes, attributes)


def _plain(name: str) -> str:
    return name.replace(".", ",")
