"""Directional albedo of a transcription by quadrature, sharing nothing with the kernels'."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping

import numpy as np
import numpy.typing as npt

from tests.kernels.transcriptions import Array, Transcription

__all__ = ["albedo"]

NODES = 16


def albedo(
    brdf: Transcription,
    theta_i: float,
    width: float,
    params: Mapping[str, float | list[float]],
    *,
    phi_i: float = 0.0,
    refine: int = 2,
) -> Array:
    """Integrate f cos_theta_o over the hemisphere of o, for one direction of incidence.

    Gauss-Legendre panels in theta_o and phi_o that grow geometrically away from the mirror
    direction, from a quarter of ``width``, the angular width of the lobe in radians. Every
    panel is cut into ``refine`` equal parts, so that two values tell the error.

    Returns
    -------
    numpy.ndarray
        Albedo [C] per channel.
    """
    theta, theta_weights = _rule(_graded(0.0, np.pi / 2, theta_i, width), refine)
    # On the sphere the lobe is wider in azimuth by 1/sin(theta).
    azimuth_width = width / max(np.sin(theta_i), width)
    mirror = phi_i + np.pi
    phi, phi_weights = _rule(_graded(mirror - np.pi, mirror + np.pi, mirror, azimuth_width), refine)
    total: Array = np.zeros(1)
    for angle, weight in zip(theta, theta_weights, strict=True):
        values = brdf(theta_i, phi_i, angle, phi, **params)
        total = total + weight * np.sin(angle) * np.cos(angle) * (values @ phi_weights)
    return total


def _graded(low: float, high: float, peak: float, width: float) -> list[float]:
    """Panel edges between low and high, at peak and at geometric distances from it."""
    distances = itertools.takewhile(
        lambda distance: distance < high - low, (width / 4 * 2**k for k in range(40))
    )
    edges = {low, high, peak}
    for distance in distances:
        edges |= {peak - distance, peak + distance}
    return sorted(edge for edge in edges if low <= edge <= high)


def _rule(
    edges: Iterable[float], refine: int
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """Nodes and weights of the composite rule over panels, each cut into equal parts."""
    x, w = np.polynomial.legendre.leggauss(NODES)
    nodes, weights = [], []
    for low, high in itertools.pairwise(edges):
        cuts = np.linspace(low, high, refine + 1)
        for a, b in itertools.pairwise(cuts):
            nodes.append((a + b) / 2 + (b - a) / 2 * x)
            weights.append((b - a) / 2 * w)
    return np.concatenate(nodes), np.concatenate(weights)
