"""What renderers make of exported files: parsed, and evaluated by the documented formulas."""

from __future__ import annotations

import re
from typing import Any
from xml.etree import ElementTree

import numpy as np
import numpy.typing as npt

__all__ = [
    "Angles",
    "Array",
    "Frame",
    "azimuth",
    "materialx_value",
    "mitsuba_value",
    "pbrt_materials",
    "pbrt_value",
    "turned",
]

Array = npt.NDArray[np.float64]
Angles = tuple[Array, Array, Array, Array]
Element = ElementTree.Element


def turned(angles: Angles, by: float) -> Angles:
    theta_i, phi_i, theta_o, phi_o = angles
    return theta_i, phi_i - by, theta_o, phi_o - by


class Frame:
    """The vectors of pairs of directions, as a renderer has them."""

    def __init__(self, angles: Angles) -> None:
        theta_i, phi_i, theta_o, phi_o = angles
        self.i = self._vector(theta_i, phi_i)
        self.o = self._vector(theta_o, phi_o)
        h = self.i + self.o
        self.h = h / np.linalg.norm(h, axis=0)
        self.cos_d = (self.i * self.h).sum(axis=0)

    @staticmethod
    def _vector(theta: Array, phi: Array) -> Array:
        sine = np.sin(theta)
        return np.stack([sine * np.cos(phi), sine * np.sin(phi), np.cos(theta)])


def ggx(f: Frame, a: float, b: float) -> Array:
    x, y, z = f.h
    return np.asarray(1 / (np.pi * a * b * ((x / a) ** 2 + (y / b) ** 2 + z**2) ** 2))


def ggx_lambda(w: Array, a: float, b: float) -> Array:
    return np.asarray((np.sqrt(1 + ((a * w[0]) ** 2 + (b * w[1]) ** 2) / w[2] ** 2) - 1) / 2)


def beckmann(f: Frame, a: float, b: float) -> Array:
    x, y, z = f.h
    slope = ((x / a) ** 2 + (y / b) ** 2) / z**2
    return np.asarray(np.exp(-slope) / (np.pi * a * b * z**4))


def beckmann_g1(w: Array, a: float, b: float) -> Array:
    c = w[2] / np.hypot(a * w[0], b * w[1])
    rational = (3.535 * c + 2.181 * c**2) / (1 + 2.276 * c + 2.577 * c**2)
    return np.where(c < 1.6, rational, 1.0)


def conductor(cos: Array, eta: Array, k: Array) -> Array:
    """Exact reflectance [C, N] by complex Snell."""
    m = (eta + 1j * k)[:, None]
    root = np.sqrt(m**2 - (1 - cos**2))
    s, p = (cos - root) / (cos + root), (m**2 * cos - root) / (m**2 * cos + root)
    return np.asarray((abs(s) ** 2 + abs(p) ** 2) / 2)


def floats(text: str) -> Array:
    return np.array([float(part) for part in re.split(r"[,\s]+", text.strip())])


def azimuth(text: str) -> float:
    """Give the azimuth that a comment states for the tangent, in radians."""
    found = re.search(r"lie at ([0-9.]+) degrees", text)
    return np.radians(float(found[1])) if found else 0.0


def mitsuba_colour(bsdf: Element, name: str, wavelengths: tuple[float, ...] = ()) -> Array:
    node = next(child for child in bsdf if child.get("name") == name)
    value = node.get("value", "")
    if ":" in value:
        points = np.array([floats(pair.replace(":", " ")) for pair in value.split(",")])
        assert points[0, 0] <= 360
        assert points[-1, 0] >= 830
        return np.asarray(np.interp(wavelengths, *points.T))
    return np.broadcast_to(floats(value), 3) if node.tag == "spectrum" else floats(value)


def mitsuba_value(bsdf: Element, f: Frame, wavelengths: tuple[float, ...] = ()) -> Array:
    def number(name: str) -> str:
        return next(str(c.get("value")) for c in bsdf if c.get("name") == name)

    def colour(name: str) -> Array:
        return mitsuba_colour(bsdf, name, wavelengths)

    kind = bsdf.get("type")
    if kind == "blendbsdf":
        first, second = (mitsuba_value(b, f, wavelengths) for b in bsdf.findall("bsdf"))
        weight = float(number("weight"))
        return (1 - weight) * first + weight * second
    if kind == "diffuse":
        reflectance = colour("reflectance")
        assert 0 <= reflectance.min() <= reflectance.max() <= 1
        return np.tile(reflectance[:, None] / np.pi, f.cos_d.size)
    assert kind == "roughconductor"
    a, b = float(number("alpha_u")), float(number("alpha_v"))
    if number("distribution") == "ggx":
        D, G = ggx(f, a, b), 1 / ((1 + ggx_lambda(f.i, a, b)) * (1 + ggx_lambda(f.o, a, b)))
    else:
        D, G = beckmann(f, a, b), beckmann_g1(f.i, a, b) * beckmann_g1(f.o, a, b)
    perfect = any(c.get("name") == "material" and c.get("value") == "none" for c in bsdf)
    F = np.ones((1, f.cos_d.size)) if perfect else conductor(f.cos_d, colour("eta"), colour("k"))
    reflectance = colour("specular_reflectance")
    # Mitsuba refuses a larger one only where it is given as R, G, B.
    assert 0 <= reflectance.min() <= reflectance.max()
    assert reflectance.max() <= 1 or not np.ptp(reflectance)
    return np.asarray(reflectance[:, None] * F * D * G / (4 * f.i[2] * f.o[2]))


def pbrt_materials(text: str) -> dict[str, dict[str, Any]]:
    """Parse named materials: parameter by name, as text or numbers."""
    tokens = re.findall(
        r'"[^"]*"|[^\s"\[\]]+|[\[\]]', re.sub(r"^#.*$", "", text, flags=re.MULTILINE)
    )
    materials: dict[str, dict[str, Any]] = {}
    parameters: dict[str, Any] = {}
    while tokens:
        token = tokens.pop(0)
        if token == "MakeNamedMaterial":
            parameters = materials.setdefault(tokens.pop(0).strip('"'), {})
            continue
        kind, name = token.strip('"').split()
        values = [tokens.pop(0)]
        if values == ["["]:
            end = tokens.index("]")
            values, tokens = tokens[:end], tokens[end + 1 :]
        known = [v.strip('"') if v[0] == '"' or kind == "bool" else float(v) for v in values]
        parameters[name] = (kind, known)
    return materials


def pbrt_value(
    materials: dict[str, dict[str, Any]], name: str, f: Frame, wavelengths: tuple[float, ...]
) -> Array:
    material = materials[name]

    def colour(key: str) -> Array:
        kind, values = material[key]
        if kind == "rgb":
            return np.array(values)
        points = np.array(values).reshape(-1, 2)
        assert np.all(np.diff(points[:, 0]) > 0)
        return np.asarray(np.interp(wavelengths, *points.T))

    kind = material["type"][1][0]
    if kind == "mix":
        first, second = (pbrt_value(materials, n, f, wavelengths) for n in material["materials"][1])
        amount = material["amount"][1][0]
        return np.asarray((1 - amount) * first + amount * second)
    if kind == "diffuse":
        reflectance = colour("reflectance")
        assert 0 <= reflectance.min() <= reflectance.max() <= 1
        return np.tile(reflectance[:, None] / np.pi, f.cos_d.size)
    assert kind == "conductor"
    assert material["remaproughness"][1] == ["false"]
    a, b = material["uroughness"][1][0], material["vroughness"][1][0]
    G = 1 / (1 + ggx_lambda(f.i, a, b) + ggx_lambda(f.o, a, b))
    F = conductor(f.cos_d, colour("eta"), colour("k"))
    return np.asarray(F * ggx(f, a, b) * G / (4 * f.i[2] * f.o[2]))


def materialx_value(root: Element, name: str, f: Frame) -> Array:
    node = next(child for child in root if child.get("name") == name)
    given = {str(c.get("name")): c for c in node}

    def value(key: str) -> str:
        return str(given[key].get("value"))

    def behind(key: str) -> Array:
        return materialx_value(root, str(given[key].get("nodename")), f)

    if node.tag in ("surfacematerial", "surface"):
        return behind("surfaceshader" if node.tag == "surfacematerial" else "bsdf")
    if node.tag == "add":
        return behind("in1") + behind("in2")
    colour, r = floats(value("color"))[:, None], float(value("roughness"))
    assert 0 <= r <= 1
    n_i, n_o = f.i[2], f.o[2]
    if node.tag == "burley_diffuse_bsdf":
        F90 = 0.5 + 2 * r * f.cos_d**2
        light, view = (1 + (F90 - 1) * (1 - n) ** 5 for n in (n_i, n_o))
        return np.asarray(colour / np.pi * light * view)
    assert node.tag == "oren_nayar_diffuse_bsdf"
    s = (f.i * f.o).sum(axis=0) - n_i * n_o
    if "energy_compensation" not in given:
        A, B = 1 - 0.5 * r**2 / (r**2 + 0.33), 0.45 * r**2 / (r**2 + 0.09)
        return np.asarray(colour / np.pi * (A + B * np.maximum(s, 0) / np.maximum(n_i, n_o)))
    assert value("energy_compensation") == "true"
    c1, c2 = 1 / 2 - 2 / (3 * np.pi), 2 / 3 - 28 / (15 * np.pi)
    A = 1 / (1 + c1 * r)
    single = colour * A * (1 + r * np.where(s > 0, s / np.maximum(n_i, n_o), s))

    def albedo(n: Array) -> Array:
        sine = np.sqrt(1 - n**2)
        G = sine * (np.arccos(n) - sine * n) + 2 / 3 * (sine * (1 - sine**3) / n - sine)
        return np.asarray(A + r * A / np.pi * G)

    mean = A * (1 + c2 * r)
    multiple = colour**2 * mean / (1 - colour * (1 - mean))
    return np.asarray(
        (single + multiple * (1 - albedo(n_i)) * (1 - albedo(n_o)) / (1 - mean)) / np.pi
    )
