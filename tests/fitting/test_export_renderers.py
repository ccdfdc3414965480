"""Exports read back: what a target's documentation says of the file is the BRDF that was fitted.

The files are parsed and evaluated from the targets' formulas, in numpy, and by Mitsuba and
MaterialX themselves where they are installed.
"""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from lobefit.fitting.export import Fitted, export_text, write_export
from lobefit.fitting.export.mitsuba import BECKMANN_ERROR
from lobefit.kernels import evaluate
from tests.fitting.export_cases import (
    COPPER,
    EXACT,
    MATERIALX,
    METAL,
    MITSUBA,
    PBRT,
    PROMISED,
    SEPARABLE,
    close,
    directions,
    fitted,
)
from tests.fitting.export_readers import (
    Frame,
    azimuth,
    materialx_value,
    mitsuba_value,
    pbrt_materials,
    pbrt_value,
    turned,
)


@pytest.mark.parametrize("name", MITSUBA)
def test_mitsuba_by_its_documentation(name: str) -> None:
    case, angles = MITSUBA[name], directions()
    rational = "beckmann" in case.candidate
    text = export_text(case, "mitsuba", BECKMANN_ERROR if rational else PROMISED)
    root = ElementTree.fromstring(text)
    found = mitsuba_value(root, Frame(turned(angles, azimuth(text))))[: len(case.channels)]
    close(found, case.evaluate(*angles), BECKMANN_ERROR if rational else EXACT)


@pytest.mark.parametrize("name", MITSUBA)
def test_mitsuba_itself(name: str) -> None:
    mi = pytest.importorskip("mitsuba")
    mi.set_variant("scalar_rgb")
    case, angles = MITSUBA[name], directions()
    rational = "beckmann" in case.candidate
    text = export_text(case, "mitsuba", BECKMANN_ERROR if rational else PROMISED)
    bsdf = mi.load_string(text)
    f = Frame(turned(angles, azimuth(text)))
    found = np.empty((3, f.cos_d.size))
    interaction = mi.SurfaceInteraction3f()
    for row in range(f.cos_d.size):
        interaction.wi = f.i[:, row].tolist()
        o = f.o[:, row].tolist()
        found[:, row] = np.array(bsdf.eval(mi.BSDFContext(), interaction, o)) / o[2]
    truth = case.evaluate(*angles)
    # Mitsuba sets D n.h below 1e-20 to zero; all else is to the promise.
    np.testing.assert_allclose(
        found[: len(truth)], truth, rtol=BECKMANN_ERROR if rational else PROMISED, atol=1e-15
    )


def test_mitsuba_wavelengths() -> None:
    channels = ("650nm", "450 nm", "550nm")
    case = fitted(
        "ggx",
        {"k_d": [0.3, 0.1, 0.2], "k_s": 0.7, "alpha": 0.3, **COPPER},
        SEPARABLE | METAL,
        channels,
    )
    text, angles = export_text(case, "mitsuba"), directions()
    found = mitsuba_value(ElementTree.fromstring(text), Frame(angles), (650, 450, 550))
    close(found, case.evaluate(*angles), EXACT)
    assert "the nearest value is repeated" in text


@pytest.mark.parametrize("name", PBRT)
def test_pbrt_by_its_documentation(name: str) -> None:
    case, angles = PBRT[name], directions()
    text = export_text(case, "pbrt")
    spectral = "wavelength" in name
    wavelengths = (630.0, 532.0, 465.0) if spectral else (500.0,) * len(case.channels)
    frame = Frame(turned(angles, azimuth(text)))
    found = pbrt_value(pbrt_materials(text), "lobefit", frame, wavelengths)
    truth = case.evaluate(*angles)
    # F = 1 is an index of 1 + 10000 i.
    close(found, truth, 2e-6 if "none" in case.options.values() else EXACT)


@pytest.mark.parametrize("name", MATERIALX)
def test_materialx_by_its_specification(name: str) -> None:
    case, angles = MATERIALX[name], directions()
    root = ElementTree.fromstring(export_text(case, "materialx"))
    found = materialx_value(root, "lobefit", Frame(angles))
    truth = case.evaluate(*angles)
    # What Fujii's term loses is a difference here, and small.
    close(found, np.broadcast_to(truth, (3, truth.shape[1])), 1e-5 if name == "eon" else EXACT)


@pytest.mark.parametrize("name", MATERIALX)
def test_materialx_itself_finds_the_document_valid(name: str) -> None:
    mx = pytest.importorskip("MaterialX")
    document = mx.createDocument()
    mx.readFromXmlString(document, export_text(MATERIALX[name], "materialx"))
    library = mx.createDocument()
    mx.loadLibraries(mx.getDefaultDataLibraryFolders(), mx.getDefaultDataSearchPath(), library)
    document.importLibrary(library)
    valid, why = document.validate()
    assert valid, why
    assert [material.getName() for material in document.getMaterialNodes()] == ["lobefit"]
    assert all(node.getNodeDef() for node in document.getNodes())


@pytest.mark.parametrize(
    "case",
    [
        fitted("ggx", {"k_d": [0.3, 0.2, 0.1], "k_s": 0.5, "F0": 0.5, "alpha": 0.05}),
        fitted("oren_nayar", {"k_d": 0.4, "sigma": 1.2}, channels=("brdf",)),
        fitted("ward:isotropic", {"k_d": 0.1, "k_s": 0.2, "alpha_x": 0.3, "alpha_y": 0.3}),
    ],
    ids=["ggx", "one channel", "a tied variant"],
)
def test_merl_cells_hold_the_model(tmp_path: Path, case: Fitted) -> None:
    written = write_export(case, "merl", tmp_path / "table.binary")
    assert [path.name for path in written] == ["table.binary", "table.binary.txt"]
    assert f"convention: {case.convention}" in written[1].read_text()
    planes = np.fromfile(written[0], dtype="<f8", offset=12).reshape(3, 90, 90, 180)
    rng = np.random.default_rng(3)
    h, d, p = (rng.integers(0, n, 4000) for n in (90, 90, 180))
    # Edges by the published rule; the centre between them, of theta_h after its square root.
    half = np.pi / 2 * (h + 0.5) ** 2 / 8100
    difference, turn = np.radians(d + 0.5), np.radians(p + 0.5)
    local = Frame._vector(difference, turn)
    rows = [[np.cos(half), np.sin(half)], [-np.sin(half), np.cos(half)]]
    i = np.stack([rows[0][0] * local[0] + rows[0][1] * local[2], local[1]])
    i = np.vstack([i, rows[1][0] * local[0] + rows[1][1] * local[2]])
    normal = np.stack([np.sin(half), np.zeros(h.size), np.cos(half)])
    o = 2 * (i * normal).sum(axis=0) * normal - i
    lit = np.minimum(i[2], o[2]) > 1e-6
    assert np.all(planes[:, h, d, p][:, ~lit] < 0)
    angles = [np.arctan2(np.hypot(w[0], w[1]), w[2])[lit] for w in (i, o)]
    turns = [np.arctan2(w[1], w[0])[lit] for w in (i, o)]
    truth = evaluate(
        case.model, case.params, angles[0], turns[0], angles[1], turns[1], options=case.options
    )
    scales = np.array([1, 1.15, 1.66])[:, None] / 1500
    found = (planes[:, h, d, p] * scales)[:, lit]
    np.testing.assert_allclose(found, np.broadcast_to(truth, found.shape), rtol=1e-9)
