"""Pictures against Mitsuba 3.9.1: rough copper under two lights and under a sky.

Mitsuba averages over a pixel, so that this renders 8 x 8 as many and averages too; pixels that the
outline crosses are left out. Its rough conductor has Smith's separable masking and the exact
Fresnel equations, which are options here.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lobefit.kernels.camera import Camera
from lobefit.kernels.lights import DirectionalLight, Environment
from lobefit.kernels.render import Rendering, render
from lobefit.kernels.scene import Scene
from tests.kernels.references.make_mitsuba_render import SKY_ROWS, sky
from tests.kernels.transcriptions import Array

__all__: list[str] = []

REFERENCE = Path(__file__).parent / "references/mitsuba_render.json"
FINER = 8


@pytest.fixture(scope="module")
def reference() -> Any:
    return json.loads(REFERENCE.read_text(encoding="utf-8"))


def picture(reference: Any, **lit: Any) -> Rendering:
    camera, material = reference["camera"], reference["material"]
    size = FINER * camera["size"]
    view = Camera(eye=tuple(camera["eye"]), field=camera["field"], width=size, height=size)
    return render(
        Scene(camera=view, **lit),
        "ggx",
        {"k_d": 0.0, "k_s": 1.0, **material},
        shading="exact",
        options={"masking": "smith_separable", "fresnel": "conductor"},
    )


def relative_differences(found: Rendering, expected: Any) -> Array:
    """Give them for each channel and pixel that the sphere covers, shape (3, N)."""
    value = np.array(expected)
    size = value.shape[1]
    blocks = found.beauty.reshape(3, size, FINER, size, FINER).mean(axis=(2, 4))
    inside = found.mask.reshape(size, FINER, size, FINER).all(axis=(1, 3))
    assert np.count_nonzero(inside) == 556
    return np.asarray(np.abs(blocks - value)[:, inside] / value[:, inside])


def test_rough_copper_under_two_lights(reference: Any) -> None:
    lights = tuple(
        DirectionalLight(tuple(light["direction"]), tuple(light["irradiance"]))
        for light in reference["lights"]
    )
    found = relative_differences(picture(reference, lights=lights), reference["under_lights"])
    # What is left is where in the pixel Mitsuba looked.
    assert found.mean() < 1e-3
    assert found.max() < 1e-2


def test_rough_copper_under_a_sky(reference: Any) -> None:
    rows = (np.arange(SKY_ROWS) + 0.5) * np.pi / SKY_ROWS
    made = picture(reference, environment=Environment(sky(rows)))
    found = relative_differences(made, reference["under_sky"])
    assert found.mean() < 5e-3
    assert found.max() < 4e-2
    # The error that the picture states covers the difference.
    stated = made.error[:, made.mask].mean() / made.beauty[:, made.mask].mean()
    assert found.mean() < stated < 0.02
