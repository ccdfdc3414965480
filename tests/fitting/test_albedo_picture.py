"""albedo.exr: the share of light that leaves, at the angles that its header names."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR
import pytest
from numpy.typing import NDArray

from lobefit.fitting.albedo_picture import write_albedo
from lobefit.fitting.export.fitted import Fitted
from lobefit.kernels import candidate
from lobefit.kernels.albedo import directional_albedo


def fitted(name: str, params: Mapping[str, float | list[float]], *channels: str) -> Fitted:
    c = candidate(name)
    return Fitted(name, c.model.name, {}, params, channels, "", "")


def read(path: Path) -> tuple[dict[str, NDArray[np.float32]], Any, Any]:
    with OpenEXR.File(str(path), separate_channels=True) as file:
        header = dict(file.header())
        pixels = {name: c.pixels for name, c in file.channels().items()}
    theta = np.deg2rad(json.loads(header["lobefit:theta_i_deg"]))
    return pixels, theta, np.deg2rad(json.loads(header["lobefit:phi_i_deg"]))


def test_a_lambert_surface_gives_back_its_albedo_everywhere(tmp_path: Path) -> None:
    grey = fitted("lambert", {"k_d": [0.25, 0.75]}, "450.5nm", "G")
    write_albedo(tmp_path / "albedo.exr", [grey])
    pixels, theta, phi = read(tmp_path / "albedo.exr")
    assert set(pixels) == {"lambert.450,5nm", "lambert.G"}
    assert len(phi) == 1
    for plane, share in zip(pixels.values(), (0.25, 0.75), strict=True):
        assert plane.shape == (1, len(theta))
        np.testing.assert_allclose(plane, share, rtol=1e-6)


@pytest.mark.parametrize(
    ("name", "params", "rows"),
    [
        ("ggx", {"k_d": 0.2, "k_s": 1.0, "F0": 0.5, "alpha": 0.05}, 1),
        ("ward", {"k_d": 0.1, "k_s": 0.5, "alpha_x": 0.4, "alpha_y": 0.03, "phi_x": 0.3}, 6),
    ],
)
def test_a_pixel_is_the_albedo_at_its_angles(
    tmp_path: Path, name: str, params: dict[str, float], rows: int
) -> None:
    """One set of numbers serves both channels; a model without azimuth has a single row."""
    write_albedo(tmp_path / "albedo.exr", [fitted(name, params, "R", "G")])
    pixels, theta, phi = read(tmp_path / "albedo.exr")
    assert len(phi) == rows
    for k in {0, rows // 2}:
        expected = directional_albedo(name, params, theta, float(phi[k]))
        np.testing.assert_allclose(pixels[f"{name}.R"][k], expected[0], rtol=1e-5)
    np.testing.assert_array_equal(pixels[f"{name}.R"], pixels[f"{name}.G"])


def test_models_of_both_kinds_share_a_picture(tmp_path: Path) -> None:
    ward = {"k_d": 0.1, "k_s": 0.5, "alpha_x": 0.3, "alpha_y": 0.1, "phi_x": 0.0}
    both = [fitted("lambert", {"k_d": 0.5}, "Y"), fitted("ward", ward, "Y")]
    write_albedo(tmp_path / "albedo.exr", both)
    pixels, theta, phi = read(tmp_path / "albedo.exr")
    assert pixels["lambert.Y"].shape == pixels["ward.Y"].shape == (len(phi), len(theta))
    assert np.ptp(pixels["lambert.Y"]) < 1e-6
    assert np.ptp(pixels["ward.Y"][:, 5]) > 1e-3  # by azimuth
