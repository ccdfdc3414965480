"""Meshes, their normals, and what is seen of them."""

from __future__ import annotations

from pathlib import Path
from typing import Any, get_args

import numpy as np
import pytest

from lobefit.kernels.camera import Camera
from lobefit.kernels.errors import SceneError
from lobefit.kernels.lights import DirectionalLight
from lobefit.kernels.mesh import make_mesh, subdivide, transformed, vertex_normals
from lobefit.kernels.mesh_file import read_mesh
from lobefit.kernels.raster import rasterise
from lobefit.kernels.render import render
from lobefit.kernels.scene import Scene
from lobefit.kernels.shapes import SHAPES, shape_mesh, sphere
from lobefit.kernels.surface import Shading, make_surface

__all__: list[str] = []

VIEW = Camera(eye=(1.5, -3.0, 1.2), width=64, height=64)
SKEWED = np.array(
    [[1.3, 0.2, 0.0, 0.1], [0.0, 0.5, 0.1, 0.0], [0.1, 0.0, 0.9, -0.1], [0.0, 0.0, 0.0, 1.0]]
)
MIRRORED = SKEWED @ np.diag([1.0, 1.0, -1.0, 1.0])


def faces_normals(vertices: Any, faces: Any) -> Any:
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    return np.cross(b - a, c - a)


@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize("level", [0, 2])
def test_shapes_face_outwards(name: str, level: int) -> None:
    mesh = SHAPES[name](level)
    outward = faces_normals(mesh.vertices, mesh.faces)
    assert np.linalg.norm(mesh.vertices, axis=1).max() < 1.5
    assert (np.linalg.norm(outward, axis=1) > 0.0).all()
    # Averaged normals agree with the faces', and a closed mesh has a positive volume.
    assert ((outward[:, None] * mesh.normals[mesh.faces]).sum(axis=2) > 0.0).all()
    np.testing.assert_allclose(np.linalg.norm(mesh.normals, axis=1), 1.0, rtol=1e-12)
    if mesh.closed:
        corners = mesh.vertices[mesh.faces]
        volume = (corners[:, 0] * np.cross(corners[:, 1], corners[:, 2])).sum() / 6.0
        assert volume > 0.1


def test_averaged_normals_become_the_spheres() -> None:
    """Weights by angle; of the same sphere, the area's are close too."""
    for level, most in ((2, 1e-2), (4, 2.5e-3)):
        mesh = sphere(level)
        assert np.abs(mesh.normals - mesh.vertices).max() < most
        by_area = vertex_normals(mesh.vertices, mesh.faces, "area")
        assert np.abs(by_area - mesh.vertices).max() < 3.0 * most


def test_angle_weights_do_not_depend_on_how_a_side_is_cut() -> None:
    """A cube's corner, each side one triangle or two: by angle the diagonal, by area not."""
    corners = np.array(
        [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 0), (1, 0, 1), (0, 1, 1)], float
    )
    # One triangle on two of the sides, two on the third.
    faces = np.array([(0, 1, 4), (0, 4, 2), (0, 3, 1), (0, 2, 3)])
    angle = vertex_normals(corners, faces, "angle")[0]
    area = vertex_normals(corners, faces, "area")[0]
    assert np.ptp(np.abs(angle)) < 1e-12
    assert np.ptp(np.abs(area)) > 0.1


@pytest.mark.parametrize("matrix", [SKEWED, MIRRORED], ids=["skewed", "mirrored"])
def test_normals_follow_the_inverse_transpose(matrix: Any) -> None:
    """Against differences of transformed points along two directions of the sphere's surface."""
    mesh = sphere(3)
    moved = transformed(make_mesh(mesh.vertices, mesh.faces, closed=True), matrix)
    p = mesh.normals  # where the averaged normal is the sphere's own
    u = np.cross(p, (0.3, 0.5, 0.8))
    v = np.cross(p, u)
    step = 1e-5

    def on(x: Any) -> Any:
        return (x / np.linalg.norm(x, axis=1, keepdims=True)) @ matrix[:3, :3].T

    along_u = on(p + step * u) - on(p - step * u)
    along_v = on(p + step * v) - on(p - step * v)
    expected = np.cross(along_u, along_v) * np.sign(np.linalg.det(matrix[:3, :3]))
    expected /= np.linalg.norm(expected, axis=1, keepdims=True)
    assert np.abs(moved.normals - expected).max() < 1e-9
    outward = faces_normals(moved.vertices, moved.faces)
    assert ((outward[:, None] * moved.normals[moved.faces]).sum(axis=2) > 0.0).all()


@pytest.mark.parametrize("matrix", [np.eye(4), SKEWED, MIRRORED])
def test_phong_shading_finds_the_true_surface(matrix: Any) -> None:
    """Position and normal of the finest mesh are those of the exact intersection."""
    for shape in ("sphere", "cylinder"):
        exact = make_surface(shape, VIEW, matrix, "exact", 0)
        found = make_surface(shape, VIEW, matrix, "phong", 5)
        both, a, b = np.intersect1d(exact.pixels, found.pixels, return_indices=True)
        assert both.size > 0.97 * max(exact.pixels.size, found.pixels.size)
        near = np.linalg.norm(exact.position[a] - found.position[b], axis=1)
        turned = np.linalg.norm(exact.normal[a] - found.normal[b], axis=1)
        assert np.quantile(near, 0.99) < 0.02
        assert np.quantile(turned, 0.99) < 0.02
        assert np.abs((exact.tangent * exact.normal).sum(axis=1)).max() < 1e-12


@pytest.mark.parametrize("kind, field", [("perspective", 40.0), ("orthographic", 2.4)])
def test_the_nearest_surface_is_seen(kind: Any, field: float) -> None:
    """The depth buffer against every triangle tried at every pixel by another formula."""
    view = Camera(eye=(0.5, -3.0, 0.8), width=24, height=24, kind=kind, field=field)
    mesh = shape_mesh("knot", 0)
    seen = rasterise(mesh, view)
    nearest = np.full(24 * 24, np.inf)
    origins, directions = view.rays(np.arange(24 * 24))
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    for pixel, (o, d) in enumerate(zip(origins, directions, strict=True)):
        system = np.stack([b - a, c - a, np.broadcast_to(-d, a.shape)], axis=2)
        u, v, t = np.linalg.solve(system, (o - a)[..., None])[..., 0].T
        hit = (u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0)
        nearest[pixel] = t[hit].min(initial=np.inf)
    assert 100 < seen.pixels.size < 400
    np.testing.assert_array_equal(seen.pixels, np.flatnonzero(np.isfinite(nearest)))
    np.testing.assert_allclose(seen.depth, nearest[seen.pixels], rtol=1e-9)
    # Several layers lie over each other, so that something is hidden.
    assert seen.front.all()


def test_neither_cracks_nor_what_is_behind_the_eye() -> None:
    inside = Camera(eye=(0.0, -0.2, 0.1), target=(0.0, 1.0, 0.0), width=32, height=32)
    mesh = shape_mesh("sphere", 3)
    assert rasterise(mesh, inside).pixels.size == 0  # backs of a closed mesh
    room = make_mesh(mesh.vertices, mesh.faces)
    seen = rasterise(room, inside)
    assert seen.pixels.size == 32 * 32
    assert not seen.front.any()


def test_both_sides_of_an_open_mesh_are_lit() -> None:
    light = (DirectionalLight((0.0, 0.0, -1.0)),)
    below = Camera(eye=(0.0, -1.0, -3.0), width=16, height=16)
    for shading in get_args(Shading):
        scene = Scene(shape="plane", lights=light, camera=below)
        picture = render(scene, "lambert", {"k_d": 1.0}, shading=shading, subdivision=1)
        np.testing.assert_allclose(picture.beauty[0][picture.mask], 1.0 / np.pi, rtol=1e-6)


def write_obj(path: Path, vertices: Any, faces: Any) -> None:
    rows = [f"v {x:.9f} {y:.9f} {z:.9f}" for x, y, z in vertices]
    rows += [f"f {a} {b} {c}" for a, b, c in faces + 1]
    path.write_text("\n".join(["mtllib ../../secret.mtl", *rows]), encoding="utf-8")


def test_an_obj_file_is_the_mesh_that_was_written(tmp_path: Path) -> None:
    pytest.importorskip("trimesh")
    mesh = sphere(2)
    path = tmp_path / "ball.obj"
    # Every triangle with corners of its own, as exporters write seams.
    write_obj(path, mesh.vertices[mesh.faces.ravel()], np.arange(mesh.faces.size).reshape(-1, 3))
    found = read_mesh(path)
    assert found.closed
    assert len(found.vertices) == len(mesh.vertices)
    pictures = [
        render(
            Scene(shape=shape, lights=(DirectionalLight((1.0, -1.0, 1.0)),), camera=VIEW),
            "lambert",
            {},
            subdivision=level,
        ).beauty
        for shape, level in ((found, 0), ("sphere", 2))
    ]
    np.testing.assert_allclose(pictures[0], pictures[1], atol=1e-5)
    twice = subdivide(found)
    assert len(twice.faces) == 4 * len(found.faces)


@pytest.mark.parametrize(
    "name, text, said",
    [
        ("a.stl", "solid", "does not end in .obj"),
        ("a.obj", "f 1 2 3", ""),
        ("a.obj", "v 0 0 0\nv 1 0 0\nv nan 1 0\nf 1 2 3", ""),
        ("a.obj", "nothing", ""),
        ("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9", "a vertex that is not there"),
        ("missing.obj", None, "cannot be read"),
    ],
)
def test_what_is_no_mesh_is_refused(tmp_path: Path, name: str, text: str | None, said: str) -> None:
    pytest.importorskip("trimesh")
    if text is not None:
        (tmp_path / name).write_text(text, encoding="utf-8")
    with pytest.raises(SceneError, match=f"{name}.*{said}"):
        read_mesh(tmp_path / name)
