"""Which triangle is seen at each pixel: a depth buffer over candidate pixels.

Every triangle is tried at the pixels of its bounding box, by the intersection of the pixel's ray
with it (T. Moeller, B. Trumbore, Fast, minimum storage ray/triangle intersection, Journal of
Graphics Tools 2(1), 1997), so that barycentric coordinates are right in perspective and no
triangle need be clipped. Done once per scene, in double precision.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lobefit.kernels.camera import Camera
from lobefit.kernels.mesh import Mesh

__all__ = ["Coverage", "rasterise"]

Array = NDArray[np.float64]
Index = NDArray[np.intp]

AT_ONCE = 1 << 20  # candidates tried at once
EDGE = 1e-9  # triangles overlap by this share of an edge, so that no crack is between them


@dataclass(frozen=True, eq=False)
class Coverage:
    """What is seen.

    Attributes
    ----------
    pixels : ndarray of int, shape (N,)
        Those that show the mesh, ``row * width + column``, ascending.
    triangle : ndarray of int, shape (N,)
        The face seen there.
    barycentric : ndarray, shape (N, 3)
        Weights of its corners.
    front : ndarray of bool, shape (N,)
        Whether its front is seen.
    depth : ndarray, shape (N,)
        Along the line of sight.
    """

    pixels: Index
    triangle: Index
    barycentric: Array
    front: NDArray[np.bool_]
    depth: Array


def _intersect(
    mesh: Mesh, camera: Camera, triangle: Index, pixel: Index
) -> tuple[Array, Array, Array, Array]:
    """Give depth (infinite for a miss), two barycentric weights and the side's sign."""
    o, d = camera.rays(pixel)
    a, b, c = (mesh.vertices[mesh.faces[triangle, k]] for k in range(3))
    ab, ac, ao = b - a, c - a, o - a
    n = np.cross(ab, ac)
    facing = -(d * n).sum(axis=1)
    # Seen edge-on it is not seen.
    safe = np.where(facing != 0.0, facing, 1.0)
    dao = np.cross(ao, d)
    u, v = (ac * dao).sum(axis=1) / safe, -(ab * dao).sum(axis=1) / safe
    t = (ao * n).sum(axis=1) / safe
    hit = (facing != 0.0) & (u >= -EDGE) & (v >= -EDGE) & (u + v <= 1.0 + EDGE) & (t > 0.0)
    return np.where(hit, t, np.inf), u, v, facing


def _boxes(mesh: Mesh, camera: Camera) -> tuple[Index, Index]:
    """Give first and last pixel (column, row) of each face's bounding box, shapes (2, F)."""
    x, y, depth = camera.project(mesh.vertices)
    limit = np.array([camera.width, camera.height])[:, None]
    corners = np.stack([x, y])[:, mesh.faces]
    with np.errstate(invalid="ignore"):
        first = np.floor(corners.min(axis=2) - 0.5 - 1e-6)
        last = np.ceil(corners.max(axis=2) - 0.5 + 1e-6)
    if camera.kind == "perspective":  # a corner behind the eye projects anywhere
        behind = depth[mesh.faces] <= 0.0
        some = behind.any(axis=1)
        first[:, some], last[:, some] = 0, (limit - 1)
        none = behind.all(axis=1)
        first[:, none], last[:, none] = 0, -1
    return (
        np.clip(first, 0, limit).astype(np.intp),
        np.clip(last, -1, limit - 1).astype(np.intp),
    )


def rasterise(mesh: Mesh, camera: Camera) -> Coverage:
    """Find the nearest triangle at the centre of each pixel.

    Parameters
    ----------
    mesh : Mesh
        In world coordinates. Backs of a closed mesh are left out.
    camera : Camera
        The view.

    Returns
    -------
    Coverage
        Of equal depths, the face of the lowest number wins.
    """
    first, last = _boxes(mesh, camera)
    size = np.maximum(last - first + 1, 0)
    faces = np.flatnonzero(size.prod(axis=0))
    if mesh.closed:
        a, b, c = (mesh.vertices[mesh.faces[faces, k]] for k in range(3))
        seen = (np.cross(b - a, c - a) * camera.towards(a)).sum(axis=1) > 0.0
        faces = faces[seen]
    counts = size[:, faces].prod(axis=0)
    best = np.full(camera.width * camera.height, np.inf)
    who = np.zeros(best.size, dtype=np.intp)
    ends = np.cumsum(counts)
    start = 0
    while start < len(faces):
        done = ends[start - 1] if start else 0
        stop = max(start + 1, int(np.searchsorted(ends, done + AT_ONCE, side="right")))
        some = faces[start:stop]
        triangle = np.repeat(some, counts[start:stop])
        nth = np.arange(triangle.size) - np.repeat(
            ends[start:stop] - counts[start:stop] - done, counts[start:stop]
        )
        down, right = np.divmod(nth, size[0, triangle])
        pixel = (first[1, triangle] + down) * camera.width + first[0, triangle] + right
        t = _intersect(mesh, camera, triangle, pixel)[0]
        hit = np.flatnonzero(np.isfinite(t))
        triangle, pixel, t = triangle[hit], pixel[hit], t[hit]
        before = best[pixel]
        np.minimum.at(best, pixel, t)
        won = np.flatnonzero((t == best[pixel]) & (t < before))[::-1]
        who[pixel[won]] = triangle[won]
        start = stop
    pixels = np.flatnonzero(np.isfinite(best))
    depth, u, v, facing = _intersect(mesh, camera, who[pixels], pixels)
    weights = np.clip(np.stack([1.0 - u - v, u, v], axis=1), 0.0, 1.0)
    return Coverage(
        pixels, who[pixels], weights / weights.sum(axis=1, keepdims=True), facing > 0.0, depth
    )
