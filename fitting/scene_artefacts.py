"""Files of a decision: the document, the pictures and the layers, whole or not at all.

scene.exr holds linear radiance in 32-bit floats, channel C of layer L named ``L.C``: the chosen
combination's ``beauty``, ``diffuse`` and ``specular`` (those of the nearest one where nothing is
within the tolerance), the ``reference``, and the error of each pixel as ``deltaE.Y`` (``relative.Y``
where relative radiance was asked for). albedo.exr has the models that the pictures show.
"""

from __future__ import annotations

import json
from pathlib import Path

from lobefit.fitting.albedo_picture import write_albedo
from lobefit.fitting.artefacts import Makers, save_together, write_json
from lobefit.fitting.export.fitted import Fitted
from lobefit.fitting.exr import SRGB, exr_name, write_exr
from lobefit.fitting.scene import Decision
from lobefit.fitting.scene_figure import tone_mapped, write_decision

__all__ = ["LAYERS_SCHEMA", "save_decision", "write_layers"]

LAYERS_SCHEMA = "lobefit.scene-layers/1"


def save_decision(decision: Decision, folder: Path) -> dict[str, Path]:
    """Write everything about a decision into a folder, which is made if it does not exist."""
    makers: Makers = {
        "figure": ("scene.png", lambda path: write_decision(path, decision)),
        "picture": ("beauty.png", lambda path: _write_picture(path, decision)),
        "layers": ("scene.exr", lambda path: write_layers(path, decision)),
        "albedo": (
            "albedo.exr",
            lambda path: write_albedo(path, _shown(decision)),
        ),
        "decision": ("decision.json", lambda path: write_json(path, decision.to_dict())),
    }
    return save_together(folder, makers)


def _shown(decision: Decision) -> list[Fitted]:
    """Give the models that the pictures show; integrating every one may take many seconds."""
    shown = [c.model for c in (decision.answer.chosen, decision.answer.cheaper) if c is not None]
    return list({m.name: m.fitted for m in (decision.fits.reference, *shown)}.values())


def write_layers(path: Path, decision: Decision) -> None:
    """Write the layers as OpenEXR and make sure that the file holds them."""
    chosen = decision.answer.chosen or decision.answer.cheaper
    shown = decision.chosen or decision.cheaper
    assert chosen is not None and shown is not None
    tolerance = decision.answer.tolerance
    layers = {
        "beauty": shown.rendering.beauty,
        "diffuse": shown.rendering.diffuse,
        "specular": shown.rendering.specular,
        "reference": decision.reference.picture,
    }
    names = [exr_name(name) for name in decision.channels]
    if tolerance.measure == "delta_e":
        names = ["R", "G", "B"]
    planes = {
        f"{layer}.{name}": plane
        for layer, picture in layers.items()
        for name, plane in zip(names, picture, strict=True)
    }
    error = "deltaE" if tolerance.measure == "delta_e" else "relative"
    planes[f"{error}.Y"] = shown.differences
    attributes: dict[str, str | tuple[float, ...]] = {
        "lobefit:schema": LAYERS_SCHEMA,
        "lobefit:model": chosen.model.name,
        "lobefit:params": json.dumps(dict(chosen.model.fitted.params)),
        "lobefit:options": json.dumps(dict(chosen.model.fitted.options)),
        "lobefit:shading": chosen.shading,
        "lobefit:level": str(chosen.level),
        "lobefit:within_tolerance": str(decision.answer.chosen is not None).lower(),
        "lobefit:tolerance": json.dumps(
            {"measure": tolerance.measure, "mean": tolerance.mean, "p99": tolerance.p99}
        ),
        "lobefit:exposure": f"{decision.factor:.9g}",
        "lobefit:reference": decision.reference.why,
        "lobefit:scene_sha256": decision.request.sha256,
        "comments": decision.sentence,
    }
    if names == ["R", "G", "B"]:
        attributes["chromaticities"] = SRGB
    write_exr(path, planes, attributes)


def _write_picture(path: Path, decision: Decision) -> None:
    from matplotlib.image import imsave

    shown = decision.chosen or decision.cheaper
    assert shown is not None
    imsave(path, tone_mapped(decision, shown.rendering.beauty), format="png")
