"""Fused log-likelihood of many parameter sets over a measurement, in one launch.

The noise is Gaussian or Student's t with ``sigma^2 = additive^2 + (relative f)^2``, f the
model's value, or with sigmas that are given and may be scaled. Values may be censored: known
only to lie above a saturation level or below a floor.
"""

from __future__ import annotations

import math
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lobefit.kernels.device import opencl_errors
from lobefit.kernels.errors import ModelError
from lobefit.kernels.geometry import Directions
from lobefit.kernels.program import BLOCK, ModelProgram, shared_text

__all__ = ["Likelihood"]

Array = NDArray[np.float64]

# Numbers per set and channel that say what the noise is; N_NOISE in cl/likelihood.cl.
N_NOISE = 3
# A variance below this has no place in single precision's range.
LEAST_VARIANCE = {"double": 1e-300, "single": 1e-35}


class Likelihood:
    """The log-likelihood of one model for one measurement.

    Parameters
    ----------
    program : ModelProgram
        The model.
    directions : Directions
        N directions, whose precision the terms have; sums are accumulated in double.
    values : ndarray, shape (C, N)
        BRDF in 1/sr; not finite means missing. What is not visible does not count.
    sigma : ndarray, shape (C, N), optional
        Standard uncertainties in 1/sr; left out, the noise is a part of each set.
    student : bool
        Student's t instead of a Gaussian, with nu degrees of freedom and sigma as its scale.
    sides : ndarray of int, shape (C, N), optional
        0 for a value, 1 for one known only to lie above what `values` has, -1 for below.

    Attributes
    ----------
    used : ndarray of bool, shape (C, N)
        Which values count.
    counts : ndarray of int, shape (C,)
        How many values that are not censored count in each channel.
    """

    def __init__(
        self,
        program: ModelProgram,
        directions: Directions,
        values: Array,
        sigma: Array | None = None,
        *,
        student: bool = False,
        sides: NDArray[np.int_] | None = None,
    ) -> None:
        if student and sides is not None:
            raise ModelError("censored values and Student's t do not go together")
        self.program, self.directions = program, directions
        self.channels = len(values)
        self.given, self.student, self.censored = sigma is not None, student, sides is not None
        self.used = np.isfinite(values) & directions.visible
        plain = self.used if sides is None else self.used & (np.asarray(sides) == 0)
        self.counts = plain.sum(axis=1)
        # What the kernel leaves to the host: the part of -0.5 ln(2 pi sigma^2) known before.
        self.constant = np.zeros(self.channels)
        weights = np.ones(values.shape)
        if sigma is not None:
            weights = 1.0 / np.where(self.used, sigma, 1.0) ** 2
            self.constant += 0.5 * np.sum(np.log(weights), axis=1, where=plain)
        if not student:
            self.constant -= 0.5 * math.log(2.0 * math.pi) * self.counts
        self._buffers = [self._upload(values), self._upload(weights)]
        self._buffers.append(self._buffers[0] if sides is None else self._upload(sides))
        self._room = 0
        self._small: Any = None
        self._result: Any = None

    def _upload(self, rows: Any) -> Any:
        import pyopencl as cl

        d = self.directions
        padded = np.zeros((self.channels, d.padded), dtype=d.dtype)
        np.copyto(padded[:, : d.count], rows, where=self.used, casting="unsafe")
        flags = cl.mem_flags.READ_ONLY | cl.mem_flags.COPY_HOST_PTR
        with opencl_errors("uploading a measurement"):
            return cl.Buffer(d.device.context, flags, hostbuf=padded)

    @cached_property
    def _sources(self) -> tuple[str, str]:
        """Program texts for parameters that the channels share, and for each channel's own."""
        texts = []
        for channel_x in (0, 1):
            defines = {
                "BLOCK": BLOCK,
                "STRIDED": int(not self.directions.device.is_cpu),
                "CHANNEL_X": channel_x,
                "N_CHANNELS": self.channels,
                "GIVEN": int(self.given),
                "STUDENT": int(self.student),
                "CENSORED": int(self.censored),
            }
            lines = "\n".join(f"#define {name} {value}" for name, value in defines.items())
            texts.append(f"{self.program.text}\n{lines}\n{shared_text('likelihood.cl')}")
        return texts[0], texts[1]

    def __call__(
        self,
        x: Array,
        coefficients: Array,
        additive: Array | None = None,
        relative: Array | None = None,
        *,
        scale: Array | None = None,
        nu: Array | None = None,
    ) -> Array:
        """Sum the log-likelihood of P sets.

        Parameters
        ----------
        x : ndarray, shape (P, n_x) or (P, C, n_x)
            Nonlinear parameters, for all channels or for each.
        coefficients : ndarray, shape (P, C, n_basis)
            Coefficients per channel.
        additive, relative : ndarray, shape (P, C)
            Scales of the noise in 1/sr and 1, where sigma is not given.
        scale : ndarray, shape (P, C), optional
            What given sigmas are multiplied with; 1 where left out.
        nu : ndarray, shape (P,), optional
            Degrees of freedom of Student's t.

        Returns
        -------
        ndarray, shape (P, C)
        """
        sets, channels = len(x), self.channels
        if coefficients.shape != (sets, channels, self.program.n_basis):
            raise ModelError(
                f"coefficients have shape {coefficients.shape}, "
                f"not {(sets, channels, self.program.n_basis)}"
            )
        noise = np.ones((sets, channels, N_NOISE))
        total = np.broadcast_to(self.constant, (sets, channels))
        if self.given:
            if scale is not None:
                noise[:, :, 0] = 1.0 / (scale * scale)
                total = total - self.counts * np.log(scale)
        elif additive is None or relative is None:
            raise ModelError("without given sigmas a likelihood needs the scales of the noise")
        else:
            least = LEAST_VARIANCE[self.directions.precision]
            noise[:, :, 0] = np.maximum(additive * additive, least)
            noise[:, :, 1] = relative * relative
        if self.student:
            if nu is None:
                raise ModelError("Student's t needs its degrees of freedom nu")
            noise[:, :, 2] = nu[:, None]
            total = total + self.counts * _student_norm(nu)[:, None]
        summed: Array = total + self._launch(x, coefficients, noise)
        return summed

    def _launch(self, x: Array, coefficients: Array, noise: Array) -> Array:
        import pyopencl as cl

        d = self.directions
        device, sets = d.device, len(x)
        kernel = device.kernel(self._sources[int(x.ndim == 3)], "log_likelihood", d.options)
        packed = np.concatenate([x.ravel(), coefficients.ravel(), noise.ravel()]).astype(d.dtype)
        out = np.empty((d.n_chunks, sets, self.channels))
        with opencl_errors(f"summing the likelihood of {self.program.model.name}"):
            self._reserve(packed.nbytes, out.nbytes)
            cl.enqueue_copy(device.queue, self._small, packed, is_blocking=False)
            kernel(
                device.queue,
                (sets, d.n_chunks) if device.is_cpu else (d.n_chunks, sets),
                (1, 1) if device.is_cpu else None,
                d.planes,
                np.int32(d.n_vectors),
                *self._buffers,
                self._small,
                np.int32(d.n_chunks),
                np.int32(d.blocks_per_chunk),
                self._result,
            )
            cl.enqueue_copy(device.queue, out, self._result)
        total: Array = out.sum(axis=0)
        return total

    def _reserve(self, small: int, result: int) -> None:
        """Keep buffers large enough; new ones cost as much as a short launch."""
        import pyopencl as cl

        if max(small, result) <= self._room:
            return
        self._release_room()
        self._room = 2 * max(small, result)
        context, flags = self.directions.device.context, cl.mem_flags
        self._small = cl.Buffer(context, flags.READ_ONLY, self._room)
        self._result = cl.Buffer(context, flags.WRITE_ONLY, self._room)

    def _release_room(self) -> None:
        if self._room:
            self._small.release()
            self._result.release()
            self._room = 0

    def release(self) -> None:
        """Free the device's memory; the directions stay."""
        self._release_room()
        for buffer in {id(b): b for b in self._buffers}.values():
            buffer.release()


def _student_norm(nu: Array) -> Array:
    """Give ln of the constant of Student's t density at scale 1."""
    return np.array([math.lgamma(0.5 * (v + 1.0)) - math.lgamma(0.5 * v) for v in nu]) - 0.5 * (
        np.log(nu * math.pi)
    )
