"""A worker that answers at once, in a thread of the test: what HTTP does needs no OpenCL."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Self

from starlette.testclient import TestClient

from lobefit.service.app import create_app
from lobefit.service.claim import Claim, Made
from lobefit.service.jobs import Queue, identity
from lobefit.service.rows import WAITING, Limits
from lobefit.service.settings import Settings
from lobefit.service.store import Store
from lobefit.service.work import QUICK
from lobefit.service.work.files import MEDIA_TYPES

CSV = b"theta_i,phi_i,theta_o,phi_o,brdf\n30,0,30,180,0.31\n30,0,40,180,0.21\n"
FAILS = "fails"
"""Fits and charts of this name fail."""
MODELS = {
    "items": [
        {
            "name": "ggx",
            "title": "GGX",
            "variants": ["ggx:k_s=1", "ggx:conductor"],
            "options": {"fresnel": {"schlick": [], "f82": []}, "masking": {"smith": []}},
            "parameters": [],
        },
        {"name": "lambert", "title": "Lambert", "variants": [], "options": {}, "parameters": []},
    ]
}

AXES = ("theta_i_deg", "phi_i_deg", "theta_o_deg", "phi_o_deg")
ANSWERS: dict[str, dict[str, Any]] = {
    "table": {
        **{key: [0.0] for key in AXES},
        "channels": ["brdf"],
        "values": [[0.1]],
        "sigma": None,
        "total": 1,
    },
    "evaluate": {"channels": ["brdf"], "values": [[0.1]], "shape": [1]},
    "curves": {"model": "ggx", "channels": ["brdf"], "curves": []},
    "sphere": {},
}


class FakeWorker:
    """Claims jobs and answers them; fits and charts wait while `held` is set.

    Attributes
    ----------
    held : threading.Event
        Set: they are claimed, tell one progress, and end once it is cleared or they are cancelled.
    silent : threading.Event
        Set: nothing is claimed.
    """

    def __init__(self, store: Store) -> None:
        self.store = store
        self.held, self.silent = threading.Event(), threading.Event()
        self._end = threading.Event()
        self._threads = [
            threading.Thread(target=self._run, args=(name, kinds))
            for name, kinds in (("desk", QUICK), ("fit-1", WAITING))
        ]

    def __enter__(self) -> Self:
        for thread in self._threads:
            thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._end.set()
        for thread in self._threads:
            thread.join()

    def _run(self, name: str, kinds: tuple[str, ...]) -> None:
        queue = Queue(self.store, identity(name), kinds)
        while not self._end.is_set():
            queue.announce("a fake device", "idle", 1)
            claim = None if self.silent.is_set() else queue.claim()
            if claim is None:
                self._end.wait(0.005)
            elif claim.job.kind in WAITING:
                self._wait(claim)
            else:
                self._quick(claim)
        queue.close()

    def _quick(self, claim: Claim) -> None:
        asked = claim.job.request
        if claim.job.kind == "inspect":
            data = self.store.files.upload(asked["upload"]).read_bytes()
            if data.startswith(b"theta_i"):
                claim.finish({"summary": {"rows": 2}, "checks": None, "warnings": []})
            else:
                claim.fail(
                    {
                        "slug": "invalid-measurement",
                        "detail": "there is no column theta_i",
                        "file": asked["name"],
                        "row": 1,
                        "column": "theta_i",
                        "text": data[:10].decode("latin-1"),
                        "expected": "theta_i, phi_i, theta_o, phi_o",
                    }
                )
        elif claim.job.kind == "catalogue":
            claim.finish(MODELS)
        elif claim.job.kind in ("simulate", "batch"):
            path = claim.folder / asked.get("file", "answer.csv")
            path.write_bytes(CSV)
            kind = MEDIA_TYPES[path.suffix]
            claim.finish({"file": path.name, "media_type": kind}, [Made(path, kind)])
        else:
            claim.finish({"kind": claim.job.kind, "asked": asked, **ANSWERS[claim.job.kind]})

    def _wait(self, claim: Claim) -> None:
        kind = claim.job.kind
        claim.beat({"stage": kind, "done": 0, "total": 1, "label": "ggx"})
        while self.held.is_set() and not self._end.is_set():
            if claim.beat():
                claim.stop()
                return
            self._end.wait(0.005)
        if self._end.is_set():
            return
        if claim.job.request["name"] == FAILS:
            claim.fail({"slug": "invalid-measurement", "detail": "it has no lobe"})
        elif kind == "chart":
            claim.finish({"answer": "take ggx", "finding": "it is fast"}, _made(claim, "chart"))
        else:
            result = {"best": "ggx", "verdict": "ggx is enough.", "converged": None}
            claim.finish(result, _made(claim, "report", "fit"))


def _made(claim: Claim, document: str, shown: str = "chart") -> list[Made]:
    report = claim.folder / f"{document}.json"
    report.write_text('{"schema": 1, "best": "ggx"}\n')
    picture = claim.folder / f"{shown}.png"
    picture.write_bytes(bytes(range(256)) * 40)
    return [Made(report, "application/json"), Made(picture, "image/png")]


class Service:
    """An application with its store, its worker and a client of it."""

    def __init__(self, client: TestClient, store: Store, worker: FakeWorker) -> None:
        self.client, self.store, self.worker = client, store, worker

    def upload(self, data: bytes = CSV, **kwargs: Any) -> str:
        """Upload a measurement and give its id."""
        answer = self.client.post(
            "/v1/measurements", content=data, headers={"Content-Type": "text/csv"}, **kwargs
        )
        assert answer.status_code in (200, 201), answer.text
        found: str = answer.json()["id"]
        return found

    def fit(self, **body: Any) -> str:
        """Submit a fit and give its id."""
        answer = self.client.post("/v1/fits", json={"measurement": self.upload(), **body})
        assert answer.status_code == 202, answer.text
        found: str = answer.json()["id"]
        return found

    def wait(self, id: str, state: str = "done", path: str = "/v1/fits") -> dict[str, Any]:
        """Poll until a fit, a chart or a batch is in a state."""
        for _ in range(1000):
            found: dict[str, Any] = self.client.get(f"{path}/{id}").json()
            if found["state"] == state:
                return found
            threading.Event().wait(0.005)
        raise AssertionError(f"it is {found['state']}, not {state}")


@contextmanager
def service(folder: Path, limits: Limits | None = None, **settings: Any) -> Iterator[Service]:
    """Run an application with a fake worker."""
    store = Store(folder, limits or Limits())
    try:
        app = create_app(Settings(folder, **settings), store)
        with FakeWorker(store) as worker, TestClient(app) as client:
            yield Service(client, store, worker)
    finally:
        store.close()
