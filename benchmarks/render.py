"""The renderer's speed beside vectorised numpy: a sphere under two directional lights.

    python -m benchmarks.render

512 x 512 pixels, shaded per pixel (Phong). Both start from the same visible points with their
normals, tangents and views, found beforehand, in single precision, and end with diffuse and
specular radiance of three channels in host memory: Lobefit with its kernel on all cores, numpy
on one. Megapixels are those that show the sphere, per second. Then the whole of what a decision
takes: twelve models, each flat, Gouraud and Phong, from the scene to the pictures, in
this process's first and second go (the first compiles what the runtime's cache does not have).
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any, get_args

import numpy as np
from numpy.typing import NDArray

from benchmarks.timing import cores, interleave, machine, ratio
from lobefit.kernels import get_device
from lobefit.kernels.camera import Camera
from lobefit.kernels.lights import DirectionalLight
from lobefit.kernels.render import Prepared
from lobefit.kernels.scene import Scene
from lobefit.kernels.surface import Shading, Surface

__all__ = ["run", "table"]

Single = NDArray[np.float32]

SCENE = Scene(
    lights=(
        DirectionalLight((1.0, -1.0, 1.0), (3.0, 2.8, 2.5)),
        DirectionalLight((-1.0, -0.5, 0.2), (0.5, 0.6, 1.0)),
    ),
    camera=Camera(eye=(0.0, -4.0, 1.0), field=29.0),
)
PARAMS: dict[str, dict[str, Any]] = {
    "lambert": {"k_d": [0.5, 0.4, 0.3]},
    "blinn_phong": {"k_d": [0.5, 0.4, 0.3], "k_s": 0.4, "n": 60.0},
    "ggx": {"k_d": [0.5, 0.4, 0.3], "k_s": 1.0, "F0": 0.04, "alpha": 0.2},
    "ggx_anisotropic": {
        "k_d": [0.5, 0.4, 0.3],
        "k_s": 1.0,
        "F0": 0.04,
        "alpha_x": 0.4,
        "alpha_y": 0.1,
        "phi_x": 0.3,
    },
}
DECISION = (
    *("lambert", "oren_nayar", "phong", "modified_phong", "blinn_phong", "ward"),
    *("cook_torrance", "beckmann", "ggx", "ggx_anisotropic", "student_t", "ggx+ggx"),
)


def _ggx(p: dict[str, Any], i: Single, o: Single, h: Single) -> Single:
    """GGX with Smith's correlated masking and Schlick's term; i, o, h in the frame, (3, N)."""
    phi, one = np.float32(p.get("phi_x", 0.0)), np.float32(p.get("alpha_x", p.get("alpha")))
    two = np.float32(p.get("alpha_y", p.get("alpha")))
    c, s = np.cos(phi), np.sin(phi)

    def stretched(v: Single) -> Single:
        along, across = c * v[0] + s * v[1], c * v[1] - s * v[0]
        return np.asarray((along * one) ** 2 + (across * two) ** 2)

    along, across = c * h[0] + s * h[1], c * h[1] - s * h[0]
    spread = (along / one) ** 2 + (across / two) ** 2 + h[2] ** 2
    D = 1.0 / (np.float32(np.pi) * one * two * spread**2)
    root_i, root_o = (np.sqrt(v[2] ** 2 + stretched(v)) for v in (i, o))
    G_over = 2.0 / (i[2] * root_o + o[2] * root_i)
    m = 1.0 - (i * h).sum(axis=0)
    F = np.float32(p["F0"]) + np.float32(1.0 - p["F0"]) * m**5
    return np.asarray(np.float32(p["k_s"] / 4.0) * D * G_over * F)


def _specular(name: str, p: dict[str, Any], i: Single, o: Single) -> Single:
    half = i + o
    h = half / np.sqrt((half * half).sum(axis=0))
    if name == "blinn_phong":
        n = np.float32(p["n"])
        return np.asarray(np.float32(p["k_s"]) * (n + 2) / np.float32(8 * np.pi) * h[2] ** n)
    return _ggx(p, i, o, h)


def numpy_renderer(name: str, surface: Surface) -> Callable[[], tuple[Single, Single]]:
    """Give a call that shades the points with numpy: diffuse and specular, (3, N)."""
    p = PARAMS[name]
    parts = (surface.tangent, np.cross(surface.normal, surface.tangent), surface.normal)
    frame = np.stack([part.T for part in parts]).astype(np.float32)  # [axis, xyz, N]
    o = np.einsum("axn,xn->an", frame, surface.view.T.astype(np.float32))
    k_d = np.array(p["k_d"], dtype=np.float32)[:, None] / np.float32(np.pi)
    rows = [light.row() for light in SCENE.lights]
    lights = [(r[:3].astype(np.float32), e.astype(np.float32)[:, None]) for r, e in rows]

    def shade() -> tuple[Single, Single]:
        diffuse = np.zeros((3, o.shape[1]), dtype=np.float32)
        specular = np.zeros_like(diffuse)
        for towards, irradiance in lights:
            i = np.einsum("axn,x->an", frame, towards)
            lit = i[2] > 0.0
            arriving = irradiance * np.where(lit, i[2], np.float32(0.0))
            diffuse += k_d * arriving
            if name != "lambert":
                i = np.where(lit, i, np.eye(3, dtype=np.float32)[:, 2:])
                specular += _specular(name, p, i, o) * arriving
        return diffuse, specular

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


def run() -> dict[str, Any]:
    """Time every model both ways, and a decision; returns a JSON-able record."""
    get_device()  # opening it is no part of either
    decisions = [_decision() for _ in range(2)]
    rows = []
    with Prepared(SCENE, shading="phong") as prepared:
        pixels = len(prepared.surface.pixels)
        for name, params in PARAMS.items():
            theirs = numpy_renderer(name, prepared.surface)
            ours = prepared.render(name, params)
            diffuse, specular = theirs()
            found = ours.beauty[:, ours.mask]
            difference = float(np.abs(found - diffuse - specular).max() / found.max())
            shading: list[float] = []

            def lobefit(
                name: str = name, params: dict[str, Any] = params, s: list[float] = shading
            ) -> None:
                s.append(prepared.render(name, params).seconds)

            timings = interleave({"lobefit": lobefit, "numpy": theirs}, rounds=9, least_s=0.05)
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
        "decision_s": [total for total, _ in decisions],
        "once_per_scene_s": [once for _, once in decisions],
    }


def table(result: dict[str, Any]) -> str:
    """Lay out the result of `run` for reading."""
    lines = [
        f"OpenCL device: {result['device']}, {result['cores']} cores; numpy on one core",
        f"megapixels/s; {result['pixels']} pixels show the sphere",
        f"{'':<18}{'kernel':>9}{'to host':>9}{'numpy':>9}{'lobefit is':>13}{'difference':>12}",
    ]
    lines += [
        f"{row['name']:<18}{row['kernel_megapixels_per_s']:>9.1f}"
        f"{row['lobefit_megapixels_per_s']:>9.1f}{row['numpy_megapixels_per_s']:>9.2f}"
        f"{row['lobefit_faster']:>11.1f} x{row['relative_difference']:>12.1e}"
        for row in result["rows"]
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
