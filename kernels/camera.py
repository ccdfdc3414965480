"""The view of a scene: from pixels to rays and from points to pixels."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from lobefit.kernels.errors import SceneError

__all__ = ["Camera"]

Array = NDArray[np.float64]
Vector = tuple[float, float, float]

LARGEST = 8192  # pixels along a side


@dataclass(frozen=True)
class Camera:
    """A pinhole or a parallel view; z is up unless `up` says otherwise.

    Attributes
    ----------
    eye, target, up : tuple of float
        World coordinates; the view goes from `eye` to `target`.
    kind : {"perspective", "orthographic"}
        Rays through one point, or parallel ones.
    field : float
        Height of the picture: degrees for a perspective view, world units for an
        orthographic one. Pixels are square.
    width, height : int
        Pixels. A pixel is what is seen through its centre.

    Raises
    ------
    SceneError
        A view that is none.
    """

    eye: Vector = (0.0, -4.0, 0.0)
    target: Vector = (0.0, 0.0, 0.0)
    up: Vector = (0.0, 0.0, 1.0)
    kind: Literal["perspective", "orthographic"] = "perspective"
    field: float = 36.0
    width: int = 512
    height: int = 512

    def __post_init__(self) -> None:
        """Check the view."""
        vectors = np.array([self.eye, self.target, self.up], dtype=np.float64)
        if vectors.shape != (3, 3) or not np.isfinite(vectors).all():
            raise SceneError("eye, target and up of a camera are three finite numbers each")
        if self.kind not in ("perspective", "orthographic"):
            raise SceneError(f"a camera is perspective or orthographic, not {self.kind!r}")
        if not 0.0 < self.field < (180.0 if self.kind == "perspective" else np.inf):
            raise SceneError(f"a {self.kind} camera has no field of {self.field:g}")
        if not (1 <= self.width <= LARGEST and 1 <= self.height <= LARGEST):
            raise SceneError(f"a picture has 1 to {LARGEST} pixels along a side")
        if not np.isfinite(self.axes).all():
            raise SceneError("a camera looks from eye to target, and up is not along that line")

    @cached_property
    def axes(self) -> Array:
        """Right, up and forward as rows, shape (3, 3), orthonormal."""
        eye, target, up = (np.asarray(v, np.float64) for v in (self.eye, self.target, self.up))
        forward = target - eye
        right = np.cross(forward, up)
        lengths = np.array([np.linalg.norm(forward), np.linalg.norm(right)])
        if lengths[0] == 0.0 or lengths[1] <= 1e-9 * lengths[0] * np.linalg.norm(up):
            return np.full((3, 3), np.nan)
        forward, right = forward / lengths[0], right / lengths[1]
        return np.stack([right, np.cross(right, forward), forward])

    @property
    def scale(self) -> float:
        """Half the picture's height at depth 1 (perspective) or anywhere (orthographic)."""
        if self.kind == "perspective":
            return float(np.tan(np.radians(self.field) / 2.0))
        return self.field / 2.0

    def rays(self, pixels: NDArray[np.intp]) -> tuple[Array, Array]:
        """Give the rays through the centres of pixels.

        Parameters
        ----------
        pixels : ndarray of int, shape (N,)
            Row by row from the top left: ``row * width + column``.

        Returns
        -------
        tuple of ndarray, shape (N, 3)
            Origins and directions; a direction has the length that makes the distance along it
            the depth, measured along the line of sight.
        """
        row, column = np.divmod(pixels, self.width)
        per_pixel = 2.0 * self.scale / self.height
        x = (column + 0.5 - self.width / 2.0) * per_pixel
        y = (self.height / 2.0 - row - 0.5) * per_pixel
        right, up, forward = self.axes
        across = x[:, None] * right + y[:, None] * up
        eye = np.asarray(self.eye, dtype=np.float64)
        if self.kind == "perspective":
            return np.broadcast_to(eye, across.shape), across + forward
        return eye + across, np.broadcast_to(forward, across.shape)

    def project(self, points: Array) -> tuple[Array, Array, Array]:
        """Give column, row (in pixels, 0 at the outer edge) and depth of points (N, 3)."""
        x, y, depth = self.axes @ (points - np.asarray(self.eye, dtype=np.float64)).T
        per_pixel = 2.0 * self.scale / self.height
        if self.kind == "perspective":
            with np.errstate(divide="ignore", invalid="ignore"):
                x, y = x / depth, y / depth
        return self.width / 2.0 + x / per_pixel, self.height / 2.0 - y / per_pixel, depth

    def towards(self, points: Array) -> Array:
        """Give unit vectors from points (N, 3) to the viewer."""
        if self.kind == "orthographic":
            return np.broadcast_to(-self.axes[2], points.shape)
        away = np.asarray(self.eye, dtype=np.float64) - points
        return np.asarray(away / np.linalg.norm(away, axis=1, keepdims=True))
