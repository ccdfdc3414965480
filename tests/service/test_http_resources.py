"""Measurements, fits and artefacts as a client sees them."""

from __future__ import annotations

import gzip
import hashlib
import io
import json
import zipfile
from collections.abc import Iterator
from typing import Any

import pytest

from tests.service.fake_worker import CSV, Service, service


@pytest.fixture(scope="module")
def running(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Service]:
    with service(tmp_path_factory.mktemp("data")) as found:
        yield found


def other(text: str) -> bytes:
    """Content that no other test uploads."""
    return CSV + f"31,0,{len(text)},180,0.1\n# {text}\n".encode()


def is_problem(answer: Any, status: int, slug: str) -> dict[str, Any]:
    assert answer.status_code == status, answer.text
    assert answer.headers["content-type"] == "application/problem+json"
    document: dict[str, Any] = answer.json()
    assert document["type"] == f"/problems/{slug}"
    assert document["status"] == status
    assert document["instance"] == answer.headers["x-request-id"]
    assert document["title"]
    assert document["detail"]
    return document


def test_the_same_content_is_one_measurement_however_it_is_sent(running: Service) -> None:
    data = other("one content")
    first = running.client.post(
        "/v1/measurements?name=../../etc/copper.csv",
        content=data,
        headers={"Content-Type": "text/csv"},
    )
    assert first.status_code == 201
    found = first.json()
    assert found["id"] == hashlib.sha256(data).hexdigest()
    assert found["name"] == "copper.csv"
    assert found["bytes"] == len(data)
    assert found["created"].endswith("Z")
    assert first.headers["location"] == f"/v1/measurements/{found['id']}"
    packed = gzip.compress(data)
    for body, headers in (
        (data, {"Content-Type": "text/csv"}),
        (packed, {"Content-Type": "application/gzip"}),
        (packed, {"Content-Type": "application/octet-stream"}),
        (packed, {"Content-Type": "text/csv", "Content-Encoding": "gzip"}),
        (gzip.compress(packed), {"Content-Type": "application/gzip", "Content-Encoding": "gzip"}),
        (gzip.compress(data[:9]) + gzip.compress(data[9:]), {"Content-Type": "application/gzip"}),
    ):
        again = running.client.post("/v1/measurements", content=body, headers=headers)
        assert (again.status_code, again.json()) == (200, found)
    form = running.client.post("/v1/measurements", files={"file": ("b.csv", data)})
    assert (form.status_code, form.json()) == (200, found)
    assert running.client.get(f"/v1/measurements/{found['id']}").json() == found


def test_what_is_wrong_in_a_csv_is_told_with_its_place(running: Service) -> None:
    answer = running.client.post(
        "/v1/measurements?name=bad.csv", content=b"nonsense\n", headers={"Content-Type": "text/csv"}
    )
    document = is_problem(answer, 422, "invalid-measurement")
    assert (document["file"], document["row"], document["column"]) == ("bad.csv", 1, "theta_i")
    assert document["text"] == "nonsense\n"
    assert "theta_o" in document["expected"]
    assert list(running.store.files.tmp.iterdir()) == []


@pytest.mark.parametrize(
    ("body", "said"),
    [
        (b"", "empty"),
        (gzip.compress(CSV, mtime=0)[:-9], "ends too early"),
        (gzip.compress(CSV, mtime=0)[:20] + b"xxxxxxxxxxxxxxxxxxxxxx", "damaged"),
        (gzip.compress(b"", mtime=0), "empty"),
    ],
)
def test_a_body_that_is_no_file_is_refused(running: Service, body: bytes, said: str) -> None:
    answer = running.client.post(
        "/v1/measurements", content=body, headers={"Content-Type": "application/gzip"}
    )
    assert said in is_problem(answer, 422, "invalid-measurement")["detail"]


def test_types_of_bodies_that_are_not_read(running: Service) -> None:
    for headers in ({}, {"Content-Type": "application/x-www-form-urlencoded"}):
        answer = running.client.post("/v1/measurements", content=CSV, headers=headers)
        is_problem(answer, 415, "unsupported-media-type")
    answer = running.client.post("/v1/fits", content=b"{}", headers={"Content-Type": "text/plain"})
    is_problem(answer, 415, "unsupported-media-type")
    answer = running.client.post("/v1/measurements", files={"other": ("a.csv", CSV)})
    assert "file" in is_problem(answer, 400, "malformed-form")["detail"]


def test_lists_are_paged(running: Service) -> None:
    ids = [running.upload(other(f"page {k}")) for k in range(5)]
    seen: list[str] = []
    page = running.client.get("/v1/measurements?limit=2").json()
    while True:
        seen += [m["id"] for m in page["items"]]
        if page["next"] is None:
            break
        page = running.client.get(f"/v1/measurements?limit=2&cursor={page['next']}").json()
    assert [s for s in seen if s in ids] == ids[::-1]
    assert len(seen) == len(set(seen))
    answer = running.client.get("/v1/measurements?limit=0")
    assert is_problem(answer, 422, "invalid-request")["errors"][0]["parameter"] == "limit"


def test_a_fit_goes_from_the_queue_to_its_report(running: Service) -> None:
    sent = {"measurement": running.upload(), "models": ["ggx", "ggx:k_s=1", "ggx+lambert"]}
    answer = running.client.post("/v1/fits", json=sent)
    assert answer.status_code == 202
    fit = answer.json()
    assert answer.headers["location"] == f"/v1/fits/{fit['id']}"
    assert fit["request"] == {
        **sent,
        "metric": "auto",
        "options": {},
        "tolerance": None,
        "max_theta_deg": None,
        "posterior": None,
        "seed": 0,
        "name": None,
    }
    assert fit["batch"] is None
    done = running.wait(fit["id"])
    assert done["best"] == "ggx"
    assert done["result"] == {"schema": 1, "best": "ggx"}
    assert done["posterior"] is None
    assert [a["name"] for a in done["artefacts"]] == ["fit.png", "report.json"]
    listed = running.client.get(f"/v1/fits?measurement={sent['measurement']}&state=done").json()
    without = {k: v for k, v in done.items() if k not in ("result", "posterior")}
    assert {**listed["items"][0], "result": None} | without == {**done, "result": None}
    for kind in ("curves", "sphere"):
        made = running.client.get(f"/v1/fits/{fit['id']}/{kind}?model=ggx")
        assert made.json()["kind"] == kind


def test_an_idempotency_key_makes_one_fit(running: Service) -> None:
    body = {"measurement": running.upload(), "seed": 3}
    key = {"Idempotency-Key": "only-once"}
    first = running.client.post("/v1/fits", json=body, headers=key)
    again = running.client.post("/v1/fits", json=body, headers=key)
    assert (first.status_code, again.status_code) == (202, 200)
    assert first.json()["id"] == again.json()["id"]
    answer = running.client.post("/v1/fits", json={**body, "seed": 4}, headers=key)
    is_problem(answer, 409, "conflict")


@pytest.mark.parametrize(
    ("change", "slug", "pointer", "said"),
    [
        ({"models": ["ggx", "gggx"]}, "unknown-model", "/models/1", "did you mean 'ggx'"),
        ({"models": ["ggx:k_s=2"]}, "unknown-model", "/models/0", "ggx:k_s=1"),
        ({"models": ["ggx+x"]}, "unknown-model", "/models/0", "known are ggx, lambert"),
        ({"posterior": {"model": "x"}}, "unknown-model", "/posterior/model", "known are"),
        ({"options": {"colour": "red"}}, "invalid-request", "/options/colour", "fresnel, masking"),
        ({"options": {"fresnel": "f8"}}, "invalid-request", "/options/fresnel", "f82, schlick"),
        ({"models": []}, "invalid-request", "/models", "at least 1"),
        ({"models": ["ggx", 3]}, "invalid-request", "/models/1", "string"),
        ({"metric": "best"}, "invalid-request", "/metric", "'relative'"),
        ({"posterior": {"steps": 5}}, "invalid-request", "/posterior/steps", "100"),
        ({"a/b~c": 1}, "invalid-request", "/a~1b~0c", "Extra"),
        ({"measurement": "../etc/passwd"}, "invalid-request", "/measurement", "match"),
        ({"tolerance": -1}, "invalid-request", "/tolerance", "greater"),
        ({"seed": 1.5}, "invalid-request", "/seed", "integer"),
    ],
)
def test_what_is_wrong_in_a_body_is_pointed_at(
    running: Service, change: dict[str, Any], slug: str, pointer: str, said: str
) -> None:
    body = {"measurement": running.upload(), **change}
    document = is_problem(running.client.post("/v1/fits", json=body), 422, slug)
    assert [e["pointer"] for e in document["errors"]] == [pointer]
    assert said in document["errors"][0]["detail"]


def test_an_unknown_measurement_is_not_found(running: Service) -> None:
    answer = running.client.post("/v1/fits", json={"measurement": "0" * 64})
    assert is_problem(answer, 404, "not-found")["errors"][0]["pointer"] == "/measurement"


def test_a_running_fit_is_cancelled_and_an_ended_one_deleted(running: Service) -> None:
    running.worker.held.set()
    try:
        id = running.fit(seed=11)
        running.wait(id, "running")
        used = running.client.delete(f"/v1/measurements/{running.upload()}")
        assert "cancel" in is_problem(used, 409, "conflict")["detail"]
        answer = running.client.delete(f"/v1/fits/{id}")
        assert (answer.status_code, answer.json()["id"]) == (202, id)
        running.wait(id, "cancelled")
        kept = running.client.delete(f"/v1/fits/{id}", params={"keep": True})
        assert "nothing to cancel" in is_problem(kept, 409, "conflict")["detail"]
        assert running.client.delete(f"/v1/fits/{id}").status_code == 204
        is_problem(running.client.get(f"/v1/fits/{id}"), 404, "not-found")
    finally:
        running.worker.held.clear()


def test_a_measurement_is_deleted_with_its_data(running: Service) -> None:
    id = running.upload(other("to be deleted"))
    assert running.client.get(f"/v1/measurements/{id}/data").content == other("to be deleted")
    assert running.client.delete(f"/v1/measurements/{id}").status_code == 204
    for path in ("", "/data", "/table"):
        is_problem(running.client.get(f"/v1/measurements/{id}{path}"), 404, "not-found")
    is_problem(running.client.delete(f"/v1/measurements/{id}"), 404, "not-found")


@pytest.mark.parametrize("id", ["x", "..%2F..", "%00", "a b", "%ff%fe", "é", "a" * 190])
def test_ids_that_were_never_given_out(running: Service, id: str) -> None:
    for path in (f"/v1/fits/{id}", f"/v1/fits/{id}/artefacts.zip", f"/v1/measurements/{id}/data"):
        is_problem(running.client.get(path), 404, "not-found")


def test_artefacts_have_etags_and_ranges(running: Service) -> None:
    id = running.fit(seed=5)
    listed = {a["name"]: a for a in running.wait(id)["artefacts"]}
    href = listed["fit.png"]["href"]
    whole = running.client.get(href)
    picture = bytes(range(256)) * 40
    assert whole.content == picture
    assert whole.headers["content-type"] == "image/png"
    etag = whole.headers["etag"]
    assert etag == f'"{hashlib.sha256(picture).hexdigest()}"'
    for given in (etag, f'"x", {etag}', "*", f"W/{etag}"):
        same = running.client.get(href, headers={"If-None-Match": given})
        assert (same.status_code, same.content, same.headers["etag"]) == (304, b"", etag)
    for asked, start, end in (
        ("bytes=0-9", 0, 10),
        ("bytes=10000-", 10000, 10240),
        ("bytes=-5", 10235, 10240),
        ("bytes=10239-99999", 10239, 10240),
        ("bytes=-99999", 0, 10240),
    ):
        part = running.client.get(href, headers={"Range": asked, "If-Range": etag})
        assert part.status_code == 206
        assert part.content == picture[start:end]
        assert part.headers["content-range"] == f"bytes {start}-{end - 1}/10240"
    for asked in ("bytes=0-1,5-6", "bytes=9-5", "lines=1-2", "bytes=", "bytes=a-b"):
        assert running.client.get(href, headers={"Range": asked}).content == picture
    changed = running.client.get(href, headers={"Range": "bytes=0-9", "If-Range": '"other"'})
    assert changed.content == picture
    for asked in ("bytes=10240-", "bytes=99999-100000", "bytes=-0"):
        answer = running.client.get(href, headers={"Range": asked})
        is_problem(answer, 416, "range-not-satisfiable")
        assert answer.headers["content-range"] == "bytes */10240"
    head = running.client.head(href)
    assert (head.content, head.headers["content-length"]) == (b"", "10240")
    is_problem(running.client.get(f"/v1/fits/{id}/artefacts/chain.h5"), 404, "not-found")
    is_problem(running.client.get(f"/v1/fits/{id}/artefacts/..%2Freport.json"), 404, "not-found")


def test_the_zip_has_all_artefacts(running: Service) -> None:
    id = running.fit(seed=6)
    running.wait(id)
    answer = running.client.get(f"/v1/fits/{id}/artefacts.zip")
    assert answer.headers["content-disposition"] == f'attachment; filename="lobefit-{id}.zip"'
    with zipfile.ZipFile(io.BytesIO(answer.content)) as archive:
        assert archive.testzip() is None
        assert archive.namelist() == ["fit.png", "report.json"]
        assert json.loads(archive.read("report.json"))["best"] == "ggx"
    assert running.client.get(f"/v1/fits/{id}/artefacts.zip").content == answer.content


def test_models_are_listed_evaluated_and_simulated(running: Service) -> None:
    items = running.client.get("/v1/models").json()["items"]
    assert [m["name"] for m in items] == ["ggx", "lambert"]
    assert running.client.get("/v1/models/ggx").json() == items[0]
    is_problem(running.client.get("/v1/models/phon"), 404, "not-found")
    grid = {"theta_i_deg": [0], "theta_o_deg": [0, 10], "phi_o_deg": [0]}
    answer = running.client.post("/v1/evaluate", json={"model": "ggx", "grid": grid})
    assert answer.json()["asked"]["grid"] == grid
    answer = running.client.post("/v1/simulate", json={"model": "lambert"})
    assert answer.headers["content-type"].startswith("text/csv")
    assert answer.content == CSV
    for path in ("/v1/evaluate", "/v1/simulate"):
        unknown = {"model": "nope", **({"grid": grid} if path == "/v1/evaluate" else {})}
        is_problem(running.client.post(path, json=unknown), 422, "unknown-model")
    for body in (
        {"model": "ggx"},
        {"model": "ggx", "grid": grid, "directions": {}},
        {"model": "ggx", "grid": {**grid, "theta_o_deg": [95]}},
        {"model": "ggx", "grid": {**grid, "theta_i_deg": [0] * 400, "theta_o_deg": [0] * 400}},
        {"model": "ggx", "grid": grid, "params": {"alpha": []}},
    ):
        is_problem(running.client.post("/v1/evaluate", json=body), 422, "invalid-request")
