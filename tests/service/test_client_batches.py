"""Charts and batches by the Python client, against a service in memory."""

from __future__ import annotations

import pickle
from dataclasses import fields
from pathlib import Path
from typing import Any

import anyio
import httpx2
import pytest

from lobefit.kernels import FitError, MeasurementError, ModelError
from lobefit.service import AsyncClient, ServiceError
from lobefit.service.client import Batch, Chart, Progress
from lobefit.service.client.tables import read_table
from lobefit.service.resources import Progress as ServiceProgress
from tests.service.clients import CSV
from tests.service.fake_service import CHART, FakeService

pytestmark = pytest.mark.usefixtures("quick_polls")

OTHER = CSV + b"0,0,30,180,0.3\n"


@pytest.fixture
def made(client: Any) -> Any:
    """Give what runs the method of a fit, chart or batch, of either client."""
    return getattr(client, "made", lambda thing: thing)


def test_a_chart_from_a_file_to_its_files(
    client: Any, made: Any, service: FakeService, tmp_path: Path
) -> None:
    path = tmp_path / "paint.csv"
    path.write_bytes(CSV)
    seen: list[Chart] = []
    chart = client.chart(path, "ggx", groups=["fit"], name="<i>", wait=True, progress=seen.append)
    assert [c.progress.done for c in seen if c.progress] == [1, 2, 3, 4]
    assert (chart.state, chart.answer, chart.result) == ("done", CHART["answer"], CHART)
    asked = service.charts[chart.id]["request"]
    assert asked["measurement"] in service.measurements
    assert (asked["models"], asked["groups"], asked["repeats"]) == (["ggx"], ["fit"], 5)
    assert str(chart) == f"<i>: done. {CHART['answer']}"
    assert "It is &lt;b&gt;fast." in chart._repr_html_() and "<i>" not in chart._repr_html_()

    (listed,) = client.charts(measurement=chart.measurement, state="done")
    assert listed.result is None and made(listed).status().result == CHART
    assert client.chart_status(chart.id) == chart
    files = made(chart).save(tmp_path / "new" / "folder")
    assert {name: p.read_bytes() for name, p in files.items()} == service.files
    assert client.download(chart, tmp_path, ["fit.png"]) == {"fit.png": tmp_path / "fit.png"}
    with pytest.raises(FitError, match=r"chart chart-1 is done and has no file 'x'"):
        client.download(chart, tmp_path, ["x"])


def test_a_chart_of_a_model_is_stopped_and_deleted(
    client: Any, made: Any, service: FakeService
) -> None:
    chart = client.chart({"model": "ggx", "params": {"k_d": (0.1, 0.2)}, "seed": 1}, name="slow")
    asked = service.charts[chart.id]["request"]
    assert asked["truth"] == {"model": "ggx", "params": {"k_d": [0.1, 0.2]}, "seed": 1}
    assert asked["models"] == "all" and "measurement" not in asked
    assert not service.measurements
    assert made(chart).cancel().state == "cancelled"
    made(chart).delete()
    assert service.charts == {}
    with pytest.raises(ServiceError, match="no such chart"):
        made(chart).wait()
    with pytest.raises(FitError, match="no candidate could be fitted") as failed:
        client.chart(CSV, name="bad", wait=True)
    assert failed.value.__notes__ == ["chart chart-2 failed in the service"]
    with pytest.raises(ModelError, match="there is no model 'no_such'"):
        client.chart(CSV, "no_such")


def test_a_batch_from_files_to_tables(
    client: Any, made: Any, service: FakeService, tmp_path: Path
) -> None:
    path = tmp_path / "other.csv"
    path.write_bytes(OTHER)
    stored = client.upload(CSV, "first.csv")
    given = [
        stored,
        stored.id,
        path,
        {"measurement": OTHER, "models": "ggx", "posterior": True, "name": "=mine"},
        {"measurement": stored, "name": "bad"},
    ]
    seen: list[Batch] = []
    batch = client.batch(given, "quick", seed=3, name="all", wait=True, progress=seen.append)
    assert batch.state == "done" and len(batch) == 5 and len(service.measurements) == 2
    counts = {"queued": 0, "running": 0, "done": 4, "failed": 1, "cancelled": 0}
    assert batch.counts == counts and batch.extent == (5, 5)
    assert str(batch) == "all: done, 5 of 5 ended, 1 failed"
    assert str(seen[0]) == "all: running, 0 of 5 ended, 2 s left" and seen[-1] == batch
    assert "<td>failed</td><td>1</td>" in batch._repr_html_()

    fits = made(batch).fits()
    assert [f.name for f in fits] == ["first.csv", None, "other.csv", "=mine", "bad"]
    assert fits == client.fits(batch=batch)[::-1] and {f.batch for f in fits} == {batch.id}
    asked = fits[3].request
    assert (asked["models"], asked["posterior"], asked["seed"]) == (["ggx"], {}, 3)
    assert fits[0].request["models"] == "quick" and fits[0].request["posterior"] is None
    assert [f.id for f in made(batch).fits(state="failed")] == [fits[4].id]
    assert client.result(fits[0]).verdict == made(fits[0]).status().verdict

    row = made(batch).table()[3]
    assert (row["name"], row["file"], row["directions"], row["rmse"]) == ("=mine", "12", 2, 0.25)
    assert row["described"] is True and row["reason"] is None
    assert row["verdict"] == '-"so, so"\nand so'
    assert made(batch).parameters()[0]["value"] == 0.3
    files = made(batch).save(tmp_path / "out")
    assert sorted(files) == ["parameters.csv", "summary.png", "table.csv"]
    assert sorted(p.name for p in (tmp_path / "out").iterdir()) == sorted(files)

    assert client.batches() == [batch] == [client.batch_status(batch.id)]
    client.delete(batch)
    assert service.fits == service.batches == {} and len(service.measurements) == 2


def test_a_batch_is_cancelled_with_its_fits(client: Any, made: Any, service: FakeService) -> None:
    batch = client.batch([{"measurement": CSV, "name": "slow"}] * 3)
    with pytest.raises(ServiceError, match=r"batch-1 is still running and goes on in the service"):
        made(batch).wait(timeout=0.05, progress=False)
    assert made(batch).cancel().counts["cancelled"] == 3
    assert made(batch).cancel().state == "cancelled"
    assert {row["state"] for row in service.fits.values()} == {"cancelled"}


def test_what_is_no_batch_is_refused_before_it_is_submitted(
    client: Any, service: FakeService, tmp_path: Path
) -> None:
    with pytest.raises(FitError, match=r"a list of measurements, not of 'x\.csv'"):
        client.batch("x.csv")
    for count in (0, 1001):
        with pytest.raises(FitError, match=f"^{count} measurements; a batch takes 1 to 1000"):
            client.batch([CSV] * count)
    with pytest.raises(FitError, match=r"has no measurement: {'name': 'a'}"):
        client.batch([{"name": "a"}])
    with pytest.raises(MeasurementError, match=r"nothing\.csv: there is no such file"):
        client.batch([CSV, tmp_path / "nothing.csv", CSV])
    with pytest.raises(ServiceError, match="upload it first; see /items/1/measurement"):
        client.batch([CSV, "0" * 64])
    assert service.keys == {}


def test_uploads_of_an_async_client_go_together() -> None:
    service = FakeService()
    now = most = 0

    async def handler(request: httpx2.Request) -> httpx2.Response:
        nonlocal now, most
        if request.url.path != "/v1/measurements":
            return service(request)
        now, most = now + 1, max(most, now + 1)
        await anyio.sleep(0.005)
        now -= 1
        return service(request)

    async def submit() -> Batch:
        async with AsyncClient(transport=httpx2.MockTransport(handler)) as client:
            return await client.batch([CSV + b"\n" * k for k in range(12)])

    batch = anyio.run(submit)
    assert 1 < most <= 8 and batch.total == 12
    sizes = [service.measurements[row["measurement"]]["bytes"] for row in service.fits.values()]
    assert sizes == [len(CSV) + k for k in range(12)]


@pytest.mark.parametrize("cells", ["described\nmaybe\n", "rmse\nsmall\n"])
def test_a_table_of_something_else_is_refused(cells: str) -> None:
    with pytest.raises(ServiceError, match=r"table\.csv is not understood"):
        read_table("table.csv", cells)


def test_a_copy_knows_no_client(client: Any) -> None:
    chart = client.chart(CSV)
    copy = pickle.loads(pickle.dumps(chart))
    assert copy == chart and repr(copy) == repr(chart)
    with pytest.raises(ServiceError, match="this chart is a copy, which knows no client"):
        copy.cancel()


def test_the_service_tells_the_progress_that_the_client_knows() -> None:
    assert {f.name for f in fields(Progress)} == set(ServiceProgress.model_fields)
