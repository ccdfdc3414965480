"""The samples are what their JSON says, can be made again, and are recovered by a fit."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from lobefit.fitting import fit, read_measurement
from lobefit.kernels import candidate, directional_albedo
from samples.make import FOLDER, load, names, write
from tests.truth import deviations

FIELDS = {
    "schema",
    "description",
    "truth",
    "channels",
    "geometry",
    "noise",
    "seed",
    "sigma_columns",
    "separator",
    "header",
    "command",
    "expected_fit",
}

every_sample = pytest.mark.parametrize("name", names())


def head(path: Path) -> list[str]:
    """Give the metadata lines and the row of column names."""
    lines = path.read_text(encoding="utf-8").splitlines()
    count = sum(line.startswith("#") for line in lines)
    return lines[: count + 1]


def test_every_measurement_has_its_provenance() -> None:
    measured = {path.stem for path in FOLDER.glob("*.csv")}
    assert measured == set(names())
    assert len(measured) >= 5
    assert len({load(name)["seed"] for name in measured}) == len(measured)


@every_sample
def test_provenance_is_complete(name: str) -> None:
    spec = load(name)
    assert set(spec) == FIELDS
    assert spec["schema"] == 1
    truth = spec["truth"]
    known = candidate(truth["candidate"])
    assert set(truth) == {"candidate", "model", "options", "params"}
    assert truth["model"] == known.model.name
    # Nothing is left to a default, which a later version might change.
    assert set(truth["params"]) == {p.name for p in known.model.parameters}
    per_channel = {p.name for p in known.model.parameters if p.per_channel}
    for parameter, value in truth["params"].items():
        if isinstance(value, list):
            assert parameter in per_channel
            assert len(value) == len(spec["channels"])
    assert set(spec["noise"]) == {"relative", "additive"}
    assert spec["command"] == f"python samples/make.py {name}"
    assert spec["expected_fit"] == {
        "first": truth["candidate"],
        "tolerance_standard_errors": 3,
    }
    assert {"material", "instrument"} <= set(spec["header"])
    assert "simulated" in spec["header"]["instrument"]
    assert name in (FOLDER / "README.md").read_text(encoding="utf-8")


@every_sample
def test_making_a_sample_again_gives_the_file(name: str, tmp_path: Path) -> None:
    kept, made = FOLDER / f"{name}.csv", tmp_path / f"{name}.csv"
    write(load(name), made)
    assert head(made) == head(kept)
    again, file = read_measurement(made), read_measurement(kept)
    for column in ("theta_i", "phi_i", "theta_o", "phi_o"):
        assert np.array_equal(getattr(again, column), getattr(file, column))
    # One unit of the seventh digit, by which another processor's exp() may tip the rounding.
    assert np.allclose(again.values, file.values, rtol=1e-6, atol=0)
    assert (again.sigma is None) == (file.sigma is None)
    if again.sigma is not None and file.sigma is not None:
        assert np.allclose(again.sigma, file.sigma, rtol=1e-6, atol=0)


@every_sample
def test_a_sample_is_small_and_is_read_without_a_remark(name: str) -> None:
    spec, path = load(name), FOLDER / f"{name}.csv"
    measurement = read_measurement(path)
    assert measurement.notes == ()
    assert measurement.dropped == ()
    assert measurement.channels == tuple(spec["channels"])
    assert measurement.n_directions <= 3000
    assert path.stat().st_size < 200_000
    anisotropic = not candidate(spec["truth"]["candidate"]).isotropic
    assert measurement.has_azimuthal_evidence == anisotropic


@every_sample
def test_a_sample_could_be_a_surface(name: str) -> None:
    truth = load(name)["truth"]
    theta_i = np.deg2rad([0, 15, 30, 45, 60, 75, 85])
    for azimuth in np.deg2rad([0, 45, 90, 135]):
        albedo = directional_albedo(
            truth["model"], truth["params"], theta_i, azimuth, options=truth["options"]
        )
        assert np.all(albedo > 0.05)
        assert np.all(albedo < 1)


@every_sample
def test_a_fit_finds_what_a_sample_was_made_from(name: str) -> None:
    spec = load(name)
    expected = spec["expected_fit"]
    report = fit(read_measurement(FOLDER / f"{name}.csv"))
    assert report.best.candidate == expected["first"], report.table()
    found = deviations(report.best, spec["truth"]["params"])
    limit = expected["tolerance_standard_errors"]
    off = {label: round(z, 2) for label, z in found.items() if not abs(z) <= limit}
    assert not off, f"standard errors off the truth: {off}\n{report.best}"
