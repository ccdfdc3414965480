"""Mitsuba 3: ``diffuse``, ``roughconductor`` and ``blendbsdf`` as XML.

Mitsuba's rough conductor is D G F / (4 cos_theta_i cos_theta_o) times a reflectance, with a
normalised D, Smith's separable masking and the exact Fresnel equations; ``material = none`` is
F = 1. Sums are blends: a lobe of strength k_s is written with the weight w and the reflectance
k_s/w, which may be above 1 where it is the same in all channels: the Fresnel term keeps the lobe
below 1. Smith's masking of Beckmann is there a rational approximation (Walter et al. 2007),
whose largest error is stated below.
"""

from __future__ import annotations

import math
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from lobefit.fitting.export.fitted import Channels, Fitted
from lobefit.fitting.export.microfacet import ELSEWHERE, Microfacet, diffuse_and_lobes
from lobefit.fitting.export.refusal import ExportError
from lobefit.fitting.export.spectra import comment, extended, numbers

__all__ = ["BECKMANN_ERROR", "LEAST_SHARE", "mitsuba_text"]

Array = NDArray[np.float64]
Element = ElementTree.Element

BECKMANN_ERROR = 0.0063
"""Largest relative error of the product of two of its maskings, with any alpha and angles."""

LEAST_SHARE = 0.01
"""A smaller share of a blend is sampled too seldom to be of use."""


def mitsuba_text(fitted: Fitted, tolerance: float) -> str:
    """Write a BSDF as Mitsuba's XML.

    Parameters
    ----------
    fitted : Fitted
        The model.
    tolerance : float
        Largest relative deviation of the BRDF that is accepted.

    Returns
    -------
    str
        A document whose root is a ``bsdf``, to be loaded or pasted into a scene.

    Raises
    ------
    ExportError
        Mitsuba has no equal of the model.
    """
    channels = Channels.named(fitted.channels)
    if channels.kind == "unknown":
        raise ExportError(
            fitted.candidate,
            "mitsuba",
            f"the channels {', '.join(channels.names)} are neither R, G, B nor wavelengths",
            "name them R,G,B or such as 450nm in the measurement",
        )
    k_d, lobes = diffuse_and_lobes(fitted, "mitsuba", "smith_separable", ("ggx", "beckmann"))
    if tolerance < BECKMANN_ERROR and any(lobe.distribution == "beckmann" for lobe in lobes):
        raise ExportError(
            fitted.candidate,
            "mitsuba",
            "its masking of Beckmann's distribution is an approximation that differs by up to "
            f"{100 * BECKMANN_ERROR:.2g} %",
            f"accept that with --tolerance {math.ceil(1000 * BECKMANN_ERROR) / 1000:g}, or fit ggx",
        )
    pieces: list[tuple[Array, Microfacet | None]] = (
        [(k_d, None)] if np.any(k_d) or not lobes else []
    )
    pieces += [(lobe.k_s, lobe) for lobe in lobes]
    shares = _shares(fitted, channels, pieces)
    root: Element | None = None
    before = 0.0
    for share, (strength, lobe) in zip(shares, pieces, strict=True):
        element = _bsdf(channels, strength / share, lobe)
        before += share
        root = element if root is None else _blend(root, element, share / before)
    if root is None:
        raise AssertionError("a model has a term")
    root.set("version", "3.0.0")
    root.set("id", "lobefit")
    for place, remark in enumerate(_remarks(fitted, channels, lobes)):
        root.insert(place, comment(remark))
    ElementTree.indent(root)
    return f'<?xml version="1.0" encoding="utf-8"?>\n{ElementTree.tostring(root, "unicode")}\n'


def _shares(
    fitted: Fitted, channels: Channels, pieces: list[tuple[Array, Microfacet | None]]
) -> list[float]:
    """Divide the blend: a term of strength s is written with the reflectance s/share.

    Mitsuba holds an RGB reflectance to 1, but not a uniform or sampled spectrum. So where the
    strengths add to more than 1, lobes that have such a strength get what the others leave.
    """
    largest = [float(strength.max()) for strength, _ in pieces]
    total = sum(largest)
    if total <= 1.0:
        return [most / total for most in largest] if total else [1.0]
    free = [
        lobe is not None and (channels.kind != "rgb" or not np.ptp(strength))
        for strength, lobe in pieces
    ]
    bound = sum(most for most, loose in zip(largest, free, strict=True) if not loose)
    rest = 1.0 - bound
    if rest <= LEAST_SHARE or not any(free):
        raise ExportError(
            fitted.candidate,
            "mitsuba",
            f"strengths that differ by channel, and k_d, add to {bound:.6g}, and the weights of a "
            "blend to 1",
            f"fit a variant with k_s=1, or: {ELSEWHERE}",
        )
    return [
        rest * most / (total - bound) if loose else most
        for most, loose in zip(largest, free, strict=True)
    ]


def _remarks(fitted: Fitted, channels: Channels, lobes: list[Microfacet]) -> list[str]:
    remarks = fitted.remarks()
    if channels.kind == "rgb":
        remarks.append("R, G, B are taken as they are in Mitsuba's rgb variants only")
    if channels.kind == "wavelengths":
        remarks.append("wavelengths for Mitsuba's spectral variants; beyond the measured ones")
        remarks[-1] += " the nearest value is repeated"
    for lobe in lobes:
        if not lobe.isotropic:
            remarks.append(
                f"alpha_u is along dp/du: let it lie at {math.degrees(lobe.phi_x):.9g} degrees in "
                "the azimuth of the measurement"
            )
    if any(lobe.distribution == "beckmann" for lobe in lobes):
        remarks.append(
            "Mitsuba's masking of Beckmann's distribution is an approximation: up to "
            f"{100 * BECKMANN_ERROR:.2g} % off"
        )
    return remarks


def _blend(first: Element, second: Element, weight: float) -> Element:
    blend = ElementTree.Element("bsdf", type="blendbsdf")
    _set(blend, "float", "weight", f"{weight:.9g}")
    blend.extend((first, second))
    return blend


def _bsdf(channels: Channels, reflectance: Array, lobe: Microfacet | None) -> Element:
    if lobe is None:
        bsdf = ElementTree.Element("bsdf", type="diffuse")
        _colour(bsdf, channels, "reflectance", reflectance)
        return bsdf
    bsdf = ElementTree.Element("bsdf", type="roughconductor")
    _set(bsdf, "string", "distribution", lobe.distribution)
    _set(bsdf, "float", "alpha_u", f"{lobe.alpha_x:.9g}")
    _set(bsdf, "float", "alpha_v", f"{lobe.alpha_y:.9g}")
    if lobe.fresnel == "none":
        _set(bsdf, "string", "material", "none")
    else:
        _colour(bsdf, channels, "eta", lobe.eta)
        _colour(bsdf, channels, "k", lobe.k)
    _colour(bsdf, channels, "specular_reflectance", reflectance)
    return bsdf


def _set(bsdf: Element, kind: str, name: str, value: str) -> None:
    ElementTree.SubElement(bsdf, kind, name=name, value=value)


def _colour(bsdf: Element, channels: Channels, name: str, values: Array) -> None:
    if channels.kind == "wavelengths":
        nodes = [
            f"{wavelength:.9g}:{value:.9g}" for wavelength, value in extended(channels, values)
        ]
        _set(bsdf, "spectrum", name, ", ".join(nodes))
    elif np.ptp(values) == 0.0:
        _set(bsdf, "spectrum", name, f"{values[0]:.9g}")
    else:
        _set(bsdf, "rgb", name, numbers(values, ", "))
