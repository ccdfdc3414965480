"""Values of a model at directions or on a grid."""

from __future__ import annotations

from typing import Any

import numpy as np

from lobefit.fitting.exr import write_exr
from lobefit.kernels import evaluate
from lobefit.service.task import Outcome, Refused, Task, answer, file_answer
from lobefit.service.work.fitted import numbers

__all__ = ["perform"]

AXES = ("theta_i_deg", "theta_o_deg", "phi_o_deg")


def perform(task: Task) -> Outcome:
    """Give values in 1/sr as JSON, or as a picture with a row per theta_i and theta_o.

    The picture's columns are phi_o; its attributes list the angles.
    """
    wanted = task.request
    grid = wanted.get("grid")
    if grid is not None:
        axes = [np.asarray(grid[name], dtype=np.float64) for name in AXES]
        shape = tuple(len(axis) for axis in axes)
        theta_i, theta_o, phi_o = (a.ravel() for a in np.meshgrid(*axes, indexing="ij"))
        degrees = [theta_i, np.zeros_like(theta_i), theta_o, phi_o]
    else:
        given = wanted["directions"]
        names = ("theta_i_deg", "phi_i_deg", "theta_o_deg", "phi_o_deg")
        degrees = [np.asarray(given[name], dtype=np.float64) for name in names]
        shape = (len(degrees[0]),)
    try:
        values = evaluate(
            wanted["model"],
            wanted.get("params") or {},
            *(np.deg2rad(a) for a in degrees),
            options=wanted.get("options") or {},
            precision=wanted.get("precision", "double"),
        )
    except ValueError as error:
        raise Refused("invalid-request", str(error)) from error
    usual = {1: ["brdf"], 3: ["R", "G", "B"]}
    channels = usual.get(len(values), [f"c{k + 1}" for k in range(len(values))])
    if wanted.get("format") == "exr":
        return _picture(task, dict(zip(channels, values, strict=True)), shape)
    found: dict[str, Any] = {
        "channels": channels,
        "values": numbers(values, 17 if wanted.get("precision") == "double" else 9),
        "shape": list(shape),
    }
    return answer(task, found)


def _picture(task: Task, values: dict[str, Any], shape: tuple[int, ...]) -> Outcome:
    grid = task.request["grid"]
    attributes = {
        f"lobefit:{name}": " ".join(f"{angle:g}" for angle in grid[name]) for name in AXES
    }
    attributes["lobefit:model"] = task.request["model"]
    attributes["lobefit:layout"] = "rows theta_i, theta_o (fastest); columns phi_o"
    planes = {name: plane.reshape(-1, shape[-1]) for name, plane in values.items()}
    path = task.folder / "values.exr"
    write_exr(path, planes, attributes)
    return file_answer(path, "image/x-exr")
