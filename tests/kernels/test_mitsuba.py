"""Kernels against Mitsuba 3.9.1, which computed the reference in single precision.

Mitsuba's rough conductor has Smith's separable masking and the exact Fresnel equations, which
are options here, so that every row is compared as it is. Only Beckmann's G1 differs: Mitsuba
takes the rational approximation of Walter and others, 2007, which is put in its place.
"""

from __future__ import annotations

import json
from math import erf
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest

from lobefit.kernels import evaluate
from tests.kernels.transcriptions import Array, geometry

__all__ = ["walter_over_exact"]

Precision = Literal["single", "double"]
Angles = tuple[Array, ...]

REFERENCE = Path(__file__).parents[2].parent / "shared/reference/mitsuba_microfacet.json"
PRESENT = REFERENCE.is_file()
CASES: dict[str, dict[str, Any]] = (
    {case["name"]: case for case in json.loads(REFERENCE.read_text())["cases"]} if PRESENT else {}
)
pytestmark = pytest.mark.skipif(not PRESENT, reason=f"no {REFERENCE.name} beside the checkout")
PRECISIONS = pytest.mark.parametrize("precision", ["double", "single"])

# Single precision gives the reference 6e-8 per operation. An error e of a component of the
# half vector becomes e / alpha or more of the value, and for Beckmann the exponent
# multiplies it again.
LAMBERT_RELATIVE = 2e-7
GGX_RELATIVE: dict[Precision, float] = {"double": 5e-6, "single": 2e-5}
BECKMANN_RELATIVE = 5e-5
# Walter's G1 is off by up to 0.0031, and G has it once for each direction.
BECKMANN_EXACT_RELATIVE = 6.3e-3
# Mitsuba sets D n.h below 1e-20 to zero.
TINY = 1e-20


def angles_and_values(case: dict[str, Any]) -> tuple[Angles, Array]:
    rows = np.array(case["rows"])
    return tuple(np.radians(rows[:, :4]).T), rows[:, 4:].T


def g1_ratio(direction: Array, alpha_x: float, alpha_y: float) -> Array:
    """Walter's rational G1 over the exact one, 1 / (1 + Lambda), of unit directions [3, N]."""
    x, y, z = direction
    projected = np.sqrt((alpha_x * x) ** 2 + (alpha_y * y) ** 2)
    a = np.minimum(z / np.maximum(projected, 1e-300), 100.0)  # both are 1 long before
    below = np.minimum(a, 1.6)  # from there on Walter's G1 is 1
    rational = (3.535 * below + 2.181 * below**2) / (1 + 2.276 * below + 2.577 * below**2)
    erf_a = np.array([erf(value) for value in a])
    smith_lambda = (erf_a - 1) / 2 + np.exp(-(a**2)) / (2 * a * np.sqrt(np.pi))
    return np.asarray(np.where(a < 1.6, rational, 1) * (1 + smith_lambda))


def walter_over_exact(angles: Angles, alpha_x: float, alpha_y: float) -> Array:
    """Give Walter's separable G over the exact one, [N], for Beckmann's distribution."""
    g = geometry(*angles)
    return g1_ratio(g.i, alpha_x, alpha_y) * g1_ratio(g.o, alpha_x, alpha_y)


def alphas(case: dict[str, Any]) -> tuple[float, float]:
    p = case["params"]
    return (p["alpha"], p["alpha"]) if "alpha" in p else (p["alpha_x"], p["alpha_y"])


def ours(case: dict[str, Any], precision: Precision, *, turned: bool = False) -> Array:
    """Evaluate the model of a case; `turned` has its axes named the other way round."""
    angles, _ = angles_and_values(case)
    given = case["params"]
    params = {k: given[k] for k in ("alpha", "alpha_x", "alpha_y", "eta", "k") if k in given}
    model = case["model"]
    if "alpha" not in given:
        model += "_anisotropic"
        params["phi_x"] = np.pi / 2 if turned else 0.0
        if turned:
            params["alpha_x"], params["alpha_y"] = params["alpha_y"], params["alpha_x"]
    options = {
        "masking": "smith_separable",
        "fresnel": "conductor" if "eta" in given else "none",
    }
    every = {"k_d": 0.0, "k_s": 1.0, **params}
    return evaluate(model, every, *angles, options=options, precision=precision)


def assert_agree(found: Array, value: Array, tolerance: float) -> None:
    """Compare relatively where Mitsuba's value is above TINY, absolutely elsewhere."""
    found = np.broadcast_to(found, value.shape)
    large = value > TINY
    assert np.count_nonzero(large) >= large.size // 4  # else the file, not the code, is wrong
    np.testing.assert_allclose(found[large], value[large], rtol=tolerance, atol=0)
    # D n.h < 1e-20 there, and 1 / (4 n.i n.o) is at most about 100 at the angles of the file.
    assert np.all(found[~large] < 1e-18)


def cases(model: str) -> list[str]:
    return [name for name, case in CASES.items() if case["model"] == model]


def test_every_case_is_compared() -> None:
    assert set(CASES) == {*cases("lambert"), *cases("ggx"), *cases("beckmann")}
    assert all(len(case["rows"]) == 24 for case in CASES.values())
    assert [name for name in CASES if "anisotropic" in name] == [
        "ggx anisotropic .1/.4, F=1",
        "beckmann anisotropic .1/.4, F=1",
    ]


@pytest.mark.parametrize("name", cases("lambert"))
def test_lambert(name: str) -> None:
    angles, value = angles_and_values(CASES[name])
    found = evaluate("lambert", {"k_d": CASES[name]["params"]["albedo"]}, *angles)
    np.testing.assert_allclose(found, value, rtol=LAMBERT_RELATIVE)


@PRECISIONS
@pytest.mark.parametrize("name", cases("ggx"))
def test_ggx(name: str, precision: Precision) -> None:
    _, value = angles_and_values(CASES[name])
    assert_agree(ours(CASES[name], precision), value, GGX_RELATIVE[precision])


@PRECISIONS
@pytest.mark.parametrize("name", cases("beckmann"))
def test_beckmann(name: str, precision: Precision) -> None:
    case = CASES[name]
    angles, value = angles_and_values(case)
    found = ours(case, precision)
    assert_agree(found * walter_over_exact(angles, *alphas(case)), value, BECKMANN_RELATIVE)
    assert_agree(found, value, BECKMANN_EXACT_RELATIVE)


@pytest.mark.parametrize("name", [name for name in CASES if "anisotropic" in name])
def test_axes_named_the_other_way_round(name: str) -> None:
    case = CASES[name]
    np.testing.assert_allclose(
        ours(case, "double", turned=True), ours(case, "double"), rtol=1e-12, atol=1e-200
    )
