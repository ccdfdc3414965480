"""What is rendered: an object, its transform, lights and a view."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lobefit.kernels.camera import Camera
from lobefit.kernels.errors import SceneError
from lobefit.kernels.lights import Environment, Light, channels_of
from lobefit.kernels.mesh import Mesh

__all__ = ["Scene"]

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False, kw_only=True)
class Scene:
    """An object under lights. Nothing casts a shadow or is reflected in anything else.

    Attributes
    ----------
    shape : str or Mesh
        "sphere", "plane", "cylinder", "knot" (see `lobefit.kernels.shapes`) or a mesh.
    lights : tuple of DirectionalLight and PointLight
        What is summed over.
    ambient : float or tuple of float
        Radiance of light from everywhere that the diffuse term alone reflects, with its
        reflectance at normal incidence: k_d times this for Lambert. The first term of
        Phong's lighting model.
    environment : Environment or None
        What is integrated over. It is not seen behind the object.
    camera : Camera
        The view.
    transform : array_like, shape (4, 4)
        Object to world coordinates; affine, invertible.

    Raises
    ------
    SceneError
        A transform or light that is none; lights of different numbers of channels.
    """

    shape: str | Mesh = "sphere"
    lights: tuple[Light, ...] = ()
    ambient: float | tuple[float, ...] = 0.0
    environment: Environment | None = None
    camera: Camera = field(default_factory=Camera)
    transform: ArrayLike = field(default_factory=lambda: np.eye(4))

    def __post_init__(self) -> None:
        """Check the transform and the lights."""
        object.__setattr__(self, "lights", tuple(self.lights))
        matrix = self.matrix
        if matrix.shape != (4, 4) or not np.isfinite(matrix).all():
            raise SceneError("a transform is a matrix of four rows of four finite numbers")
        scale = np.linalg.norm(matrix[:3, :3], axis=0).prod()
        if not np.array_equal(matrix[3], (0, 0, 0, 1)):
            raise SceneError("a transform is affine: its last row is 0 0 0 1")
        if not abs(np.linalg.det(matrix[:3, :3])) > 1e-9 * scale:
            raise SceneError("a transform keeps the object solid: its determinant is not 0")
        self.channels  # noqa: B018 - it complains where they do not fit together

    @property
    def matrix(self) -> Array:
        """The transform as an array."""
        return np.asarray(self.transform, dtype=np.float64)

    @property
    def channels(self) -> int:
        """Channels of the lights: 1, or as many as the lights with more have."""
        sizes = {light.row()[1].size for light in self.lights}
        sizes.add(channels_of(self.ambient, "ambient light").size)
        if self.environment is not None:
            sizes.add(self.environment.radiance.shape[2])
        several = sizes - {1}
        if len(several) > 1:
            raise SceneError(f"lights of {sorted(several)} channels do not fit together")
        return several.pop() if several else 1
