"""Make kernels/metals.csv and the RGB values of kernels/metals.py.

    python make_metals.py kernels/metals.csv

Needs mitsuba 3.9 (whose wheel holds the measured spectra), colour-science and scipy. It
writes the table and prints the RGB values.
"""

from __future__ import annotations

import sys
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

__all__ = ["reflectance", "rgb_constants", "srgb"]

Array = npt.NDArray[np.float64]

SYMBOLS = {"aluminium": "Al", "copper": "Cu", "gold": "Au", "silver": "Ag"}
# The rows of the spectra that enclose the range of the colour matching functions used here.
SHORTEST, LONGEST = 375.0, 800.0
VISIBLE = np.arange(380.0, 781.0)
GRAZING = 1.0 / 7.0  # the cosine, about 82 degrees, at which the second colour is matched


def reflectance(cos: Any, eta: Any, k: Any) -> Array:
    """Reflectance of a conductor for unpolarised light, by complex Snell."""
    index = np.asarray(eta) + 1j * np.asarray(k)
    refracted = np.sqrt(1 - (1 - cos**2) / index**2)
    s = (cos - index * refracted) / (cos + index * refracted)
    p = (index * cos - refracted) / (index * cos + refracted)
    return np.asarray((np.abs(s) ** 2 + np.abs(p) ** 2) / 2)


def srgb(spectrum: Array) -> Array:
    """Linear sRGB of a reflectance at VISIBLE under D65 (CIE 1931, 2 degrees); white is 1."""
    colour = import_module("colour")  # ships no types, and need not be installed
    shape = colour.SpectralShape(VISIBLE[0], VISIBLE[-1], 1)
    observer = colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"]
    light = colour.SDS_ILLUMINANTS["D65"]
    weights = observer.copy().align(shape).values * light.copy().align(shape).values[:, None]
    to_rgb = colour.RGB_COLOURSPACES["sRGB"].matrix_XYZ_to_RGB
    return np.asarray(to_rgb @ (spectrum @ weights) / (to_rgb @ weights.sum(axis=0)))


def rgb_constants(eta: Array, k: Array) -> tuple[list[float], list[float], Array, Array]:
    """Indices whose reflectance has the colours of the spectra at normal and at 82 degrees."""
    from scipy.optimize import brentq

    spectrum = reflectance(1.0, eta, k)
    F0, F82 = srgb(spectrum), srgb(reflectance(GRAZING, eta, k))
    found: list[tuple[float, float]] = []
    # No conductor reflects all: what lies outside the gamut is limited to what the metal has.
    for normal, grazing in zip(np.minimum(F0, spectrum.max()), F82, strict=True):

        def extinction(n: float, R: float = normal) -> float:
            return float(np.sqrt(max((R * (n + 1) ** 2 - (n - 1) ** 2) / (1 - R), 0.0)))

        def miss(n: float, R: float = grazing, extinction: Any = extinction) -> float:
            return float(reflectance(GRAZING, n, extinction(n)) - R)

        nodes = np.geomspace(0.02, 5.0, 400)
        signs = np.sign([miss(n) for n in nodes])
        (crossings,) = np.nonzero(np.diff(signs))
        n = float(brentq(miss, nodes[crossings[0]], nodes[crossings[0] + 1], xtol=1e-12))
        found.append((n, extinction(n)))
    return [n for n, _ in found], [k for _, k in found], F0, F82


def main() -> None:
    folder = Path(str(import_module("mitsuba").__file__)).parent / "data/ior"
    columns: dict[str, Array] = {}
    for name, symbol in SYMBOLS.items():
        for kind, ending in (("eta", "eta"), ("k", "k")):
            table = np.loadtxt(folder / f"{symbol}.{ending}.spd")
            table = table[(table[:, 0] > SHORTEST) & (table[:, 0] < LONGEST)]
            wavelengths = columns.setdefault("wavelength_nm", table[:, 0])
            assert np.array_equal(wavelengths, table[:, 0])
            columns[f"{name}_{kind}"] = table[:, 1]
    rows = zip(*columns.values(), strict=True)
    lines = [",".join(columns), *(",".join(f"{x:.9g}" for x in row) for row in rows)]
    Path(sys.argv[1]).write_text("\n".join(lines) + "\n", encoding="utf-8")
    for name in SYMBOLS:
        eta, k = (
            np.interp(VISIBLE, columns["wavelength_nm"], columns[f"{name}_{kind}"])
            for kind in ("eta", "k")
        )
        n, extinction, F0, F82 = rgb_constants(eta, k)
        print(f'    "{name}": {{"eta": {np.round(n, 4).tolist()}, ', end="")
        print(f'"k": {np.round(extinction, 4).tolist()}}},  # F0 {F0.round(4)}, F82 {F82.round(4)}')


if __name__ == "__main__":
    main()
