"""A scene under lights, shaded with a reflectance model.

What is seen, and with which normal, is found once per scene and shading, in double precision
(`lobefit.kernels.surface`), and serves every model. A kernel made of the model's own formula then
sums the reflection equation at each shaded point, L = sum f E cos_theta_i over the lights and
the integral of f L_i cos_theta_i over the environment; a second one makes pixels of points.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from lobefit.kernels.device import Device, get_device
from lobefit.kernels.environment_integral import EnvironmentIntegral
from lobefit.kernels.errors import SceneError
from lobefit.kernels.evaluate import Params, basis_values
from lobefit.kernels.geometry import Directions, Precision
from lobefit.kernels.lights import channels_of, light_rows
from lobefit.kernels.registry import Model
from lobefit.kernels.scene import Scene
from lobefit.kernels.shaded_points import Lobes, ShadedPoints, lobes_of
from lobefit.kernels.surface import Shading, make_surface

__all__ = ["CELLS", "Prepared", "Rendering", "render"]

FEWEST, CELLS = 512, 2048  # directional lights that an environment is cut into

Image = NDArray[np.floating[Any]]


@dataclass(frozen=True, eq=False)
class Rendering:
    """A picture in linear radiance, split by what reflected it.

    Attributes
    ----------
    diffuse, specular : ndarray, shape (C, H, W)
        Radiance in the unit of the lights, row 0 at the top; 0 where the object is not.
        Ambient light is diffuse. A model that mixes both in its basis functions
        (``disney_principled``) is specular as a whole.
    mask : ndarray of bool, shape (H, W)
        Pixels that show the object.
    error : ndarray, shape (C, H, W)
        Estimated error of the environment's integral, in radiance: its difference from the
        same with a quarter of the nodes. 0 without an environment.
    seconds : float
        What the shading took on the device, pixels included; neither what is done once
        per scene or parameters, nor the error's estimate, nor copies.
    points : int
        Shaded points: triangles, vertices or pixels.
    """

    diffuse: Image
    specular: Image
    mask: NDArray[np.bool_]
    error: Image
    seconds: float
    points: int

    @property
    def beauty(self) -> Image:
        """Diffuse and specular radiance together, shape (C, H, W)."""
        return self.diffuse + self.specular


class Prepared:
    """A scene whose visible points are on the device, to be shaded with model after model.

    Parameters
    ----------
    scene : Scene
        What to render.
    shading : {"flat", "gouraud", "phong", "exact"}
        See `lobefit.kernels.surface`.
    subdivision : int
        Subdivision level of the mesh; "exact" needs none.
    precision : {"single", "double"}
        Of shading.
    device : str, Device or None
        See `lobefit.kernels.get_device`.
    nodes : tuple of int
        For narrow lobes in an environment: panels of two nodes from the normal to the horizon, and
        azimuths.
    cells : int
        For broad ones: directional lights that the environment is cut into, about.

    Attributes
    ----------
    surface : Surface
        The visible points.

    Raises
    ------
    SceneError
        An unknown shape or shading, or a level that is none.
    DeviceError
        No usable OpenCL device.
    """

    def __init__(
        self,
        scene: Scene,
        *,
        shading: Shading = "phong",
        subdivision: int = 5,
        precision: Precision = "single",
        device: str | Device | None = None,
        nodes: tuple[int, int] = (8, 24),
        cells: int = CELLS,
    ) -> None:
        if precision not in ("single", "double"):
            raise SceneError(f"precision is 'single' or 'double', not {precision!r}")
        if min(nodes) < 2:
            raise SceneError("an environment's quadrature has 2 panels and 2 azimuths at least")
        if cells < FEWEST:
            raise SceneError(f"an environment is cut into {FEWEST} lights at least")
        self.scene = scene
        self.device = get_device(device)
        self.dtype: np.dtype[Any] = np.dtype(np.float64 if precision == "double" else np.float32)
        camera = scene.camera
        self.surface = make_surface(scene.shape, camera, scene.matrix, shading, subdivision)
        self._points: ShadedPoints | None = None
        self._environment: EnvironmentIntegral | None = None
        if self.surface.pixels.size:
            self._points = ShadedPoints(self.surface, self.device, precision)
            if scene.environment is not None:
                around = EnvironmentIntegral(self._points, scene.environment, nodes, cells)
                self._environment = around

    def release(self) -> None:
        """Free the device's memory."""
        if self._points is not None:
            self._points.release()

    def __enter__(self) -> Self:
        """Give itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Free the device's memory."""
        self.release()

    def render(
        self,
        model: str | Model,
        params: Params,
        *,
        options: Mapping[str, str] | None = None,
        estimate: bool = True,
    ) -> Rendering:
        """Shade with one model; see `render_sets` and `lobefit.kernels.render.render`."""
        return self.render_sets(model, [params], options=options, estimate=estimate)[0]

    def render_sets(
        self,
        model: str | Model,
        params: Sequence[Params],
        *,
        options: Mapping[str, str] | None = None,
        estimate: bool = True,
    ) -> list[Rendering]:
        """Shade with several sets of parameters of one model, in one launch.

        Parameters
        ----------
        model, params, options
            As for `lobefit.kernels.evaluate`; `params` is a sequence of sets.
        estimate : bool
            Whether to estimate the error of an environment's integral.

        Returns
        -------
        list of Rendering
            One a set; `seconds` is an equal part of the launch.

        Raises
        ------
        ModelError
            Unknown model, parameter or option; a value outside its bounds.
        SceneError
            The model has another number of channels than the lights.
        """
        lobes = lobes_of(model, params, options, self.scene.channels)
        sets, channels, _ = lobes.coefficients.shape
        shape = (self.scene.camera.height, self.scene.camera.width)
        where = self.surface.pixels
        mask = np.zeros(shape, dtype=bool)
        mask.ravel()[where] = True
        values, seconds, points = np.zeros((sets, channels, 2, 0), self.dtype), 0.0, 0
        if self._points is not None:
            values, seconds = self._shade(lobes, self._points, estimate)
            points = self._points.count
        parts = values.shape[2]
        images = np.zeros((sets, parts, channels, *shape), dtype=self.dtype)
        planes = images.reshape(-1, mask.size)
        rows = values.swapaxes(1, 2).reshape(len(planes), where.size)
        # Plane by plane: assignment by one index is several times as fast as by many.
        for plane, numbers in zip(planes, rows, strict=True):
            plane[where] = numbers
        no_error = np.broadcast_to(self.dtype.type(0), (channels, *shape))
        return [
            Rendering(i[0], i[1], mask, i[2] if parts == 3 else no_error, seconds / sets, points)
            for i in images
        ]

    def _shade(
        self, lobes: Lobes, points: ShadedPoints, estimate: bool
    ) -> tuple[NDArray[Any], float]:
        """Give diffuse, specular and any error of each pixel, (sets, C, 2 or 3, M); and seconds."""
        lights = light_rows(self.scene.lights, lobes.coefficients.shape[1])
        values, seconds = points.under_lights(lobes, lights, self._ambient(lobes))
        if self._environment is not None:
            around, error, more = self._environment(lobes, estimate)
            values, seconds = np.concatenate([values + around, error], axis=2), seconds + more
        made, filling = points.pixels(values)
        return made, seconds + filling

    def _ambient(self, lobes: Lobes) -> NDArray[np.float64]:
        """Give the radiance that ambient light leaves with, shape (sets, C)."""
        light = channels_of(self.scene.ambient, "ambient light")
        sets, channels, _ = lobes.coefficients.shape
        if not light.any():
            return np.zeros((sets, channels))
        along = Directions(self.device, 0.0, 0.0, 0.0, 0.0)
        groups = [basis_values(lobes.program, along, x)[:, :, 0] for x in lobes.x]
        along.release()
        diffuse = (lobes.coefficients * np.stack(groups))[..., lobes.diffuse].sum(axis=2)
        return np.asarray(np.pi * diffuse * light)


def render(
    scene: Scene,
    model: str | Model,
    params: Params,
    *,
    shading: Shading = "phong",
    subdivision: int = 5,
    options: Mapping[str, str] | None = None,
    precision: Precision = "single",
    device: str | Device | None = None,
    nodes: tuple[int, int] = (8, 24),
    cells: int = CELLS,
) -> Rendering:
    """Render a scene with one model.

    To render it with several, make a `Prepared` once.

    Parameters
    ----------
    scene : Scene
        Object, transform, lights and view.
    model, params, options
        As for `lobefit.kernels.evaluate`; sums such as "ggx+ggx" too.
    shading, subdivision, precision, device, nodes, cells
        See `Prepared`.

    Returns
    -------
    Rendering
        Linear radiance per channel. Lights and models of one channel go with any number.

    Raises
    ------
    ModelError
        Unknown model, parameter or option; a value outside its bounds.
    SceneError
        An unknown shape or shading; channels that do not fit together.
    DeviceError
        No usable OpenCL device.
    """
    prepared = Prepared(
        scene,
        shading=shading,
        subdivision=subdivision,
        precision=precision,
        device=device,
        nodes=nodes,
        cells=cells,
    )
    with prepared:
        return prepared.render(model, params, options=options)
