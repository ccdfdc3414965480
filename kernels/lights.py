"""Lights of a scene: directional, point, and an environment that surrounds it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from lobefit.kernels.errors import SceneError

__all__ = ["DirectionalLight", "Environment", "Light", "PointLight", "channels_of", "light_rows"]

Array = NDArray[np.float64]
Vector = tuple[float, float, float]

LARGEST = 4096  # rows of an environment
COARSEST = 4  # rows of the last level of its pyramid


def channels_of(value: float | tuple[float, ...], what: str) -> Array:
    """Check one number, or one for each channel, that is finite and not negative."""
    try:
        values = np.atleast_1d(np.asarray(value, dtype=np.float64))
    except (TypeError, ValueError) as error:
        raise SceneError(f"{what} is a number or one for each channel, not {value!r}") from error
    if values.ndim != 1 or not values.size or not np.isfinite(values).all() or values.min() < 0:
        raise SceneError(f"{what} is finite and not negative, a number or one for each channel")
    return values


def _vector(value: Vector, what: str) -> Array:
    vector = np.asarray(value, dtype=np.float64)
    if vector.shape != (3,) or not np.isfinite(vector).all():
        raise SceneError(f"{what} is three finite numbers, not {value!r}")
    return vector


@dataclass(frozen=True)
class DirectionalLight:
    """Parallel light.

    Attributes
    ----------
    direction : tuple of float
        From the object towards the light, in world coordinates; any length.
    irradiance : float or tuple of float
        On a surface that faces the light, per channel: E of L = f E cos_theta_i.
    """

    direction: Vector
    irradiance: float | tuple[float, ...] = 1.0

    def row(self) -> tuple[Array, Array]:
        """Give (x, y, z, 0 for directional) and the irradiance.

        Raises
        ------
        SceneError
            A direction or an irradiance that is none.
        """
        towards = _vector(self.direction, "a light's direction")
        length = np.linalg.norm(towards)
        if not length > 0.0:
            raise SceneError("a light's direction is not zero")
        return np.append(towards / length, 0.0), channels_of(self.irradiance, "irradiance")


@dataclass(frozen=True)
class PointLight:
    """Light from a point, equal in all directions, falling off with the squared distance.

    Attributes
    ----------
    position : tuple of float
        World coordinates.
    intensity : float or tuple of float
        Per channel: the irradiance at distance 1 on a surface that faces the light.
    """

    position: Vector
    intensity: float | tuple[float, ...] = 1.0

    def row(self) -> tuple[Array, Array]:
        """Give (x, y, z, 1 for a point) and the intensity.

        Raises
        ------
        SceneError
            A position or an intensity that is none.
        """
        position = _vector(self.position, "a light's position")
        return np.append(position, 1.0), channels_of(self.intensity, "intensity")


Light = DirectionalLight | PointLight


def light_rows(lights: tuple[Light, ...], channels: int) -> Array:
    """Stack lights for the kernel, shape (lights, 4 + channels)."""
    rows = [np.append(place, np.broadcast_to(e, channels)) for place, e in map(_row, lights)]
    return np.array(rows).reshape(len(lights), 4 + channels)


def _row(light: Light) -> tuple[Array, Array]:
    return light.row()


@dataclass(frozen=True, eq=False)
class Environment:
    """Radiance from every direction, infinitely far away.

    Attributes
    ----------
    radiance : ndarray, shape (H, W, C)
        Latitude-longitude, as OpenEXR lays it out: the top row is up (+z here, +y there), the
        middle column +x (+z there), a quarter from the left +y, the left and right edges -x.
        Pixels are samples at their centres, interpolated in between.

    Raises
    ------
    SceneError
        A picture that is no environment.
    """

    radiance: Array

    def __post_init__(self) -> None:
        """Check the picture."""
        picture = np.asarray(self.radiance, dtype=np.float64)
        if picture.ndim == 2:
            picture = picture[:, :, None]
        if picture.ndim != 3 or picture.shape[2] < 1 or not 2 <= picture.shape[0] <= LARGEST:
            raise SceneError(f"an environment has rows (2 to {LARGEST}), columns and channels")
        if picture.shape[1] != 2 * picture.shape[0]:
            raise SceneError(
                "an environment in latitude and longitude is twice as wide as it is high, "
                f"not {picture.shape[1]} x {picture.shape[0]}"
            )
        if not np.isfinite(picture).all() or picture.min() < 0.0:
            raise SceneError("an environment's radiance is finite and not negative")
        object.__setattr__(self, "radiance", picture)

    def towards(self, directions: Array) -> Array:
        """Look the radiance up, bilinear, for unit vectors (N, 3); shape (C, N)."""
        height, width, _ = self.radiance.shape
        x, y, z = directions.T
        column = (0.5 - np.arctan2(y, x) / (2.0 * np.pi)) * width - 0.5
        row = np.clip(np.arccos(np.clip(z, -1.0, 1.0)) / np.pi * height - 0.5, 0.0, height - 1.0)
        left, above = np.floor(column).astype(np.intp), np.floor(row).astype(np.intp)
        fx, fy = (column - left)[:, None], (row - above)[:, None]
        below = np.minimum(above + 1, height - 1)
        one, two = left % width, (left + 1) % width
        p = self.radiance
        upper = p[above, one] * (1.0 - fx) + p[above, two] * fx
        lower = p[below, one] * (1.0 - fx) + p[below, two] * fx
        return np.asarray((upper * (1.0 - fy) + lower * fy).T)

    def resampled(self, rows: int) -> Array:
        """Interpolate the picture at the pixels of one of so many rows, shape (rows, 2 rows, C)."""
        theta = (np.arange(rows) + 0.5) * (np.pi / rows)
        phi = np.pi - (np.arange(2 * rows) + 0.5) * (np.pi / rows)
        grid = np.stack(
            [
                np.outer(np.sin(theta), np.cos(phi)),
                np.outer(np.sin(theta), np.sin(phi)),
                np.outer(np.cos(theta), np.ones(2 * rows)),
            ],
            axis=-1,
        )
        return self.towards(grid.reshape(-1, 3)).T.reshape(rows, 2 * rows, -1)

    @cached_property
    def pyramid(self) -> list[Array]:
        """Averages over ever larger solid angles, the first the picture itself.

        Rows are a power of two in every level; a picture with other numbers is interpolated to
        the next one above.
        """
        height = self.radiance.shape[0]
        rows = max(COARSEST, 1 << (height - 1).bit_length())
        level = self.radiance if rows == height else self.resampled(rows)
        levels = [level]
        while len(level) > COARSEST:
            edges = np.cos(np.linspace(0.0, np.pi, len(level) + 1))
            share = (edges[:-1] - edges[1:])[:, None, None]  # solid angle of the rows
            weighted = level * share
            pairs = weighted[0::2] + weighted[1::2]
            pairs = 0.5 * (pairs[:, 0::2] + pairs[:, 1::2])
            level = pairs / (share[0::2] + share[1::2])
            levels.append(level)
        return levels
