"""What a chart is about: data to fit, and other data that say how far off a fit is."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lobefit.fitting.blocks import find_blocks, signed_theta_o
from lobefit.fitting.measurement import DIRECTION_COLUMNS, Measurement
from lobefit.fitting.result import FitResult
from lobefit.fitting.scan_patterns import Hemisphere
from lobefit.fitting.selection import DARK
from lobefit.fitting.simulate import simulate
from lobefit.kernels import Device, MeasurementError, candidate
from lobefit.kernels.evaluate import Params

__all__ = ["Subject", "every", "held_out", "simulated"]

Array = NDArray[np.float64]

# Directions that a simulated truth is compared on: a grid of its own, between the usual scans'.
DENSE = Hemisphere(
    incidences_deg=(5.0, 20.0, 35.0, 50.0, 65.0, 77.0), theta_step_deg=4.0, phi_step_deg=12.0
)
# Fewer rows than this left in a scan line say nothing about a lobe.
SHORTEST = 2


@dataclass(frozen=True, kw_only=True, eq=False)
class Subject:
    """Data to fit, and what fits are scored against.

    Attributes
    ----------
    name : str
        File, or model.
    train : Measurement
        What is fitted.
    test : Measurement
        What a fit should predict.
    note : str
        How the two were made.
    settings : dict
        What is needed to make them again.
    exact : bool
        There is no noise in `test`.
    """

    name: str
    train: Measurement
    test: Measurement
    note: str
    settings: Mapping[str, Any] = field(default_factory=dict)
    exact: bool = False

    @property
    def angles(self) -> tuple[Array, Array, Array, Array]:
        """Directions that fits should predict, in radians."""
        i, pi, o, po = (getattr(self.test, name) for name in DIRECTION_COLUMNS)
        return i, pi, o, po

    @cached_property
    def _size(self) -> Array:
        """What errors are relative to, shape (C, N)."""
        size = np.abs(self.test.values)
        bright = size * np.cos(self.test.theta_i)
        dark = DARK * np.nanmedian(bright, axis=1, keepdims=True)
        return np.asarray(
            np.maximum(size, np.maximum(dark, 1e-300) / np.cos(self.test.theta_i)[None])
        )

    def error(self, predicted: Array) -> float:
        """Give the root mean square of the relative errors.

        Parameters
        ----------
        predicted : ndarray, shape (C, N)
            In 1/sr, at `angles`.

        Returns
        -------
        float
            Over all values that are there. Where f cos_theta_i is less than a twentieth of its
            channel's median, the error is relative to that.
        """
        return self._relative(predicted - self.test.values)

    def noise(self, result: FitResult) -> float | None:
        """Give the error that a perfect prediction would have, because readings are noisy.

        Parameters
        ----------
        result : FitResult
            Of `train`, for the noise that it found.

        Returns
        -------
        float or None
            None where the fit cannot tell noise from its own misfit.
        """
        if self.exact:
            return 0.0
        if result.noise.given and self.test.sigma is not None:
            return self._relative(self.test.sigma)
        if result.noise.given or result.diagnostics.misfit_limited:
            return None
        additive, relative = (
            np.array(scale)[:, None] for scale in (result.noise.additive, result.noise.relative)
        )
        return self._relative(np.hypot(additive, relative * self.test.values))

    def _relative(self, difference: Array) -> float:
        relative = difference / self._size
        return float(np.sqrt(np.nanmean(relative * relative)))


def held_out(measurement: Measurement) -> Subject:
    """Keep every second block of a measurement back, to be predicted from the others.

    Parameters
    ----------
    measurement : Measurement

    Returns
    -------
    Subject

    Raises
    ------
    MeasurementError
        There are not two blocks, or a channel has no value on one side.
    """
    blocks = find_blocks(measurement)
    out = blocks.labels % 2 == 1
    kept, left = ~out, blocks.count // 2
    for rows in (kept, out):
        if not rows.any() or np.isnan(measurement.values[:, rows]).all(axis=1).any():
            raise MeasurementError(
                "the measurement is too small to keep a part of it back for scoring",
                file=measurement.source or None,
                expected="two incidences, or ranges of theta_o, with values in every channel",
            )
    return Subject(
        name=measurement.source or str(measurement.metadata.get("material", "measurement")),
        train=replace(measurement.select(kept), source=measurement.source),
        test=measurement.select(out),
        note=(
            f"scored on {left} held-out {blocks.kind} of {blocks.count}, every second one "
            f"({blocks.note}); fitted to the others"
        ),
        settings={"kind": "held out", "blocks": blocks.kind, "count": blocks.count},
    )


def simulated(
    model: str,
    params: Params,
    *,
    geometry: str = "in-plane",
    noise: tuple[float, float] = (0.02, 1e-3),
    seed: int = 0,
    options: Mapping[str, str] | None = None,
    device: str | Device | None = None,
) -> Subject:
    """Simulate a measurement, to be scored against the surface it was made of.

    Parameters
    ----------
    model, params, geometry, noise, seed, options, device
        As for `lobefit.fitting.simulate`.

    Returns
    -------
    Subject
        Whose `test` is free of noise, on a grid over the hemisphere.
    """
    made = simulate(model, params, geometry, noise, seed, options=options, device=device)
    dense = DENSE if candidate(model, options).isotropic else DENSE.turned()
    truth = simulate(model, params, dense, (0.0, 0.0), 0, options=options, device=device)
    return Subject(
        name=model,
        train=made,
        test=truth,
        note=(
            f"simulated with {noise[0]:g} of relative and {noise[1]:g} 1/sr of additive noise, "
            f"seed {seed}; scored against the truth in {truth.n_directions:,} directions"
        ),
        exact=True,
        settings={
            "kind": "simulated",
            "model": model,
            "params": {k: v if isinstance(v, float | int) else list(v) for k, v in params.items()},
            "options": dict(options or {}),
            "geometry": geometry,
            "noise": list(noise),
            "seed": seed,
        },
    )


def every(measurement: Measurement, step: int) -> Measurement | None:
    """Keep every so many angles of view of each scan line.

    Parameters
    ----------
    measurement : Measurement
    step : int
        2 keeps every second one.

    Returns
    -------
    Measurement or None
        None where too little would be left of the lines.
    """
    m = measurement
    axis = np.rint(np.degrees(np.mod(m.phi_o - m.phi_i, np.pi)) * 10.0) % 1800
    signed = signed_theta_o(m)
    kept: list[NDArray[np.intp]] = []
    groups: Sequence[NDArray[np.intp]] = list(m.distinct_incidences().values())
    if len(groups) * SHORTEST > m.n_directions:  # scattered: no lines
        groups = [np.argsort(m.theta_i, kind="stable")]
    for k, rows in enumerate(groups):
        order = rows[np.lexsort((signed[rows], axis[rows]))]
        if len(order) < SHORTEST * step:
            return None
        kept.append(order[k % step :: step])
    return replace(m.select(np.sort(np.concatenate(kept))), source=m.source)
