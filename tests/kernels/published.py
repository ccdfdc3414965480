"""Published fits of MERL materials (Ngan 2005, Low 2012, Bagher 2012), and how they are scored.

A table is a text file, one material a line: ``name = Aggregate(Lambertian(albedo = [...]),
Lobe(key = value, ...))``. Every author has a normalisation of his own; the factors between
theirs and this project's are written here once, from the formulas.

The score is E2 of Low et al. 2012: the square root of the mean over theta_i, theta_o and phi of
the sum over R, G, B of (ln(1 + f cos(theta_i)) - ln(1 + g cos(theta_i)))^2 sin(theta_i). Published
figures take the mean over a grid of 1 x 1 x 2 degrees up to 79.5. The tables of materials here
hold theta_i = 0, 15, 30, 45, 60, 70, theta_o by 5 and phi by 10 degrees, with theta_o by 0.5
degrees within 8 degrees of the mirror direction, in the plane of incidence only. So the mean is
a trapezoidal sum, up to theta_i = 70 and theta_o = 75 degrees, and lobes narrower than 10 degrees
count for more than they should, as the plane of incidence stands for 10 degrees of phi.
"""

from __future__ import annotations

import ast
import math
import re
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import numpy.typing as npt

from lobefit.fitting import Measurement, read_measurement
from lobefit.kernels import evaluate

__all__ = [
    "FITS",
    "MATERIALS",
    "TABLES",
    "Lobe",
    "e2",
    "materials",
    "predicted",
    "read_table",
    "volumes",
]

Array = npt.NDArray[np.float64]
Value = float | list[float]

SHARED = Path(__file__).parents[3] / "shared"
MATERIALS = SHARED / "data" / "merl_like"
FITS = SHARED / "reference" / "published_fits"

# Zenith angles beyond this, in degrees, are left out as in the papers.
LARGEST = 79.5


@dataclass(frozen=True)
class Lobe:
    """A lobe of this project's, by its model, parameters and options; k_d belongs to lambert."""

    model: str
    params: dict[str, Value]
    options: dict[str, str] = field(default_factory=dict)


def _times(values: Value, factor: float) -> list[float]:
    return [factor * float(v) for v in np.atleast_1d(values)]


def low_cook_torrance(p: dict[str, Value]) -> Lobe:
    """D = exp(-t^2/m^2)/(m^2 cos^4) without 1/pi, over pi: four times D G F/4, D normalised."""
    params = {"k_s": _times(p["albedo"], 4.0), "alpha": p["roughness"], "eta": p["eta"]}
    return Lobe("cook_torrance", params, {"fresnel": "dielectric"})


def ngan_cook_torrance(p: dict[str, Value]) -> Lobe:
    """Normalised D over pi, Schlick's F; the key eta holds F0."""
    params = {"k_s": _times(p["albedo"], 4 / math.pi), "alpha": p["roughness"], "F0": p["eta"]}
    return Lobe("cook_torrance", params)


def low_with_ngan_d(p: dict[str, Value]) -> Lobe:
    """Low's numbers read with Ngan's normalised D: pi times too dark."""
    right = low_cook_torrance(p)
    return Lobe(
        right.model, right.params | {"k_s": _times(p["albedo"], 4 / math.pi)}, right.options
    )


def low_abc_microfacet(p: dict[str, Value]) -> Lobe:
    """The numbers of the supplement are for pi n.i n.o in the denominator."""
    params = {"A": _times(p["A"], 1 / math.pi)} | {key: p[key] for key in ("B", "C", "eta")}
    return Lobe("abc_microfacet", params)


def low_abc_smooth(p: dict[str, Value]) -> Lobe:
    """As printed."""
    return Lobe("abc", {key: p[key] for key in ("A", "B", "C", "eta")})


def _ashikhmin_shirley(p: dict[str, Value], fresnel: str, key: str) -> Lobe:
    alpha = math.sqrt(2.0 / float(np.asarray(p["sharpness"])))
    params = {"k_s": p["albedo"], "alpha_x": alpha, "alpha_y": alpha, key: p["fresnelReflectance"]}
    return Lobe("ashikhmin_shirley", params, {"fresnel": fresnel})


def low_ashikhmin_shirley(p: dict[str, Value]) -> Lobe:
    """The lobe with a dielectric's F; the key fresnelReflectance holds its index."""
    return _ashikhmin_shirley(p, "dielectric", "eta")


def ngan_ashikhmin_shirley(p: dict[str, Value]) -> Lobe:
    """The lobe with Schlick's F."""
    return _ashikhmin_shirley(p, "schlick", "F0")


def ngan_ward(p: dict[str, Value]) -> Lobe:
    """Ward 1992."""
    width = p["roughness"]
    return Lobe("ward", {"k_s": p["albedo"], "alpha_x": width, "alpha_y": width})


def ngan_ward_dur(p: dict[str, Value]) -> Lobe:
    """Dur 2006."""
    return Lobe("ward_dur", ngan_ward(p).params)


def ngan_blinn_phong(p: dict[str, Value]) -> Lobe:
    """Read as (n + 2)/(2 pi) (n.h)^n, without the 1/4 of this project's."""
    return Lobe("blinn_phong", {"k_s": _times(p["albedo"], 4.0), "n": p["sharpness"]})


def ngan_lafortune(p: dict[str, Value]) -> Lobe:
    """Times (n + 2)/(2 pi max(|C_xy|, |C_z|)^n): only the ratio of the two is left."""
    xy, z = (float(np.asarray(p[key])) for key in ("Cxy", "Cz"))
    largest = max(abs(xy), abs(z))
    C = -xy / z if abs(z) == largest else math.copysign(2.0 - z / largest, -xy)
    return Lobe("lafortune", {"k_s": p["albedo"], "C": C, "n": p["sharpness"]})


def bagher_sgd(p: dict[str, Value]) -> Lobe:
    """F = F0' - F1' cos + ...; a reflectance at normal incidence below 0 is cut off, as theirs."""
    grazing, slope = (np.array(row) for row in p["eta"])  # type: ignore[union-attr]
    params: dict[str, Value] = {
        "k_s": p["albedo"],
        "F0": np.clip(grazing - slope, 0.0, 1.0).tolist(),
        "F_g": grazing.tolist(),
        "alpha": p["alpha"],
        "p": p["p"],
        "Lambda": p["Lambda"],
        "k_g": p["k"],
        "theta0": p["theta0"],
    }
    return Lobe("sgd", params)


Convert = Callable[[dict[str, Value]], Lobe]

TABLES: dict[str, tuple[str, Convert]] = {
    "Low ABC microfacet E2": ("low_lowmicrofacet_E2", low_abc_microfacet),
    "Low ABC smooth E2": ("low_lowsmooth_E2", low_abc_smooth),
    "Low Ashikhmin-Shirley E2": ("low_ashikhminshirley_E2", low_ashikhmin_shirley),
    "Low Ashikhmin-Shirley E1": ("low_ashikhminshirley_E1", low_ashikhmin_shirley),
    "Low Cook-Torrance E2": ("low_cooktorrance_E2", low_cook_torrance),
    "Low Cook-Torrance E1": ("low_cooktorrance_E1", low_cook_torrance),
    "Low Cook-Torrance E2, Ngan's D": ("low_cooktorrance_E2", low_with_ngan_d),
    "Bagher SGD": ("bagher_sgd", bagher_sgd),
    "Ngan Cook-Torrance": ("ngan_cooktorrance", ngan_cook_torrance),
    "Ngan Ashikhmin-Shirley": ("ngan_ashikhminshirley", ngan_ashikhmin_shirley),
    "Ngan Ward-Dur": ("ngan_wardduer", ngan_ward_dur),
    "Ngan Ward": ("ngan_ward", ngan_ward),
    "Ngan Lafortune": ("ngan_lafortune", ngan_lafortune),
    "Ngan Blinn-Phong": ("ngan_blinnphong", ngan_blinn_phong),
}


def _numbers(text: str) -> dict[str, Value]:
    """Read ``key = value, key = [value, ...]``."""
    pairs = re.findall(r"(\w+) = (\[\[.*?\]\]|\[.*?\]|[-+\d.eE]+)", text)
    return {key: ast.literal_eval(value) for key, value in pairs}


def read_table(name: str) -> dict[str, tuple[list[float], Lobe]]:
    """Read a table: for each material k_d of the diffuse term, and the lobe."""
    stem, convert = TABLES[name]
    found = {}
    for line in (FITS / f"{stem}.fit").read_text().splitlines():
        material, _, text = line.partition(" = Aggregate(")
        if not text:
            continue
        diffuse, lobe = re.fullmatch(r"Lambertian\((.*?)\), \w+\((.*)\)\)", text).groups()  # type: ignore[union-attr]
        k_d = _numbers(diffuse)["albedo"]
        found[material] = (_times(k_d, 1.0), convert(_numbers(lobe)))
    return found


def materials() -> dict[str, Measurement]:
    """Read the materials of the reference tables that there are data for."""
    return {
        path.name.removesuffix(".csv.gz"): read_measurement(path)
        for path in sorted(MATERIALS.glob("*.csv.gz"))
    }


def predicted(k_d: list[float], lobe: Lobe, m: Measurement) -> Array:
    """Give the BRDF of a published fit, shape (3, N)."""
    angles = (m.theta_i, m.phi_i, m.theta_o, m.phi_o)
    f: Array = np.array(k_d)[:, None] / math.pi + evaluate(
        lobe.model, {**lobe.params, "k_d": 0.0}, *angles, options=lobe.options
    )
    return f


def _lengths(nodes: Array) -> Array:
    """Give the weights of the trapezoidal rule on ascending nodes."""
    middles = np.concatenate([nodes[:1], (nodes[1:] + nodes[:-1]) / 2, nodes[-1:]])
    return np.diff(middles)


def volumes(m: Measurement) -> Array:
    """Give the cell in theta_i, theta_o and phi that each row of a material stands for."""
    theta_i, theta_o, phi = (
        np.degrees(angle).round(6) for angle in (m.theta_i, m.theta_o, m.phi_o - m.phi_i)
    )
    near = (theta_i <= LARGEST) & (theta_o <= LARGEST)
    found = np.zeros(len(theta_i))
    incidences = np.unique(theta_i[near])
    for incidence, length in zip(incidences, _lengths(incidences), strict=True):
        for azimuth in np.unique(phi):  # evenly spaced; the normal belongs to all of them
            scan = near & (theta_i == incidence) & ((phi == azimuth) | (theta_o == 0.0))
            rows = np.flatnonzero(scan)
            rows = rows[np.argsort(theta_o[rows])]
            found[rows] += length * _lengths(theta_o[rows])
    return found


def e2(m: Measurement, f: Array) -> float:
    """Score a BRDF of shape (3, N) on a material."""
    n_i = np.cos(m.theta_i)
    difference = np.log1p(m.values * n_i) - np.log1p(f * n_i)
    weights = volumes(m)
    error = (difference**2).sum(axis=0) * np.sin(m.theta_i)
    return float(np.sqrt(weights @ error / weights.sum()))
