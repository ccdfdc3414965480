"""The scene file: what is asked, read strictly.

A JSON document, schema ``lobefit.scene/1``; files that it names lie in its folder or below.

==============  ====================================================================================
key             what stands there
==============  ====================================================================================
schema          "lobefit.scene/1"
description     text, optional
object          {"shape": "sphere", "plane", "cylinder", "knot" or "mesh"; "file": an OBJ, for
                "mesh"; "subdivision": one level or several to choose from, by default 5,
                3 for the knot and 0 for a mesh; "transform": steps in order, each {"scale": number or [x, y, z]},
                {"rotate": {"axis": [x, y, z], "degrees": a}}, {"translate": [x, y, z]} or
                {"matrix": four rows of four}}
lights          array of {"kind": "directional", "direction": towards the light, "irradiance": E}
                and {"kind": "point", "position": ..., "intensity": irradiance at distance 1};
                a number or one for each channel
ambient         radiance that the diffuse term alone reflects; 0 by default
environment     {"file": latitude-longitude OpenEXR, "scale": 1}, optional
view            {"eye", "target", "up", "kind": "perspective" or "orthographic", "field": degrees
                or world units, "width", "height"}, all optional
tolerance       {"delta_e": {"mean": a, "p99": b}} or {"relative": {"mean": a, "p99": b}}
exposure        {"percentile": 99, "level": 0.9} by default, or {"factor": number}
models          candidates of the report to choose from; all by default
shadings        of "flat", "gouraud", "phong"; all by default
==============  ====================================================================================
"""

from __future__ import annotations

import hashlib
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from lobefit.fitting.scene_json import Node, read_node
from lobefit.kernels.camera import Camera
from lobefit.kernels.errors import SceneError
from lobefit.kernels.lights import DirectionalLight, Light, PointLight
from lobefit.kernels.shapes import FINEST, SHAPES
from lobefit.kernels.surface import Shading

__all__ = ["SCHEMA", "Exposure", "SceneRequest", "Tolerance", "read_scene"]

SCHEMA = "lobefit.scene/1"
SHADINGS: tuple[Shading, ...] = ("flat", "gouraud", "phong")
KEYS = (
    *("schema", "description", "object", "lights", "ambient", "environment", "view"),
    *("tolerance", "exposure", "models", "shadings"),
)
MOST_LIGHTS, MOST_MODELS, MOST_PIXELS = 64, 64, 4096
BRIGHTEST = 1e6
KNOT_FINEST = 6  # 786,432 triangles
Array = NDArray[np.float64]


@dataclass(frozen=True)
class Tolerance:
    """How far a picture may be from the reference.

    Attributes
    ----------
    measure : {"delta_e", "relative"}
        CIE ΔE2000 after exposure, or the relative error of radiance.
    mean, p99 : float
        Over the pixels that show the object: the mean and the 99th percentile.
    """

    measure: Literal["delta_e", "relative"]
    mean: float
    p99: float

    def scaled(self, factor: float) -> Tolerance:
        """Give the tolerance tightened or loosened."""
        return Tolerance(self.measure, self.mean * factor, self.p99 * factor)

    def excess(self, mean: float, p99: float) -> float:
        """Give by how many times errors exceed it; 1 and below is within."""
        return max(mean / self.mean, p99 / self.p99)


@dataclass(frozen=True)
class Exposure:
    """What radiance is multiplied by before it is shown, the same for every picture.

    Attributes
    ----------
    factor : float or None
        That number, or None: so that the percentile of the reference gets to the level.
    percentile, level : float
        Of the brightest channel over the object's pixels, and of linear sRGB.
    """

    factor: float | None = None
    percentile: float = 99.0
    level: float = 0.9


@dataclass(frozen=True, eq=False)
class SceneRequest:
    """What a scene file asks.

    Attributes
    ----------
    file : Path
        The scene file.
    sha256 : str
        Its digest.
    description : str
    shape : str
        See `lobefit.kernels.shapes.SHAPES`, or "mesh".
    mesh : Path or None
        The OBJ file of a mesh.
    levels : tuple of int
        Subdivision levels to choose from.
    matrix : ndarray, shape (4, 4)
        The object's transform.
    lights : tuple of Light
    ambient : tuple of float
    environment : Path or None
    environment_scale : float
    camera : Camera
    tolerance : Tolerance
    exposure : Exposure
    models : tuple of str
        Candidates to choose from; none for all.
    shadings : tuple of str
    """

    file: Path
    sha256: str
    description: str
    shape: str
    mesh: Path | None
    levels: tuple[int, ...]
    matrix: Array
    lights: tuple[Light, ...]
    ambient: tuple[float, ...]
    environment: Path | None
    environment_scale: float
    camera: Camera
    tolerance: Tolerance
    exposure: Exposure
    models: tuple[str, ...]
    shadings: tuple[Shading, ...]


def read_scene(path: str | os.PathLike[str]) -> SceneRequest:
    """Read a scene file.

    Parameters
    ----------
    path : path-like
        A JSON document; see the table above.

    Raises
    ------
    SceneError
        It cannot be read, or a value is wrong; the message has a pointer to it.
    """
    file = Path(path)
    root = read_node(file)
    top = root.members(KEYS, ("schema", "object", "tolerance"))
    top["schema"].choice((SCHEMA,))
    shape, mesh, levels, matrix = _object(top["object"], file.parent)
    lights = tuple(_light(n) for n in _items(top, "lights", MOST_LIGHTS))
    environment, scale = _environment(top.get("environment"), file.parent)
    if not lights and environment is None:
        root.fail("a scene needs light; add an entry to lights, or an environment")
    models = tuple(n.text(200) for n in _items(top, "models", MOST_MODELS))
    chosen = {n.choice(SHADINGS) for n in _items(top, "shadings", len(SHADINGS))}
    return SceneRequest(
        file=file,
        sha256=hashlib.sha256(file.read_bytes()).hexdigest(),
        description=top["description"].text() if "description" in top else "",
        shape=shape,
        mesh=mesh,
        levels=levels,
        matrix=matrix,
        lights=lights,
        ambient=top["ambient"].per_channel(BRIGHTEST) if "ambient" in top else (0.0,),
        environment=environment,
        environment_scale=scale,
        camera=_view(top.get("view")),
        tolerance=_tolerance(top["tolerance"]),
        exposure=_exposure(top.get("exposure")),
        models=models,
        shadings=tuple(s for s in SHADINGS if not chosen or s in chosen),
    )


def _items(top: dict[str, Node], key: str, most: int) -> list[Node]:
    return top[key].items(most, int(key != "lights")) if key in top else []


def _beside(node: Node, folder: Path, ending: str) -> Path:
    """Give a file that lies in the scene's folder or below."""
    name = node.text(400)
    path = folder / name
    if not name or "\0" in name or not path.resolve().is_relative_to(folder.resolve()):
        node.fail("files lie in the scene's folder or below it; copy the file there")
    if path.suffix.lower() != ending:
        node.fail(f"a file whose name ends in {ending} is expected")
    if not path.is_file():
        node.fail(f"there is no such file beside the scene: {name}")
    return path


def _object(node: Node, folder: Path) -> tuple[str, Path | None, tuple[int, ...], Array]:
    keys = node.members(("shape", "file", "subdivision", "transform"), ("shape",))
    shape = keys["shape"].choice((*SHAPES, "mesh"))
    if (shape == "mesh") != ("file" in keys):
        node.fail("'file' goes with the shape 'mesh', and only with it")
    mesh = _beside(keys["file"], folder, ".obj") if "file" in keys else None
    levels: tuple[int, ...] = ({"mesh": 0, "knot": 3}.get(shape, 5),)
    if "subdivision" in keys:
        given = keys["subdivision"]
        several = given.items(4, 1) if isinstance(given.value, list) else [given]
        finest = KNOT_FINEST if shape == "knot" else FINEST
        levels = tuple(sorted({n.whole(0, finest) for n in several}))
    matrix = np.eye(4)
    for step in keys["transform"].items(16) if "transform" in keys else ():
        matrix = _step(step) @ matrix
    return shape, mesh, levels, matrix


def _step(node: Node) -> Array:
    members = node.members(("scale", "rotate", "translate", "matrix"))
    if len(members) != 1:
        node.fail("one of scale, rotate, translate and matrix is expected")
    (kind, value), matrix = next(iter(members.items())), np.eye(4)
    if kind == "matrix":
        rows = [[n.number() for n in row.items(4, 4)] for row in value.items(4, 4)]
        return np.array(rows)
    if kind == "translate":
        matrix[:3, 3] = value.vector()
    elif kind == "scale":
        one = not isinstance(value.value, list)
        matrix[:3, :3] *= np.diag((value.number(),) * 3 if one else value.vector())
    else:
        parts = value.members(("axis", "degrees"), ("axis", "degrees"))
        axis, angle = np.array(parts["axis"].vector()), np.radians(parts["degrees"].number())
        if not np.linalg.norm(axis) > 0.0:
            parts["axis"].fail("an axis is not zero")
        x, y, z = axis / np.linalg.norm(axis)
        cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        # Rodrigues' formula.
        turn = np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross
        matrix[:3, :3] = turn
    return matrix


def _light(node: Node) -> Light:
    kinds = {"directional": ("direction", "irradiance"), "point": ("position", "intensity")}
    every = ("kind", *(key for keys in kinds.values() for key in keys))
    kind = node.members(every, ("kind",))["kind"].choice(tuple(kinds))
    place, strength = kinds[kind]
    members = node.members(("kind", place, strength), (place, strength))
    vector, power = members[place].vector(), members[strength].per_channel(BRIGHTEST)
    if kind == "point":
        return PointLight(vector, power)
    if not any(vector):
        members[place].fail("a direction is not zero; give the vector towards the light")
    return DirectionalLight(vector, power)


def _environment(node: Node | None, folder: Path) -> tuple[Path | None, float]:
    if node is None:
        return None, 1.0
    members = node.members(("file", "scale"), ("file",))
    scale = members["scale"].number(0.0, BRIGHTEST) if "scale" in members else 1.0
    return _beside(members["file"], folder, ".exr"), scale


def _view(node: Node | None) -> Camera:
    if node is None:
        return Camera()
    keys = node.members(("eye", "target", "up", "kind", "field", "width", "height"))
    given: dict[str, object] = {k: keys[k].vector() for k in ("eye", "target", "up") if k in keys}
    given |= {k: keys[k].whole(1, MOST_PIXELS) for k in ("width", "height") if k in keys}
    if "kind" in keys:
        given["kind"] = keys["kind"].choice(("perspective", "orthographic"))
    if "field" in keys:
        given["field"] = keys["field"].number(1e-9)
    try:
        return Camera(**given)  # type: ignore[arg-type]
    except SceneError as error:
        node.fail(str(error))


def _tolerance(node: Node) -> Tolerance:
    members = node.members(("delta_e", "relative"))
    if len(members) != 1:
        node.fail('either {"delta_e": ...} or {"relative": ...} is expected')
    measure, value = next(iter(members.items()))
    parts = value.members(("mean", "p99"), ("mean", "p99"))
    mean, p99 = (parts[k].number(1e-6, 100.0) for k in ("mean", "p99"))
    return Tolerance("delta_e" if measure == "delta_e" else "relative", mean, p99)


def _exposure(node: Node | None) -> Exposure:
    if node is None:
        return Exposure()
    members = node.members(("factor", "percentile", "level"))
    if "factor" in members:
        if len(members) > 1:
            node.fail("a factor leaves nothing for percentile and level to say")
        return Exposure(factor=members["factor"].number(1e-9, 1e9))
    default = Exposure()
    return Exposure(
        percentile=members["percentile"].number(1.0, 100.0)
        if "percentile" in members
        else default.percentile,
        level=members["level"].number(1e-3, 1.0) if "level" in members else default.level,
    )
