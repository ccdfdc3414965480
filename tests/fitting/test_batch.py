"""Many measurements and many texels on any executor: the same bytes, resumable, failures listed."""

from __future__ import annotations

import csv
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks.batch_same import files_of
from lobefit.fitting import fit, fit_many, read_measurement, simulate, write_measurement
from lobefit.fitting.batch import Batch
from lobefit.fitting.batch_figure import draw_batch
from lobefit.fitting.batch_table import item_row
from lobefit.fitting.engine import Ledger, Status
from lobefit.fitting.texel_batch import fit_texel_file
from lobefit.fitting.texel_result import Reason
from lobefit.fitting.texels import fit_texels
from lobefit.kernels import LobefitError, MeasurementError
from tests.fitting.clusters import local_cluster
from tests.fitting.texel_cases import directions, surfaces

SCAN = "in-plane incidences=10,40 step=10"
TEXELS = 200


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Give a folder with three measurements, one that is none, and a file of texels."""
    folder = tmp_path_factory.mktemp("inputs")
    for k, name in enumerate(("red", "green", "blue")):
        m = simulate("lambert", {"k_d": 0.1 * (k + 2)}, SCAN, noise=(0.01, 1e-4), seed=k)
        write_measurement(m, folder / f"{name}.csv")
    (folder / "broken.csv").write_text("theta_i,phi_i,theta_o,phi_o,brdf\n1,2,3,4,0.1x\n")
    angles = directions(24)
    values, _ = surfaces("lambert", angles, TEXELS, 1, seed=5)
    values = values * (1 + 0.01 * np.random.default_rng(2).standard_normal(values.shape))
    values[7] = np.nan
    np.savez(folder / "texels.npz", values=values, directions=angles)
    return folder


@pytest.fixture(scope="module")
def scheduler() -> Iterator[str]:
    with local_cluster() as address:
        yield address


@pytest.fixture(scope="module")
def here(place: Path, tmp_path_factory: pytest.TempPathFactory) -> Batch:
    """Fit them on this machine."""
    return fit_many(str(place / "*.csv"), tmp_path_factory.mktemp("here"), "lambert", jobs=1)


def test_every_item_has_a_report_or_a_reason(here: Batch, place: Path) -> None:
    assert [row["name"] for row in here.rows] == ["blue", "broken", "green", "red"]
    assert list(here.failed) == ["broken"]
    assert "line 2" in here.failed["broken"]
    for row in here.rows:
        assert here.report(row["name"]).is_file() == (row["status"] == "fitted")
    report = json.loads(here.report("red").read_text())
    alone = fit(read_measurement(place / "red.csv"), "lambert")
    assert report["results"][0]["params"] == alone.best.params
    assert report["measurement"]["file"] == "red.csv"
    assert len(report["measurement"]["sha256"]) == 64


def test_the_table_says_who_was_fitted_by_what(here: Batch) -> None:
    with (here.folder / "table.csv").open(newline="") as stream:
        rows = {row["name"]: row for row in csv.DictReader(stream)}
    assert rows["red"]["model"] == "lambert"
    assert rows["broken"]["status"] == "failed"
    assert rows["broken"]["typical_error"] == ""
    with (here.folder / "parameters.csv").open(newline="") as stream:
        values = {row["name"]: float(row["value"]) for row in csv.DictReader(stream)}
    assert values == pytest.approx({"red": 0.2, "green": 0.3, "blue": 0.4}, rel=0.02)
    assert (here.folder / "summary.png").read_bytes().startswith(b"\x89PNG")


def test_a_typical_error_is_that_of_the_median_not_of_the_dark(here: Batch) -> None:
    report = json.loads(here.report("red").read_text())
    decade = report["results"][0]["diagnostics"]["decades"][0]
    report["results"][0]["diagnostics"]["decades"] = [
        {**decade, "count": 5, "rms_relative": 250.0},
        {**decade, "count": 3, "rms_relative": 0.03},
        {**decade, "count": 3, "rms_relative": 0.02},
    ]
    assert item_row(report)["typical_error"] == 0.03
    report["results"][0]["diagnostics"]["decades"] = []
    assert item_row(report)["typical_error"] is None


def test_the_picture_tells_failures_from_what_was_cancelled() -> None:
    fitted = {"status": "fitted", "model": "lambert", "typical_error": 0.01, "seconds": 1.0}
    failed = {"status": "failed", "model": None, "reason": "no rows"}
    ended = {"status": "cancelled", "model": None, "reason": "cancelled before its end"}

    def words(*kinds: dict[str, Any]) -> list[str]:
        rows = [{"name": f"item {k}", **kind} for k, kind in enumerate(kinds)]
        figure = draw_batch(rows)
        names = [label.get_text() for label in figure.axes[0].get_yticklabels()]
        return [figure.get_suptitle(), *names, *(t.get_text() for t in figure.axes[1].texts)]

    few = words(fitted, failed, ended)
    assert few[0].startswith("3 items: 1 fitted") and few[0].endswith("1 failed, 1 cancelled")
    assert few[1:4] == ["item 0", "item 1", "item 2"]
    assert few[4:] == ["failed: no rows", "cancelled before its end"]
    many = words(*[ended] * 400, failed)
    assert many[1:] == ["item 400", "failed: no rows"]
    assert len(words(*[failed] * 400)) == 1  # no room for any


def test_the_table_is_parquet_too(here: Batch) -> None:
    parquet: Any = pytest.importorskip(
        "pyarrow.parquet", reason="pyarrow is not installed: pip install lobefit[parquet]"
    )
    table = parquet.read_table(here.folder / "table.parquet").to_pydict()
    assert table["name"] == [row["name"] for row in here.rows]
    assert table["rmse"] == [row.get("rmse") for row in here.rows]


def test_reports_are_the_same_bytes_in_another_pool(
    here: Batch, place: Path, tmp_path: Path
) -> None:
    other = fit_many(str(place / "*.csv"), tmp_path, "lambert", jobs=2, pool="processes")
    assert files_of(other.folder) == files_of(here.folder)


def test_reports_are_the_same_bytes_on_a_cluster(
    here: Batch, place: Path, tmp_path: Path, scheduler: str
) -> None:
    other = fit_many(str(place / "*.csv"), tmp_path, "lambert", scheduler=scheduler)
    assert files_of(other.folder) == files_of(here.folder)


def test_only_what_changed_or_is_gone_is_fitted_again(place: Path, tmp_path: Path) -> None:
    said: list[Status] = []

    def call(*inputs: Any, **settings: Any) -> Batch:
        said.clear()
        return fit_many(
            inputs, tmp_path, "lambert", jobs=1, pool="processes", progress=said.append, **settings
        )

    files = [tmp_path / f"in/{name}.csv" for name in ("one", "two", "three")]
    files[0].parent.mkdir()
    for path, source in zip(files, ("red", "green", "blue"), strict=True):
        path.write_bytes((place / f"{source}.csv").read_bytes())
    call(*files[:2])
    assert (said[0].done, said[-1].done) == (0, 2)
    assert len(call(*files[:2])) == 2
    assert said == []  # nothing to do: no worker was started
    files[1].write_bytes((place / "blue.csv").read_bytes())
    (tmp_path / "one" / "report.json").unlink()
    found = call(*files)
    assert (said[0].done, said[-1].done) == (0, 3)
    k_d = [row["parameters"][0]["value"] for row in found.rows]
    assert k_d == pytest.approx([0.2, 0.4, 0.4], rel=0.02)


def test_a_manifest_says_how_each_is_fitted(place: Path, tmp_path: Path) -> None:
    (place / "list.txt").write_text(
        "file,name,models,metric\nred.csv,first,lambert,log\nred.csv,,oren_nayar,\nlost.csv,,,\n"
    )
    found = fit_many(place / "list.txt", tmp_path, "lambert", jobs=1)
    assert [(r["name"], r["model"], r.get("metric")) for r in found.rows] == [
        ("first", "lambert", "log"),
        ("red", "oren_nayar", "relative"),
        ("lost", None, None),
    ]
    assert list(found.failed) == ["lost"]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("file,model\nred.csv,ggx\n", "list.txt, line 2: unknown column 'model'"),
        ("file,models\nred.csv,nothing\n", "list.txt, line 2: .*nothing"),
        ("file,tolerance\nred.csv,much\n", "line 2, column tolerance: .*much"),
        ("file,student\nred.csv,perhaps\n", "neither yes nor no"),
        ("file,options\nred.csv,fresnel\n", "not NAME=VALUE"),
        ("file,metric\nred.csv,chi\n", "line 2: metric is one of"),
        ("file\nred.csv,ggx\n", "more cells than the header"),
        ("name,file\nred,\n", "names no file"),
        ("file\n", "nothing to fit"),
    ],
)
def test_a_bad_manifest_is_refused_before_anything_is_fitted(
    tmp_path: Path, text: str, message: str
) -> None:
    (tmp_path / "list.txt").write_text(text)
    with pytest.raises(LobefitError, match=message):
        fit_many(tmp_path / "list.txt", tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_inputs_that_are_not_there_are_refused(tmp_path: Path) -> None:
    with pytest.raises(MeasurementError, match="matches no file"):
        fit_many(tmp_path / "*.csv", tmp_path / "out")
    with pytest.raises(MeasurementError, match="no such file"):
        fit_many(tmp_path / "none.csv", tmp_path / "out")
    with pytest.raises(MeasurementError, match="is a folder"):
        fit_many(tmp_path, tmp_path / "out")
    with pytest.raises(MeasurementError, match="nothing to fit"):
        fit_many([], tmp_path / "out")
    (tmp_path / "file").write_text("")
    (tmp_path / "some.csv").write_text("")
    with pytest.raises(LobefitError, match="is a file; name a folder"):
        fit_many(tmp_path / "some.csv", tmp_path / "file")


def texel_files(folder: Path) -> dict[str, bytes]:
    return {p.name: p.read_bytes() for p in folder.glob("*") if p.suffix in (".npy", ".json")}


def test_texels_are_the_same_bytes_however_they_are_cut(
    place: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with np.load(place / "texels.npz") as stored:
        whole = fit_texels(stored["directions"], stored["values"], ["lambert"])
    one = fit_texel_file(place / "texels.npz", tmp_path / "one", ["lambert"], jobs=1)
    assert one.chunks == 1
    monkeypatch.setattr("lobefit.fitting.texel_batch.FEWEST", 30)
    two = fit_texel_file(place / "texels.npz", tmp_path / "two", ["lambert"], jobs=2)
    assert two.chunks > 1
    assert texel_files(two.folder) == texel_files(one.folder)
    assert not list(two.folder.glob("readings*"))
    fit = two.fit
    assert fit.failures == [(7, "too few")]
    for name in ("model", "rmse", "bic", "reason"):
        np.testing.assert_array_equal(getattr(fit, name), getattr(whole, name))
    np.testing.assert_array_equal(fit.params["k_d"], whole.params["k_d"])
    # Settled already: nothing is fitted, nothing is written.
    again = fit_texel_file(place / "texels.npz", tmp_path / "two", ["lambert"], jobs=2)
    assert texel_files(again.folder) == texel_files(one.folder)
    with pytest.raises(LobefitError, match=r"holds other work \(its input or settings"):
        fit_texel_file(place / "texels.npz", tmp_path / "two", ["oren_nayar"], jobs=2)


def test_texels_are_the_same_bytes_on_a_cluster(
    place: Path, tmp_path: Path, scheduler: str
) -> None:
    here = fit_texel_file(place / "texels.npz", tmp_path / "here", ["lambert"], jobs=1)
    sent = fit_texel_file(place / "texels.npz", tmp_path / "sent", ["lambert"], scheduler=scheduler)
    assert texel_files(sent.folder) == texel_files(here.folder)


def test_a_texel_that_no_chunk_came_back_with_is_marked(place: Path, tmp_path: Path) -> None:
    fit_texel_file(place / "texels.npz", tmp_path, ["lambert"], jobs=1)
    with Ledger(tmp_path / "texels.sqlite") as ledger:
        from lobefit.fitting.engine import Row

        ledger._db.execute("DELETE FROM chunks")
        ledger.settle([Row(0, 50), Row(51, TEXELS), Row(50, 51, None, "it died")])
    found = fit_texel_file(place / "texels.npz", tmp_path, ["lambert"], jobs=1)
    assert found.failed == {50: "it died"}
    assert (found.fit.model[50], found.fit.reason[50]) == (-1, Reason.CRASHED)
    assert np.isnan(found.fit.params["k_d"][50]).all()
    assert found.fit.texel(50) == {"model": None, "reason": "crashed"}
    mended = fit_texel_file(place / "texels.npz", tmp_path, ["lambert"], jobs=1, retry=True)
    assert mended.failed == {}
    assert mended.fit.model[50] == 0
