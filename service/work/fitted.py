"""A fit that was made earlier: its candidates, and the samples it used."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lobefit.fitting import Measurement, read_measurement
from lobefit.kernels import evaluate, get_model
from lobefit.service.rows import NotFound
from lobefit.service.store import Store
from lobefit.service.task import Refused

__all__ = ["Fitted", "fitted", "numbers", "samples"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Fitted:
    """A candidate of a report."""

    candidate: str
    model: str
    options: dict[str, str]
    params: dict[str, float | list[float]]
    channels: tuple[str, ...]

    @property
    def isotropic(self) -> bool:
        """Whether only the difference of the azimuths counts."""
        tied = self.candidate.endswith(":isotropic")
        return tied or get_model(self.model, self.options).isotropic

    def predict(
        self, theta_i: ArrayLike, phi_i: ArrayLike, theta_o: ArrayLike, phi_o: ArrayLike
    ) -> Array:
        """Evaluate at directions in radians, shape (C, N) in 1/sr."""
        values = evaluate(
            self.model, self.params, theta_i, phi_i, theta_o, phi_o, options=self.options
        )
        return np.broadcast_to(values, (len(self.channels), values.shape[1]))


def fitted(store: Store, id: str, name: str | None) -> Fitted:
    """Give a candidate of a fit, the best one where no name is given.

    Raises
    ------
    NotFound
        There is no such fit.
    Refused
        It has no report, or no such candidate.
    """
    store.job(id)
    try:
        text = store.artefact_path(id, "report.json").read_text(encoding="utf-8")
    except (NotFound, OSError):
        raise Refused("conflict", "the fit has no report; look at its state") from None
    report = json.loads(text)
    found: dict[str, Any] = {r["candidate"]: r for r in report["results"]}
    wanted = report["best"] if name is None else name
    if wanted not in found:
        raise Refused("unknown-model", f"{wanted} was not fitted; these were: {', '.join(found)}")
    r = found[wanted]
    return Fitted(wanted, r["model"], r["options"], r["params"], tuple(r["channels"]))


def samples(store: Store, id: str) -> Measurement:
    """Give the measurement as the fit used it."""
    return read_measurement(store.artefact_path(id, "samples.csv"))


def numbers(values: ArrayLike, digits: int = 7) -> list[Any]:
    """Turn an array into lists; None for what is not finite."""
    array = np.asarray(values, dtype=np.float64)
    if array.ndim > 1:
        return [numbers(row, digits) for row in array]
    form = f"%.{digits}g"
    return [float(form % v) if np.isfinite(v) else None for v in array.tolist()]
