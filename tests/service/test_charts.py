"""Charts as a client sees them; what fits and charts have in common is tested with fits."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

from tests.service.fake_worker import FAILS, Service, service
from tests.service.test_http_events import events_of
from tests.service.test_http_resources import is_problem

TRUTH = {"model": "ggx", "params": {"alpha": 0.3}}


@pytest.fixture(scope="module")
def running(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Service]:
    with service(tmp_path_factory.mktemp("data")) as found:
        yield found


def test_a_chart_goes_from_the_queue_to_its_files(running: Service) -> None:
    id = running.upload()
    sent = {"measurement": id, "models": ["ggx"], "groups": ["fit"], "repeats": 1, "name": "mine"}
    key = {"Idempotency-Key": "one-chart"}
    answer = running.client.post("/v1/charts", json=sent, headers=key)
    assert answer.status_code == 202
    chart = answer.json()
    path = f"/v1/charts/{chart['id']}"
    assert answer.headers["location"] == path
    assert chart["request"] == {
        **sent,
        "truth": None,
        "metric": "auto",
        "tolerance": 0.02,
        "seed": 0,
        "max_theta_deg": None,
    }
    again = running.client.post("/v1/charts", json=sent, headers=key)
    assert (again.status_code, again.json()["id"]) == (200, chart["id"])
    events = events_of(running.client.get(f"{path}/events").text)
    assert [d["state"] for _, kind, d in events if kind == "state"] == ["queued", "running", "done"]
    assert [d["stage"] for _, kind, d in events if kind == "progress"] == ["chart"]
    done = running.wait(chart["id"], path="/v1/charts")
    assert (done["answer"], done["finding"], done["name"]) == ("take ggx", "it is fast", "mine")
    assert done["result"] == {"schema": 1, "best": "ggx"} and done["problem"] is None
    assert [a["href"] for a in done["artefacts"]] == [
        f"{path}/artefacts/chart.json",
        f"{path}/artefacts/chart.png",
    ]
    for artefact in done["artefacts"]:
        got = running.client.get(artefact["href"])
        assert got.headers["etag"] == f'"{artefact["sha256"]}"'
    assert running.client.get(f"{path}/artefacts.zip").content.startswith(b"PK")
    (listed,) = running.client.get(f"/v1/charts?measurement={id}&state=done").json()["items"]
    assert {**listed, "result": done["result"]} == done
    # Neither is the other.
    assert running.client.get(f"/v1/fits?measurement={id}").json()["items"] == []
    is_problem(running.client.get(f"/v1/fits/{chart['id']}"), 404, "not-found")
    is_problem(running.client.get(f"/v1/charts/{running.fit()}"), 404, "not-found")
    assert running.client.delete(path).status_code == 204
    is_problem(running.client.get(path), 404, "not-found")


def test_a_chart_of_a_truth_needs_no_measurement(running: Service) -> None:
    made = running.client.post("/v1/charts", json={"truth": TRUTH}).json()
    assert made["measurement"] is None
    assert made["request"]["truth"] == {
        **TRUTH,
        "options": {},
        "geometry": "in-plane",
        "noise": [0.02, 0.001],
        "seed": 0,
    }
    assert running.wait(made["id"], path="/v1/charts")["state"] == "done"
    failing = running.client.post("/v1/charts", json={"truth": TRUTH, "name": FAILS}).json()
    failed = running.wait(failing["id"], "failed", "/v1/charts")
    assert failed["problem"]["detail"] == "it has no lobe" and failed["answer"] is None


def test_a_chart_is_cancelled_and_quick_fits_go_first(running: Service) -> None:
    running.worker.held.set()
    try:
        one, two = (
            running.client.post("/v1/charts", json={"truth": TRUTH, "seed": k}).json()["id"]
            for k in range(2)
        )
        running.wait(one, "running", "/v1/charts")
        fit = running.fit(seed=9)
        assert running.client.get(f"/v1/fits/{fit}").json()["position"] == 1
        assert running.client.get(f"/v1/charts/{two}").json()["position"] == 2
        for id in (one, two):
            assert running.client.delete(f"/v1/charts/{id}").status_code == 202
            running.wait(id, "cancelled", "/v1/charts")
        kept = running.client.delete(f"/v1/charts/{two}?keep=true")
        assert "the chart is cancelled" in is_problem(kept, 409, "conflict")["detail"]
    finally:
        running.worker.held.clear()
    running.wait(fit)


@pytest.mark.parametrize(
    ("body", "slug", "pointers"),
    [
        ({}, "invalid-request", ["/measurement", "/truth"]),
        ({"measurement": 1, "truth": TRUTH}, "invalid-request", ["/measurement", "/truth"]),
        ({"measurement": None, "truth": None}, "invalid-request", ["/measurement", "/truth"]),
        ({"truth": TRUTH, "max_theta_deg": 60}, "invalid-request", ["/max_theta_deg"]),
        ({"truth": TRUTH, "groups": ["speed"]}, "invalid-request", ["/groups/0"]),
        ({"truth": TRUTH, "repeats": 51}, "invalid-request", ["/repeats"]),
        ({"truth": {**TRUTH, "noise": [1]}}, "invalid-request", ["/truth/noise/1"]),
        ({"truth": {**TRUTH, "options": {"x": "y"}}}, "invalid-request", ["/truth/options/x"]),
        (
            {"truth": {"model": "x"}, "models": ["y"]},
            "unknown-model",
            ["/models/0", "/truth/model"],
        ),
    ],
)
def test_what_is_wrong_in_a_chart_is_pointed_at(
    running: Service, body: dict[str, Any], slug: str, pointers: list[str]
) -> None:
    if body.get("measurement"):
        body = {**body, "measurement": running.upload()}
    document = is_problem(running.client.post("/v1/charts", json=body), 422, slug)
    assert [e["pointer"] for e in document["errors"]] == pointers


def test_a_chart_of_an_unknown_measurement_is_not_found(running: Service) -> None:
    answer = running.client.post("/v1/charts", json={"measurement": "0" * 64})
    assert is_problem(answer, 404, "not-found")["errors"][0]["pointer"] == "/measurement"
