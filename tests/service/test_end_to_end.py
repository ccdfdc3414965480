"""The client against ``lobefit serve`` as it is started by people."""

from __future__ import annotations

import asyncio
import math
import time
from pathlib import Path

import httpx2
import pytest

from lobefit.fitting import fit, read_measurement
from lobefit.kernels import FitError, MeasurementError, ModelError, evaluate
from lobefit.service import AsyncClient, Client, ServiceError
from lobefit.service.client import Fit, Retries, Values
from tests.service.fake_network import Faulty

SAMPLE = Path(__file__).parents[2] / "samples" / "noisy_few_angles.csv"


@pytest.fixture
def url(service_url: str) -> str:
    return service_url


def test_the_service_gives_what_the_local_api_gives(url: str, tmp_path: Path) -> None:
    local = fit(read_measurement(SAMPLE), ["lambert", "ggx"])
    seen: list[Fit] = []
    with Client(url) as client:
        stored = client.upload(SAMPLE)
        assert stored.directions == 147 and stored.channels == ("brdf",)
        assert client.upload(SAMPLE.read_bytes()).id == stored.id
        done = client.fit(stored, ["lambert", "ggx"], wait=True, progress=seen.append)
        assert done.state == "done" and done.best == local.best.candidate
        assert any(f.state == "running" for f in seen)
        report = client.result(done)
        assert report.verdict == local.verdict
        alpha = local.best.params["alpha"]
        assert report.best.params["alpha"] == pytest.approx(alpha, rel=1e-6)
        files = client.download(done, tmp_path)
        assert {"report.json", "fit.png", "lobes.exr"} <= set(files)
        assert files["fit.png"].read_bytes().startswith(b"\x89PNG")
        assert {p.name for p in tmp_path.iterdir()} == set(files)

        theta = math.radians(30.0)
        model = report.best.model, report.best.params
        values = client.evaluate(*model, theta_i_deg=30.0, theta_o_deg=[0.0, 30.0], phi_o_deg=180.0)
        expected = evaluate(*model, theta, 0.0, [0.0, theta], math.pi)
        assert values.values[0] == pytest.approx(expected[0].tolist(), rel=1e-6)
        assert client.upload(client.simulate("lambert", {"k_d": 0.3}, seed=1)).directions > 100

        assert client.cancel(done).state == "done", "what has ended stays"
        assert [f.id for f in client.fits(measurement=stored)] == [done.id]
        client.delete(done)
        assert client.fits(measurement=stored) == []
        client.delete(stored)


def test_a_running_fit_is_cancelled_and_kept(url: str) -> None:
    with Client(url) as client:
        running = client.fit(SAMPLE, ["ggx"], posterior={"steps": 1_000_000, "ensembles": 16})
        end = time.monotonic() + 60.0
        while (now := client.status(running)).state == "queued" and time.monotonic() < end:
            time.sleep(0.02)
        assert now.state == "running"
        began = time.monotonic()
        cancelled = client.cancel(running)
        assert cancelled.state == "cancelled"
        assert time.monotonic() - began < 10.0  # 2 s, on a machine that does nothing else
        assert client.status(running).state == "cancelled"


def test_faults_of_the_network_change_nothing(url: str) -> None:
    """Dropped, repeated, delayed and cut answers: the same report, and nothing done twice."""
    network = httpx2.HTTPTransport()

    def through(request: httpx2.Request) -> httpx2.Response:
        response = network.handle_request(request)
        content = response.read()
        response.close()
        return httpx2.Response(response.status_code, headers=response.headers, content=content)

    with Client(url) as clean:
        stored = clean.upload(SAMPLE)
        expected = clean.result(clean.fit(stored, "lambert", wait=True))
        before = len(clean.fits())
        faulty = Faulty(through, seed=3, share=0.5)
        patient = Retries(attempts=50, first=1e-3, longest=1e-2)
        with Client(url, transport=faulty, retries=patient) as client:
            for _ in range(3):
                assert client.upload(SAMPLE) == stored
                report = client.result(client.fit(SAMPLE, "lambert", wait=True))
                assert report.verdict == expected.verdict
                assert report.best.params == expected.best.params
            assert len(clean.fits()) == before + 3
        assert sum(faulty.met.values()) - faulty.met["none"] > 10
    network.close()


def test_many_at_once_with_await(url: str) -> None:
    async def values() -> list[Values]:
        async with AsyncClient(url) as client:
            stored = await client.upload(SAMPLE)
            fit = await client.fit(stored, "lambert", wait=True)
            assert (await client.result(fit)).best.candidate == "lambert"
            asked = (
                client.evaluate("lambert", {"k_d": k}, theta_i_deg=0, theta_o_deg=0, phi_o_deg=0)
                for k in (0.1, 0.2, 0.3)
            )
            return list(await asyncio.gather(*asked))

    found = [v.values[0][0] for v in asyncio.run(values())]
    assert found == pytest.approx([0.1 / math.pi, 0.2 / math.pi, 0.3 / math.pi], rel=1e-6)


def test_a_batch_and_a_chart(url: str, tmp_path: Path) -> None:
    flat = {"model": "lambert", "params": {"k_d": 0.3}, "geometry": "in-plane step=15"}
    with Client(url) as client:
        other = {"measurement": SAMPLE, "models": "ggx", "name": "other"}
        batch = client.batch([SAMPLE, other], "lambert", wait=True)
        assert batch.counts["done"] == 2 and batch.ended is not None
        assert [f.best for f in batch.fits()] == ["lambert", "ggx"]
        assert [(r["name"], r["model"]) for r in batch.table()] == [
            (SAMPLE.name, "lambert"),
            ("other", "ggx"),
        ]
        assert {r["parameter"] for r in batch.parameters()} >= {"k_d", "alpha"}
        assert batch.save(tmp_path)["summary.png"].read_bytes().startswith(b"\x89PNG")
        batch.delete()
        long = client.batch([SAMPLE] * 3, "ggx", posterior={"steps": 1_000_000})
        assert long.cancel().counts["cancelled"] == 3
        long.delete()
        chart = client.chart(flat, "lambert", groups=["fit"], repeats=1, wait=True)
        assert chart.answer and chart.result and chart.result["answer"] == chart.answer
        assert set(chart.save(tmp_path)) == {"chart.json", "chart.png"}
        chart.delete()


def test_refusals_are_the_errors_of_the_local_api(url: str) -> None:
    with Client(url) as client:
        with pytest.raises(MeasurementError) as caught:
            client.upload(b"theta_i,phi_i,theta_o,phi_o,R\n0,0,10,0,1\n0,0,20,0,x\n", "a.csv")
        e = caught.value
        assert (e.file, e.row, e.column, e.text) == ("a.csv", 3, "R", "x")
        with pytest.raises(ModelError, match="no model is called 'no_such'"):
            client.fit(SAMPLE, "no_such")
        with pytest.raises(FitError, match="metric"):
            client.fit(SAMPLE, metric="no_such")
        with pytest.raises(ModelError, match="alpha = 2e\\+09 is outside its range"):
            client.evaluate("ggx", {"alpha": 2e9}, theta_i_deg=0, theta_o_deg=0, phi_o_deg=0)
        with pytest.raises(ServiceError) as missing:
            client.status("none")
        assert missing.value.status == 404 and missing.value.request_id
