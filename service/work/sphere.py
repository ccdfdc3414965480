"""A fitted BRDF over half and difference angles, for a page that shades a sphere with it."""

from __future__ import annotations

import base64
import re

import numpy as np
from numpy.typing import NDArray

from lobefit.service.task import Outcome, Task, answer
from lobefit.service.work.fitted import Fitted, fitted

__all__ = ["perform"]

Array = NDArray[np.float64]

# Nodes of theta_h, spaced like squares, so finest near the mirror direction, of theta_d and of
# phi_d over a turn; fewer where the azimuth of the half vector is a fourth dimension.
ISOTROPIC = (64, 24, 37)
ANISOTROPIC = (48, 16, 25)
# No table has holes: a direction below the horizon is raised to this angle.
LOWEST = np.cos(np.deg2rad(89.5))
# Wavelengths in nm that stand for red, green and blue.
PRIMARIES = (620.0, 545.0, 460.0)


def perform(task: Task) -> Outcome:
    """Tabulate a candidate in Rusinkiewicz's angles, 32-bit floats in 1/sr."""
    model = fitted(task.store, task.request["fit"], task.request.get("model"))
    isotropic = model.isotropic
    half, difference, turn = ISOTROPIC if isotropic else ANISOTROPIC
    theta_h = 90.0 * (np.arange(half) / (half - 1)) ** 2
    theta_d = np.linspace(0.0, 89.0, difference)
    phi_d = np.linspace(0.0, 180.0, turn // 2 + 1) if isotropic else np.linspace(0.0, 360.0, turn)
    phi_h = np.zeros(1) if isotropic else np.linspace(0.0, 360.0, 25)
    wi, wo = _directions(*np.meshgrid(phi_h, theta_h, theta_d, phi_d, indexing="ij"))
    values = model.predict(*_angles(wi), *_angles(wo))
    shown = _shown(model)
    values = values[shown].T
    values = np.where(np.isfinite(values), np.maximum(values, 0.0), 0.0)
    return answer(
        task,
        {
            "model": model.candidate,
            "channels": [model.channels[k] for k in shown],
            "theta_h_deg": theta_h.tolist(),
            "theta_d_deg": theta_d.tolist(),
            "phi_d_deg": phi_d.tolist(),
            "phi_h_deg": phi_h.tolist(),
            "shape": [len(phi_h), half, difference, len(phi_d), len(shown)],
            "values": base64.b64encode(values.astype("<f4").tobytes()).decode("ascii"),
        },
    )


def _directions(phi_h: Array, theta_h: Array, theta_d: Array, phi_d: Array) -> tuple[Array, Array]:
    """Turn angles in degrees into unit vectors to the light and to the view, shape (3, N)."""
    ph, th, td, pd = (np.deg2rad(a).ravel() for a in (phi_h, theta_h, theta_d, phi_d))
    # The light as the half vector sees it, then turned into the surface's frame.
    x, y, z = np.sin(td) * np.cos(pd), np.sin(td) * np.sin(pd), np.cos(td)
    x, z = np.cos(th) * x + np.sin(th) * z, np.cos(th) * z - np.sin(th) * x
    wi = np.stack([np.cos(ph) * x - np.sin(ph) * y, np.sin(ph) * x + np.cos(ph) * y, z])
    wh = np.stack([np.sin(th) * np.cos(ph), np.sin(th) * np.sin(ph), np.cos(th)])
    wo = 2.0 * (wh * wi).sum(axis=0) * wh - wi
    return wi, wo


def _angles(w: Array) -> tuple[Array, Array]:
    """Give theta and phi in radians, theta at most 89.5 degrees."""
    z = np.maximum(w[2], LOWEST)
    theta = np.arctan2(np.hypot(w[0], w[1]), z)
    return np.minimum(theta, np.deg2rad(89.5)), np.mod(np.arctan2(w[1], w[0]), 2.0 * np.pi)


def _shown(model: Fitted) -> list[int]:
    """Choose the channels for red, green and blue, or one for grey."""
    names = list(model.channels)
    if {"R", "G", "B"} <= set(names):
        return [names.index(c) for c in "RGB"]
    wavelengths = [re.fullmatch(r"(\d+(?:\.\d+)?) ?nm", name) for name in names]
    if len(names) >= 3 and all(wavelengths):
        there = np.array([float(w[1]) for w in wavelengths if w])
        return [int(np.argmin(np.abs(there - wanted))) for wanted in PRIMARIES]
    return [0]
