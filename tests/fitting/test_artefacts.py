"""Files of a fit are written whole or not at all."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from lobefit.fitting import artefacts
from lobefit.fitting.readers import read_measurement
from lobefit.kernels.errors import LobefitError
from tests.fitting.reports import (
    GLOSSY,
    hand_made_report,
    hand_made_result,
    simulated,
    strict,
)


def test_save(tmp_path: Path) -> None:
    m = simulated("in-plane", ["R", "G", "B"])
    report = hand_made_report(m, hand_made_result(m, "ggx", GLOSSY))
    folder = tmp_path / "new" / "folder"
    for _ in range(2):  # the second time over the files of the first
        written = report.save(folder)
    assert {kind: path.name for kind, path in written.items()} == {
        "report": "report.json",
        "fit": "fit.png",
        "lobes": "lobes.exr",
        "albedo": "albedo.exr",
        "samples": "samples.csv",
    }
    assert set(folder.iterdir()) == set(written.values())
    document = strict(written["report"].read_text(encoding="utf-8"))
    expected = report.to_dict()
    assert {**document, "created": None} == {**expected, "created": None}
    back = read_measurement(written["samples"])
    assert back.channels == m.channels
    np.testing.assert_allclose(back.values, m.values, rtol=1e-6)  # written to 7 digits


@pytest.mark.parametrize("trouble", [LobefitError("no"), KeyboardInterrupt()])
def test_an_interrupted_save_leaves_what_was_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, trouble: BaseException
) -> None:
    m = simulated("in-plane", ["brdf"])
    report = hand_made_report(m, hand_made_result(m, "ggx", GLOSSY))
    old = report.save(tmp_path / "old")
    before = {path: path.read_bytes() for path in old.values()}

    def fail(*_: object) -> None:
        raise trouble

    monkeypatch.setattr(artefacts, "write_measurement", fail)
    other = hand_made_report(m, hand_made_result(m, "lambert", {}))
    for folder in (tmp_path / "old", tmp_path / "new"):
        with pytest.raises(type(trouble)):
            other.save(folder)
    assert {path: path.read_bytes() for path in (tmp_path / "old").iterdir()} == before
    assert not (tmp_path / "new").exists()


def test_a_folder_that_cannot_be_written_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("here")
    m = simulated("in-plane", ["brdf"])
    report = hand_made_report(m, hand_made_result(m, "ggx", GLOSSY))
    for folder in (tmp_path / "file", tmp_path / "file" / "below"):
        with pytest.raises(LobefitError, match=r"cannot write to the folder .*file"):
            report.save(folder)
    assert (tmp_path / "file").read_text() == "here"
