"""Readings of an instrument that is not ideal, made without the code that accounts for it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lobefit.fitting import Measurement
from lobefit.fitting.scan_patterns import pattern
from lobefit.kernels import evaluate
from lobefit.kernels.evaluate import Params

Array = NDArray[np.float64]


def vectors(theta: Array, phi: Array) -> Array:
    """Give unit vectors, shape (3, N)."""
    return np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)])


def angles(v: Array) -> tuple[Array, Array]:
    """Give theta and phi of vectors (3, N)."""
    return np.arctan2(np.hypot(v[0], v[1]), v[2]), np.arctan2(v[1], v[0])


def leaning(tilt_deg: tuple[float, float]) -> Array:
    """Give the matrix into the frame of a sample whose normal leans so many degrees to x and y.

    By its axes, not by a rotation's formula: z is the normal. How x and y lie about it does not
    matter to an isotropic surface.
    """
    a, b = np.radians(tilt_deg)
    lean = np.hypot(a, b)
    z = np.array([np.sin(lean) * a, np.sin(lean) * b, lean * np.cos(lean)]) / lean
    x = np.cross([0.0, 1.0, 0.0], z)
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(z, x), z])


def readings(
    params: Params,
    scan: str,
    *,
    tilt_deg: tuple[float, float] = (0.0, 0.0),
    veil: float = 0.0,
    gain: float = 1.0,
    aperture_deg: float = 0.0,
    noise: tuple[float, float] = (0.01, 1e-4),
    seed: int = 0,
    sigma: bool = True,
) -> Measurement:
    """Measure a GGX surface's flux: one channel, f cos(theta_o) over the nominal cosine.

    The aperture is a disc of 61 directions, hexagonal, in the plane across the nominal one.
    """
    nominal = pattern(scan).angles()
    wi, wo = vectors(*nominal[:2]), vectors(*nominal[2:])
    across = np.stack([-np.sin(nominal[3]), np.cos(nominal[3]), np.zeros_like(nominal[3])])
    up = np.cross(wo, across, axis=0)
    turned = leaning(tilt_deg) if any(tilt_deg) else np.eye(3)
    disc = [(0.0, 0.0)]
    if aperture_deg:
        disc = [
            (i + 0.5 * j, np.sqrt(0.75) * j)
            for i in range(-4, 5)
            for j in range(-4, 5)
            if abs(i + j) <= 4
        ]
    # The radius whose disc has the second moment of these points.
    size = np.sqrt(2.0 * np.mean([u * u + v * v for u, v in disc])) or 1.0
    radius = np.tan(np.radians(aperture_deg / 2.0)) / size
    signal = np.zeros_like(nominal[0])
    for u, v in disc:
        seen = wo + radius * (u * up + v * across)
        out = turned @ (seen / np.linalg.norm(seen, axis=0))
        f = evaluate("ggx", params, *angles(turned @ wi), *angles(out))[0]
        signal += f * np.maximum(out[2], 0.0) / len(disc)
    values = gain * (signal + veil) / np.cos(nominal[2])
    spread = np.hypot(noise[0] * values, noise[1])
    values = values + spread * np.random.default_rng(seed).standard_normal(values.size)
    return Measurement(
        *nominal,
        values=values[None],
        channels=("brdf",),
        sigma=spread[None] if sigma else None,
    )
