"""pbrt-v4: ``diffuse``, ``conductor`` and ``mix`` as named materials.

pbrt's conductor is D G F / (4 cos_theta_i cos_theta_o) with GGX, Smith's height-correlated
masking and the exact Fresnel equations; it has no strength of its own, so k_s is the weight of
a ``mix`` and must be one number of at most 1. F = 1 is written as an index of 1 + 10000 i, which
is 1 to 4e-5 for cos_theta_d above 0.001. pbrt takes roughness below 0.001 for a mirror. It
renders spectra, so an index of refraction given as R, G, B has no exact equal in it.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from lobefit.fitting.export.fitted import Channels, Fitted
from lobefit.fitting.export.microfacet import ELSEWHERE, Microfacet, diffuse_and_lobes
from lobefit.fitting.export.refusal import ExportError
from lobefit.fitting.export.spectra import VISIBLE, extended, numbers

__all__ = ["LEAST_ALPHA", "PERFECT_K", "pbrt_text"]

Array = NDArray[np.float64]

LEAST_ALPHA = 1e-3
PERFECT_K = 1e4


def pbrt_text(fitted: Fitted, tolerance: float) -> str:
    """Write named materials as pbrt's scene description.

    Parameters
    ----------
    fitted : Fitted
        The model.
    tolerance : float
        Not used: what pbrt expresses is exact.

    Returns
    -------
    str
        To be included in a scene; the material is called "lobefit".

    Raises
    ------
    ExportError
        pbrt has no equal of the model.
    """

    def refuse(reason: str, remedy: str) -> ExportError:
        return ExportError(fitted.candidate, "pbrt", reason, remedy)

    channels = Channels.named(fitted.channels)
    if channels.kind == "unknown":
        raise refuse(
            f"the channels {', '.join(channels.names)} are neither R, G, B nor wavelengths",
            "name them R,G,B or such as 450nm in the measurement",
        )
    k_d, lobes = diffuse_and_lobes(fitted, "pbrt", "smith_correlated", ("ggx",))
    weights = []
    for lobe in lobes:
        _check(fitted, channels, lobe)
        weights.append(float(lobe.k_s[0]))
    total = sum(weights)
    if total > 1.0:
        raise refuse(
            f"its strength k_s is {total:.6g} and the weight of a mix at most 1",
            f"fit a variant with k_s=1, or: {ELSEWHERE}",
        )
    rest = 1.0 - total
    if not lobes and np.any(k_d > 1.0):
        raise refuse(f"its albedo k_d is {k_d.max():.6g} and that of pbrt at most 1", ELSEWHERE)
    if np.any(k_d > rest):
        raise refuse(
            f"k_d = {k_d.max():.6g} beside k_s = {total:.6g}: the weights of a mix add to 1, so "
            "that k_d can be at most 1 - k_s",
            f"fit a variant in which k_s is free, or: {ELSEWHERE}",
        )
    pieces: list[tuple[float, str, list[str]]] = []
    if rest > 0.0:
        pieces.append((rest, "diffuse", [_colour(channels, "reflectance", k_d / rest)]))
    for lobe, weight in zip(lobes, weights, strict=True):
        pieces.append((weight, "conductor", _conductor(channels, lobe)))
    lines = [f"# {remark}" for remark in _remarks(fitted, channels, lobes)]
    return "\n".join((*lines, *_materials(pieces))) + "\n"


def _check(fitted: Fitted, channels: Channels, lobe: Microfacet) -> None:
    def refuse(reason: str, remedy: str) -> ExportError:
        return ExportError(fitted.candidate, "pbrt", reason, remedy)

    if min(lobe.alpha_x, lobe.alpha_y) < LEAST_ALPHA:
        raise refuse(
            f"pbrt takes roughness below {LEAST_ALPHA:g} for a mirror, and alpha is "
            f"{min(lobe.alpha_x, lobe.alpha_y):.6g}",
            "use a mirror there",
        )
    if np.ptp(lobe.k_s):
        raise refuse(
            "its strength k_s differs by channel and the weight of a mix cannot",
            f"fit a variant with k_s=1 and --option fresnel=conductor, or: {ELSEWHERE}",
        )
    if channels.kind == "rgb" and lobe.fresnel == "exact" and (np.ptp(lobe.eta) or np.ptp(lobe.k)):
        raise refuse(
            "pbrt renders spectra, and an index of refraction by R, G, B is none",
            "fit a measurement whose channels are wavelengths (450nm, ...), or export to mitsuba",
        )


def _remarks(fitted: Fitted, channels: Channels, lobes: list[Microfacet]) -> list[str]:
    remarks = fitted.remarks()
    if channels.kind == "rgb":
        remarks.append("pbrt turns R, G, B into a spectrum that looks the same in its colour space")
    if channels.kind == "wavelengths":
        remarks.append("beyond the measured wavelengths the nearest value is repeated")
    for lobe in lobes:
        if not lobe.isotropic:
            remarks.append(
                f"uroughness is along dp/du: let it lie at {math.degrees(lobe.phi_x):.9g} degrees "
                "in the azimuth of the measurement"
            )
    return [*remarks, 'use: NamedMaterial "lobefit"']


def _materials(pieces: list[tuple[float, str, list[str]]]) -> list[str]:
    """Name the only material "lobefit", or mix: `amount` is the share of the second one."""
    if len(pieces) == 1:
        return _named("lobefit", *pieces[0][1:])
    lines: list[str] = []
    names = [f"lobefit-{kind}-{place}" for place, (_, kind, _) in enumerate(pieces, start=1)]
    for name, (_, kind, parameters) in zip(names, pieces, strict=True):
        lines += _named(name, kind, parameters)
    first, before = names[0], pieces[0][0]
    for name, (share, *_) in zip(names[1:], pieces[1:], strict=True):
        before += share
        mixed = "lobefit" if name == names[-1] else f"lobefit-mix-{name[-1]}"
        pair = f'"string materials" [ "{first}" "{name}" ]'
        lines += _named(mixed, "mix", [pair, f'"float amount" [ {share / before:.9g} ]'])
        first = mixed
    return lines


def _named(name: str, kind: str, parameters: list[str]) -> list[str]:
    head = f'MakeNamedMaterial "{name}"'
    return [head, *(f"  {text}" for text in (f'"string type" "{kind}"', *parameters))]


def _conductor(channels: Channels, lobe: Microfacet) -> list[str]:
    eta, k = lobe.eta, lobe.k
    if lobe.fresnel == "none":
        eta, k = np.ones_like(lobe.k_s), np.full_like(lobe.k_s, PERFECT_K)
    return [
        _colour(channels, "eta", eta),
        _colour(channels, "k", k),
        f'"float uroughness" [ {lobe.alpha_x:.9g} ]',
        f'"float vroughness" [ {lobe.alpha_y:.9g} ]',
        '"bool remaproughness" false',
    ]


def _colour(channels: Channels, name: str, values: Array) -> str:
    if channels.kind == "wavelengths":
        nodes = [number for node in extended(channels, values) for number in node]
        return f'"spectrum {name}" [ {numbers(np.array(nodes))} ]'
    if np.ptp(values) == 0.0:
        flat = (VISIBLE[0], values[0], VISIBLE[1], values[0])
        return f'"spectrum {name}" [ {numbers(np.array(flat))} ]'
    return f'"rgb {name}" [ {numbers(values)} ]'
