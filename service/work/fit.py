"""A fit: the point fit and its report first, then the posterior, then the pictures."""

from __future__ import annotations

import json
import math
import shutil
import time
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from lobefit.fitting import FitReport, FitResult, Measurement, fit, sample
from lobefit.fitting.albedo_picture import write_albedo
from lobefit.fitting.artefacts import write_json, write_together
from lobefit.fitting.figure import write_figure
from lobefit.fitting.lobes import write_lobes
from lobefit.fitting.posterior import Posterior
from lobefit.fitting.writers import write_measurement
from lobefit.kernels.errors import FitError
from lobefit.service.task import Outcome, Refused, Stopped, Task
from lobefit.service.work.files import made_of
from lobefit.service.work.measured import wanted_measurement

if TYPE_CHECKING:
    from lobefit.fitting.sampler import SamplingProgress

__all__ = ["perform"]

CHAIN = "chain.h5"


def perform(task: Task) -> Outcome:
    """Fit, sample where that was asked for, and write everything there is to see of it.

    A job that is to end gives what is finished by then: the candidates fitted, the chain.
    """
    wanted = task.request
    measurement, digest = wanted_measurement(task)
    told = _Teller(task)
    report = fit(
        measurement,
        models=wanted.get("models", "standard"),
        metric=wanted.get("metric", "auto"),
        options=wanted.get("options") or {},
        tolerance=wanted.get("tolerance"),
        progress=told.candidate,
        stop=task.stopped,
    )
    added: dict[str, Any] = {"sha256": digest}
    if wanted.get("max_theta_deg") is not None:
        added["max_theta_deg"] = wanted["max_theta_deg"]
    report = replace(report, settings={**report.settings, **added})
    result: dict[str, Any] = {
        "best": report.best.candidate,
        "verdict": report.verdict,
        "converged": None,
    }
    _write_report(task, report)
    try:
        told.stage("files", 0, 1, "pictures of the fit")
        _give(
            task,
            {
                "fit.png": lambda path: write_figure(path, report),
                "lobes.exr": lambda path: write_lobes(path, report.best, measurement),
                "albedo.exr": lambda path: write_albedo(path, [report.best]),
            },
        )
        if wanted.get("posterior") is not None:
            posterior = _sampled(task, told, report, measurement)
            result["converged"] = posterior.converged
            told.stage("files", 0, 1, "pictures of the posterior")
            paths = posterior.save(task.folder)
            task.publish(made_of(path) for path in paths.values())
    except Stopped:
        _keep_chain(task)
    return Outcome(result)


def _write_report(task: Task, report: FitReport) -> None:
    """Give out report and samples; what comes after takes longer than the fit itself."""
    _give(
        task,
        {
            "samples.csv": lambda path: write_measurement(report.measurement, path),
            "report.json": lambda path: write_json(path, report.to_dict()),
        },
    )


def _sampled(task: Task, told: _Teller, report: FitReport, measurement: Measurement) -> Posterior:
    """Sample the posterior, on from where an attempt before was ended."""
    wanted = task.request["posterior"]
    result = _chosen(report, wanted.get("model"))
    chain = task.folder / CHAIN
    earlier = task.earlier(CHAIN)
    if earlier is not None:
        # A copy: a worker that lost the job, and does not know it yet, may still write there.
        shutil.copyfile(earlier, chain)
    settings: dict[str, Any] = {
        "seed": task.request.get("seed", 0),
        "walkers": wanted.get("walkers"),
        "ensembles": wanted.get("ensembles", 4),
        "max_steps": wanted.get("steps", 10_000),
        "noise": wanted.get("noise", "auto"),
        "student": wanted.get("student", False),
        "saturation": wanted.get("saturation"),
        "floor": wanted.get("floor"),
        "progress": told.sampling,
    }
    told.stage("posterior", 0, settings["max_steps"], result.candidate)
    try:
        posterior = sample(result, measurement, file=chain, **settings)
    except FitError as error:
        if earlier is None or "chain" not in str(error):
            raise
        # The file was cut off in the middle of a write: begin anew.
        chain.unlink(missing_ok=True)
        posterior = sample(result, measurement, file=chain, **settings)
    chain.unlink(missing_ok=True)
    return posterior


def _chosen(report: FitReport, name: str | None) -> FitResult:
    if name is None:
        return report.best
    try:
        return report[name]
    except KeyError:
        fitted = ", ".join(r.candidate for r in report.results)
        raise Refused(
            "invalid-request", f"the posterior of {name} was asked for; fitted were: {fitted}"
        ) from None


def _keep_chain(task: Task) -> None:
    """Give out the chain of a run that was ended, without the room it did not need."""
    chain = task.folder / CHAIN
    if task.reason == "shutdown" or not chain.exists():
        return
    import h5py

    from lobefit.fitting.chain_file import ChainFile

    with h5py.File(chain, "r") as file:
        settings = json.loads(file.attrs["settings"])
        _, walkers, size = file["chain"].shape
    kept = ChainFile(chain, settings, walkers, size, 0)
    if kept.iteration:
        kept.trim()
        task.publish([made_of(chain)])
    else:
        chain.unlink()


def _give(task: Task, makers: dict[str, Any]) -> None:
    """Write files and give them out."""
    write_together(task.folder, makers)
    task.publish(made_of(task.folder / name) for name in makers)


class _Teller:
    """Turns what fit and sample tell into the progress that people see."""

    def __init__(self, task: Task) -> None:
        self._task, self._began = task, time.monotonic()

    def stage(self, stage: str, done: int, total: int, label: str, **more: float | None) -> None:
        """Tell a stage; raises `Stopped` where the job is to end."""
        self._task.tell(
            {
                "stage": stage,
                "done": done,
                "total": total,
                "label": label,
                "evaluations": None,
                "tau": None,
                "acceptance": None,
                "ess": None,
                "seconds": round(time.monotonic() - self._began, 3),
                "seconds_left": None,
                **more,
            }
        )

    def candidate(self, done: int, total: int, label: str) -> None:
        """Tell the candidate that is being fitted; `fit` asks by itself whether to end."""
        seconds = time.monotonic() - self._began
        left = round(seconds / done * (total - done), 1) if done else None
        try:
            self.stage("fit", done, total, label, seconds_left=left)
        except Stopped:
            return

    def sampling(self, state: SamplingProgress) -> None:
        """Tell where the sampler stands; raises `Stopped` where it is to end."""
        self.stage(
            "posterior",
            state.steps,
            state.max_steps,
            "sampling",
            tau=_finite(state.tau),
            acceptance=_finite(state.acceptance),
            ess=_finite(state.ess),
            seconds_left=_finite(state.seconds_left),
        )


def _finite(value: float) -> float | None:
    return round(float(value), 4) if math.isfinite(value) else None
