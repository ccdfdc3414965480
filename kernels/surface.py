"""The points of a scene that are shaded, and how a picture is made of them.

===========  =======================================================================
flat         one point per visible triangle, its middle, with the triangle's own normal
gouraud      one point per visible vertex; the colours are interpolated
phong        one point per pixel, with the normal interpolated between the vertices
exact        one point per pixel, with position and normal of the true sphere, plane
             or cylinder
===========  =======================================================================

H. Gouraud, Continuous shading of curved surfaces, IEEE Trans. Computers C-20(6), 1971;
B. T. Phong, Illumination for computer generated pictures, CACM 18(6), 1975.

Anisotropic models need a direction for phi = 0. It is the mesh's tangent where it has one (along
the knot's tube); else it runs about the object's z axis, z x normal, as grooves do that were
turned on a lathe, and along x where the normal is along z. It follows the object's transform.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from lobefit.kernels.camera import Camera
from lobefit.kernels.errors import SceneError
from lobefit.kernels.mesh import Mesh, transformed, unit
from lobefit.kernels.raster import Coverage, rasterise
from lobefit.kernels.shapes import EXACT, shape_mesh

__all__ = ["Shading", "Surface", "make_surface"]

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Shading = Literal["flat", "gouraud", "phong", "exact"]

# An interpolated normal may look away from the viewer at an outline; it is then bent to have
# this cosine, so that no lobe is asked below the horizon.
GRAZING = 1e-3


@dataclass(frozen=True, eq=False)
class Surface:
    """Points that are shaded, in world coordinates, and the pixels made of them.

    Attributes
    ----------
    position, normal, tangent, view : ndarray, shape (N, 3)
        All but the first are unit vectors; `view` points to the viewer, `tangent` is at right
        angles to `normal`.
    pixels : ndarray of int, shape (M,)
        Pixels that show the object, ``row * width + column``.
    taps : ndarray of int, shape (K, M), or None
        Points that each pixel is made of; None for one point per pixel, in order.
    weights : ndarray, shape (K, M), or None
        Their weights; None for one tap of weight 1.
    """

    position: Array
    normal: Array
    tangent: Array
    view: Array
    pixels: Index
    taps: Index | None = None
    weights: Array | None = None


def _tangents(normals: Array, given: Array | None, matrix: Array) -> Array:
    """Give unit tangents at right angles to world normals."""
    linear = matrix[:3, :3]
    if given is None:
        local = unit(normals @ linear)  # the inverse of what normals were transformed by
        given = np.stack([-local[:, 1], local[:, 0], np.zeros(len(local))], axis=1)
        given[np.hypot(local[:, 0], local[:, 1]) < 1e-6] = (1.0, 0.0, 0.0)
        given = given @ linear.T
    across = unit(given - (given * normals).sum(axis=1, keepdims=True) * normals)
    # Where the tangent is along the normal, any direction does.
    lost = ~across.any(axis=1)
    if lost.any():
        axis = np.eye(3)[np.abs(normals[lost]).argmin(axis=1)]
        across[lost] = unit(np.cross(normals[lost], axis))
    return across


def _facing(normals: Array, view: Array) -> Array:
    """Bend normals that look away from the viewer until they just do not."""
    cosine = (normals * view).sum(axis=1, keepdims=True)
    bent = unit(normals - cosine * view)
    bent = unit(bent + GRAZING * view)
    return np.where(cosine < GRAZING, bent, normals)


def _points(
    camera: Camera, matrix: Array, position: Array, normal: Array, tangent: Array | None
) -> tuple[Array, Array, Array, Array]:
    view = camera.towards(position)
    normal = _facing(unit(normal), view)
    return position, normal, _tangents(normal, tangent, matrix), view


def _exact(shape: str | Mesh, camera: Camera, matrix: Array) -> Surface:
    if not isinstance(shape, str) or shape not in EXACT:
        raise SceneError(f"exact shading is there for {', '.join(EXACT)}; use phong for meshes")
    inverse = np.linalg.inv(matrix)
    pixels = np.arange(camera.width * camera.height)
    origins, directions = camera.rays(pixels)
    o = origins @ inverse[:3, :3].T + inverse[:3, 3]
    d = directions @ inverse[:3, :3].T
    distance, normal = EXACT[shape](o, d)
    pixels = np.flatnonzero(np.isfinite(distance))
    position = origins[pixels] + distance[pixels, None] * directions[pixels]
    normal = unit(normal[pixels] @ inverse[:3, :3])
    behind = (normal * camera.towards(position)).sum(axis=1) < 0.0
    normal = np.where(behind[:, None], -normal, normal)
    return Surface(*_points(camera, matrix, position, normal, None), pixels)


def _flat(mesh: Mesh, seen: Coverage, camera: Camera, matrix: Array) -> Surface:
    visible, taps = np.unique(seen.triangle, return_inverse=True)
    corners = mesh.vertices[mesh.faces[visible]]
    normal = unit(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))
    front = np.zeros(len(visible), dtype=bool)
    front[taps] = seen.front
    normal = np.where(front[:, None], normal, -normal)
    tangent = None if mesh.tangents is None else mesh.tangents[mesh.faces[visible]].mean(axis=1)
    points = _points(camera, matrix, corners.mean(axis=1), normal, tangent)
    return Surface(*points, seen.pixels, taps[None])


def _gouraud(mesh: Mesh, seen: Coverage, camera: Camera, matrix: Array) -> Surface:
    # A vertex that is seen from both sides is two points.
    key = 2 * mesh.faces[seen.triangle] + seen.front[:, None]
    points, taps = np.unique(key, return_inverse=True)
    vertex, front = np.divmod(points, 2)
    normal = np.where(front[:, None] == 1, mesh.normals[vertex], -mesh.normals[vertex])
    tangent = None if mesh.tangents is None else mesh.tangents[vertex]
    made = _points(camera, matrix, mesh.vertices[vertex], normal, tangent)
    return Surface(*made, seen.pixels, taps.reshape(key.shape).T, seen.barycentric.T)


def _phong(mesh: Mesh, seen: Coverage, camera: Camera, matrix: Array) -> Surface:
    corner = mesh.faces[seen.triangle]

    def between(values: Array) -> Array:
        return np.asarray(np.einsum("nk,nkd->nd", seen.barycentric, values[corner]))

    normal = np.where(seen.front[:, None], 1.0, -1.0) * between(mesh.normals)
    tangent = None if mesh.tangents is None else between(mesh.tangents)
    made = _points(camera, matrix, between(mesh.vertices), normal, tangent)
    return Surface(*made, seen.pixels)


@lru_cache(maxsize=2)
def _seen(shape: str | Mesh, level: int, matrix: bytes, camera: Camera) -> tuple[Mesh, Coverage]:
    """Find what is seen once for the three shadings of a mesh."""
    transform = np.frombuffer(matrix).reshape(4, 4)
    mesh = transformed(shape_mesh(shape, level), transform)
    return mesh, rasterise(mesh, camera)


def make_surface(
    shape: str | Mesh, camera: Camera, matrix: Array, shading: Shading, level: int
) -> Surface:
    """Find what is seen and where it is shaded.

    Parameters
    ----------
    shape : str or Mesh
        See `lobefit.kernels.shapes.shape_mesh`.
    camera : Camera
        The view.
    matrix : ndarray, shape (4, 4)
        The object's transform, affine and invertible.
    shading : {"flat", "gouraud", "phong", "exact"}
        See the table above.
    level : int
        Subdivision level of the mesh.

    Raises
    ------
    SceneError
        An unknown shading or shape.
    """
    if shading not in get_args(Shading):
        raise SceneError(f"shading is {', '.join(get_args(Shading))}, not {shading!r}")
    if shading == "exact":
        return _exact(shape, camera, matrix)
    mesh, seen = _seen(shape, level, matrix.tobytes(), camera)
    ways = {"flat": _flat, "gouraud": _gouraud, "phong": _phong}
    return ways[shading](mesh, seen, camera, matrix)
