"""What came out of a fit of many texels."""

from __future__ import annotations

import enum
import os
from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["Reason", "Status", "TexelFit"]

Numbers = NDArray[np.float32]


class Status(enum.IntFlag):
    """Flags of a texel."""

    CONVERGED = 1
    """The minimum was reached."""
    ON_BOUND = 2
    """A parameter is on a bound, where its standard error is NaN."""
    POLISHED = 4
    """NLopt was needed."""
    GAPS = 8
    """Readings were missing."""
    FAILED = 16
    """There is no result; `Reason` says why."""


class Reason(enum.IntEnum):
    """Why a texel has no result."""

    NONE = 0
    TOO_FEW = 1
    """Fewer readings than parameters and one more."""
    CONSTANT = 2
    """All readings are the same number, as of a masked or saturated pixel."""
    HUGE = 3
    """A reading is infinite or beyond what single precision can square."""
    DARK = 4
    """No reading is above zero."""
    NOT_FINITE = 5
    """Every model ended in numbers that are none."""
    CRASHED = 6
    """The process that worked on it died every time, or its chunk raised an error."""


@dataclass(frozen=True, eq=False)
class TexelFit:
    """Fits of T texels of C channels.

    Attributes
    ----------
    models : tuple of str
        Candidates.
    channels : int
        C.
    model : ndarray of int, shape (T,)
        Which of `models` was chosen: the simplest within the margin of the best BIC; -1 where
        the fit failed.
    params, errors : dict of str to ndarray, shape (T,) or (T, C)
        Free parameters and their first-order standard errors, from the Gauss-Newton matrix and
        the scatter of the residuals. NaN where the chosen model does not have the parameter or
        the fit failed; an error also where the parameter is on its bound or undetermined.
    rmse : ndarray, shape (T,)
        Root mean square residual of all readings, 1/sr.
    scatter : ndarray, shape (T,)
        Root of the reduced chi-square: the relative noise for noise="relative", the noise in
        1/sr for noise="constant", times the stated noise otherwise.
    bic : ndarray, shape (T, M)
        Of each candidate; NaN where it failed.
    status, reason : ndarray of uint8, shape (T,)
        `Status` flags and `Reason`.
    held : dict of str to dict
        For each candidate the parameters that are not free: a value, or the name of the
        parameter that they follow.
    seconds : dict of str to float
        Time by stage, of all candidates.
    settings : dict
        How the fit was made.
    """

    models: tuple[str, ...]
    channels: int
    model: NDArray[np.int16]
    params: Mapping[str, Numbers]
    errors: Mapping[str, Numbers]
    rmse: Numbers
    scatter: Numbers
    bic: Numbers
    status: NDArray[np.uint8]
    reason: NDArray[np.uint8]
    held: Mapping[str, Mapping[str, float | str]]
    seconds: dict[str, float]
    settings: Mapping[str, Any] = field(default_factory=dict)

    def __len__(self) -> int:
        """Count the texels."""
        return len(self.model)

    def has(self, flag: Status) -> NDArray[np.bool_]:
        """Tell which texels have a flag."""
        found: NDArray[np.bool_] = (self.status & np.uint8(flag)) != 0
        return found

    @property
    def counts(self) -> dict[str, int]:
        """How many texels have each flag, each reason of failure, and each model."""
        found = {flag.name or "": int(self.has(flag).sum()) for flag in Status}
        found["UNCONVERGED"] = int((~self.has(Status.CONVERGED | Status.FAILED)).sum())
        reasons = Counter(self.reason[self.reason > 0].tolist())
        found |= {f"FAILED: {Reason(r).name}": n for r, n in sorted(reasons.items())}
        chosen = Counter(self.model[self.model >= 0].tolist())
        return {k.lower(): n for k, n in found.items()} | {
            self.models[m]: n for m, n in sorted(chosen.items())
        }

    @property
    def failures(self) -> list[tuple[int, str]]:
        """Texels without a result, and why."""
        return [
            (int(k), Reason(int(self.reason[k])).name.lower().replace("_", " "))
            for k in np.flatnonzero(self.reason)
        ]

    def texel(self, index: int) -> dict[str, Any]:
        """Give one texel: its model, all parameters that `lobefit.kernels.evaluate` takes, errors.

        Parameters
        ----------
        index : int
            Which; in an image ``row * width + column``.
        """
        chosen = int(self.model[index])
        if chosen < 0:
            return {"model": None, "reason": Reason(int(self.reason[index])).name.lower()}
        name = self.models[chosen]
        held = self.held[name]
        params: dict[str, Any] = {
            key: rows[index].tolist()
            for key, rows in self.params.items()
            if np.isfinite(rows[index]).all()
        }
        params |= {key: v for key, v in held.items() if not isinstance(v, str)}
        params |= {key: params[leader] for key, leader in held.items() if isinstance(leader, str)}
        return {
            "model": name,
            "params": params,
            "errors": {k: self.errors[k][index].tolist() for k in self.errors if k in params},
            "rmse": float(self.rmse[index]),
            "status": Status(int(self.status[index])),
        }

    def save_exr(self, path: str | os.PathLike[str], height: int, width: int) -> None:
        """Write maps: `lobefit.fitting.texel_files.save_exr`."""
        from lobefit.fitting.texel_files import save_exr

        save_exr(self, path, height, width)

    def save_npz(self, path: str | os.PathLike[str]) -> None:
        """Write all arrays: `lobefit.fitting.texel_files.save_npz`."""
        from lobefit.fitting.texel_files import save_npz

        save_npz(self, path)

    @staticmethod
    def join(parts: Sequence[TexelFit]) -> TexelFit:
        """Put chunks of one fit together, in order."""
        first = parts[0]
        if len(parts) == 1:
            return first
        seconds: dict[str, float] = defaultdict(float)
        for part in parts:
            seconds.update(part.seconds)

        def all_of(name: str) -> Any:
            return np.concatenate([getattr(part, name) for part in parts])

        def by_name(name: str) -> dict[str, Numbers]:
            return {
                key: np.concatenate([getattr(part, name)[key] for part in parts])
                for key in getattr(first, name)
            }

        return TexelFit(
            models=first.models,
            channels=first.channels,
            model=all_of("model"),
            params=by_name("params"),
            errors=by_name("errors"),
            rmse=all_of("rmse"),
            scatter=all_of("scatter"),
            bic=all_of("bic"),
            status=all_of("status"),
            reason=all_of("reason"),
            held=first.held,
            seconds=dict(seconds),
            settings=first.settings,
        )
