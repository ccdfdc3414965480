"""Fitted models that renderers have an equal of, and directions to try them at."""

from __future__ import annotations

from typing import Any

import numpy as np

from lobefit.fitting.export import Fitted
from lobefit.kernels import get_model
from tests.fitting.export_readers import Angles, Array

__all__ = [
    "COPPER",
    "EXACT",
    "MATERIALX",
    "METAL",
    "MITSUBA",
    "NONE",
    "PBRT",
    "PROMISED",
    "RGB",
    "SEPARABLE",
    "close",
    "directions",
    "fitted",
]

RGB = ("R", "G", "B")
SEPARABLE = {"masking": "smith_separable"}
METAL = {"fresnel": "conductor"}
COPPER = {"eta": [0.246, 1.072, 1.157], "k": [3.378, 2.591, 2.457]}
NONE = {"fresnel": "none"}
EXACT = 1e-6  # nine digits are written
PROMISED = 1e-3


def fitted(
    candidate: str,
    params: dict[str, Any],
    options: dict[str, str] | None = None,
    channels: tuple[str, ...] = RGB,
) -> Fitted:
    model = get_model(candidate.partition(":")[0], options)
    return Fitted(
        candidate=candidate,
        model=model.name,
        options=model.options,
        params=params,
        channels=channels,
        convention=model.convention,
        origin="copper.csv",
    )


def directions(count: int = 300) -> Angles:
    """Give pairs over the hemisphere, half of them near the mirror, some grazing."""
    rng = np.random.default_rng(7)
    theta_i = np.radians(rng.uniform(0.5, 88.0, count))
    phi_i = rng.uniform(0.0, 2 * np.pi, count)
    theta_o = np.radians(rng.uniform(0.5, 88.0, count))
    phi_o = rng.uniform(0.0, 2 * np.pi, count)
    near = np.arange(count) % 2 == 0
    theta_o[near] = np.clip(theta_i[near] + rng.normal(0, 0.05, near.sum()), 0.01, 1.54)
    phi_o[near] = phi_i[near] + np.pi + rng.normal(0, 0.1, near.sum())
    return theta_i, phi_i, theta_o, phi_o


def close(found: Array, truth: Array, tolerance: float) -> None:
    found = np.broadcast_to(found, truth.shape)
    np.testing.assert_allclose(found, truth, rtol=tolerance, atol=1e-14)


MITSUBA = {
    "diffuse": fitted("lambert", {"k_d": [0.3, 0.2, 0.1]}),
    "black": fitted("lambert", {"k_d": 0.0}),
    "metal": fitted("ggx", {"k_d": 0.0, "k_s": 1.0, "alpha": 0.3, **COPPER}, SEPARABLE | METAL),
    "tinted metal over diffuse": fitted(
        "ggx",
        {"k_d": [0.2, 0.1, 0.05], "k_s": [0.6, 0.7, 0.5], "alpha": 0.15, **COPPER},
        SEPARABLE | METAL,
    ),
    "F = 1": fitted("ggx", {"k_d": 0.1, "k_s": 0.4, "alpha": 0.5}, SEPARABLE | {"fresnel": "none"}),
    "F0 = 1 of Schlick is F = 1": fitted(
        "ggx", {"k_d": 0.0, "k_s": 0.8, "F0": 1.0, "alpha": 0.2}, SEPARABLE
    ),
    "k_s = 1 beside a colour": fitted(
        "ggx:conductor",
        {"k_d": [0.03, 0.02, 0.01], "k_s": 1.0, "alpha": 0.3, **COPPER},
        SEPARABLE | METAL,
    ),
    "dielectric": fitted(
        "ggx:dielectric",
        {"k_d": 0.0, "k_s": 1.0, "eta": 1.5, "alpha": 0.2},
        SEPARABLE | {"fresnel": "dielectric"},
    ),
    "one channel": fitted(
        "ggx",
        {"k_d": 0.3, "k_s": 0.5, "alpha": 0.2, "eta": 1.2, "k": 7.0},
        SEPARABLE | METAL,
        ("brdf",),
    ),
    "brushed": fitted(
        "ggx_anisotropic",
        {"k_d": 0.05, "k_s": 0.9, "alpha_x": 0.4, "alpha_y": 0.1, "phi_x": 0.6, **COPPER},
        SEPARABLE | METAL,
    ),
    "two lobes": fitted(
        "ggx+ggx",
        {"k_d": 0.1, "k_s_1": 0.3, "alpha_1": 0.1, "k_s_2": [0.5, 0.4, 0.3], "alpha_2": 0.6},
        SEPARABLE | {"fresnel": "none"},
    ),
    "beckmann": fitted(
        "beckmann", {"k_d": 0.1, "k_s": 0.8, "alpha": 0.5, **COPPER}, SEPARABLE | METAL
    ),
}


PBRT = {
    "diffuse": fitted("lambert", {"k_d": [0.3, 0.2, 0.1]}),
    "one metal": fitted(
        "ggx:conductor",
        {"k_d": 0.0, "k_s": 1.0, "alpha": 0.3, "eta": 0.2, "k": 3.9},
        METAL,
        ("brdf",),
    ),
    "grey metal over a colour": fitted(
        "ggx", {"k_d": [0.2, 0.1, 0.05], "k_s": 0.7, "alpha": 0.2, "eta": 0.2, "k": 3.9}, METAL
    ),
    "metal by wavelength": fitted(
        "ggx",
        {"k_d": [0.1, 0.2, 0.3], "k_s": 0.7, "alpha": 0.3, **COPPER},
        METAL,
        ("630nm", "532nm", "465nm"),
    ),
    "F = 1": fitted("ggx", {"k_d": 0.1, "k_s": 0.4, "alpha": 0.5}, {"fresnel": "none"}),
    "nothing beside": fitted("ggx", {"k_d": 0.0, "k_s": 0.4, "alpha": 0.5}, {"fresnel": "none"}),
    "coat": fitted(
        "ggx",
        {"k_d": [0.5, 0.4, 0.3], "k_s": 0.3, "alpha": 0.05, "eta": 1.5},
        {"fresnel": "dielectric"},
    ),
    "brushed": fitted(
        "ggx_anisotropic",
        {"k_d": 0.0, "k_s": 1.0, "alpha_x": 0.4, "alpha_y": 0.1, "phi_x": 2.6},
        {"fresnel": "none"},
    ),
    "two lobes": fitted(
        "ggx+ggx",
        {"k_d": 0.1, "k_s_1": 0.3, "alpha_1": 0.1, "k_s_2": 0.5, "alpha_2": 0.6},
        {"fresnel": "none"},
    ),
}


MATERIALX = {
    "diffuse": fitted("lambert", {"k_d": [0.3, 0.2, 0.1]}),
    "black": fitted("lambert", {"k_d": 0.0}),
    "one channel": fitted("oren_nayar", {"k_d": 0.4, "sigma": 0.5}, channels=("550nm",)),
    "oren_nayar": fitted("oren_nayar", {"k_d": [0.9, 0.5, 0.1], "sigma": 0.35}),
    "eon": fitted("eon", {"rho": [0.9, 0.5, 0.1], "r": 0.7}),
    "disney": fitted("disney_diffuse", {"k_d": [0.9, 0.5, 0.1], "roughness": 0.6}),
}
