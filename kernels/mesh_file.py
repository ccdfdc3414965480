"""Meshes from Wavefront OBJ files, read by trimesh."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np

from lobefit.kernels.errors import SceneError
from lobefit.kernels.mesh import Mesh, Weights, make_mesh

__all__ = ["read_mesh"]

LARGEST = 64 << 20  # bytes
MOST_FACES = 2_000_000


def read_mesh(path: str | Path, *, weights: Weights = "angle") -> Mesh:
    """Read the triangles of an OBJ file.

    Vertices at the same place are one, whatever their texture coordinates, and the normals of
    the file are not used: they are averaged anew. Materials and textures are not opened.

    Parameters
    ----------
    path : str or Path
        The file, of 64 MiB at most.
    weights : {"angle", "area"}
        See `lobefit.kernels.mesh.vertex_normals`.

    Raises
    ------
    SceneError
        trimesh is not installed; no such file; it is too large, or no mesh.
    """
    try:
        import trimesh
    except ImportError as error:
        raise SceneError(
            f"reading meshes needs trimesh ({error}); install it with `pip install trimesh`"
        ) from error
    path = Path(path)
    if path.suffix.lower() != ".obj":
        raise SceneError(f"{path.name} is no Wavefront OBJ file: its name does not end in .obj")
    try:
        size = path.stat().st_size
        if size > LARGEST:
            raise SceneError(f"{path.name} has {size >> 20} MiB; {LARGEST >> 20} are the most")
        data = path.read_bytes()
    except OSError as error:
        raise SceneError(f"{path.name} cannot be read: {error.strerror}") from error
    try:
        # From memory, without a folder: a material library that it names is not looked for.
        loaded = trimesh.load_mesh(
            io.BytesIO(data), file_type="obj", skip_materials=True, process=False
        )
        loaded.merge_vertices(merge_tex=True, merge_norm=True)
        vertices = np.asarray(loaded.vertices, dtype=np.float64)
        faces = np.asarray(loaded.faces, dtype=np.intp)
        closed = bool(loaded.is_watertight and loaded.is_winding_consistent)
    except IndexError as error:
        raise SceneError(
            f"{path.name} cannot be read as a mesh: a face names a vertex that is not there ({error})"
        ) from error
    except Exception as error:  # trimesh raises whatever its parser stumbles over
        raise SceneError(f"{path.name} cannot be read as a mesh: {error}") from error
    if len(faces) > MOST_FACES:
        raise SceneError(f"{path.name} has {len(faces)} triangles; {MOST_FACES} are the most")
    if closed and loaded.volume < 0.0:  # inside out
        faces = faces[:, ::-1]
    try:
        return make_mesh(vertices, faces, closed=closed, weights=weights)
    except SceneError as error:
        raise SceneError(f"{path.name}: {error}") from error
