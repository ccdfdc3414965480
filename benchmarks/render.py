"""The renderer's speed beside vectorised numpy: a sphere under two directional lights.

    python -m benchmarks.render

512 x 512 pixels, shaded per pixel (Phong). Both start from the same visible points with their
normals, tangents and views, found beforehand, in single precision, and end with radiance of three
channels in host memory: Lobefit with its kernel on all cores, its diffuse and specular parts apart;
numpy on one, by the transcriptions that the tests hold the kernels against. Megapixels are those
that show the sphere, per second: of the kernel alone, and to host memory. Then two lobes in an
environment, and the pictures of a decision: twelve models, each flat, Gouraud and Phong, from the
scene to the pictures, in this process's first and second go (the first compiles what the runtime's
cache does not have). The decision itself, errors and timing included, is in ``benchmarks.scene``.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any, get_args

import numpy as np
from numpy.typing import NDArray

from benchmarks.models import PreparedGeometry, handed
from benchmarks.timing import cores, interleave, machine, ratio
from lobefit.kernels import get_device
from lobefit.kernels.camera import Camera
from lobefit.kernels.lights import DirectionalLight, Environment
from lobefit.kernels.registry import get_model
from lobefit.kernels.render import Prepared
from lobefit.kernels.scene import Scene
from lobefit.kernels.surface import Shading, Surface
from tests.kernels.transcriptions import Geometry, load

__all__ = ["run", "table"]

Single = NDArray[np.float32]

SCENE = Scene(
    lights=(
        DirectionalLight((1.0, -1.0, 1.0), (3.0, 2.8, 2.5)),
        DirectionalLight((-1.0, -0.5, 0.2), (0.5, 0.6, 1.0)),
    ),
    camera=Camera(eye=(0.0, -4.0, 1.0), field=29.0),
)
DECISION = (
    *("lambert", "oren_nayar", "phong", "modified_phong", "blinn_phong", "ward"),
    *("cook_torrance", "beckmann", "ggx", "ggx_anisotropic", "student_t", "ggx+ggx"),
)
MODELS = tuple(name for name in DECISION if "+" not in name)
ROUGHNESS = (0.05, 0.3)  # of GGX in the environment: a narrow and a broad lobe


def _params(name: str) -> dict[str, Any]:
    """Give every parameter: defaults, with three channels of k_d and a lobe that is not round."""
    known = get_model(name).choose(None)
    full: dict[str, Any] = {p.name: p.default for p in (*known.linear, *known.nonlinear)}
    full |= {"k_d": [0.5, 0.4, 0.3]}
    return full | ({"alpha_x": 0.4, "alpha_y": 0.1} if "alpha_x" in full else {})


def numpy_renderer(name: str, surface: Surface) -> Callable[[], Single]:
    """Give a call that shades the points with numpy: radiance (3, N)."""
    formula, params = load(name), _params(name)
    parts = (surface.tangent, np.cross(surface.normal, surface.tangent), surface.normal)
    frame = np.stack([part.T for part in parts]).astype(np.float32)  # [axis, xyz, N]
    o = np.einsum("axn,xn->an", frame, surface.view.T.astype(np.float32))
    up = np.eye(3, dtype=np.float32)[:, 2:]
    rows = [light.row() for light in SCENE.lights]
    lights = [(r[:3].astype(np.float32), e.astype(np.float32)[:, None]) for r, e in rows]
    angles = np.zeros((4, o.shape[1]), dtype=np.float32)  # the geometry is handed over instead

    def shade() -> Single:
        total = np.zeros((3, o.shape[1]), dtype=np.float32)
        for towards, irradiance in lights:
            i = np.einsum("axn,x->an", frame, towards)
            lit = i[2] > 0.0
            arriving = irradiance * np.where(lit, i[2], np.float32(0.0))
            ready = PreparedGeometry(Geometry(np.where(lit, i, up), o, lit))
            with handed(name, ready), np.errstate(all="ignore"):  # tails underflow
                total += formula(*angles, **params) * arriving
        return total

    return shade


def _decision() -> tuple[float, float]:
    """Give the seconds of everything and, of them, of what is done once per shading."""
    start, once = time.perf_counter(), 0.0
    for shading in get_args(Shading)[:3]:
        began = time.perf_counter()
        with Prepared(SCENE, shading=shading) as prepared:
            once += time.perf_counter() - began
            for name in DECISION:
                assert prepared.render(name, {}).beauty.shape == (3, 512, 512)
    return time.perf_counter() - start, once


def _room() -> Environment:
    """A dim room of 128 rows with a window."""
    picture = np.full((128, 256, 3), (0.2, 0.25, 0.3))
    picture[40:60, 100:140] = 8.0
    return Environment(picture)


def _environment(alpha: float) -> float:
    """Give the megapixels a second of the kernels for GGX in an environment."""
    scene = replace(SCENE, lights=(), environment=_room())
    params = _params("ggx") | {"alpha": alpha}
    with Prepared(scene, shading="phong") as prepared:
        once = [prepared.render("ggx", params, estimate=False).seconds for _ in range(4)]
        return len(prepared.surface.pixels) / min(once[1:]) / 1e6


def run() -> dict[str, Any]:
    """Time every model both ways, and a decision; returns a JSON-able record."""
    get_device()  # opening it is no part of either
    decisions = [_decision() for _ in range(2)]
    rows = []
    with Prepared(SCENE, shading="phong") as prepared:
        pixels = len(prepared.surface.pixels)
        for name in MODELS:
            params = _params(name)
            theirs = numpy_renderer(name, prepared.surface)
            ours = prepared.render(name, params)
            found = ours.beauty[:, ours.mask]
            difference = float(np.abs(found - theirs()).max() / found.max())
            shading: list[float] = []

            def lobefit(
                name: str = name, params: dict[str, Any] = params, s: list[float] = shading
            ) -> None:
                s.append(prepared.render(name, params).seconds)

            timings = interleave({"lobefit": lobefit, "numpy": theirs}, rounds=7, least_s=0.05)
            rows.append(
                {
                    "name": name,
                    "lobefit_megapixels_per_s": pixels / timings["lobefit"].median / 1e6,
                    "kernel_megapixels_per_s": pixels / float(np.median(shading)) / 1e6,
                    "numpy_megapixels_per_s": pixels / timings["numpy"].median / 1e6,
                    "lobefit_faster": ratio(timings["numpy"], timings["lobefit"]),
                    "relative_difference": difference,
                    "timings": {key: timing.to_dict() for key, timing in timings.items()},
                }
            )
    return {
        "device": str(get_device().info),
        "cores": cores(),
        "pixels": pixels,
        "rows": rows,
        "environment_megapixels_per_s": {alpha: _environment(alpha) for alpha in ROUGHNESS},
        "decision_s": [total for total, _ in decisions],
        "once_per_scene_s": [once for _, once in decisions],
    }


def table(result: dict[str, Any]) -> str:
    """Lay out the result of `run` for reading."""
    lines = [
        f"OpenCL device: {result['device']}, {result['cores']} cores; numpy on one core",
        f"megapixels/s; {result['pixels']} pixels show the sphere",
        (
            f"{'':<18}{'kernel':>9}{'to host':>9}{'numpy':>9}{'kernel is':>12}"
            f"{'to host is':>12}{'difference':>12}"
        ),
    ]
    lines += [
        f"{row['name']:<18}{row['kernel_megapixels_per_s']:>9.1f}"
        f"{row['lobefit_megapixels_per_s']:>9.1f}{row['numpy_megapixels_per_s']:>9.2f}"
        f"{row['kernel_megapixels_per_s'] / row['numpy_megapixels_per_s']:>10.1f} x"
        f"{row['lobefit_faster']:>10.1f} x{row['relative_difference']:>12.1e}"
        for row in result["rows"]
    ]
    lines += [
        f"ggx, alpha {alpha}, in an environment of 128 rows: {speed:.2f} (kernels)"
        for alpha, speed in result["environment_megapixels_per_s"].items()
    ]
    for go, total, once in zip(
        ("first", "second"), result["decision_s"], result["once_per_scene_s"], strict=True
    ):
        lines.append(
            f"{len(DECISION)} models, flat, Gouraud and Phong, {go} go: {total:.2f} s, "
            f"of which {once:.2f} s to find what is seen"
        )
    return "\n".join(lines)


def main() -> None:
    """Print the machine and the table."""
    print("; ".join(f"{key} {value}" for key, value in machine().items()))
    print(table(run()))


if __name__ == "__main__":
    main()
