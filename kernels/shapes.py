"""Objects of a scene: sphere, plane, cylinder and a knot, as meshes and, the first three, exactly.

The sphere has radius 1; the plane is the square from -1 to 1 at z = 0, its front up; the cylinder
has radius 1 about the z axis from z = -1 to 1, with caps; the knot is a tube about a trefoil that
fits the sphere. A subdivision level more halves the edges.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from lobefit.kernels.errors import SceneError
from lobefit.kernels.mesh import Mesh, make_mesh, split, subdivide, unit

__all__ = ["EXACT", "SHAPES", "cylinder", "knot", "plane", "shape_mesh", "sphere"]

Array = NDArray[np.float64]
Faces = NDArray[np.intp]
Hits = tuple[Array, Array]

FINEST = 8


def sphere(level: int) -> Mesh:
    """Give an icosahedron with its triangles cut into four `level` times, on the unit sphere."""
    g = (1.0 + np.sqrt(5.0)) / 2.0
    corner = [(-1, g), (1, g), (-1, -g), (1, -g)]
    rows = [(a, b, 0) for a, b in corner] + [(0, a, b) for a, b in corner]
    vertices = unit(np.array(rows + [(b, 0, a) for a, b in corner], dtype=np.float64))
    numbers = (
        "0 11 5 0 5 1 0 1 7 0 7 10 0 10 11 1 5 9 5 11 4 11 10 2 10 7 6 7 1 8 "
        "3 9 4 3 4 2 3 2 6 3 6 8 3 8 9 4 9 5 2 4 11 6 2 10 8 6 7 9 8 1"
    )
    faces = np.array(numbers.split(), dtype=np.intp).reshape(-1, 3)
    for _ in range(level):
        faces, ends = split(faces, len(vertices))
        vertices = np.concatenate([vertices, unit(vertices[ends].sum(axis=1))])
    return make_mesh(vertices, faces, closed=True)


def _grid(rows: int, columns: int, *, wrap_rows: bool = False, wrap: bool = False) -> Faces:
    """Give two triangles for each cell of a grid of vertices; a wrapped side has no end."""
    height, width = rows + (not wrap_rows), columns + (not wrap)
    r, c = np.divmod(np.arange(rows * columns), columns)
    below, right = (r + 1) % height, (c + 1) % width
    a, b, d, e = r * width + c, r * width + right, below * width + c, below * width + right
    return np.concatenate([np.stack([a, b, e], axis=1), np.stack([a, e, d], axis=1)])


def plane(level: int) -> Mesh:
    """Give the square from -1 to 1 in 2^level by 2^level cells."""
    n = 2**level
    y, x = np.divmod(np.arange((n + 1) ** 2), n + 1)
    vertices = np.stack([2.0 * x / n - 1.0, 2.0 * y / n - 1.0, np.zeros(x.size)], axis=1)
    return make_mesh(vertices, _grid(n, n))


def cylinder(level: int) -> Mesh:
    """Give a cylinder of 6 times 2^level sides; its rims are sharp."""
    n, high = 6 * 2**level, 2**level
    around = np.arange(n) * (2.0 * np.pi / n)
    circle = np.stack([np.cos(around), np.sin(around), np.zeros(n)], axis=1)
    heights = np.linspace(-1.0, 1.0, high + 1)
    axis = np.array([0.0, 0.0, 1.0])
    side = np.concatenate([circle + z * axis for z in heights])
    parts, faces = [side], [_grid(high, n, wrap=True)]
    first = len(side)
    turn = np.arange(n)
    for z, order in ((-1.0, (0, 2, 1)), (1.0, (0, 1, 2))):
        parts.append(np.concatenate([z * axis[None], circle + z * axis]))
        fan = np.stack([np.zeros(n, np.intp), 1 + turn, 1 + (turn + 1) % n], axis=1)
        faces.append(first + fan[:, order])
        first += n + 1
    return make_mesh(np.concatenate(parts), np.concatenate(faces), closed=True)


def knot(level: int) -> Mesh:
    """Give a tube about a trefoil of 24 times 2^level rings of 4 times 2^level sides.

    The tangent runs along the tube, as the grain of a drawn wire does.
    """
    rings, sides = 24 * 2**level, 4 * 2**level
    t = np.arange(rings) * (2.0 * np.pi / rings)
    wide = 2.0 + np.cos(3.0 * t)
    centre = np.stack([wide * np.cos(2.0 * t), wide * np.sin(2.0 * t), np.sin(3.0 * t)], axis=1)
    slope = np.stack(
        [
            -3.0 * np.sin(3.0 * t) * np.cos(2.0 * t) - 2.0 * wide * np.sin(2.0 * t),
            -3.0 * np.sin(3.0 * t) * np.sin(2.0 * t) + 2.0 * wide * np.cos(2.0 * t),
            3.0 * np.cos(3.0 * t),
        ],
        axis=1,
    )
    along = unit(slope)
    # Upright, as far as the curve lets it; the curve is never vertical.
    across = unit(np.cross(along, (0.0, 0.0, 1.0)))
    up = np.cross(across, along)
    turn = (np.arange(sides) * (2.0 * np.pi / sides))[None, :, None]
    out = np.cos(turn) * across[:, None] + np.sin(turn) * up[:, None]
    tube = (centre[:, None] + 0.55 * out).reshape(-1, 3) / 3.55
    tangents = np.repeat(along, sides, axis=0)
    faces = _grid(rings, sides, wrap_rows=True, wrap=True)
    return make_mesh(tube, faces[:, ::-1], tangents=tangents, closed=True)


SHAPES: dict[str, Callable[[int], Mesh]] = {
    "sphere": sphere,
    "plane": plane,
    "cylinder": cylinder,
    "knot": knot,
}


def shape_mesh(shape: str | Mesh, level: int) -> Mesh:
    """Give an object as triangles.

    Parameters
    ----------
    shape : str or Mesh
        One of `SHAPES`, or a mesh of one's own, which keeps its surface: its triangles
        are cut and the normals interpolated.
    level : int
        Subdivision level, 0 to 8.

    Raises
    ------
    SceneError
        An unknown shape, or a level outside that range or of too many triangles.
    """
    if not 0 <= level <= FINEST:
        raise SceneError(f"a subdivision level is 0 to {FINEST}, not {level}")
    if isinstance(shape, str):
        if shape not in SHAPES:
            raise SceneError(f"no shape is called {shape!r}; known are {', '.join(SHAPES)}")
        return SHAPES[shape](level)
    if len(shape.faces) * 4**level > 4_000_000:
        raise SceneError(f"level {level} would cut the mesh into more than 4 million triangles")
    mesh = replace(shape)
    for _ in range(level):
        mesh = subdivide(mesh)
    return mesh


def _quadratic(a: Array, half_b: Array, c: Array) -> tuple[Array, Array]:
    """Roots of a t^2 + 2 half_b t + c in ascending order; infinite where there are none."""
    inside = half_b**2 - a * c
    real = (inside >= 0.0) & (a > 0.0)
    root = np.sqrt(np.where(real, inside, 0.0))
    safe = np.where(real, a, 1.0)
    near, far = (-half_b - root) / safe, (-half_b + root) / safe
    return np.where(real, near, np.inf), np.where(real, far, np.inf)


def _hit_sphere(o: Array, d: Array) -> Hits:
    near, far = _quadratic((d * d).sum(1), (o * d).sum(1), (o * o).sum(1) - 1.0)
    t = np.where(near > 0.0, near, np.where(far > 0.0, far, np.inf))
    return t, o + np.where(np.isfinite(t), t, 0.0)[:, None] * d


def _hit_level(o: Array, d: Array, z: float) -> Array:
    with np.errstate(divide="ignore", invalid="ignore"):
        t = (z - o[:, 2]) / d[:, 2]
    return np.where(np.isfinite(t) & (t > 0.0), t, np.inf)


def _at(o: Array, d: Array, t: Array) -> Array:
    return np.asarray(o + np.where(np.isfinite(t), t, 0.0)[:, None] * d)


def _hit_plane(o: Array, d: Array) -> Hits:
    t = _hit_level(o, d, 0.0)
    inside = (np.abs(_at(o, d, t)[:, :2]) <= 1.0).all(axis=1)
    return np.where(inside, t, np.inf), np.broadcast_to(np.array([0.0, 0.0, 1.0]), o.shape)


def _hit_cylinder(o: Array, d: Array) -> Hits:
    o2, d2 = o[:, :2], d[:, :2]
    best = np.full(len(o), np.inf)
    normal = np.zeros_like(o)
    for t in _quadratic((d2 * d2).sum(1), (o2 * d2).sum(1), (o2 * o2).sum(1) - 1.0):
        p = _at(o, d, t)
        better = (np.abs(p[:, 2]) <= 1.0) & (t > 0.0) & (t < best)
        best[better] = t[better]
        normal[better] = p[better] * (1.0, 1.0, 0.0)
    for z in (-1.0, 1.0):
        t = _hit_level(o, d, z)
        better = ((_at(o, d, t)[:, :2] ** 2).sum(axis=1) <= 1.0) & (t < best)
        best[better] = t[better]
        normal[better] = (0.0, 0.0, z)
    return best, normal


# For rays (origins, directions): distance along the ray, infinite for a miss, and the normal.
EXACT: dict[str, Callable[[Array, Array], Hits]] = {
    "sphere": _hit_sphere,
    "plane": _hit_plane,
    "cylinder": _hit_cylinder,
}
