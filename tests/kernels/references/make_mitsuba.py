"""Values of Mitsuba's materials, to hold the models against: mitsuba_*.json beside this file.

    pip install mitsuba==3.9.1; python make_mitsuba.py

Mitsuba's wheel evaluates in single precision. Its `eval` includes the cosine of the outgoing
direction, which is divided out here.
"""

from __future__ import annotations

import json
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

__all__ = ["seeded_directions"]

Array = npt.NDArray[np.float64]

SEED = 31
# Indices at 630, 532 and 465 nm.
COPPER = {"eta": [0.246, 1.072, 1.157], "k": [3.378, 2.591, 2.457]}
ALUMINIUM = {"eta": [1.357, 0.884, 0.661], "k": [7.588, 6.47, 5.654]}
BLUE, OCHRE = [0.1, 0.3, 0.7], [0.8, 0.5, 0.2]


def seeded_directions(seed: int, count: int = 60) -> Array:
    """Angles [count, 4] in degrees: anywhere, near the mirror direction, and nearer to it."""
    rng = np.random.default_rng(seed)
    third = count // 3
    theta_i, theta_o = np.degrees(np.arccos(rng.uniform(0.05, 1.0, (2, count))))
    phi_i, phi_o = rng.uniform(0.0, 360.0, (2, count))
    for first, width in ((third, 12.0), (2 * third, 3.0)):
        near = slice(first, first + third)
        theta_o[near] = np.abs(theta_i[near] + rng.normal(0.0, width, third))
        phi_o[near] = (phi_i[near] + 180.0 + rng.normal(0.0, width, third)) % 360.0
    angles = np.stack([theta_i, phi_i, np.minimum(theta_o, 87.0), phi_o], axis=1)
    return angles.round(6)


def colour(values: list[float]) -> dict[str, Any]:
    return {"type": "rgb", "value": values}


def conductor(distribution: str, alpha_u: float, alpha_v: float, index: Any) -> dict[str, Any]:
    return {
        "type": "roughconductor",
        "distribution": distribution,
        "alpha_u": alpha_u,
        "alpha_v": alpha_v,
        "eta": colour(index["eta"]),
        "k": colour(index["k"]),
    }


def plastic(distribution: str, alpha: float, eta: float) -> dict[str, Any]:
    return {
        "type": "roughplastic",
        "distribution": distribution,
        "alpha": alpha,
        "int_ior": eta,
        "ext_ior": 1.0,
        "diffuse_reflectance": colour([0.0, 0.0, 0.0]),
    }


def dielectric(distribution: str, alpha: float, eta: float) -> dict[str, Any]:
    return {
        "type": "roughdielectric",
        "distribution": distribution,
        "alpha": alpha,
        "int_ior": eta,
        "ext_ior": 1.0,
    }


def principled(base_color: list[float], **parameters: float) -> dict[str, Any]:
    return {"type": "principled", "base_color": colour(base_color), **parameters}


MICROFACET = {
    "diffuse": {"type": "diffuse", "reflectance": colour(OCHRE)},
    "ggx .3/.1 copper": conductor("ggx", 0.3, 0.1, COPPER),
    "ggx .05/.2 aluminium": conductor("ggx", 0.05, 0.2, ALUMINIUM),
    "ggx .9/.4 copper": conductor("ggx", 0.9, 0.4, COPPER),
    "beckmann .3/.1 copper": conductor("beckmann", 0.3, 0.1, COPPER),
    "beckmann .1/.4 aluminium": conductor("beckmann", 0.1, 0.4, ALUMINIUM),
    "beckmann .9/.4 copper": conductor("beckmann", 0.9, 0.4, COPPER),
    "plastic ggx .1": plastic("ggx", 0.1, 1.5),
    "plastic ggx .5": plastic("ggx", 0.5, 1.33),
    "plastic beckmann .3": plastic("beckmann", 0.3, 1.9),
    "dielectric ggx .2": dielectric("ggx", 0.2, 1.5),
    "dielectric beckmann .4": dielectric("beckmann", 0.4, 2.0),
}
BLACK = [0.0, 0.0, 0.0]
# With spec_tint = 1 the dielectric's Fresnel term is Schlick's, else the exact one.
TINTED = {"specular": 0.5, "spec_tint": 1.0}
MIXED = {
    "metallic": 0.3, "roughness": 0.6, "anisotropic": 0.5, "specular": 0.7, "spec_tint": 1.0,
    "sheen": 0.5, "sheen_tint": 0.5, "flatness": 0.3,
}  # fmt: skip
PRINCIPLED = {
    "metal": principled(OCHRE, metallic=1.0, roughness=0.5),
    "metal anisotropic": principled(OCHRE, metallic=1.0, roughness=0.7, anisotropic=0.8),
    "tinted": principled(OCHRE, roughness=0.4, specular=1.0, spec_tint=1.0),
    "flat": principled(BLUE, roughness=0.5, flatness=0.6, **TINTED),
    "sheen": principled(BLUE, roughness=0.5, sheen=1.0, sheen_tint=0.4, **TINTED),
    "mixed": principled(OCHRE, **MIXED),
    "mixed coated": principled(OCHRE, clearcoat=0.6, clearcoat_gloss=0.4, **MIXED),
    "metal coated": principled(OCHRE, metallic=1.0, roughness=0.5, clearcoat=1.0,
                               clearcoat_gloss=1.0),
    "dielectric": principled(BLUE, roughness=0.4, specular=0.5),
    "dielectric black": principled(BLACK, roughness=0.7, specular=1.0),
    "dielectric matt": principled(BLUE, roughness=0.9, specular=0.0),
}  # fmt: skip


def evaluate(mi: Any, material: dict[str, Any], angles: Array) -> list[list[float]]:
    """Give f [N][3] in 1/sr, to the eight digits that single precision has."""
    bsdf, context, rows = mi.load_dict(material), mi.BSDFContext(), []
    for theta_i, phi_i, theta_o, phi_o in np.radians(angles):
        wi, wo = (
            [np.sin(t) * np.cos(p), np.sin(t) * np.sin(p), np.cos(t)]
            for t, p in ((theta_i, phi_i), (theta_o, phi_o))
        )
        si = mi.SurfaceInteraction3f()
        si.wi = mi.Vector3f(*wi)
        value = np.array(bsdf.eval(context, si, mi.Vector3f(*wo)), dtype=np.float64)
        rows.append([float(f"{v:.8g}") for v in value / np.float32(wo[2])])
    return rows


def main() -> None:
    mi = import_module("mitsuba")
    mi.set_variant("scalar_rgb")
    for name, materials in (("microfacet", MICROFACET), ("principled", PRINCIPLED)):
        angles = seeded_directions(SEED)
        record = {
            "source": f"Mitsuba {mi.__version__}, scalar_rgb, by make_mitsuba.py",
            "columns": ["theta_i", "phi_i", "theta_o", "phi_o"],
            "units": "degrees; values R, G, B in 1/sr",
            "directions": angles.tolist(),
            "cases": [
                {"name": case, "material": material, "values": evaluate(mi, material, angles)}
                for case, material in materials.items()
            ],
        }
        path = Path(__file__).with_name(f"mitsuba_{name}.json")
        path.write_text(json.dumps(record, separators=(",", ":")) + "\n", encoding="utf-8")
        print(path.name, path.stat().st_size, "bytes")


if __name__ == "__main__":
    main()
