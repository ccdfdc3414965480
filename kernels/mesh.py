"""Triangle meshes: normals averaged at the vertices, subdivision, transforms.

Vertex normals are averages of the normals of the faces around a vertex, weighted by the angle
that a face has there (G. Thuermer, C. A. Wuethrich, Computing vertex normals from polygonal
facets, Journal of Graphics Tools 3(1), 1998), which do not depend on how a flat part is cut into
triangles; weights by area are the alternative. Normals follow a transform M by its inverse
transpose, tangents by M itself.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from lobefit.kernels.errors import SceneError

__all__ = ["Mesh", "make_mesh", "subdivide", "transformed", "unit", "vertex_normals"]

Array = NDArray[np.float64]
Faces = NDArray[np.intp]
Weights = Literal["angle", "area"]


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles with a normal at each vertex.

    Attributes
    ----------
    vertices : ndarray, shape (V, 3)
        Positions.
    faces : ndarray of int, shape (F, 3)
        Vertices of each triangle, counter-clockwise as seen from the front.
    normals : ndarray, shape (V, 3)
        Unit vectors.
    tangents : ndarray, shape (V, 3) or None
        Direction of phi = 0 of the BRDF; None for the rule of `lobefit.kernels.surface`.
    closed : bool
        Whether backs are never seen; else they are shaded like fronts.
    """

    vertices: Array
    faces: Faces
    normals: Array
    tangents: Array | None = None
    closed: bool = False


def unit(vectors: Array) -> Array:
    """Divide vectors (..., 3) by their lengths; zero stays zero."""
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.asarray(vectors / np.where(length > 0.0, length, 1.0))


def vertex_normals(vertices: Array, faces: Faces, weights: Weights = "angle") -> Array:
    """Average the normals of the faces around each vertex.

    Parameters
    ----------
    vertices, faces : ndarray, shapes (V, 3) and (F, 3)
        See `Mesh`. Degenerate faces count nothing.
    weights : {"angle", "area"}
        By the angle of the face at the vertex, or by the face's area.

    Returns
    -------
    ndarray, shape (V, 3)
        Unit vectors; +z where no face says anything.
    """
    corners = vertices[faces]
    twice_area = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    total = np.zeros_like(vertices)
    for k in range(3):
        share: Array = twice_area
        if weights == "angle":
            a = corners[:, (k + 1) % 3] - corners[:, k]
            b = corners[:, (k + 2) % 3] - corners[:, k]
            crossed = np.linalg.norm(np.cross(a, b), axis=1)
            angle = np.arctan2(crossed, (a * b).sum(axis=1))
            share = unit(twice_area) * angle[:, None]
        for axis in range(3):
            total[:, axis] += np.bincount(faces[:, k], share[:, axis], minlength=len(vertices))
    normals = unit(total)
    normals[~normals.any(axis=1)] = (0.0, 0.0, 1.0)
    return normals


def make_mesh(
    vertices: Array,
    faces: Faces,
    *,
    tangents: Array | None = None,
    closed: bool = False,
    weights: Weights = "angle",
) -> Mesh:
    """Check triangles and average their normals.

    Raises
    ------
    SceneError
        No triangle, a vertex that is no point, a face of a vertex that is not there.
    """
    vertices = np.ascontiguousarray(vertices, dtype=np.float64)
    faces = np.ascontiguousarray(faces, dtype=np.intp)
    if vertices.ndim != 2 or vertices.shape[1:] != (3,) or faces.ndim != 2 or not faces.size:
        raise SceneError("a mesh has vertices of three coordinates and at least one triangle")
    if faces.shape[1] != 3 or faces.min() < 0 or faces.max() >= len(vertices):
        raise SceneError("a mesh has triangles of vertices that are there")
    if not np.isfinite(vertices).all():
        raise SceneError("a mesh has a vertex that is no point: its coordinates are not finite")
    normals = vertex_normals(vertices, faces, weights)
    return Mesh(vertices, faces, normals, tangents, closed)


def split(faces: Faces, n_vertices: int) -> tuple[Faces, Faces]:
    """Cut each triangle into four by the middles of its edges.

    Returns
    -------
    tuple of ndarray of int, shapes (4 F, 3) and (E, 2)
        The new faces, and the ends of the edges whose middles are the vertices added.
    """
    edges = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    key = edges[:, 0] * n_vertices + edges[:, 1]
    known, where = np.unique(key, return_inverse=True)
    middle = n_vertices + where.reshape(-1, 3)
    a, b, c = faces.T
    ab, bc, ca = middle.T
    quarters = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
    new = np.stack([np.stack(q, axis=1) for q in quarters], axis=1).reshape(-1, 3)
    return new, np.stack(np.divmod(known, n_vertices), axis=1)


def subdivide(mesh: Mesh) -> Mesh:
    """Cut each triangle into four; the surface stays, normals and tangents are interpolated."""
    faces, ends = split(mesh.faces, len(mesh.vertices))

    def with_middles(values: Array) -> Array:
        return np.concatenate([values, values[ends].mean(axis=1)])

    tangents = None if mesh.tangents is None else unit(with_middles(mesh.tangents))
    return Mesh(
        with_middles(mesh.vertices), faces, unit(with_middles(mesh.normals)), tangents, mesh.closed
    )


def transformed(mesh: Mesh, matrix: Array) -> Mesh:
    """Move a mesh by an affine matrix, shape (4, 4); normals by its inverse transpose."""
    linear = matrix[:3, :3]
    # A reflection turns the sense of the corners, and with it what is the front.
    faces = mesh.faces if np.linalg.det(linear) > 0.0 else mesh.faces[:, ::-1]
    return replace(
        mesh,
        vertices=mesh.vertices @ linear.T + matrix[:3, 3],
        faces=faces,
        normals=unit(mesh.normals @ np.linalg.inv(linear)),
        tangents=None if mesh.tangents is None else unit(mesh.tangents @ linear.T),
    )
