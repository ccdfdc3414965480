"""Batches as a client sees them, and as the store keeps them."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest

from lobefit.service.jobs import Queue, identity
from lobefit.service.rows import InUse, Limits, NotFound, QueueFull, StoreFull
from lobefit.service.store import Store
from lobefit.service.task import Task
from lobefit.service.work.batch import perform
from tests.service.fake_worker import CSV, FAILS, Service, service
from tests.service.test_http_resources import is_problem


@pytest.fixture(scope="module")
def running(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Service]:
    limits = Limits(queue=5, queue_per_owner=4)
    with service(tmp_path_factory.mktemp("data"), limits) as found:
        yield found


def put(running: Service, items: list[dict[str, Any]], **more: Any) -> dict[str, Any]:
    answer = running.client.post("/v1/batches", json={"items": items, **more})
    assert answer.status_code == 202, answer.text
    found: dict[str, Any] = answer.json()
    assert answer.headers["location"] == f"/v1/batches/{found['id']}"
    return found


def fits_of(running: Service, batch: str) -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = running.client.get(f"/v1/fits?batch={batch}").json()["items"]
    return found


def test_a_batch_goes_from_the_queue_to_its_table(running: Service) -> None:
    id = running.upload()
    alone = running.fit(seed=1)
    items: list[dict[str, Any]] = [
        {"measurement": id, "name": "one"},
        {"measurement": id, "name": FAILS, "models": ["ggx"], "posterior": {"steps": 500}},
        {"measurement": id, "seed": 3, "tolerance": None},
    ]
    made = put(running, items, name="three", models=["lambert"], tolerance=0.1)
    assert (made["name"], made["total"], made["ended"]) == ("three", 3, None)
    assert made["state"] in ("queued", "running", "done")
    batch = running.wait(made["id"], path="/v1/batches")
    assert batch["counts"] == {"queued": 0, "running": 0, "done": 2, "failed": 1, "cancelled": 0}
    assert batch["ended"].endswith("Z") and batch["seconds_left"] is None

    last, second, first = fits_of(running, made["id"])  # the newest first
    assert [f["name"] for f in (first, second, last)] == ["one", FAILS, None]
    assert (second["state"], second["problem"]["detail"]) == ("failed", "it has no lobe")
    assert {f["batch"] for f in (first, second, last)} == {made["id"]}
    assert running.wait(alone)["batch"] is None
    # What an item does not say is the batch's, and what that does not say is the usual.
    told = {key: [f["request"][key] for f in (first, second, last)] for key in first["request"]}
    assert told["models"] == [["lambert"], ["ggx"], ["lambert"]]
    assert told["tolerance"] == [0.1, 0.1, None]
    assert told["seed"] == [0, 0, 3] and told["metric"] == ["auto"] * 3
    assert told["posterior"][1]["ensembles"] == 4

    for name, kind in (("table.csv", "text/csv"), ("summary.png", "image/png")):
        file = running.client.get(f"/v1/batches/{made['id']}/{name}")
        assert file.headers["content-type"].startswith(kind) and file.content == CSV
    newest, *_ = running.client.get("/v1/batches?limit=1").json()["items"]
    assert newest == batch

    assert running.client.delete(f"/v1/fits/{first['id']}").status_code == 204
    left = running.client.get(f"/v1/batches/{made['id']}").json()
    assert (left["total"], left["counts"]["done"], left["state"]) == (2, 1, "done")
    kept = running.client.delete(f"/v1/batches/{made['id']}?keep=true")
    assert "nothing to cancel" in is_problem(kept, 409, "conflict")["detail"]
    assert running.client.delete(f"/v1/batches/{made['id']}").status_code == 204
    for path in ("", "/table.csv", "/parameters.csv", "/summary.png"):
        answer = running.client.get(f"/v1/batches/{made['id']}{path}")
        is_problem(answer, 404, "not-found")
    assert fits_of(running, made["id"]) == []
    is_problem(running.client.get(f"/v1/fits/{last['id']}"), 404, "not-found")
    assert running.client.get(f"/v1/measurements/{id}").status_code == 200


def test_a_batch_is_cancelled_as_a_whole(running: Service) -> None:
    running.worker.held.set()
    try:
        made = put(running, [{"measurement": running.upload()}] * 3)
        waiting = running.wait(made["id"], "running", "/v1/batches")
        assert waiting["counts"]["running"] == 1 and waiting["counts"]["queued"] == 2
        places = [f["position"] for f in fits_of(running, made["id"])]
        assert places == [2, 1, None]
        answer = running.client.delete(f"/v1/batches/{made['id']}")
        assert answer.status_code == 202
        ended = running.wait(made["id"], "cancelled", "/v1/batches")
        assert ended["counts"]["cancelled"] == 3, str(ended)
        assert ended["ended"] is not None
        assert {f["state"] for f in fits_of(running, made["id"])} == {"cancelled"}
    finally:
        running.worker.held.clear()


def test_all_items_are_queued_or_none_is(running: Service) -> None:
    id = running.upload()
    running.worker.held.set()
    try:
        before = put(running, [{"measurement": id}] * 3)
        running.wait(before["id"], "running", "/v1/batches")
        batches = running.client.get("/v1/batches").json()
        full = running.client.post("/v1/batches", json={"items": [{"measurement": id}] * 3})
        assert "wait already" in is_problem(full, 503, "queue-full")["detail"]
        assert full.headers["retry-after"]
        assert running.store.depth("fit") == 2
        assert running.client.get("/v1/batches").json() == batches
    finally:
        running.worker.held.clear()
    running.wait(before["id"], path="/v1/batches")
    many = running.client.post("/v1/batches", json={"items": [{"measurement": id}] * 5})
    (error,) = is_problem(many, 422, "invalid-request")["errors"]
    assert error["pointer"] == "/items" and "4 fits are the most" in error["detail"]


@pytest.mark.parametrize(
    ("change", "slug", "pointers"),
    [
        ({"items": []}, "invalid-request", ["/items"]),
        ({"items": [{}]}, "invalid-request", ["/items/0/measurement"]),
        ({"measurement": "0" * 64}, "invalid-request", ["/measurement"]),
        ({"models": ["x"]}, "unknown-model", ["/models/0"]),
        ({"options": {"fresnel": "x"}}, "invalid-request", ["/options/fresnel"]),
        (
            {"items": [{"models": ["ggx", "x"]}, {"posterior": {"model": "y"}}]},
            "unknown-model",
            ["/items/0/models/1", "/items/1/posterior/model"],
        ),
        (
            {"items": [{}, {"options": {"x": "y"}}]},
            "invalid-request",
            ["/items/1/options/x"],
        ),
        (
            {"items": [{}, {"measurement": "0" * 64}, {"measurement": "1" * 64}]},
            "not-found",
            ["/items/1/measurement", "/items/2/measurement"],
        ),
    ],
)
def test_what_is_wrong_in_a_batch_is_pointed_at(
    running: Service, change: dict[str, Any], slug: str, pointers: list[str]
) -> None:
    id = running.upload()
    body = {"items": [{}], **change}
    if pointers != ["/items/0/measurement"]:
        body["items"] = [{"measurement": id, **item} for item in body["items"]]
    answer = running.client.post("/v1/batches", json=body)
    document = is_problem(answer, 404 if slug == "not-found" else 422, slug)
    assert [e["pointer"] for e in document["errors"]] == pointers


def test_an_idempotency_key_makes_one_batch(running: Service) -> None:
    body = {"items": [{"measurement": running.upload()}]}
    key = {"Idempotency-Key": "a-batch"}
    first = running.client.post("/v1/batches", json=body, headers=key)
    again = running.client.post("/v1/batches", json=body, headers=key)
    assert (first.status_code, again.status_code) == (202, 200)
    assert first.json()["id"] == again.json()["id"]
    changed = running.client.post("/v1/batches", json={**body, "name": "x"}, headers=key)
    is_problem(changed, 409, "conflict")
    fit = running.client.post("/v1/fits", json=body["items"][0], headers=key)
    is_problem(fit, 409, "conflict")


def test_the_store_keeps_batches_whole(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    store = Store(tmp_path, Limits(queue=4))
    with store.upload() as upload:
        upload.write(b"x")
        upload.finish()
        there = store.adopt(upload, "x.csv", {})[0].id

    def requests(*ids: str) -> list[dict[str, Any]]:
        return [{"measurement": id} for id in ids]

    assert store.missing({there, "no"}) == {"no"}
    with pytest.raises(NotFound):
        store.submit_batch(None, requests(there, "no"))
    with pytest.raises(QueueFull, match="0 of at most 4"):
        store.submit_batch(None, requests(*[there] * 5))
    with monkeypatch.context() as patch:
        patch.setattr(type(store.files), "free", lambda self: (1000, 1 << 30))
        with pytest.raises(StoreFull):
            store.submit_batch(None, requests(there))
    assert store.batches(9) == ([], None) and store.depth("fit") == 0

    one, _ = store.submit_batch("a", requests(there, there), key="k")
    two, _ = store.submit_batch("b", requests(there))
    page, cursor = store.batches(1)
    assert [b.id for b in page + store.batches(9, cursor)[0]] == [two.id, one.id]
    single, _ = store.submit("fit", {})
    # A fit of somebody else goes before the later items of a batch.
    places = [store.position(job.id) for job in store.batch_jobs(one.id)]
    assert places[0] == 1 and places[1] == 4 and store.position(single.id) == 3
    with pytest.raises(InUse):
        store.delete_batch(one.id)
    cancelled = store.cancel_batch(one.id)
    assert cancelled.counts["cancelled"] == 2 and cancelled.cancelled and cancelled.ended
    for job in store.batch_jobs(one.id):
        assert [e.data["state"] for e in store.events(job.id, 0)] == ["queued", "cancelled"]
        store.delete_job(job.id)
    assert store.batch(one.id).ended is not None
    store.delete_batch(one.id)
    store.cancel(store.batch_jobs(two.id)[0].id)
    assert not store.cancel_batch(two.id).cancelled  # its fit had ended before
    for forget in (store.batch, store.cancel_batch, store.delete_batch):
        with pytest.raises(NotFound):
            forget(one.id)
    again, new = store.submit_batch("a", requests(there), key="k")  # the key went with it
    assert new and again.id != one.id
    store.close()


def test_a_fit_that_is_deleted_meanwhile_is_in_no_table(tmp_path: Path) -> None:
    store = Store(tmp_path)
    batch, _ = store.submit_batch("a", [{"measurement": None, "name": name} for name in "bc"])
    queue = Queue(store, identity("w"), ["fit"])
    claim = queue.claim()
    assert claim is not None
    claim.finish({"best": "ggx"})  # as if its files were gone by now
    store.cancel_batch(batch.id)
    request = {"batch": batch.id, "file": "table.csv"}
    task = SimpleNamespace(store=store, request=request, folder=tmp_path)
    perform(cast("Task", task))
    _, *rows = (tmp_path / "table.csv").read_text(encoding="utf-8").splitlines()
    assert [row.split(",")[0] for row in rows] == ["c"]
    assert rows[0].endswith("cancelled before its end")
    queue.close()
    store.close()
