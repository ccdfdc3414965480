"""Measured refractive indices of metals, for the exact Fresnel term of the microfacet models.

`metals.csv` holds n and k from 375.7 to 799.9 nm in steps of 0.05 eV, as the renderers pbrt-v4
and Mitsuba 3 distribute them (the collection of luxpop.com; copper agrees within 0.007 with the
tabulation of E. D. Palik, Handbook of Optical Constants of Solids, 1985). Samples differ: P. B.
Johnson & R. W. Christy, Phys. Rev. B 6, 4370 (1972), give copper the linear sRGB reflectance
0.932, 0.623, 0.522 at normal incidence where this table gives 0.955, 0.638, 0.538.

A renderer with three channels has no wavelengths, and a metal's colour is not its reflectance
at three of them. The RGB indices therefore reproduce two colours, each integrated over the
table with the CIE 1931 observer under D65 and converted to linear sRGB: the one at normal
incidence and the one at cos_theta_d = 1/7, about 82 degrees, where metals depart from Schlick's
curve. At every other angle up to 89 degrees the exact Fresnel equations then stay within 0.006
of the integrated colour, but for the red of gold. That is out of the gamut: it would be 1.022 at
normal incidence, which no refractive index reflects. The reflectance there is limited to the
largest that the metal has at any wavelength from 380 to 780 nm, which is 0.972 for gold.
"""

from __future__ import annotations

from collections.abc import Sequence
from difflib import get_close_matches
from functools import cache
from importlib.resources import files

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lobefit.kernels.errors import ModelError

__all__ = ["conductor", "metals"]

# Printed by tests/kernels/references/make_metals.py.
RGB: dict[str, dict[str, Sequence[float]]] = {
    "aluminium": {"eta": (1.4321, 0.9297, 0.5908), "k": (7.7497, 6.6068, 5.3577)},
    "copper": {"eta": (0.1464, 0.9759, 1.2086), "k": (3.435, 2.6206, 2.3644)},
    "gold": {"eta": (0.0462, 0.4113, 1.5617), "k": (2.3606, 2.3603, 1.7181)},
    "silver": {"eta": (0.1292, 0.1242, 0.1512), "k": (4.1073, 3.3379, 2.4116)},
}


@cache
def _table() -> dict[str, NDArray[np.float64]]:
    text = (files("lobefit.kernels") / "metals.csv").read_text(encoding="utf-8")
    header, *lines = text.splitlines()
    rows = np.array([[float(cell) for cell in line.split(",")] for line in lines])
    return dict(zip(header.split(","), rows.T, strict=True))


def metals() -> tuple[str, ...]:
    """Give the names that `conductor` knows, in alphabetical order."""
    return tuple(sorted(RGB))


def conductor(name: str, wavelengths_nm: ArrayLike | None = None) -> dict[str, list[float]]:
    """Give a metal's complex refractive index, as parameters of a ``conductor`` Fresnel term.

    Parameters
    ----------
    name : str
        One of `metals`.
    wavelengths_nm : array_like, shape (channels,), optional
        Wavelengths in vacuum, in nm; n and k are interpolated linearly. Left out, the
        three channels are linear sRGB under D65.

    Returns
    -------
    dict of str to list of float
        "eta" and "k", one value per channel.

    Raises
    ------
    ModelError
        An unknown metal, or a wavelength outside the table.

    Examples
    --------
    >>> conductor("copper", [630.0])
    {'eta': [0.245884], 'k': [3.37835]}
    """
    if name not in RGB:
        near = get_close_matches(str(name), RGB, n=1)
        hint = f"did you mean {near[0]!r}? " if near else ""
        raise ModelError(f"no metal is called {name!r}; {hint}Known are {', '.join(metals())}")
    if wavelengths_nm is None:
        return {key: list(values) for key, values in RGB[name].items()}
    table = _table()
    known = table["wavelength_nm"]
    try:
        wanted = np.atleast_1d(np.asarray(wavelengths_nm, dtype=np.float64))
    except (TypeError, ValueError) as error:
        raise ModelError(f"wavelengths are numbers in nm, not {wavelengths_nm!r}") from error
    if wanted.ndim != 1 or wanted.size == 0:
        raise ModelError("wavelengths are one number in nm, or a list with one per channel")
    outside = ~((wanted >= known[0]) & (wanted <= known[-1]))
    if outside.any():
        raise ModelError(
            f"{name} is tabulated from {known[0]:.1f} to {known[-1]:.1f} nm; "
            f"{wanted[outside][0]:g} nm is outside"
        )
    return {
        key: np.interp(wanted, known, table[f"{name}_{key}"]).round(6).tolist()
        for key in ("eta", "k")
    }
