"""Charts and batches of a service as people start it, asked for without a client of ours."""

from __future__ import annotations

import csv
import io
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx2
import pytest

from lobefit.fitting.batch_table import ITEM_COLUMNS, PARAMETER_COLUMNS
from lobefit.fitting.tradeoff import Chart
from tests.service.test_http_events import events_of

SAMPLE = Path(__file__).parents[2] / "samples" / "noisy_few_angles.csv"
TRUTH = {
    "model": "lambert",
    "params": {"k_d": 0.3},
    "geometry": "in-plane incidences=0,30,60 step=10",
}


@pytest.fixture(scope="module")
def http(service_url: str) -> Iterator[httpx2.Client]:
    with httpx2.Client(base_url=service_url, timeout=60.0) as client:
        yield client


def upload(http: httpx2.Client, data: bytes, name: str) -> str:
    answer = http.post(
        "/v1/measurements",
        params={"name": name},
        content=data,
        headers={"Content-Type": "text/csv"},
    )
    found: str = answer.raise_for_status().json()["id"]
    return found


def post(http: httpx2.Client, path: str, body: dict[str, Any]) -> str:
    answer = http.post(path, json=body)
    assert answer.status_code == 202, answer.text
    found: str = answer.headers["location"]
    return found


def wait(http: httpx2.Client, path: str, *states: str) -> dict[str, Any]:
    end = time.monotonic() + 120.0
    while True:
        found: dict[str, Any] = http.get(path).raise_for_status().json()
        if found["state"] in states:
            return found
        assert time.monotonic() < end, found
        time.sleep(0.02)


def table(http: httpx2.Client, path: str) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(http.get(path).raise_for_status().text)))


def test_a_batch_of_which_one_fails(http: httpx2.Client) -> None:
    sample = upload(http, SAMPLE.read_bytes(), SAMPLE.name)
    items = [
        {"measurement": sample, "name": "first"},
        {"measurement": sample, "max_theta_deg": 1e-3},
        {"measurement": sample, "models": ["lambert", "ggx"], "name": "both"},
    ]
    path = post(http, "/v1/batches", {"items": items, "models": ["lambert"], "name": "three"})
    batch = wait(http, path, "done")
    assert (batch["total"], batch["counts"]["done"], batch["counts"]["failed"]) == (3, 2, 1)
    fits = http.get("/v1/fits", params={"batch": batch["id"]}).json()["items"][::-1]

    rows = table(http, f"{path}/table.csv")
    assert list(rows[0]) == list(ITEM_COLUMNS)
    assert [r["name"] for r in rows] == ["first", SAMPLE.name, "both"]
    assert [r["status"] for r in rows] == ["fitted", "failed", "fitted"]
    assert [r["model"] for r in rows] == ["lambert", "", fits[2]["best"]]
    assert rows[1]["reason"] == fits[1]["problem"]["detail"]
    assert rows[2]["candidates"] == "2" and rows[2]["verdict"] == fits[2]["verdict"]
    parameters = table(http, f"{path}/parameters.csv")
    assert list(parameters[0]) == list(PARAMETER_COLUMNS)
    report = http.get(f"/v1/fits/{fits[0]['id']}").json()["result"]
    k_d = report["results"][0]["params"]["k_d"]
    assert float(parameters[0]["value"]) == k_d and parameters[0]["parameter"] == "k_d"
    picture = http.get(f"{path}/summary.png")
    assert picture.headers["content-type"] == "image/png"
    assert picture.content.startswith(b"\x89PNG")

    assert http.delete(path).status_code == 204
    assert http.get(f"/v1/fits/{fits[0]['id']}").status_code == 404
    assert http.get(f"/v1/measurements/{sample}").status_code == 200


def test_a_chart_of_a_measurement(http: httpx2.Client) -> None:
    csv_ = http.post("/v1/simulate", json=TRUTH).content
    body = {
        "measurement": upload(http, csv_, "flat.csv"),
        "models": ["lambert", "oren_nayar"],
        "groups": ["fit"],
        "repeats": 1,
    }
    path = post(http, "/v1/charts", body)
    events = events_of(http.get(f"{path}/events").text)
    assert [d["state"] for _, kind, d in events if kind == "state"] == ["queued", "running", "done"]
    told = [d for _, kind, d in events if kind == "progress"]
    assert told and all(d["stage"] == "chart" and d["label"] for d in told)
    chart = http.get(path).json()
    assert chart["answer"] == chart["result"]["answer"]
    assert chart["finding"] == chart["result"]["finding"]
    made = Chart.from_dict(chart["result"])
    assert made.name == "flat.csv" and made.settings["subject"]["kind"] == "held out"
    assert {p.group for p in made.panels[0].points} >= {"model", "metric", "data"}
    files = {a["name"]: http.get(a["href"]).content for a in chart["artefacts"]}
    assert set(files) == {"chart.json", "chart.png"}
    assert files["chart.png"].startswith(b"\x89PNG")
    assert http.delete(path).status_code == 204


def test_a_chart_of_what_it_cannot_be_made_of(http: httpx2.Client) -> None:
    sample = upload(http, SAMPLE.read_bytes(), SAMPLE.name)
    nothing = post(http, "/v1/charts", {"measurement": sample, "max_theta_deg": 1e-3})
    problem = wait(http, nothing, "failed")["problem"]
    assert problem["type"] == "/problems/invalid-measurement"
    huge = {"truth": {**TRUTH, "geometry": "in-plane step=0.001"}}
    problem = wait(http, post(http, "/v1/charts", huge), "failed")["problem"]
    assert problem["type"] == "/problems/invalid-request" and "larger steps" in problem["detail"]


def test_a_chart_of_a_truth_is_cancelled_and_its_worker_goes_on(http: httpx2.Client) -> None:
    """Within seconds, wherever it stands: its worker does not have to be started anew."""
    path = post(http, "/v1/charts", {"truth": TRUTH, "models": ["lambert"], "repeats": 50})
    wait(http, path, "running")
    end = time.monotonic() + 60.0
    while not (progress := http.get(path).json()["progress"]) and time.monotonic() < end:
        time.sleep(0.02)
    assert progress["stage"] == "chart"
    began = time.monotonic()
    assert http.delete(path).status_code == 202
    cancelled = wait(http, path, "cancelled")
    assert time.monotonic() - began < 10.0  # 2 s, on a machine that does nothing else
    assert cancelled["artefacts"] == [] and cancelled["result"] is None
    sample = upload(http, SAMPLE.read_bytes(), SAMPLE.name)
    fit = wait(http, post(http, "/v1/fits", {"measurement": sample, "models": ["lambert"]}), "done")
    assert fit["attempts"] == 1
