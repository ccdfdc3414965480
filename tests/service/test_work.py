"""What jobs do: one small fit, and all that can be asked about it."""

from __future__ import annotations

import base64
import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import OpenEXR
import pytest

from lobefit.fitting import read_measurement, simulate, write_measurement
from lobefit.kernels import evaluate, models
from lobefit.kernels.errors import LobefitError
from lobefit.service.claim import Claim
from lobefit.service.jobs import Queue, identity
from lobefit.service.rows import JobRow, NotFound
from lobefit.service.store import Store
from lobefit.service.task import Refused, Stopped, Task, problem_of
from lobefit.service.work import KINDS, work_of
from lobefit.service.work import fit as work_fit
from lobefit.service.work.warm import warm


@dataclass
class Bench:
    """A store, and a queue of which jobs are done at once."""

    store: Store
    queue: Queue

    def task(self, kind: str, request: dict[str, Any]) -> tuple[Claim, Task]:
        self.store.submit(kind, request)
        claim = self.queue.claim()
        assert claim is not None
        return claim, Task(self.store, claim)

    def do(self, kind: str, request: dict[str, Any]) -> JobRow:
        claim, task = self.task(kind, request)
        try:
            outcome = work_of(kind)(task)
        except (LobefitError, Refused) as error:
            claim.fail(problem_of(error) or {})
        else:
            claim.finish(outcome.result, outcome.made)
        return self.store.job(claim.job.id)

    def ask(self, kind: str, request: dict[str, Any]) -> Any:
        job = self.do(kind, request)
        assert job.state == "done", job.problem
        body, media_type = self.store.answer(job)
        return json.loads(body) if media_type == "application/json" else (body, media_type)

    def refused(self, kind: str, request: dict[str, Any]) -> dict[str, Any]:
        job = self.do(kind, request)
        assert job.state == "failed" and job.problem is not None
        return job.problem

    def keep(self, path: Path, name: str) -> str:
        with self.store.upload() as upload:
            upload.write(path.read_bytes())
            upload.finish()
            return self.store.adopt(upload, name, {})[0].id


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Bench]:
    store = Store(tmp_path_factory.mktemp("work") / "data")
    queue = Queue(store, identity("test"), list(KINDS))
    with pytest.MonkeyPatch.context() as patch:
        # Drawing takes longer than all the rest, and is tested with the figures.
        patch.setattr(work_fit, "write_figure", lambda path, report: path.write_bytes(b"png"))
        yield Bench(store, queue)
    queue.close()
    store.close()


@pytest.fixture(scope="module")
def measured(bench: Bench, tmp_path_factory: pytest.TempPathFactory) -> str:
    path = tmp_path_factory.mktemp("csv") / "x.csv"
    surface = simulate(
        "ggx",
        {"k_d": [0.1, 0.2, 0.3], "alpha": 0.3},
        geometry="in-plane incidences=0,30,60 step=5",
        noise=(0.02, 0.001),
        seed=1,
    )
    write_measurement(surface, path)
    return bench.keep(path, "lab's file.csv")


@pytest.fixture(scope="module")
def fit(bench: Bench, measured: str) -> JobRow:
    return bench.do("fit", {"measurement": measured, "models": ["lambert", "ggx"]})


def document(bench: Bench, id: str, name: str = "report.json") -> Any:
    return json.loads(bench.store.artefact_path(id, name).read_text(encoding="utf-8"))


def test_a_fit_has_its_report_samples_and_pictures(bench: Bench, fit: JobRow) -> None:
    assert fit.state == "done" and fit.result is not None
    assert fit.result["best"] == "ggx" and fit.result["converged"] is None
    kinds = {a.name: a.media_type for a in bench.store.artefacts(fit.id)}
    assert kinds == {
        "albedo.exr": "image/x-exr",
        "fit.png": "image/png",
        "lobes.exr": "image/x-exr",
        "report.json": "application/json",
        "samples.csv": "text/csv",
    }
    report = document(bench, fit.id)
    assert report["measurement"]["file"] == "lab's file.csv"
    assert report["measurement"]["sha256"] == fit.request["measurement"]
    assert [r["candidate"] for r in report["results"]] == ["ggx", "lambert"]


def test_an_angle_above_which_rows_do_not_count(bench: Bench, measured: str) -> None:
    job = bench.do("fit", {"measurement": measured, "models": ["lambert"], "max_theta_deg": 45})
    report = document(bench, job.id)
    assert report["settings"]["max_theta_deg"] == 45
    assert report["measurement"]["theta_i_deg"][1] == pytest.approx(30.0)


def test_a_stopped_fit_keeps_the_candidates_it_has(bench: Bench, measured: str) -> None:
    request = {"measurement": measured, "models": ["lambert", "ggx", "ward:isotropic"]}
    claim, task = bench.task("fit", request)
    tell = task.tell

    def stop_at_second(progress: dict[str, Any]) -> None:
        if progress["done"] == 1:
            task.stop("cancel")
        tell(progress)

    task.tell = stop_at_second  # type: ignore[method-assign]
    outcome = work_of("fit")(task)
    assert outcome.result is not None and task.noticed
    claim.stop(outcome.result)
    job = bench.store.job(claim.job.id)
    assert (job.state, (job.result or {})["best"]) == ("cancelled", "ggx")
    report = document(bench, job.id)
    assert [f["candidate"] for f in report["failed"]] == ["ward:isotropic"]
    assert "stopped" in report["failed"][0]["reason"]
    assert {a.name for a in bench.store.artefacts(job.id)} == {"report.json", "samples.csv"}


def test_a_posterior_that_was_ended_goes_on(bench: Bench, measured: str) -> None:
    """Cancelled it leaves its chain; given back the next attempt goes on from there."""
    request = {
        "measurement": measured,
        "models": ["lambert"],
        "posterior": {"steps": 500, "noise": "fixed", "ensembles": 2},
        "seed": 3,
    }

    def ended(claim: Claim, task: Task, reason: str) -> None:
        tell = task.tell

        def stop_later(progress: dict[str, Any]) -> None:
            if progress["stage"] == "posterior" and progress["done"] > 100:
                task.stop(reason)
            tell(progress)

        task.tell = stop_later  # type: ignore[method-assign]
        work_of("fit")(task)
        assert task.noticed

    claim, task = bench.task("fit", request)
    ended(claim, task, "cancel")
    claim.stop()
    path = bench.store.artefact_path(claim.job.id, "chain.h5")
    with h5py.File(path) as file:
        steps = file["chain"].shape[0]
    assert 100 < steps < 500

    claim, task = bench.task("fit", request)
    ended(claim, task, "shutdown")
    claim.give_back()
    again = bench.queue.claim()
    assert again is not None and again.job.id == claim.job.id
    second = Task(bench.store, again)
    told: list[dict[str, Any]] = []
    second.tell = lambda progress: told.append(progress)  # type: ignore[method-assign]
    outcome = work_of("fit")(second)
    again.finish(outcome.result, outcome.made)
    again.tidy()
    steps = [p["done"] for p in told if p["stage"] == "posterior"]
    assert min(steps[1:]) > 100  # the first is told before the chain is read
    job = bench.store.job(again.job.id)
    names = {a.name for a in bench.store.artefacts(job.id)}
    assert {"posterior.nc", "posterior.json", "corner.png", "trace.png"} <= names
    assert "chain.h5" not in names
    assert document(bench, job.id, "posterior.json")["ensembles"] == 2
    assert isinstance((job.result or {})["converged"], bool)


def test_a_posterior_of_what_was_not_fitted_is_refused(bench: Bench, measured: str) -> None:
    request = {"measurement": measured, "models": ["lambert"], "posterior": {"model": "ggx"}}
    job = bench.do("fit", request)
    assert job.state == "failed" and (job.problem or {})["slug"] == "invalid-request"
    assert "report.json" in {a.name for a in bench.store.artefacts(job.id)}


def test_an_upload_is_inspected_under_its_own_name(bench: Bench, measured: str) -> None:
    data = bench.store.data_path(measured).read_bytes()
    with bench.store.upload() as upload:
        upload.write(data)
        upload.finish()
        found = bench.ask("inspect", {"upload": upload.path.name, "name": "mine.csv"})
    assert found["summary"]["file"] == "mine.csv"
    assert [c["name"] for c in found["summary"]["channels"]] == ["R", "G", "B"]
    assert found["summary"]["incidences"] == 3
    assert {c["name"] for c in found["checks"]["checks"]} >= {"reciprocity", "saturation"}
    assert isinstance(found["warnings"], list)
    same = bench.ask("inspect", {"measurement": measured, "checks": False})
    assert same["summary"]["sha256"] == measured and same["checks"] is None


def test_a_bad_upload_is_refused_with_its_place(bench: Bench) -> None:
    with bench.store.upload() as upload:
        upload.write(b"theta_i,phi_i,theta_o,phi_o,brdf\n0,0,10,0,0.1\n0,0,20,0,oops\n")
        upload.finish()
        problem = bench.refused("inspect", {"upload": upload.path.name, "name": "bad.csv"})
    assert problem["slug"] == "invalid-measurement"
    assert (problem["file"], problem["row"], problem["column"]) == ("bad.csv", 3, "brdf")
    assert problem["text"] == "oops"
    gone = bench.refused("inspect", {"upload": "upload-gone", "name": "x"})
    assert gone["slug"] == "not-found"


def test_a_table_is_thinned(bench: Bench, measured: str) -> None:
    whole = bench.ask("table", {"measurement": measured, "max_points": 20_000})
    assert whole["total"] == len(whole["theta_i_deg"]) == len(whole["values"][2])
    assert max(whole["theta_i_deg"]) == pytest.approx(60.0) and whole["sigma"] is None
    few = bench.ask("table", {"measurement": measured, "max_points": 10})
    assert len(few["phi_o_deg"]) <= 10 and few["total"] == whole["total"]


def test_the_catalogue_has_every_model(bench: Bench) -> None:
    items = bench.ask("catalogue", {})["items"]
    assert {item["name"] for item in items} == set(models())
    ggx = next(item for item in items if item["name"] == "ggx")
    alpha = next(p for p in ggx["parameters"] if p["name"] == "alpha")
    assert alpha["low"] < alpha["default"] < alpha["high"]
    assert "ggx:k_s=1" in ggx["variants"] and "fresnel" in ggx["options"]


def test_a_model_is_evaluated_at_directions_and_on_a_grid(bench: Bench) -> None:
    params: dict[str, Any] = {"k_d": [0.1, 0.2, 0.3], "alpha": 0.3}
    angles = {"theta_i_deg": [30], "phi_i_deg": [0], "theta_o_deg": [40], "phi_o_deg": [180]}
    request = {"model": "ggx", "params": params, "directions": angles, "precision": "double"}
    found = bench.ask("evaluate", request)
    expected = evaluate("ggx", params, *(np.deg2rad(angles[k]) for k in angles), precision="double")
    assert found["channels"] == ["R", "G", "B"] and found["shape"] == [1]
    assert np.array_equal(found["values"], expected)
    grid = {"theta_i_deg": [0, 30], "theta_o_deg": [0, 40, 60], "phi_o_deg": [0, 180]}
    flat = bench.ask("evaluate", {"model": "ggx", "params": params, "grid": grid})
    assert flat["shape"] == [2, 3, 2]
    cube = np.reshape(flat["values"], (3, 2, 3, 2))
    assert cube[:, 1, 1, 1] == pytest.approx(expected[:, 0], rel=1e-6)
    body, media_type = bench.ask(
        "evaluate", {"model": "ggx", "params": params, "grid": grid, "format": "exr"}
    )
    assert media_type == "image/x-exr"
    picture = bench.store.files.tmp / "picture.exr"
    picture.write_bytes(body)
    with OpenEXR.File(str(picture), separate_channels=True) as file:
        assert file.channels()["G"].pixels.shape == (6, 2)
        assert file.channels()["G"].pixels[4, 1] == pytest.approx(cube[1, 1, 1, 1], rel=1e-6)
    picture.unlink()


def test_what_a_model_has_not_is_refused(bench: Bench) -> None:
    angles = {"theta_i_deg": [0], "phi_i_deg": [0], "theta_o_deg": [0], "phi_o_deg": [0]}
    problem = bench.refused(
        "evaluate", {"model": "ggx", "params": {"beta": 1}, "directions": angles}
    )
    assert problem["slug"] == "invalid-model" and "beta" in problem["detail"]
    for geometry in ("in-plane step=0.00001", "in-plane step=0.001", "sideways"):
        problem = bench.refused("simulate", {"model": "lambert", "geometry": geometry})
        assert problem["slug"] == "invalid-request"


def test_a_simulated_csv_can_be_read(bench: Bench, tmp_path: Path) -> None:
    request = {"model": "lambert", "params": {"k_d": [0.5, 0.4, 0.3]}, "noise": [0, 0], "seed": 1}
    body, media_type = bench.ask("simulate", request)
    assert media_type == "text/csv"
    path = tmp_path / "s.csv"
    path.write_bytes(body)
    m = read_measurement(path)
    assert m.values[:, 0] == pytest.approx(np.array([0.5, 0.4, 0.3]) / np.pi, rel=1e-6)


def test_curves_stand_beside_the_measurement(bench: Bench, fit: JobRow) -> None:
    found = bench.ask("curves", {"fit": fit.id, "model": None})
    assert found["model"] == "ggx" and found["channels"] == ["R", "G", "B"]
    by_incidence = {c["theta_i_deg"]: c for c in found["curves"]}
    curve = by_incidence[60.0]
    assert curve["plane"] and curve["theta_o_deg"] == sorted(curve["theta_o_deg"])
    fitted, measured_ = np.array(curve["fitted"]), np.array(curve["measured"])
    assert fitted == pytest.approx(measured_, rel=0.15, abs=0.01)
    # The highlight stands on the positive side.
    assert curve["theta_o_deg"][int(np.argmax(fitted[0]))] > 40.0
    assert len(found["residuals"]["relative"][0]) == len(found["residuals"]["theta_o_deg"])
    other = bench.ask("curves", {"fit": fit.id, "model": "lambert"})
    assert np.ptp(np.array(other["curves"][0]["fitted"][0])) < 1e-6
    assert bench.refused("curves", {"fit": fit.id, "model": "ward"})["slug"] == "unknown-model"
    assert bench.refused("curves", {"fit": "gone", "model": None})["slug"] == "not-found"


def test_a_sphere_is_a_table_without_holes(bench: Bench, fit: JobRow) -> None:
    found = bench.ask("sphere", {"fit": fit.id, "model": "ggx"})
    shape = found["shape"]
    assert shape == [1, 64, 24, 19, 3] and found["channels"] == ["R", "G", "B"]
    values = np.frombuffer(base64.b64decode(found["values"]), "<f4").reshape(shape)
    assert np.isfinite(values).all() and (values >= 0.0).all()
    # theta_h = 0, phi_d = 0 is the mirror direction at theta_d.
    k, params = 8, document(bench, fit.id)["results"][0]["params"]
    theta = np.deg2rad([found["theta_d_deg"][k]])
    mirror = evaluate("ggx", params, theta, [0.0], theta, [np.pi])
    assert values[0, 0, k, 0] == pytest.approx(mirror[:, 0], rel=1e-4)
    # theta_d = 0 looks back along the light, from theta_h.
    theta = np.deg2rad([found["theta_h_deg"][30]])
    back = evaluate("ggx", params, theta, [0.0], theta, [0.0])
    assert values[0, 30, 0, 5] == pytest.approx(back[:, 0], rel=1e-4)


def test_work_that_is_told_to_end_raises(bench: Bench) -> None:
    claim, task = bench.task("table", {})
    task.tell({"done": 1})
    task.stop("cancel")
    task.stop("wall")
    with pytest.raises(Stopped):
        task.tell({"done": 2})
    assert (task.reason, task.news(), task.news()) == ("cancel", {"done": 2}, None)
    claim.stop()


def test_errors_become_problems() -> None:
    assert problem_of(Refused("conflict", "no")) == {"slug": "conflict", "detail": "no"}
    assert (problem_of(NotFound("gone")) or {})["slug"] == "not-found"
    assert problem_of(KeyError("x")) is None


def test_warming_up_names_the_device() -> None:
    assert warm(("catalogue", "inspect"))
