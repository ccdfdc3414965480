"""Many surfaces at once: the same answers as one at a time, whatever stands beside a texel."""

from __future__ import annotations

import pickle
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from lobefit.fitting import Measurement, fit, texel_solve
from lobefit.fitting.measurement import DIRECTION_COLUMNS
from lobefit.fitting.texel_files import load_texels, save_chunks
from lobefit.fitting.texel_model import refusal
from lobefit.fitting.texel_result import Reason, Status, TexelFit
from lobefit.fitting.texel_source import open_texels
from lobefit.fitting.texels import eligible, fit_texel_chunks, fit_texels
from lobefit.kernels import (
    Device,
    FitError,
    LobefitError,
    MeasurementError,
    ModelError,
    candidate,
    evaluate,
)
from tests.fitting.texel_cases import directions, surfaces

Array = NDArray[Any]

MODEL = "ggx:k_s=1"
RGB = ("R", "G", "B")
TEXELS = 203
NOISE = 0.01


@pytest.fixture(scope="module")
def angles() -> Array:
    return directions(64)


@pytest.fixture(scope="module")
def measured(angles: Array) -> tuple[Array, dict[str, Array]]:
    clean, truth = surfaces(MODEL, angles, TEXELS, 3, seed=5)
    noise = np.random.default_rng(6).standard_normal(clean.shape)
    return (clean * (1 + NOISE * noise)).astype(np.float32), truth


@pytest.fixture(scope="module")
def fitted(angles: Array, measured: tuple[Array, Any]) -> TexelFit:
    return fit_texels(angles, measured[0], [MODEL])


def arrays(result: TexelFit) -> Iterator[tuple[str, Array]]:
    for name in ("model", "rmse", "scatter", "bic", "status", "reason"):
        yield name, getattr(result, name)
    for kind in ("params", "errors"):
        for name, rows in getattr(result, kind).items():
            yield f"{kind} {name}", rows


def assert_same_bytes(a: TexelFit, b: TexelFit, rows: Any = slice(None)) -> None:
    for (name, left), (_, right) in zip(arrays(a), arrays(b), strict=True):
        assert left[rows].tobytes() == right.tobytes(), name


def test_parameters_are_recovered_within_their_errors(
    fitted: TexelFit, measured: tuple[Array, Any]
) -> None:
    assert fitted.counts["converged"] == TEXELS
    assert fitted.counts["failed"] == fitted.counts["unconverged"] == 0
    for name, true in measured[1].items():
        z = (fitted.params[name] - true) / fitted.errors[name]
        assert np.isfinite(z).all(), name
        assert np.abs(z).max() < 5.0, name
        assert z.std() == pytest.approx(1.0, abs=4 / np.sqrt(2 * TEXELS)), name
        assert abs(z.mean()) < 4 / np.sqrt(TEXELS), name
    assert np.median(fitted.scatter) == pytest.approx(NOISE, rel=0.03)


def test_the_answer_is_that_of_fit(angles: Array, measured: tuple[Array, Any]) -> None:
    values = measured[0][:4]
    many = fit_texels(angles, values, [MODEL], noise="constant")
    placed = dict(zip(DIRECTION_COLUMNS, angles, strict=True))
    for k, texel in enumerate(values):
        sigma = np.full(texel.T.shape, float(many.scatter[k]))
        one = fit(
            Measurement(**placed, values=texel.T.astype(float), channels=RGB, sigma=sigma), [MODEL]
        ).best
        for e in one.estimates:
            if e.standard_error is None or e.status == "fixed":
                continue
            column = () if e.channel is None else (RGB.index(e.channel),)
            found = many.params[e.name][(k, *column)]
            assert found == pytest.approx(e.value, abs=0.01 * e.standard_error), e.name
            error = many.errors[e.name][(k, *column)]
            assert error == pytest.approx(e.standard_error, rel=0.05), e.name
        assert many.rmse[k] == pytest.approx(one.rmse, rel=1e-4)


@pytest.mark.parametrize("chunk", [1, 7, 64])
def test_chunks_do_not_change_a_byte(
    chunk: int, angles: Array, measured: tuple[Array, Any], fitted: TexelFit
) -> None:
    few = slice(0, 5) if chunk == 1 else slice(None)
    again = fit_texels(angles, measured[0][few], [MODEL], chunk=chunk)
    assert_same_bytes(fitted, again, few)


def test_poison_is_named_and_hurts_nobody(
    angles: Array, measured: tuple[Array, Any], fitted: TexelFit
) -> None:
    values = measured[0].copy()
    poison: dict[int, tuple[Any, Reason]] = {
        3: (np.nan, Reason.TOO_FEW),
        10: (np.inf, Reason.HUGE),
        11: (1e25, Reason.HUGE),
        40: (0.25, Reason.CONSTANT),
        41: (0.0, Reason.CONSTANT),
    }
    for k, (value, _) in poison.items():
        values[k] = value
    values[12, 5, 1] = -np.inf
    values[42] = -np.abs(values[42])
    expected = {k: reason for k, (_, reason) in poison.items()}
    expected |= {12: Reason.HUGE, 42: Reason.DARK}
    found = fit_texels(angles, values, [MODEL])
    assert dict(enumerate(found.reason)) == {k: expected.get(k, 0) for k in range(TEXELS)}
    assert (3, "too few") in found.failures
    assert (12, "huge") in found.failures
    bad = sorted(expected)
    assert found.has(Status.FAILED)[bad].all()
    assert (found.model[bad] == -1).all()
    assert all(np.isnan(rows[bad]).all() for rows in found.params.values())
    good = np.setdiff1d(np.arange(TEXELS), bad)
    for (name, rows), (_, before) in zip(arrays(found), arrays(fitted), strict=True):
        assert rows[good].tobytes() == before[good].tobytes(), name


def test_missing_readings_count_for_nothing(
    angles: Array, measured: tuple[Array, Any], fitted: TexelFit
) -> None:
    values = measured[0].copy()
    rng = np.random.default_rng(8)
    gaps = rng.random(values.shape) < 0.15
    gaps[50:] = False
    values[gaps] = np.nan
    found = fit_texels(angles, values, [MODEL])
    assert found.has(Status.GAPS)[:50].all()
    for (name, rows), (_, before) in zip(arrays(found), arrays(fitted), strict=True):
        assert rows[50:].tobytes() == before[50:].tobytes(), name
    for name, true in measured[1].items():
        z = (found.params[name] - true)[:50] / found.errors[name][:50]
        assert np.abs(z).max() < 5.0, name
    # A direction that is missing in all channels might as well not be there.
    cut = measured[0][:8].copy()
    cut[:, 60:] = np.nan
    with_gaps = fit_texels(angles, cut, [MODEL])
    without = fit_texels(angles[:, :60], measured[0][:8, :60], [MODEL])
    for name in without.params:
        size = np.abs(with_gaps.params[name] - without.params[name]) / without.errors[name]
        assert size.max() < 0.01, name


def test_physical_limits_hold(angles: Array) -> None:
    """Readings that would like F0 above 1 and k_d below 0."""
    clean, truth = surfaces(MODEL, angles, 32, 3, seed=9)
    noise = np.random.default_rng(10).standard_normal(clean.shape)
    values = 1.8 * clean - 1.9 * truth["k_d"][:, None, :] / np.pi + 0.01 * noise
    found = fit_texels(angles, values, [MODEL], noise="constant")
    k_d, F0 = found.params["k_d"], found.params["F0"]
    assert (k_d >= 0).all()
    assert (F0 >= 0).all()
    assert (candidate(MODEL).model.linear[1].bounds[1] >= F0).all()
    assert (k_d == 0).any()
    held = k_d == 0
    assert np.isnan(found.errors["k_d"][held]).all()
    assert found.has(Status.ON_BOUND)[held.any(axis=1)].all()


def test_the_simplest_sufficient_model_is_chosen(
    angles: Array, measured: tuple[Array, Any]
) -> None:
    rng = np.random.default_rng(11)
    flat = rng.uniform(0.1, 0.3, (64, 1, 3)) * (1 + NOISE * rng.standard_normal((64, 64, 3)))
    values = np.concatenate([flat.astype(np.float32), measured[0][:64]])
    found = fit_texels(angles, values, ["lambert", MODEL])
    assert found.models == ("lambert", MODEL)
    assert (found.model[64:] == 1).all()
    assert (found.model[:64] == 0).mean() > 0.9
    assert np.isnan(found.params["alpha"][found.model == 0]).all()
    assert found.texel(0)["model"] == "lambert"
    shown = found.texel(70)
    assert shown["params"]["k_s"] == 1.0
    f = evaluate("ggx", shown["params"], *angles)
    assert np.sqrt(np.mean((f.T - values[70]) ** 2)) == pytest.approx(shown["rmse"], rel=1e-3)


def test_maps_and_files_come_back(
    tmp_path: Path, angles: Array, measured: tuple[Array, Any], fitted: TexelFit
) -> None:
    import OpenEXR

    fitted.save_exr(tmp_path / "maps.exr", 7, 29)
    with OpenEXR.File(str(tmp_path / "maps.exr"), separate_channels=True) as file:
        planes = {name: channel.pixels for name, channel in file.channels().items()}
        header = dict(file.header())
    assert planes["alpha.Y"].tobytes() == fitted.params["alpha"].tobytes()
    assert planes["F0.G"].tobytes() == np.ascontiguousarray(fitted.params["F0"][:, 1]).tobytes()
    assert planes["error.k_d.B"].shape == (7, 29)
    assert (planes["model.Y"] == 0).all()
    assert header["lobefit:models"] == f'["{MODEL}"]'
    with pytest.raises(LobefitError, match="no picture"):
        fitted.save_exr(tmp_path / "no.exr", 10, 10)

    fitted.save_npz(tmp_path / "a.npz")
    fitted.save_npz(tmp_path / "b.npz")
    assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "b.npz").read_bytes()
    assert_same_bytes(load_texels(tmp_path / "a.npz"), fitted)
    chunks = fit_texel_chunks(angles, measured[0], [MODEL], chunk=100)
    folder = save_chunks(chunks, TEXELS, tmp_path / "folder")
    assert_same_bytes(load_texels(folder), fitted)
    with pytest.raises(LobefitError, match="not complete"):
        save_chunks([(0, fitted)], TEXELS + 1, tmp_path / "half")
    with pytest.raises(MeasurementError, match="no fits of texels"):
        load_texels(tmp_path / "half")


@pytest.mark.parametrize("kind", ["npy", "npz", "compressed", "zarr"])
def test_readings_come_from_disk(
    kind: str, tmp_path: Path, angles: Array, measured: tuple[Array, Any]
) -> None:
    values = measured[0]
    path = tmp_path / f"texels.{'npy' if kind == 'npy' else 'npz'}"
    if kind == "npy":
        np.save(path, values)
    elif kind == "zarr":
        zarr = pytest.importorskip("zarr", reason="the extra lobefit[zarr] is not installed")
        path = tmp_path / "texels.zarr"
        group = zarr.open_group(str(path), mode="w")
        group.create_array("values", data=values, chunks=(50, 64, 3))
        group.create_array("directions", data=angles)
    else:
        save = np.savez if kind == "npz" else np.savez_compressed
        save(path, values=values, directions=angles)
    source = open_texels(path)
    assert source.shape == values.shape
    if kind != "npy":
        assert source.directions is not None
        assert source.directions.tobytes() == angles.tobytes()
    pieces = list(source.chunks(64))
    assert [first for first, _ in pieces] == [0, 64, 128, 192]
    assert np.concatenate([rows for _, rows in pieces]).tobytes() == values.tobytes()
    ((first, rows),) = source.chunks(64, 100, 120)
    assert first == 100
    assert rows.tobytes() == values[100:120].tobytes()


def test_bad_calls_say_what_is_wrong(tmp_path: Path, angles: Array) -> None:
    values = np.ones((2, 64, 3))
    with pytest.raises(MeasurementError, match="63 directions and 64 readings"):
        fit_texels(angles[:, :63], values)
    with pytest.raises(MeasurementError, match="5 channels"):
        fit_texels(angles, np.ones((2, 64, 5)))
    with pytest.raises(MeasurementError, match="shape"):
        fit_texels(angles, np.ones(64))
    with pytest.raises(MeasurementError, match="numbers"):
        fit_texels(angles, np.array(["a"]))
    with pytest.raises(MeasurementError, match="four rows"):
        fit_texels(angles[:3], values)
    with pytest.raises(MeasurementError, match="lack phi_i, theta_o, phi_o"):
        fit_texels({"theta_i": angles[0]}, values)
    below = angles.copy()
    below[0, 3] = np.pi / 2
    with pytest.raises(MeasurementError, match="direction 3 lies at or below the horizon"):
        fit_texels(below, values, "lambert")
    with pytest.raises(FitError, match="noise is"):
        fit_texels(angles, values, noise=(-1.0, 0.0))
    with pytest.raises(ModelError, match="searches for eta, k in each channel"):
        fit_texels(angles, values, "ggx:conductor")
    with pytest.raises(MeasurementError, match="no such file"):
        open_texels(tmp_path / "none.npy")
    np.save(tmp_path / "f.npy", np.asfortranarray(values))
    with pytest.raises(MeasurementError, match="Fortran"):
        open_texels(tmp_path / "f.npy")
    np.savez(tmp_path / "v.npz", readings=values)
    with pytest.raises(MeasurementError, match="there are: readings"):
        open_texels(tmp_path / "v.npz")


def test_sets_leave_out_what_texels_cannot_be_fitted_with() -> None:
    names = {c.name for c in eligible("all", 3)}
    assert {"lambert", "oren_nayar", "ggx", "beckmann", "blinn_phong", "ward:isotropic"} <= names
    assert not names & {"ggx:conductor", "eon", "ward", "sgd:lobe"}
    assert refusal(candidate("sgd:lobe"), 1).endswith("takes one surface at a time")
    assert refusal(candidate("ggx:conductor"), 1) == ""


def test_the_form_for_gpus_gives_the_same_answers(
    monkeypatch: pytest.MonkeyPatch, angles: Array, measured: tuple[Array, Any], fitted: TexelFit
) -> None:
    """One texel per work-item, neighbours reading neighbours."""
    monkeypatch.setattr(Device, "is_cpu", False)
    found = fit_texels(angles, measured[0][:21], [MODEL])
    for name, rows in found.params.items():
        size = np.abs(rows - fitted.params[name][:21]) / fitted.errors[name][:21]
        assert size.max() < 0.01, name


@pytest.mark.slow
def test_double_precision_has_more_digits(angles: Array) -> None:
    clean, truth = surfaces(MODEL, angles, 9, 3, seed=14)
    found = fit_texels(angles, clean, [MODEL], precision="double")
    assert found.scatter.max() < 1e-9
    for name, true in truth.items():
        # Results are stored in single precision.
        assert found.params[name] == pytest.approx(true, rel=1e-6), name


def test_what_does_not_converge_is_polished(
    monkeypatch: pytest.MonkeyPatch, angles: Array, measured: tuple[Array, Any], fitted: TexelFit
) -> None:
    """With one step allowed nobody gets there on the device; NLopt finds the same minimum."""
    monkeypatch.setattr(texel_solve, "MOST_STEPS", 1)
    found = fit_texels(angles, measured[0][:5], [MODEL])
    assert found.counts["polished"] == found.counts["converged"] == 5
    for name, rows in found.params.items():
        size = np.abs(rows - fitted.params[name][:5]) / fitted.errors[name][:5]
        assert size.max() < 0.05, name


def test_a_result_travels_between_processes(fitted: TexelFit) -> None:
    assert_same_bytes(pickle.loads(pickle.dumps(fitted)), fitted)
