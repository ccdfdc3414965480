"""Fits that others published for real data, least squares of log10, to the digits they give."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest
from scipy.optimize import least_squares

from lobefit.fitting import FitResult, Measurement, fit, read_measurement
from tests.fitting.shared_data import DATA, needs_data
from tests.kernels.transcriptions import geometry, load

Array = npt.NDArray[np.float64]


pytestmark = needs_data

ALUMINIUM = {"A": 3.362e-3, "B": 4.309e-6, "g": 2.068}
VEGETATION = {"k_d": 0.53, "k_s": 0.28, "n": 7.31}
# Just above the horizon, where a BRDF is 0: neither r.o nor a constant changes by 2e-6.
NEARLY_90 = np.radians(89.9999)


def rounded(result: FitResult, published: dict[str, float]) -> dict[str, float]:
    """Give the parameters to as many digits as were published."""
    found = {}
    for name, value in published.items():
        digits = len(f"{value:g}".split("e")[0].replace(".", "").lstrip("0"))
        found[name] = float(f"{float(np.ravel(result.params[name])[0]):.{digits}g}")
    return found


def raw(name: str) -> Measurement:
    """Give the rows as they stand, where the reader averages repeated directions."""
    lines = (DATA / name).read_text().splitlines()
    rows = [line.split(",") for line in lines if line[0].isdigit()]
    *degrees, values = np.array(rows, dtype=np.float64).T
    theta_i, phi_i, theta_o, phi_o = np.radians(degrees)
    values = values[np.newaxis]
    return Measurement(theta_i, phi_i, np.minimum(theta_o, NEARLY_90), phi_o, values, ("brdf",))


def test_abg_of_polished_aluminium() -> None:
    """A/(B + x^g) on all rows, x = |sin(theta_o) - sin(theta_i)| and no diffuse term."""
    m = read_measurement(DATA / "merl_aluminium_slice.csv")
    assert m.values.size == 1785
    result = fit(m, "abg:k_d=0", metric="log").best
    assert result.params["k_d"] == 0.0
    assert rounded(result, ALUMINIUM) == ALUMINIUM
    assert result.diagnostics.log10_rms == pytest.approx(0.14683, abs=1e-5)


def test_a_diffuse_term_changes_the_scatter_parameters() -> None:
    """It lowers the residuals a little and g rises: what is quoted has none."""
    m = read_measurement(DATA / "merl_aluminium_slice.csv")
    pure, free = (fit(m, name, metric="log").best for name in ("abg:k_d=0", "abg"))
    assert pure.n_parameters == free.n_parameters - 1
    assert free.objective < pure.objective
    assert free.params["g"] == pytest.approx(2.132, abs=1e-3)


def test_phong_of_vegetation() -> None:
    """All 14,500 rows, 66 of them at a zenith angle of 90 degrees, repeated ones as they are."""
    m = raw("vegetation_cars_479nm.csv")
    assert m.values.size == 14500
    assert np.sum(m.theta_o == NEARLY_90) == 66
    result = fit(m, "modified_phong", metric="log").best
    assert rounded(result, VEGETATION) == VEGETATION


def by_scipy(m: Measurement) -> tuple[Array, float]:
    """Minimise the rms of log10 with the formula in numpy; returns (k_d, k_s, n) and the rms."""
    angles = (m.theta_i, m.phi_i, m.theta_o, m.phi_o)
    assert geometry(*angles).lit.all()
    brdf, measured = load("modified_phong"), np.log10(m.values[0])

    def residuals(x: Array) -> Array:
        k_d, k_s, n = (float(value) for value in np.exp(x))
        return np.asarray(
            np.log10(brdf(*angles, k_d=k_d, k_s=k_s, n=n)[0]) - measured, dtype=np.float64
        )

    best = least_squares(residuals, np.log([0.3, 0.3, 10.0]), xtol=1e-12, ftol=1e-12, gtol=1e-12)
    return np.exp(best.x), float(np.sqrt(2.0 * best.cost / measured.size))


@pytest.mark.parametrize("rows", ["raw", "averaged"])
def test_phong_of_vegetation_as_scipy(rows: str) -> None:
    """The reader averages 178 repeated rows into 74 and leaves those at 90 degrees out.

    That moves the optimum to n = 7.378; n = 7.331 if only the rows at 90 degrees are missing.
    """
    name = "vegetation_cars_479nm.csv"
    m = raw(name) if rows == "raw" else read_measurement(DATA / name)
    assert m.values.size == (14500 if rows == "raw" else 14330)
    expected, rms = by_scipy(m)
    result = fit(m, "modified_phong", metric="log").best
    found = [float(np.ravel(result.params[key])[0]) for key in VEGETATION]
    np.testing.assert_allclose(found, expected, rtol=1e-4)
    assert result.diagnostics.log10_rms == pytest.approx(rms, rel=1e-6)
    assert found[2] == pytest.approx({"raw": 7.314, "averaged": 7.378}[rows], abs=1e-3)
