"""Fused weighted sums of a model over a measurement: chi-square and normal equations.

Nothing per direction is written out: a launch takes many sets of parameters and
returns a handful of sums for each set and channel.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from lobefit.kernels.device import opencl_errors
from lobefit.kernels.errors import ModelError
from lobefit.kernels.geometry import Directions
from lobefit.kernels.program import ModelProgram

__all__ = ["Metric", "Observations", "Sums", "chi_square", "normal_equations", "transform"]

Metric = Literal["identity", "log", "cube_root", "cosine_log"]
METRICS: dict[str, int] = {"identity": 0, "log": 1, "cube_root": 2, "cosine_log": 3}

Array = NDArray[np.float64]


def transform(values: Array, metric: Metric, cos_theta_i: Array | None = None) -> Array:
    """Apply the transform in which residuals are taken.

    Parameters
    ----------
    values : ndarray
        BRDF values; for "log" positive ones, for "cosine_log" above -1/cos_theta_i.
    metric : {"identity", "log", "cube_root", "cosine_log"}
        The transform; "cosine_log" is ln(1 + f cos_theta_i) of Low et al. 2012.
    cos_theta_i : ndarray, optional
        Cosines of incidence of the values; "cosine_log" needs them.
    """
    if metric == "log":
        return np.log(values)
    if metric == "cosine_log":
        if cos_theta_i is None:
            raise ModelError("the metric cosine_log needs the cosines of incidence")
        return np.log1p(values * cos_theta_i)
    return np.cbrt(values) if metric == "cube_root" else values


class Observations:
    """Values and weights of a measurement on the device, beside its directions.

    Parameters
    ----------
    directions : Directions
        N directions.
    values : ndarray, shape (C, N)
        BRDF per channel; not finite means missing.
    weights : ndarray, shape (C, N)
        Weight of each squared residual; missing and invisible ones become 0.
    metric : {"identity", "log", "cube_root", "cosine_log"}
        Residuals are taken between the transforms of value and model. With
        "log" values that are not positive get no weight, with "cosine_log"
        those that are not above -1/cos_theta_i.

    Attributes
    ----------
    used : ndarray of bool, shape (C, N)
        Which values count.
    """

    def __init__(
        self,
        directions: Directions,
        values: Array,
        weights: Array,
        metric: Metric = "identity",
    ) -> None:
        import pyopencl as cl

        if metric not in METRICS:
            raise ModelError(f"metric is one of {', '.join(METRICS)}, not {metric!r}")
        self.directions = directions
        self.metric: Metric = metric
        self.channels = len(values)
        self.used = np.isfinite(values) & directions.visible
        cosines = None
        if metric == "log":
            self.used &= values > 0.0
        elif metric == "cosine_log":
            cosines = directions.plane("cos_theta_i")
            self.used &= values * cosines > -1.0
        # A model value this small ends the logarithm's domain: far below any datum.
        smallest = np.min(np.abs(values), where=self.used & (values != 0.0), initial=1.0)
        self.tiny = float(1e-6 * smallest + 1e-30)
        flags = cl.mem_flags
        size = self.channels * directions.padded * directions.dtype.itemsize
        with opencl_errors("uploading a measurement"):
            self.values = cl.Buffer(directions.device.context, flags.READ_ONLY, size)
            self.weights = cl.Buffer(directions.device.context, flags.READ_ONLY, size)
        if metric == "identity":
            self._upload(self.values, values)
        else:
            usable = np.where(self.used, values, 1.0)
            self._upload(self.values, transform(usable, metric, cosines))
        self.set_weights(weights)

    def _upload(self, buffer: Any, rows: Array) -> None:
        import pyopencl as cl

        d = self.directions
        padded = np.zeros((self.channels, d.padded), dtype=d.dtype)
        np.copyto(padded[:, : d.count], rows, where=self.used, casting="same_kind")
        with opencl_errors("uploading a measurement"):
            cl.enqueue_copy(d.device.queue, buffer, padded)

    def set_weights(self, weights: Array) -> None:
        """Replace the weights, shape (C, N)."""
        self._upload(self.weights, weights)

    def release(self) -> None:
        """Free the device's memory; the directions stay."""
        self.values.release()
        self.weights.release()


@dataclass(frozen=True, slots=True)
class Sums:
    """Weighted sums for P sets and C channels over M columns.

    With r the residual and J the columns: ``chi_square`` (P, C) = sum w r^2,
    ``rhs`` (P, C, M) = sum w J r, ``gram`` (P, C, M, M) = sum w J J^T. The
    columns are the basis functions, followed by `ModelProgram.derivatives`
    where asked for, each times the slope of the metric's transform.
    """

    chi_square: Array
    rhs: Array
    gram: Array


def _launch(
    program: ModelProgram,
    observations: Observations,
    x: Array,
    coefficients: Array,
    steps: Array | None,
    centres: Array | None = None,
    *,
    gram: bool,
) -> Array:
    """Run the kernel; returns raw sums, shape (P, C, n_sums)."""
    import pyopencl as cl

    d = observations.directions
    device = d.device
    derivatives = steps is not None
    sets, channels = len(x), observations.channels
    if coefficients.shape != (sets, channels, program.n_basis):
        raise ModelError(
            f"coefficients have shape {coefficients.shape}, not {(sets, channels, program.n_basis)}"
        )
    columns = program.n_basis + (len(program.derivatives) if derivatives else 0)
    n_sums = 1 + (columns + columns * (columns + 1) // 2 if gram else 0)
    kernel = device.kernel(
        program.sums_source(
            metric=METRICS[observations.metric],
            gram=gram,
            derivatives=derivatives,
            strided=not device.is_cpu,
            channel_x=x.ndim == 3,
        ),
        "weighted_sums",
        d.options,
    )
    out = np.empty((sets, d.n_chunks, channels, n_sums))
    # One small upload: x, centres, steps, coefficients behind one another.
    parts = (x, x if centres is None else centres, x if steps is None else steps, coefficients)
    packed = np.concatenate([p.ravel() for p in parts]).astype(d.dtype)
    flags = cl.mem_flags
    with opencl_errors(f"summing {program.model.name}"):
        small = cl.Buffer(device.context, flags.READ_ONLY | flags.COPY_HOST_PTR, hostbuf=packed)
        result = cl.Buffer(device.context, flags.WRITE_ONLY, out.nbytes)
        kernel(
            device.queue,
            (d.n_chunks, sets),
            (1, 1) if device.is_cpu else None,
            d.planes,
            np.int32(d.n_vectors),
            observations.values,
            observations.weights,
            np.int32(channels),
            small,
            d.dtype.type(observations.tiny),
            np.int32(d.n_chunks),
            np.int32(d.blocks_per_chunk),
            result,
        )
        cl.enqueue_copy(device.queue, out, result)
        small.release()
        result.release()
    total: Array = out.sum(axis=1)
    return total


def chi_square(
    program: ModelProgram, observations: Observations, x: Array, coefficients: Array
) -> Array:
    """Sum the weighted squared residuals.

    Parameters
    ----------
    program : ModelProgram
        The model.
    observations : Observations
        The measurement.
    x : ndarray, shape (P, n_x) or (P, C, n_x)
        Nonlinear parameters of P sets, for all channels or for each.
    coefficients : ndarray, shape (P, C, n_basis)
        Their coefficients per channel.

    Returns
    -------
    ndarray, shape (P, C)
        In units of the weights times the transformed values squared.
    """
    return _launch(program, observations, x, coefficients, None, gram=False)[:, :, 0]


def normal_equations(
    program: ModelProgram,
    observations: Observations,
    x: Array,
    coefficients: Array | None = None,
    steps: Array | None = None,
    centres: Array | None = None,
) -> Sums:
    """Sum the normal equations around given coefficients.

    Parameters
    ----------
    program, observations, x
        As for `chi_square`.
    coefficients : ndarray, shape (P, C, n_basis), optional
        Where the residuals are taken; 0 where left out, so that ``rhs`` is
        the right-hand side of the linear problem and ``chi_square`` is sum w y^2.
    steps : ndarray, shaped as x, optional
        Half widths of the central differences; with them the derivatives along
        the nonlinear parameters follow the basis columns; 0 where not a step is
        taken, and the derivative 0.
    centres : ndarray, shaped as x, optional
        Where the differences are centred, each parameter by itself; x where left out.
        Beside a bound they must not leave the formula's domain.

    Returns
    -------
    Sums
    """
    if coefficients is None:
        coefficients = np.zeros((len(x), observations.channels, program.n_basis))
    raw = _launch(program, observations, x, coefficients, steps, centres, gram=True)
    columns = program.n_basis + (len(program.derivatives) if steps is not None else 0)
    upper = _upper(columns)
    gram = np.zeros((*raw.shape[:2], columns, columns))
    gram[:, :, upper[0], upper[1]] = raw[:, :, 1 + columns :]
    gram[:, :, upper[1], upper[0]] = raw[:, :, 1 + columns :]
    return Sums(raw[:, :, 0], raw[:, :, 1 : 1 + columns], gram)


@cache
def _upper(columns: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Give rows and columns of the upper triangle; a fit asks a thousand times."""
    rows, across = np.triu_indices(columns)
    return rows, across
