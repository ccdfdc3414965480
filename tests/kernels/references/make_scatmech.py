"""Values of SCATMECH (T. A. Germer, NIST), to hold the models against: scatmech.json.

    pip install pySCATMECH==0.1.10 numpy; python make_scatmech.py

SCATMECH computes in double precision. Its facet models are specular points of a distribution
of slopes with exact Fresnel reflection: the distribution of an ellipsoid's slopes is GGX, the
Gaussian one Beckmann. Smooth-surface roughness gives the power laws of stray light; its value
over that for a power spectrum of 1 leaves the power spectrum itself.
"""

from __future__ import annotations

import json
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

__all__: list[str] = []

Array = npt.NDArray[np.float64]

SEED = 47
WAVELENGTH = 0.5  # micrometres
COPPER, GLASS, ALUMINIUM = (1.072, 2.591), (1.5, 0.0), (0.884, 6.47)


def seeded_directions(count: int = 60) -> Array:
    """Angles [count, 4] in degrees, two thirds of them near the mirror direction."""
    rng = np.random.default_rng(SEED)
    third = count // 3
    theta_i, theta_o = np.degrees(np.arccos(rng.uniform(0.05, 1.0, (2, count))))
    phi_i, phi_o = rng.uniform(0.0, 360.0, (2, count))
    for first, width in ((third, 12.0), (2 * third, 3.0)):
        near = slice(first, first + third)
        theta_o[near] = np.abs(theta_i[near] + rng.normal(0.0, width, third))
        phi_o[near] = (phi_i[near] + 180.0 + rng.normal(0.0, width, third)) % 360.0
    return np.stack([theta_i, phi_i, np.minimum(theta_o, 87.0), phi_o], axis=1).round(6)


def ellipsoid(alpha_x: float, alpha_y: float) -> dict[Any, Any]:
    """Slopes of an ellipsoid with the axes 1/alpha_x, 1/alpha_y and 1, normalised."""
    axes = {"rx": 1 / alpha_x, "ry": 1 / alpha_y, "rz": 1.0}
    density = alpha_x * alpha_y / np.pi
    return {None: "Ellipsoid_Slope_Distribution_Function", **axes, "density": density}


def gaussian(alpha: float) -> dict[Any, Any]:
    return {None: "Gaussian_Slope_Distribution_Function", "s": alpha}


def facets(sdf: dict[Any, Any], index: tuple[float, float], shadow: Any) -> dict[str, Any]:
    material = {"substrate": complex(*index), "sdf": sdf, "shadow": shadow}
    return {"model": "Shadowed_Facet_BRDF_Model", **material}


def smith(alpha: float) -> dict[Any, Any]:
    return {None: "Smith_Shadow_Function", "w": alpha / np.sqrt(2)}


V_CAVITY = {None: "Torrance_Sparrow_Shadow_Function"}
FACETS = {
    "ggx .3 copper": facets(ellipsoid(0.3, 0.3), COPPER, V_CAVITY),
    "ggx .05 glass": facets(ellipsoid(0.05, 0.05), GLASS, V_CAVITY),
    "ggx .5/.1 aluminium": facets(ellipsoid(0.5, 0.1), ALUMINIUM, V_CAVITY),
    "beckmann .3 copper": facets(gaussian(0.3), COPPER, V_CAVITY),
    "beckmann .1 glass": facets(gaussian(0.1), GLASS, V_CAVITY),
    "beckmann .6 aluminium smith": facets(gaussian(0.6), ALUMINIUM, smith(0.6)),
    "beckmann .2 copper smith": facets(gaussian(0.2), COPPER, smith(0.2)),
}
POWER_SPECTRA = {
    "abc l=.01 s=-1.5": {None: "ABC_PSD_Function", "A": 1.0, "B": WAVELENGTH / 0.01, "C": 1.5},
    "abc l=.1 s=-2.5": {None: "ABC_PSD_Function", "A": 1.0, "B": WAVELENGTH / 0.1, "C": 2.5},
    "fractal g=1.7": {None: "Fractal_PSD_Function", "A": WAVELENGTH**-1.7, "exponent": 1.7},
}


def evaluate(brdf: Any, angles: Array) -> list[float]:
    """Give f [N] in 1/sr for unpolarised light."""
    values = []
    for theta_i, phi_i, theta_o, phi_o in np.radians(angles):
        # SCATMECH has the light at the azimuth pi and turns the sample instead.
        turned, azimuth = np.pi - phi_i, phi_o - phi_i + np.pi
        values.append(float(brdf.BRDF(theta_i, theta_o, azimuth, turned)))
    return values


def main() -> None:
    model = import_module("pySCATMECH.brdf").BRDF_Model
    angles = seeded_directions()
    cases = []
    for name, material in FACETS.items():
        parameters = {key: value for key, value in material.items() if key != "model"}
        brdf = model(material["model"], {"lambda": WAVELENGTH}, parameters)
        cases.append({"name": name, "values": evaluate(brdf, angles)})
    rough = {"lambda": WAVELENGTH, "substrate": complex(*COPPER)}
    flat = model("Microroughness_BRDF_Model", rough, {"psd": {None: "Unit_PSD_Function"}})
    for name, spectrum in POWER_SPECTRA.items():
        brdf = model("Microroughness_BRDF_Model", rough, {"psd": spectrum})
        ratio = np.array(evaluate(brdf, angles)) / np.array(evaluate(flat, angles))
        cases.append({"name": name, "values": ratio.tolist()})
    record = {
        "source": "SCATMECH by pySCATMECH 0.1.10, by make_scatmech.py",
        "columns": ["theta_i", "phi_i", "theta_o", "phi_o"],
        "units": "degrees; values in 1/sr",
        "directions": angles.tolist(),
        "cases": cases,
    }
    path = Path(__file__).with_name("scatmech.json")
    path.write_text(json.dumps(record, separators=(",", ":")) + "\n", encoding="utf-8")
    print(path.name, path.stat().st_size, "bytes")


if __name__ == "__main__":
    main()
