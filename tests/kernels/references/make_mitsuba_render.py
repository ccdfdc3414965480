"""Pictures of Mitsuba, to hold the renderer against: mitsuba_render.json beside this file.

    pip install mitsuba==3.9.1; python make_mitsuba_render.py

A sphere of rough copper (GGX, alpha 0.2), 32 x 32 pixels. The two directional lights are rendered
one by one: with one light to choose, the direct integrator has no noise but from the place in the
pixel. A pixel is the average over its area. The environment is a smooth map, a constant, a sky
and a wide sun. Mitsuba interpolates it between rows that lie at 0, ..., pi where this project has
them at the middles of equal parts, so that each is given the radiance at its own rows.
"""

from __future__ import annotations

import json
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

__all__ = ["sky"]

Array = npt.NDArray[np.float64]

ETA, K = [0.1464, 0.9759, 1.2086], [3.435, 2.6206, 2.3644]
ALPHA, SIZE, FIELD = 0.2, 32, 32.0
EYE = [0.0, -4.0, 1.0]
LIGHTS = [
    {"direction": [1.0, -1.0, 1.0], "irradiance": [3.0, 2.5, 2.0]},
    {"direction": [-1.0, -0.3, 0.2], "irradiance": [0.5, 1.0, 1.5]},
]
SKY_ROWS, SUN, SHARP = 64, [1.0, -1.0, 1.5], 20.0


def sky(theta: Array) -> Array:
    """Radiance [rows, 2 SKY_ROWS, 3] at zenith angles, in the layout of `Environment`."""
    phi = np.pi - (np.arange(2 * SKY_ROWS) + 0.5) * np.pi / SKY_ROWS
    sun = np.array(SUN) / np.linalg.norm(SUN)
    cosine = np.sin(theta)[:, None] * (np.cos(phi) * sun[0] + np.sin(phi) * sun[1])
    cosine = cosine + (np.cos(theta) * sun[2])[:, None]
    glow = np.exp(SHARP * (cosine - 1.0))[:, :, None]
    blue = (0.5 + 0.5 * np.cos(theta))[:, None, None] * np.array([0.1, 0.2, 0.4])
    return np.asarray(0.3 + blue + glow * np.array([5.0, 4.5, 3.5]))


def scene(mi: Any, emitter: dict[str, Any]) -> dict[str, Any]:
    transform = mi.ScalarTransform4f
    return {
        "type": "scene",
        "integrator": {"type": "direct", "hide_emitters": True},
        "sensor": {
            "type": "perspective",
            "fov": FIELD,
            "fov_axis": "y",
            "to_world": transform().look_at(origin=EYE, target=[0, 0, 0], up=[0, 0, 1]),
            "film": {
                "type": "hdrfilm",
                "width": SIZE,
                "height": SIZE,
                "pixel_format": "rgb",
                "component_format": "float32",
                "rfilter": {"type": "box"},
            },
            "sampler": {"type": "multijitter", "sample_count": 16},
        },
        "sphere": {
            "type": "sphere",
            "bsdf": {
                "type": "roughconductor",
                "distribution": "ggx",
                "alpha": ALPHA,
                "eta": {"type": "rgb", "value": ETA},
                "k": {"type": "rgb", "value": K},
            },
        },
        "emitter": emitter,
    }


def picture(mi: Any, emitter: dict[str, Any], samples: int) -> Array:
    """Render, shape [3, SIZE, SIZE]."""
    image = np.array(mi.render(mi.load_dict(scene(mi, emitter)), spp=samples), dtype=np.float64)
    return image.transpose(2, 0, 1)


def main() -> None:
    mi = import_module("mitsuba")
    mi.set_variant("scalar_rgb")
    pictures = [
        picture(
            mi,
            {
                "type": "directional",
                "direction": [-v for v in light["direction"]],
                "irradiance": {"type": "rgb", "value": light["irradiance"]},
            },
            256,
        )
        for light in LIGHTS
    ]
    under_lights = np.sum(pictures, axis=0)
    # Mitsuba's map has y up and its middle column at +z; the pixels lie the same way round
    # when y, z, x there are z, x, y here.
    around = mi.ScalarTransform4f(
        np.array([[0, 0, 1, 0], [1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 0, 1]], dtype=float)
    )
    rows = sky(np.linspace(0.0, np.pi, SKY_ROWS))
    bitmap = mi.Bitmap(np.ascontiguousarray(rows, dtype=np.float32))
    environment = {"type": "envmap", "bitmap": bitmap, "to_world": around}
    under_sky = picture(mi, environment, 8192)
    record = {
        "source": f"Mitsuba {mi.__version__}, scalar_rgb, by make_mitsuba_render.py",
        "camera": {"eye": EYE, "field": FIELD, "size": SIZE},
        "material": {"alpha": ALPHA, "eta": ETA, "k": K},
        "lights": LIGHTS,
        "under_lights": [[[float(f"{v:.6g}") for v in row] for row in c] for c in under_lights],
        "under_sky": [[[float(f"{v:.6g}") for v in row] for row in c] for c in under_sky],
    }
    path = Path(__file__).with_name("mitsuba_render.json")
    path.write_text(json.dumps(record, separators=(",", ":")) + "\n", encoding="utf-8")
    print(path.name, path.stat().st_size, "bytes")


if __name__ == "__main__":
    main()
