"""Kernels against Mitsuba 3.9.1, which computed the reference in single precision.

Mitsuba's rough conductor has Smith's separable masking and the exact Fresnel equations. The
first is an option of `ggx`; the second no model has, so Mitsuba's value is divided by it.
Where the masking differs too, each side is divided by its own, written here or in the
transcriptions, which leaves D / (4 n.i n.o). The anisotropic Beckmann rows are held against
`ward`, whose exponential is the same one. No model has an anisotropic GGX distribution, so
those rows cannot be compared.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from lobefit.kernels import evaluate
from tests.kernels.transcriptions import Array, Geometry, geometry
from tests.kernels.transcriptions.cook_torrance import v_cavity
from tests.kernels.transcriptions.ggx import smith_lambda

REFERENCE = Path(__file__).parents[2].parent / "shared/reference/mitsuba_microfacet.json"
if not REFERENCE.is_file():
    pytest.skip(f"no {REFERENCE.name} beside the checkout", allow_module_level=True)

CASES = {case["name"]: case for case in json.loads(REFERENCE.read_text())["cases"]}
NOT_COMPARABLE = {"ggx anisotropic .1/.4, F=1"}

# Single precision gives the reference 6e-8 per operation. An error e of a component of the
# half vector becomes e / alpha or more of the value, and for Beckmann the exponent
# multiplies it again.
LAMBERT_RELATIVE = 2e-7
GGX_RELATIVE = 5e-6
BECKMANN_RELATIVE = 5e-5
# Mitsuba sets D n.h below 1e-20 to zero.
TINY = 1e-20

Angles = tuple[Array, Array, Array, Array]


def angles_and_values(case: dict[str, Any]) -> tuple[Angles, Array]:
    rows = np.array(case["rows"])
    theta_i, phi_i, theta_o, phi_o = np.radians(rows[:, :4]).T
    return (theta_i, phi_i, theta_o, phi_o), rows[:, 4:].T


def conductor_fresnel(cos: Array, eta: npt.ArrayLike, k: npt.ArrayLike) -> Array:
    """Exact reflectance [C, N] of a metal for unpolarised light, by complex Snell."""
    m = (np.asarray(eta) + 1j * np.asarray(k))[:, np.newaxis]
    transmitted = np.sqrt(1 - (1 - cos**2) / m**2)
    s = (cos - m * transmitted) / (cos + m * transmitted)
    p = (m * cos - transmitted) / (m * cos + transmitted)
    return np.asarray((np.abs(s) ** 2 + np.abs(p) ** 2) / 2)


def beckmann_g1(direction: Array, alpha_x: float, alpha_y: float) -> Array:
    """Smith's masking of one direction in the rational form of Walter and others, 2007."""
    x, y, z = direction
    projected = np.sqrt((alpha_x * x) ** 2 + (alpha_y * y) ** 2)
    a = np.minimum(z / np.maximum(projected, 1e-300), 1.6)  # from there on G1 is 1
    rational = (3.535 * a + 2.181 * a**2) / (1 + 2.276 * a + 2.577 * a**2)
    return np.where(a < 1.6, rational, 1)


def separable_ggx(g: Geometry, alpha: float) -> Array:
    return 1 / ((1 + smith_lambda(g.i, alpha)) * (1 + smith_lambda(g.o, alpha)))


def separable_beckmann(g: Geometry, alpha_x: float, alpha_y: float) -> Array:
    return beckmann_g1(g.i, alpha_x, alpha_y) * beckmann_g1(g.o, alpha_x, alpha_y)


def fresnel_of(case: dict[str, Any], g: Geometry) -> Array:
    params = case["params"]
    if "eta" not in params:
        return np.ones((3, g.lit.size))
    return conductor_fresnel(g.cos_d, params["eta"], params["k"])


def assert_agree(ours: Array, reference: Array, value: Array, tolerance: float) -> None:
    """Compare relatively where Mitsuba's value is above TINY, absolutely elsewhere."""
    ours = np.broadcast_to(ours, reference.shape)
    large = value > TINY
    assert np.count_nonzero(large) >= large.size // 4  # else the file, not the code, is wrong
    np.testing.assert_allclose(ours[large], reference[large], rtol=tolerance, atol=0)
    # D n.h < 1e-20 there, and 1 / (4 n.i n.o) is at most about 100 at the angles of the file.
    assert np.all(ours[~large] < 1e-18)


def cases(kind: str) -> list[str]:
    return [name for name in CASES if name.startswith(kind) and "anisotropic" not in name]


def test_every_case_is_compared_or_named() -> None:
    compared = {*cases("diffuse"), *cases("ggx"), *cases("beckmann")}
    assert set(CASES) - compared - NOT_COMPARABLE == {"beckmann anisotropic .1/.4, F=1"}
    assert all(len(case["rows"]) == 24 for case in CASES.values())


@pytest.mark.parametrize("name", cases("diffuse"))
def test_lambert(name: str) -> None:
    angles, value = angles_and_values(CASES[name])
    ours = evaluate("lambert", {"k_d": CASES[name]["params"]["albedo"]}, *angles)
    np.testing.assert_allclose(ours, value, rtol=LAMBERT_RELATIVE)


@pytest.mark.parametrize("name", cases("ggx"))
def test_ggx_with_the_same_masking(name: str) -> None:
    case = CASES[name]
    angles, value = angles_and_values(case)
    params = {"k_d": 0.0, "k_s": 1.0, "F0": 1.0, "alpha": case["params"]["alpha"]}
    ours = evaluate("ggx", params, *angles, options={"masking": "smith_separable"})
    reference = value / fresnel_of(case, geometry(*angles))
    assert_agree(ours, reference, value, GGX_RELATIVE)


@pytest.mark.parametrize("name", cases("ggx"))
def test_ggx_distribution(name: str) -> None:
    case = CASES[name]
    angles, value = angles_and_values(case)
    g, alpha = geometry(*angles), case["params"]["alpha"]
    ours = evaluate("ggx", {"k_d": 0.0, "k_s": 1.0, "F0": 1.0, "alpha": alpha}, *angles)
    correlated = 1 / (1 + smith_lambda(g.i, alpha) + smith_lambda(g.o, alpha))
    reference = value / fresnel_of(case, g) / separable_ggx(g, alpha)
    assert_agree(ours / correlated, reference, value, GGX_RELATIVE)


@pytest.mark.parametrize("name", cases("beckmann"))
def test_beckmann_distribution(name: str) -> None:
    case = CASES[name]
    angles, value = angles_and_values(case)
    g, alpha = geometry(*angles), case["params"]["alpha"]
    ours = evaluate("cook_torrance", {"k_d": 0.0, "k_s": 1.0, "F0": 1.0, "alpha": alpha}, *angles)
    reference = value / fresnel_of(case, g) / separable_beckmann(g, alpha, alpha)
    assert_agree(ours / v_cavity(g), reference, value, BECKMANN_RELATIVE)


def test_ward_exponent() -> None:
    """Ward's f times sqrt(ni no) is Beckmann's D nh^4 / 4; the wide axis is at 90 degrees."""
    case = CASES["beckmann anisotropic .1/.4, F=1"]
    angles, value = angles_and_values(case)
    g = geometry(*angles)
    along_x, along_y = case["params"]["alpha_x"], case["params"]["alpha_y"]
    axes = {"alpha_x": along_y, "alpha_y": along_x, "phi_x": np.pi / 2}
    ours = evaluate("ward", {"k_d": 0.0, "k_s": 1.0, **axes}, *angles)
    cos4_h = (1 + g.tan2_h) ** -2
    ours = ours / cos4_h / np.sqrt(g.i[2] * g.o[2])
    reference = value / separable_beckmann(g, along_x, along_y)
    assert_agree(ours, reference, value, BECKMANN_RELATIVE)
