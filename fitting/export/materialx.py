"""MaterialX 1.39: its two diffuse BSDF nodes, where the specification's formula is the model's.

``oren_nayar_diffuse_bsdf`` is Lambert with a roughness of 0, the qualitative model of Oren and
Nayar, and with ``energy_compensation`` the EON model; ``burley_diffuse_bsdf`` is Disney's
diffuse term. The microfacet nodes are not used: the specification expects them to add light
that is scattered several times, which no model here has.
"""

from __future__ import annotations

from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from lobefit.fitting.export.fitted import Channels, Fitted, Part
from lobefit.fitting.export.microfacet import ELSEWHERE
from lobefit.fitting.export.refusal import ExportError
from lobefit.fitting.export.spectra import comment, numbers

__all__ = ["materialx_text"]

Array = NDArray[np.float64]
Element = ElementTree.Element

# The record's name, the node, the record's roughness, and whether energy is compensated.
_NODES = {
    "lambert": ("oren_nayar_diffuse_bsdf", None, False),
    "oren_nayar": ("oren_nayar_diffuse_bsdf", "sigma", False),
    "eon": ("oren_nayar_diffuse_bsdf", "r", True),
    "disney_diffuse": ("burley_diffuse_bsdf", "roughness", False),
}
_CLAMPED = (
    "the shader generator of MaterialX 1.39.5 (GLSL) takes the cosine between light and view as at "
    "least 0, unlike the specification: it is brighter where they are more than 90 degrees apart"
)


def materialx_text(fitted: Fitted, tolerance: float) -> str:
    """Write a surface material as a MaterialX document.

    Parameters
    ----------
    fitted : Fitted
        The model.
    tolerance : float
        Not used: what MaterialX expresses is exact.

    Returns
    -------
    str
        The document; the material is called "lobefit".

    Raises
    ------
    ExportError
        MaterialX has no equal of the model.
    """
    channels = Channels.named(fitted.channels)
    if channels.kind not in ("grey", "rgb"):
        raise ExportError(
            fitted.candidate,
            "materialx",
            f"a MaterialX colour has three channels, and these are {', '.join(channels.names)}",
            "fit a measurement with the channels R,G,B, or with one channel",
        )
    root = ElementTree.Element("materialx", version="1.39")
    for remark in [*fitted.remarks(), *(_CLAMPED for p in fitted.parts if p.lobe == "eon")]:
        root.append(comment(remark))
    black = Part("lambert", {}, {"k_d": np.zeros(len(channels.names))})
    last = ""
    for place, part in enumerate(fitted.parts or (black,), start=1):
        name = f"diffuse_{place}"
        root.append(_node(fitted, part, name))
        if last:
            added = _typed("add", f"sum_{place}", "BSDF")
            _connect(added, "in1", "BSDF", last)
            _connect(added, "in2", "BSDF", name)
            root.append(added)
            name = f"sum_{place}"
        last = name
    surface = _typed("surface", "surface", "surfaceshader")
    _connect(surface, "bsdf", "BSDF", last)
    material = _typed("surfacematerial", "lobefit", "material")
    _connect(material, "surfaceshader", "surfaceshader", "surface")
    root.extend((surface, material))
    ElementTree.indent(root)
    return f'<?xml version="1.0" encoding="utf-8"?>\n{ElementTree.tostring(root, "unicode")}\n'


def _node(fitted: Fitted, part: Part, name: str) -> Element:
    if part.lobe not in _NODES:
        raise ExportError(
            fitted.candidate,
            "materialx",
            f"no node of MaterialX is {part.lobe}"
            + (
                "; its microfacet nodes add light scattered several times, which the model lacks"
                if "k_s" in part.params
                else ""
            ),
            f"fit {', '.join(_NODES)}, or: {ELSEWHERE}",
        )
    kind, roughness_name, compensated = _NODES[part.lobe]
    roughness = 0.0 if roughness_name is None else _single(fitted, part, roughness_name)
    node = _typed(kind, name, "BSDF")
    colour = np.broadcast_to(part.strength, 3)
    _input(node, "color", "color3", numbers(colour, ", "))
    _input(node, "roughness", "float", f"{roughness:.9g}")
    if compensated:
        _input(node, "energy_compensation", "boolean", "true")
    return node


def _single(fitted: Fitted, part: Part, name: str) -> float:
    values = part.params[name]
    value = float(values[0])
    reason = f"its {name} is {value:.6g} and that of MaterialX lies within 0 and 1"
    if np.ptp(values):
        reason = f"its {name} differs by channel and that of MaterialX cannot"
    elif 0.0 <= value <= 1.0:
        return value
    raise ExportError(fitted.candidate, "materialx", reason, f"fit eon, or: {ELSEWHERE}")


def _typed(kind: str, name: str, type_name: str) -> Element:
    return ElementTree.Element(kind, name=name, type=type_name)


def _input(node: Element, name: str, kind: str, value: str) -> None:
    ElementTree.SubElement(node, "input", name=name, type=kind, value=value)


def _connect(node: Element, name: str, kind: str, source: str) -> None:
    ElementTree.SubElement(node, "input", name=name, type=kind, nodename=source)
