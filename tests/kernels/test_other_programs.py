"""Kernels against other programs: Mitsuba 3.9.1 and SCATMECH (NIST), values in references/.

SCATMECH is in double precision and agrees to rounding. Mitsuba ran in single precision, whose
6e-8 per operation becomes 1e-6 and more of a narrow lobe's value.
"""

from __future__ import annotations

import json
from math import erf
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest

from lobefit.kernels import evaluate
from tests.kernels.test_mitsuba import walter_over_exact
from tests.kernels.transcriptions import Array

REFERENCES = Path(__file__).with_name("references")
Precision = Literal["single", "double"]
Params = dict[str, Any]

RELATIVE: dict[Precision, float] = {"double": 5e-6, "single": 2e-5}
PRECISIONS = pytest.mark.parametrize("precision", ["double", "single"])
SCATMECH_RELATIVE = 1e-12
# Mitsuba sets D n.h below 1e-20 to zero.
TINY = 1e-20
SEPARABLE = {"masking": "smith_separable"}
COPPER = {"eta": [0.246, 1.072, 1.157], "k": [3.378, 2.591, 2.457]}
ALUMINIUM = {"eta": [1.357, 0.884, 0.661], "k": [7.588, 6.47, 5.654]}


class Table:
    """Directions and, by the name of the case, materials and values [C, N] of one file."""

    def __init__(self, name: str) -> None:
        record = json.loads((REFERENCES / name).read_text(encoding="utf-8"))
        assert record["columns"] == ["theta_i", "phi_i", "theta_o", "phi_o"]
        self.angles = tuple(np.radians(np.array(record["directions"])).T)
        self.materials = {c["name"]: c.get("material", {}) for c in record["cases"]}
        self.values = {c["name"]: np.array(c["values"]).T for c in record["cases"]}

    def evaluate(self, model: str, params: Params, **keywords: Any) -> Array:
        return evaluate(model, params, *self.angles, **keywords)


MICROFACET = Table("mitsuba_microfacet.json")
PRINCIPLED = Table("mitsuba_principled.json")
SCATMECH = Table("scatmech.json")


def assert_agree(ours: Array, value: Array, tolerance: float) -> None:
    """Compare relatively where the reference is above TINY, absolutely elsewhere."""
    ours = np.broadcast_to(ours, value.shape)
    large = value > TINY
    assert np.count_nonzero(large) >= large.size // 2
    np.testing.assert_allclose(ours[large], value[large], rtol=tolerance, atol=0)
    assert np.all(ours[~large] < 1e-18)


# --- Mitsuba: diffuse, roughconductor, roughplastic, roughdielectric


def test_mitsuba_diffuse() -> None:
    ours = MICROFACET.evaluate("lambert", {"k_d": [0.8, 0.5, 0.2]})
    np.testing.assert_allclose(ours, MICROFACET.values["diffuse"], rtol=2e-7)


@PRECISIONS
@pytest.mark.parametrize(
    ("name", "alpha_x", "alpha_y", "index"),
    [
        ("ggx .3/.1 copper", 0.3, 0.1, COPPER),
        ("ggx .05/.2 aluminium", 0.05, 0.2, ALUMINIUM),
        ("ggx .9/.4 copper", 0.9, 0.4, COPPER),
        ("beckmann .3/.1 copper", 0.3, 0.1, COPPER),
        ("beckmann .1/.4 aluminium", 0.1, 0.4, ALUMINIUM),
        ("beckmann .9/.4 copper", 0.9, 0.4, COPPER),
    ],
)
def test_mitsuba_rough_conductor(
    name: str, alpha_x: float, alpha_y: float, index: Params, precision: Precision
) -> None:
    distribution = name.split()[0]
    axes = {"alpha_x": alpha_x, "alpha_y": alpha_y, "phi_x": 0.0}
    ours = MICROFACET.evaluate(
        f"{distribution}_anisotropic",
        {"k_d": 0.0, "k_s": 1.0, **axes, **index},
        options={**SEPARABLE, "fresnel": "conductor"},
        precision=precision,
    )
    if distribution == "beckmann":
        ours = ours * walter_over_exact(MICROFACET.angles, alpha_x, alpha_y)
    tolerance = 5e-5 if distribution == "beckmann" else RELATIVE[precision]
    assert_agree(ours, MICROFACET.values[name], tolerance)


@PRECISIONS
@pytest.mark.parametrize(
    ("name", "alpha", "eta"),
    [
        # The specular part of roughplastic, whose diffuse part (with internal scattering) is off,
        ("plastic ggx .1", 0.1, 1.5),
        ("plastic ggx .5", 0.5, 1.33),
        ("plastic beckmann .3", 0.3, 1.9),
        # and the reflected side of roughdielectric.
        ("dielectric ggx .2", 0.2, 1.5),
        ("dielectric beckmann .4", 0.4, 2.0),
    ],
)
def test_mitsuba_dielectric_surfaces(
    name: str, alpha: float, eta: float, precision: Precision
) -> None:
    distribution = name.split()[1]
    ours = MICROFACET.evaluate(
        distribution,
        {"k_d": 0.0, "k_s": 1.0, "alpha": alpha, "eta": eta},
        options={**SEPARABLE, "fresnel": "dielectric"},
        precision=precision,
    )
    if distribution == "beckmann":
        ours = ours * walter_over_exact(MICROFACET.angles, alpha, alpha)
    tolerance = 5e-5 if distribution == "beckmann" else RELATIVE[precision]
    assert_agree(ours, MICROFACET.values[name], tolerance)


# --- Mitsuba: principled. It departs from Burley 2012 in four ways.
# 1. Masking is separable Smith with the lobe's own alpha_x and alpha_y, as in Burley's addendum
#    of 2014: compared with the option burley2014.
# 2. The dielectric's Fresnel term is exact, of the index whose F0 is 0.08 specular. Only with
#    spec_tint = 1 it is Schlick's, as Burley's always is; with 0, up to a fifth lies between.
# 3. The clear coat lacks the denominator 4 cos_theta_i cos_theta_o.
# 4. specular = 0 switches the lobe off (index 1), where Schlick's term still rises to 1.
# "subsurface" is called flatness there; the luminance in the tint is that of linear sRGB.

LUMINANCE = (0.212671, 0.715160, 0.072169)
RENAMED = {"flatness": "subsurface", "spec_tint": "specular_tint"}
OURS_ONLY = {"subsurface": 0.0, "specular_tint": 0.0, "clearcoat": 0.0}


def principled(name: str, precision: Precision = "double", **changed: float) -> Array:
    """Evaluate our model with the parameters of one of Mitsuba's materials."""
    given = {RENAMED.get(k, k): v for k, v in PRINCIPLED.materials[name].items() if k != "type"}
    base = np.array(given.pop("base_color")["value"])
    params = {
        **OURS_ONLY,
        **given,
        **changed,
        "base_color": base,
        "tint": base / (base @ LUMINANCE),
    }
    options = {"masking": "burley2014"}
    return PRINCIPLED.evaluate("disney_principled", params, options=options, precision=precision)


@PRECISIONS
@pytest.mark.parametrize("name", ["metal", "metal anisotropic", "tinted", "flat", "sheen", "mixed"])
def test_mitsuba_principled_where_it_is_burleys(name: str, precision: Precision) -> None:
    assert_agree(principled(name, precision), PRINCIPLED.values[name], RELATIVE[precision])


@pytest.mark.parametrize(
    # The coat of gloss 1 has alpha = 0.001: 1 - n.h^2 has lost most of its digits in Mitsuba.
    ("name", "tolerance"),
    [("mixed coated", 5e-5), ("metal coated", 5e-3)],
)
def test_mitsuba_clear_coat_but_for_its_denominator(name: str, tolerance: float) -> None:
    bare = principled(name, clearcoat=0.0)
    theta_i, _, theta_o, _ = PRINCIPLED.angles
    coat = (principled(name) - bare) * 4 * np.cos(theta_i) * np.cos(theta_o)
    assert_agree(bare + coat, PRINCIPLED.values[name], tolerance)


@PRECISIONS
@pytest.mark.parametrize("name", ["dielectric", "dielectric black", "dielectric matt"])
def test_mitsuba_principled_dielectric(name: str, precision: Precision) -> None:
    """Disney's diffuse term and a GGX lobe with the exact Fresnel term."""
    material = PRINCIPLED.materials[name]
    roughness, root = material["roughness"], np.sqrt(0.08 * material["specular"])
    diffuse = PRINCIPLED.evaluate(
        "disney_diffuse",
        {"k_d": material["base_color"]["value"], "roughness": roughness},
        precision=precision,
    )
    lobe = PRINCIPLED.evaluate(
        "ggx",
        {"k_d": 0.0, "k_s": 1.0, "alpha": roughness**2, "eta": (1 + root) / (1 - root)},
        options={**SEPARABLE, "fresnel": "dielectric"},
        precision=precision,
    )
    assert_agree(diffuse + lobe, PRINCIPLED.values[name], RELATIVE[precision])


def test_mitsuba_exact_fresnel_is_not_burleys() -> None:
    ratio = principled("dielectric") / PRINCIPLED.values["dielectric"]
    assert 0.15 < np.abs(ratio - 1).max() < 0.25


# --- SCATMECH: facets with slopes and exact Fresnel reflection, and power laws


def smith_1967(cot_over_alpha: Array) -> Array:
    """Chance that a point's own slope does not hide it, which is in Smith's S of 1967.

    S = (1 - erfc(a)/2) / (1 + Lambda), a = 1/(alpha tan(theta)), is an average over all
    facets; today's G1 is that of the facets which face the direction, 1 / (1 + Lambda).
    """
    return np.array([(1 + erf(a)) / 2 for a in cot_over_alpha])


GLASS = {"eta": 1.5, "k": 0.0}
COPPER_GREEN, ALUMINIUM_GREEN = {"eta": 1.072, "k": 2.591}, {"eta": 0.884, "k": 6.47}


@pytest.mark.parametrize(
    ("name", "shape", "index"),
    [
        ("ggx .3 copper", {"alpha": 0.3}, COPPER_GREEN),
        ("ggx .05 glass", {"alpha": 0.05}, GLASS),
        ("ggx .5/.1 aluminium", {"alpha_x": 0.5, "alpha_y": 0.1, "phi_x": 0.0}, ALUMINIUM_GREEN),
        ("beckmann .3 copper", {"alpha": 0.3}, COPPER_GREEN),
        ("beckmann .1 glass", {"alpha": 0.1}, GLASS),
    ],
)
def test_scatmech_facets_in_v_cavities(name: str, shape: Params, index: Params) -> None:
    model = name.split()[0] + ("_anisotropic" if "alpha_x" in shape else "")
    ours = SCATMECH.evaluate(
        model,
        {"k_d": 0.0, "k_s": 1.0, **shape, **index},
        options={"masking": "v_cavity", "fresnel": "conductor"},
    )
    np.testing.assert_allclose(ours[0], SCATMECH.values[name], rtol=SCATMECH_RELATIVE, atol=1e-200)


@pytest.mark.parametrize(
    ("name", "alpha", "index"),
    [
        ("beckmann .6 aluminium smith", 0.6, ALUMINIUM_GREEN),
        ("beckmann .2 copper smith", 0.2, COPPER_GREEN),
    ],
)
def test_scatmech_facets_with_smith_masking(name: str, alpha: float, index: Params) -> None:
    ours = SCATMECH.evaluate(
        "beckmann",
        {"k_d": 0.0, "k_s": 1.0, "alpha": alpha, **index},
        options={**SEPARABLE, "fresnel": "conductor"},
    )
    theta_i, _, theta_o, _ = SCATMECH.angles
    for theta in (theta_i, theta_o):
        ours = ours * smith_1967(1 / (alpha * np.tan(theta)))
    np.testing.assert_allclose(ours[0], SCATMECH.values[name], rtol=SCATMECH_RELATIVE, atol=1e-200)


@pytest.mark.parametrize(
    ("name", "model", "params", "tolerance"),
    [
        ("abc l=.01 s=-1.5", "harvey_shack", {"b": 1.0, "l": 0.01, "s": -1.5}, SCATMECH_RELATIVE),
        ("abc l=.1 s=-2.5", "harvey_shack", {"b": 1.0, "l": 0.1, "s": -2.5}, SCATMECH_RELATIVE),
        # A fractal spectrum has no knee; B at its bound is 1e-8 of the smallest x^g here.
        ("fractal g=1.7", "abg", {"A": 1.0, "B": 1e-12, "g": 1.7}, 2e-8),
    ],
)
def test_scatmech_power_spectra(name: str, model: str, params: Params, tolerance: float) -> None:
    ours = SCATMECH.evaluate(model, {"k_d": 0.0, **params})
    np.testing.assert_allclose(ours[0], SCATMECH.values[name], rtol=tolerance, atol=0)


def test_every_case_is_compared() -> None:
    """Each case of the files is named in this file, so none lies unused."""
    text = Path(__file__).read_text(encoding="utf-8")
    for table in (MICROFACET, PRINCIPLED, SCATMECH):
        assert all(value.shape[-1] == 60 for value in table.values.values())
        assert all(f'"{name}"' in text for name in table.values)
