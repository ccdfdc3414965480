"""Refractive indices of metals: the table, and what the exact Fresnel equations make of it."""

from __future__ import annotations

import numpy as np
import pytest

from lobefit.kernels import ModelError, get_model
from lobefit.kernels.metals import conductor, metals
from tests.kernels.references.make_metals import (
    GRAZING,
    VISIBLE,
    Array,
    reflectance,
    rgb_constants,
    srgb,
)

PRIMARIES = (630.0, 532.0, 465.0)  # nm
# Reflectance at normal incidence in linear sRGB under D65, from the spectra of pbrt-v4.
F0 = {
    "aluminium": (0.9134, 0.9216, 0.9239),
    "copper": (0.9555, 0.6377, 0.5379),
    "gold": (1.022, 0.783, 0.343),
    "silver": (0.972, 0.960, 0.915),
}


def spectrum(name: str) -> tuple[Array, Array]:
    index = conductor(name, VISIBLE)
    return np.array(index["eta"]), np.array(index["k"])


def test_the_names() -> None:
    assert metals() == ("aluminium", "copper", "gold", "silver")


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("copper", [(0.246, 3.378), (1.072, 2.591), (1.157, 2.457)]),
        ("aluminium", [(1.357, 7.588), (0.884, 6.470), (0.661, 5.654)]),
    ],
)
def test_index_at_wavelengths(name: str, expected: list[tuple[float, float]]) -> None:
    index = conductor(name, PRIMARIES)
    found = np.column_stack([index["eta"], index["k"]])
    np.testing.assert_allclose(found, expected, rtol=0, atol=6e-4)  # three decimals, rounded


@pytest.mark.parametrize("name", metals())
def test_rgb_reflectance_at_normal_incidence(name: str) -> None:
    index = conductor(name)
    largest = reflectance(1.0, *spectrum(name)).max()
    found = reflectance(1.0, index["eta"], index["k"])
    # The published values are rounded, and come from colour matching functions in other steps.
    np.testing.assert_allclose(found, np.minimum(F0[name], largest), rtol=0, atol=1e-3)


@pytest.mark.parametrize("name", metals())
def test_rgb_is_what_the_spectrum_integrates_to(name: str) -> None:
    pytest.importorskip("colour", reason="colour-science has the CIE colour matching functions")
    eta, k = spectrum(name)
    np.testing.assert_allclose(srgb(reflectance(1.0, eta, k)), F0[name], rtol=0, atol=1e-3)
    index = conductor(name)
    reachable = srgb(reflectance(1.0, eta, k)) < 1  # all but the red of gold
    for cos in np.cos(np.radians(np.arange(90))):
        found = reflectance(cos, index["eta"], index["k"])
        assert np.all(np.abs(found - srgb(reflectance(cos, eta, k)))[reachable] < 0.006)
    grazing = srgb(reflectance(GRAZING, eta, k))
    found = reflectance(GRAZING, index["eta"], index["k"])
    np.testing.assert_allclose(found, grazing, rtol=0, atol=1e-4)  # indices have four decimals


@pytest.mark.parametrize("name", metals())
def test_rgb_is_what_the_script_prints(name: str) -> None:
    pytest.importorskip("colour", reason="colour-science has the CIE colour matching functions")
    pytest.importorskip("scipy")
    eta, k, _, _ = rgb_constants(*spectrum(name))
    index = conductor(name)
    np.testing.assert_allclose(index["eta"], eta, rtol=0, atol=1e-4)
    np.testing.assert_allclose(index["k"], k, rtol=0, atol=1e-4)


@pytest.mark.parametrize("name", metals())
def test_the_models_accept_the_values(name: str) -> None:
    bounds = {p.name: p.bounds for p in get_model("ggx", {"fresnel": "conductor"}).parameters}
    for index in (conductor(name), conductor(name, [375.8, 799.8])):
        for key, values in index.items():
            assert all(bounds[key][0] <= value <= bounds[key][1] for value in values)


def test_one_wavelength_and_interpolation() -> None:
    table = conductor("gold", [551.040771, 563.564453])
    middle = conductor("gold", (551.040771 + 563.564453) / 2)
    assert table["eta"] == [0.3455, 0.306]
    np.testing.assert_allclose(middle["k"], [np.mean(table["k"])], rtol=0, atol=1e-6)


@pytest.mark.parametrize(
    ("name", "hint"), [("aluminum", "did you mean 'aluminium'"), ("Copper", "'copper'"), ("", "Kn")]
)
def test_an_unknown_metal(name: str, hint: str) -> None:
    with pytest.raises(ModelError, match=hint):
        conductor(name)


@pytest.mark.parametrize("wavelengths", [[550.0, 300.0], [900.0], [np.nan], [], [[550.0]], "red"])
def test_wavelengths_that_are_not_in_the_table(wavelengths: object) -> None:
    with pytest.raises(ModelError, match=r"nm"):
        conductor("silver", wavelengths)  # type: ignore[arg-type]
