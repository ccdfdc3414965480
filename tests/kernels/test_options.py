"""Maskings and Fresnel terms that lobes are compiled with, and the distributions they sit on."""

from __future__ import annotations

import math
from functools import partial

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lobefit.kernels import ModelError, directional_albedo, evaluate, get_model, models
from tests.kernels.strategies import (
    Params,
    awkward_directions,
    directions,
    legal_params,
)
from tests.kernels.transcriptions import Array, load

Options = dict[str, str]

ORDINARY = directions(1024, seed=11)
AWKWARD = awkward_directions()

# Few examples: every combination pays for compiling two kernels.
examples = settings(max_examples=8, deadline=None, derandomize=True, database=None)


def combinations() -> list[tuple[str, Options]]:
    """Give every choice of every option at least once, those of the other options cycled."""
    return [
        (name, {key: choices[k % len(choices)] for key, choices in model.allowed.items()})
        for name, model in models().items()
        if model.allowed
        for k in range(max(len(choices) for choices in model.allowed.values()))
    ]


every_combination = pytest.mark.parametrize(
    ("name", "options"),
    [pytest.param(n, o, id="-".join((n, *o.values()))) for n, o in combinations()],
)


def elongation(name: str, params: Params) -> float:
    """Ratio of the axes of an anisotropic lobe, else 1."""
    axes = models()[name].lobe.axes
    wide, narrow = (params[axes[0]], params[axes[1]]) if axes else (1.0, 1.0)
    assert isinstance(wide, float)
    assert isinstance(narrow, float)
    return wide / narrow


def without_fresnel(name: str, options: Options, params: Params) -> Array:
    """Give the size that rounding of the Fresnel term is relative to: f with F = 1.

    A dark term is a difference of two that are not, so it has no digits of its own: f82
    crosses zero, and that of a dielectric is the square of eta - 1.
    """
    if "none" not in get_model(name).allowed.get("fresnel", ()):
        return np.zeros(1)
    own = {p.name for p in get_model(name, options | {"fresnel": "none"}).parameters}
    kept = {key: value for key, value in params.items() if key in own}
    return load(name)(*ORDINARY, **kept, **(options | {"fresnel": "none"}))


@every_combination
@given(data=st.data())
@examples
def test_double_agrees_with_transcription(name: str, options: Options, data: st.DataObject) -> None:
    params = data.draw(legal_params(get_model(name, options)))
    expected = load(name)(*ORDINARY.exact(), **params, **options)
    f = evaluate(name, params, *ORDINARY, options=options)
    # 2e-10 and 1e-12 as for the default options.
    allowed = 2e-10 * expected + 1e-12 + 1e-13 * without_fresnel(name, options, params)
    assert np.all(np.abs(f - expected) <= allowed)


@every_combination
@given(data=st.data())
@examples
def test_single_agrees_with_double(name: str, options: Options, data: st.DataObject) -> None:
    params = data.draw(legal_params(get_model(name, options)))
    double = evaluate(name, params, *ORDINARY, options=options)
    single = evaluate(name, params, *ORDINARY, precision="single", options=options)
    # 6e-8 of parameters and slopes, in an exponent of 80 and seen by the narrow axis, as for
    # the default options; 6e-8 of cos_theta_d and of the indices in the Fresnel term.
    relative = 2e-5 + 6e-6 * elongation(name, params)
    allowed = relative * double + 1e-30 + 1e-6 * without_fresnel(name, options, params)
    assert np.all(np.abs(single - double) <= allowed)


@every_combination
@given(data=st.data())
@examples
def test_it_is_a_brdf(name: str, options: Options, data: st.DataObject) -> None:
    """Finite and not negative even at grazing, and reciprocal where the record says so."""
    params = data.draw(legal_params(get_model(name, options)))
    f = evaluate(name, params, *AWKWARD, options=options)
    single = evaluate(name, params, *AWKWARD, precision="single", options=options)
    for values in (f, single):
        assert np.all(np.isfinite(values))
        assert np.all(values >= 0)
    if models()[name].reciprocal:
        swapped = evaluate(name, params, *AWKWARD.swapped(), options=options)
        np.testing.assert_allclose(swapped, f, rtol=1e-13, atol=1e-200)


@pytest.mark.parametrize(
    ("name", "options", "said"),
    [
        ("ggx", {"polish": "high"}, "ggx has no option 'polish'; its options: masking, fresnel"),
        ("lambert", {"fresnel": "none"}, "lambert has no option 'fresnel'; its options: none"),
        (
            "ggx",
            {"masking": "smith"},
            "ggx has no masking 'smith'; it can be smith_correlated, smith_separable, v_cavity",
        ),
        (
            "beckmann",
            {"fresnel": "metal"},
            "beckmann has no fresnel 'metal'; it can be schlick, none, dielectric, conductor, f82",
        ),
        *(
            (
                name,
                {"masking": "smith_correlated"},
                f"{name} has no masking 'smith_correlated'; it can be v_cavity",
            )
            for name in ("blinn", "gtr", "torrance_sparrow")
        ),
    ],
)
def test_wrong_choices_are_told(name: str, options: Options, said: str) -> None:
    with pytest.raises(ModelError) as caught:
        evaluate(name, {}, 0.1, 0.0, 0.2, 0.0, options=options)
    assert str(caught.value) == said


def test_a_choice_brings_its_parameters() -> None:
    def names(fresnel: str) -> list[str]:
        return [p.name for p in get_model("ggx", {"fresnel": fresnel}).parameters]

    assert names("schlick") == ["k_d", "k_s", "F0", "alpha"]
    assert names("none") == ["k_d", "k_s", "alpha"]
    assert names("dielectric") == ["k_d", "k_s", "eta", "alpha"]
    assert names("conductor") == ["k_d", "k_s", "eta", "k", "alpha"]
    assert names("f82") == ["k_d", "k_s", "F0", "F82", "alpha"]


# Distributions


DISTRIBUTIONS: list[tuple[str, float, dict[str, float]]] = [
    *(
        (name, alpha, {"alpha": alpha})
        for name in ("ggx", "beckmann", "cook_torrance", "torrance_sparrow")
        for alpha in (1e-3, 0.1, 0.5, 1.0, 2.0)
    ),
    *(
        (name, narrow, {"alpha_x": wide, "alpha_y": narrow, "phi_x": 0.3})
        for name in ("ggx_anisotropic", "beckmann_anisotropic")
        for wide, narrow in ((0.5, 0.2), (1.5, 1.0))
    ),
    *(("blinn", n**-0.5, {"n": n}) for n in (1.0, 20.0, 1e4, 1e6)),
    *(
        ("gtr", alpha, {"alpha": alpha, "gamma": gamma})
        for alpha in (1e-3, 0.1, 0.7, 1.0 - 1e-9, 1.0)
        for gamma in (1.0, 1.0 + 1e-9, 1.5, 2.0, 10.0, 30.0)
    ),
    *(
        ("student_t", alpha, {"alpha": alpha, "gamma": gamma})
        for alpha in (1e-3, 0.1, 0.5, 2.0)
        for gamma in (1.8, 2.0, 3.0, 10.0, 40.0)
    ),
]


def test_every_microfacet_model_is_among_the_distributions() -> None:
    assert {name for name, *_ in DISTRIBUTIONS} == {
        name for name, m in models().items() if "none" in m.allowed.get("fresnel", ())
    }


@pytest.mark.parametrize(
    ("name", "width", "params"),
    [
        pytest.param(*row, id=f"{row[0]}-{'-'.join(map(str, row[2].values()))}")
        for row in DISTRIBUTIONS
    ],
)
def test_distributions_are_normalised(name: str, width: float, params: dict[str, float]) -> None:
    """The integral of D cos_theta_h is 1; D is what a mirrored facet sends straight back."""
    options = {"fresnel": "none"}
    if "masking" in models()[name].allowed:
        options["masking"] = "v_cavity"
    x, w = np.polynomial.legendre.leggauss(20)
    # Geometric panels from a hundredth of the width, and again towards the horizon, which a
    # long tail reaches with a power of the cosine.
    below = np.geomspace(width / 100, 0.7, math.ceil(math.log2(70 / width)) + 1)
    edges = np.concatenate([[0.0], below, math.pi / 2 - np.geomspace(0.7, 2e-7, 25)])
    half = np.diff(edges)[:, None] / 2
    theta = (edges[:-1, None] + half * (x + 1)).ravel()
    weight = (half * w).ravel()
    phi = np.arange(64) * (math.pi / 64) if models()[name].axes else np.zeros(1)
    theta, azimuth = np.repeat(theta, phi.size), np.tile(phi, theta.size)
    weight = np.repeat(weight, phi.size) * (2 * math.pi / phi.size)
    f = evaluate(
        name, params | {"k_d": 0.0, "k_s": 1.0}, theta, azimuth, theta, azimuth, options=options
    )[0]
    # Towards light and eye at once the V-cavity's G is min(1, 2 cos^2).
    D = f * 4 * np.cos(theta) ** 2 / np.minimum(1, 2 * np.cos(theta) ** 2)
    assert float(np.sum(weight * D * np.cos(theta) * np.sin(theta))) == pytest.approx(1, abs=1e-8)


@pytest.mark.parametrize("alpha", [1e-3, 0.1, 0.5, 1.0])
@pytest.mark.parametrize(
    ("name", "maskings"),
    [("student_t", ("smith_correlated", "smith_separable", "v_cavity")), ("gtr", ("v_cavity",))],
)
def test_gamma_2_is_ggx(name: str, maskings: tuple[str, ...], alpha: float) -> None:
    for masking in maskings:
        options = {"masking": masking}
        params: Params = {"k_d": 0.0, "k_s": 1.0, "F0": 0.2, "alpha": alpha}
        expected = evaluate("ggx", params, *ORDINARY, options=options)
        f = evaluate(name, params | {"gamma": 2.0}, *ORDINARY, options=options)
        np.testing.assert_allclose(f, expected, rtol=1e-13)


@pytest.mark.parametrize("name", ["blinn", "torrance_sparrow", "gtr", "student_t"])
def test_narrow_and_steep_lobes_are_beckmanns(name: str) -> None:
    """All four tend to the same Gaussian, which fixes what each calls its width."""
    alpha = 2e-3
    own: dict[str, Params] = {
        "blinn": {"n": 2 / alpha**2},
        "torrance_sparrow": {"alpha": alpha},
        "gtr": {"alpha": alpha * 29**0.5, "gamma": 30.0},
        "student_t": {"alpha": alpha, "gamma": 40.0},
    }
    at = partial(evaluate, theta_i=0.5, phi_i=0.0, theta_o=0.5 + alpha, phi_o=math.pi)
    shared: Params = {"k_d": 0.0, "k_s": 1.0, "F0": 1.0}
    expected = at("cook_torrance", shared | {"alpha": alpha}).item()
    # The exponent is 1/4 here, and 1/gamma of it is lacking.
    assert at(name, shared | own[name]).item() == pytest.approx(expected, rel=0.01)


# Directional albedo

# Half a unit of the last digit given, and what the kinks of V-cavities leave of the quadrature.
FIVE_DIGITS = 0.5e-5 + 0.5e-5
ANGLES = [0.0, 30.0, 60.0, 75.0, 85.0]
ALBEDO = {
    ("ggx", "v_cavity", 0.1): [0.98261, 0.98173, 0.97534, 0.95625, 0.94746],
    ("ggx", "v_cavity", 0.5): [0.69925, 0.71647, 0.81473, 0.89830, 0.96480],
    ("ggx", "v_cavity", 1.0): [0.37500, 0.42616, 0.65306, 0.82123, 0.93991],
    ("beckmann", "v_cavity", 0.5): [0.89242, 0.87504, 0.88688, 0.93437, 0.97720],
    ("beckmann", "smith_separable", 0.5): [0.94300, 0.90279, 0.86894, 0.90001, 0.93924],
    ("beckmann", "smith_correlated", 0.5): [0.94300, 0.90279, 0.86936, 0.90525, 0.96014],
}


@pytest.mark.parametrize(("name", "masking", "alpha"), ALBEDO)
def test_albedo(name: str, masking: str, alpha: float) -> None:
    options = {"masking": masking, "fresnel": "none"}
    params: Params = {"k_d": 0.0, "k_s": 1.0, "alpha": alpha}
    found = directional_albedo(name, params, np.radians(ANGLES), options=options)
    np.testing.assert_allclose(found[0], ALBEDO[name, masking, alpha], atol=FIVE_DIGITS)


@pytest.mark.parametrize(
    ("name", "params"),
    [
        *(("torrance_sparrow", {"alpha": alpha}) for alpha in (0.03, 0.3, 2.0)),
        *(("blinn", {"n": n}) for n in (1.0, 20.0, 1e4)),
        *(("gtr", {"alpha": a, "gamma": g}) for a in (0.03, 0.3, 1.0) for g in (1.0, 1.5, 10.0)),
        *(
            ("student_t", {"alpha": a, "gamma": g})
            for a in (0.03, 0.3, 2.0)
            for g in (1.51, 1.8, 40.0)
        ),
    ],
)
def test_energy_is_conserved(name: str, params: Params) -> None:
    """Of all light that facets without loss send back, each masking leaves 1 at most."""
    for masking in models()[name].allowed["masking"]:
        found = directional_albedo(
            name,
            params | {"k_d": 0.0, "k_s": 1.0},
            np.radians([*ANGLES, 89.0]),
            options={"masking": masking, "fresnel": "none"},
        )
        assert np.all(found > 0.0)
        assert np.all(found <= 1.0 + 1e-6)  # the quadrature's error
