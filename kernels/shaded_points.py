"""Points of a scene on a device, and the launches that shade them."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lobefit.kernels.device import Device, opencl_errors
from lobefit.kernels.errors import SceneError
from lobefit.kernels.evaluate import Params
from lobefit.kernels.geometry import Precision
from lobefit.kernels.lights import Environment
from lobefit.kernels.lobe_nodes import azimuth_nodes, radial_nodes
from lobefit.kernels.parameters import coefficients_of, complete, nonlinear_of
from lobefit.kernels.program import ModelProgram, build_options, model_program, shared_text
from lobefit.kernels.registry import Model, get_model
from lobefit.kernels.surface import Surface

__all__ = ["Lobes", "ShadedPoints", "lobes_of"]

Array = NDArray[np.float64]
Values = tuple[NDArray[Any], float]

# Work-items a group: fixed, since a runtime may compile a kernel for each size anew.
CPU_GROUP, GPU_GROUP = 16, 64
RUN = 64  # pixels
TEXEL = 4  # channels that one look-up in an environment gives


@dataclass(frozen=True, eq=False)
class Lobes:
    """A model with its numbers, as the kernels take them.

    Attributes
    ----------
    program : ModelProgram
        The model.
    x : ndarray, shape (sets, 1 or C, n_x)
        Nonlinear parameters.
    coefficients : ndarray, shape (sets, C, n_basis)
        What the basis functions are multiplied by.
    """

    program: ModelProgram
    x: Array
    coefficients: Array

    @property
    def diffuse(self) -> NDArray[np.bool_]:
        """Which basis functions are diffuse: those of k_d alone, and a whole diffuse lobe's."""
        found: list[bool] = []
        for term in self.program.model.terms:
            alone = not term.lobe.diffuse and len(term.coefficients) == 1
            found += [alone or c == ("k_d",) for c in term.coefficients]
        return np.array(found)

    def of(self, channels: slice) -> Lobes:
        """Give the same for some of the channels."""
        x = self.x if self.x.shape[1] == 1 else self.x[:, channels]
        return Lobes(self.program, x, self.coefficients[:, channels])

    def singly(self) -> list[Lobes]:
        """Give each set of parameters by itself."""
        pairs = zip(self.x, self.coefficients, strict=True)
        return [Lobes(self.program, x[None], c[None]) for x, c in pairs]

    def source(self, name: str) -> str:
        """Give the text of a shading kernel of the model."""
        peaks = {p for term in self.program.model.terms for p in term.lobe.peaks}
        defines = {
            "N_CHANNELS": self.coefficients.shape[1],
            "CHANNEL_X": int(self.x.shape[1] > 1),
            "DIFFUSE_BITS": sum(1 << k for k, d in enumerate(self.diffuse) if d),
            "MIRROR": int("mirror" in peaks),
            "BACK": int("back" in peaks),
        }
        lines = "\n".join(f"#define {key} {value}" for key, value in defines.items())
        shading, kernel = shared_text("shading.h"), shared_text(f"{name}.cl")
        return f"{self.program.text}\n{lines}\n{shading}\n{kernel}"


def lobes_of(
    model: str | Model,
    params: Sequence[Params],
    options: Mapping[str, str] | None,
    channels: int,
) -> Lobes:
    """Check sets of parameters and stack them.

    Parameters
    ----------
    model, params, options
        As for `lobefit.kernels.evaluate`; several sets.
    channels : int
        Of the lights; 1 goes with any number, else they are the model's (`SceneError`).
    """
    known = (model if isinstance(model, Model) else get_model(model)).choose(options)
    full = [complete(known, p) for p in params]
    xs = [nonlinear_of(known, f) for f in full]
    coefficients = [coefficients_of(known, f) for f in full]
    several = {channels, *map(len, xs), *map(len, coefficients)} - {1}
    if len(several) > 1:
        raise SceneError(
            f"{known.name} and the lights have different numbers of channels: {sorted(several)}"
        )
    wide, groups = max(several, default=1), max(map(len, xs))
    return Lobes(
        model_program(known),
        np.stack([np.broadcast_to(x, (groups, x.shape[1])) for x in xs]),
        np.stack([np.broadcast_to(c, (wide, c.shape[1])) for c in coefficients]),
    )


class ShadedPoints:
    """The points of a surface on a device.

    Parameters
    ----------
    surface : Surface
        At least one point.
    device : Device
        Where to keep them.
    precision : {"single", "double"}
        Of shading; the points themselves were found in double precision.
    """

    def __init__(self, surface: Surface, device: Device, precision: Precision) -> None:
        s = surface
        self.surface, self.device = surface, device
        self.dtype: np.dtype[Any] = np.dtype(np.float64 if precision == "double" else np.float32)
        self.width = device.width(precision)
        self.options = build_options(self.width, precision)
        bitangent = np.cross(s.normal, s.tangent)
        frame = [(s.view * axis).sum(axis=1) for axis in (s.tangent, bitangent, s.normal)]
        planes = np.concatenate([s.position.T, s.normal.T, s.tangent.T, np.stack(frame)])
        self.count = planes.shape[1]
        self.group = CPU_GROUP if device.is_cpu else GPU_GROUP
        whole = self.group * self.width
        self.padded = -(-self.count // whole) * whole
        planes = np.pad(planes, ((0, 0), (0, self.padded - self.count)), mode="edge")
        self._points = self._copy(planes)
        self._taps: list[Any] = []
        if s.taps is not None:
            # On a CPU a work-item fills a run of neighbours; whole runs, whole groups of them.
            self._run_length = RUN if device.is_cpu else 1
            over = ((0, 0), (0, -s.taps.shape[1] % (self._run_length * self.group)))
            taps = np.pad(s.taps, over)
            weights = np.zeros(1) if s.weights is None else np.pad(s.weights, over)
            self._tap_shape = taps.shape
            self._taps = [self._copy(taps, np.dtype(np.int32)), self._copy(weights)]
        self._pyramids: list[Any] = []

    def release(self) -> None:
        """Free the device's memory."""
        for buffer in (self._points, *self._taps, *self._pyramids):
            buffer.release()

    def _copy(self, values: NDArray[Any], dtype: np.dtype[Any] | None = None) -> Any:
        import pyopencl as cl

        host = np.ascontiguousarray(values, dtype=dtype or self.dtype)
        if not host.size:
            host = np.zeros(1, host.dtype)
        flags = cl.mem_flags.READ_ONLY | cl.mem_flags.COPY_HOST_PTR
        with opencl_errors("uploading a scene"):
            return cl.Buffer(self.device.context, flags, hostbuf=host)

    def _run(
        self, kernel: Any, size: tuple[int, ...], arguments: Sequence[Any], shape: tuple[int, ...]
    ) -> Values:
        """Run a kernel whose last argument is its result; arrays among the others are copied."""
        import pyopencl as cl

        out = np.empty(shape, dtype=self.dtype)
        copies = [self._copy(a) if isinstance(a, np.ndarray) else None for a in arguments]
        given = [a if c is None else c for a, c in zip(arguments, copies, strict=True)]
        with opencl_errors("rendering"):
            result = cl.Buffer(self.device.context, cl.mem_flags.WRITE_ONLY, out.nbytes)
            self.device.queue.finish()
            start = time.perf_counter()
            kernel(self.device.queue, size, (self.group, 1), *given, result)
            self.device.queue.finish()
            seconds = time.perf_counter() - start
            cl.enqueue_copy(self.device.queue, out, result)
            for buffer in (*copies, result):
                if buffer is not None:
                    buffer.release()
        return out, seconds

    def _shade(self, lobes: Lobes, name: str, arguments: Sequence[Any]) -> Values:
        kernel = self.device.kernel(lobes.source(name), f"shade_{name}", self.options)
        n = self.padded // self.width
        sets, channels, _ = lobes.coefficients.shape
        first = [self._points, np.int32(n), lobes.x, lobes.coefficients]
        shape = (sets, channels, 2, self.padded)
        return self._run(kernel, (n, sets), [*first, *arguments], shape)

    def under_lights(self, lobes: Lobes, lights: Array, ambient: Array) -> Values:
        """Sum over lights.

        Parameters
        ----------
        lobes : Lobes
            What reflects.
        lights : ndarray, shape (lights, 4 + C)
            See `lobefit.kernels.lights.light_rows`.
        ambient : ndarray, shape (sets, C)
            Radiance added to the diffuse part.

        Returns
        -------
        tuple of ndarray and float
            Radiance, shape (sets, C, 2, padded points), diffuse and specular; and seconds.
        """
        return self._shade(lobes, "lights", [lights, np.int32(len(lights)), ambient])

    def under_environment(
        self, lobes: Lobes, environment: Environment, nodes: tuple[int, int]
    ) -> Values:
        """Integrate over an environment; nodes as for `lobefit.kernels.render.Prepared`.

        Returns
        -------
        tuple of ndarray and float
            Radiance, shape (sets, C, 2, padded points), diffuse and specular; and seconds.
        """
        sets, channels, _ = lobes.coefficients.shape
        out = np.empty((sets, channels, 2, self.padded), dtype=self.dtype)
        if not self._pyramids:
            self._pyramids = [
                self._pyramid(environment, slice(first, min(first + TEXEL, channels)))
                for first in range(0, channels, TEXEL)
            ]
        rows, levels = len(environment.pyramid[0]), len(environment.pyramid)
        total = 0.0
        for k, pyramid in enumerate(self._pyramids):
            some = slice(k * TEXEL, min((k + 1) * TEXEL, channels))
            for s, one in enumerate(lobes.singly()):
                used = one.coefficients[0].any(axis=0)
                radial = radial_nodes(lobes.program, self.device, one.x[0], used, nodes[0])
                around = azimuth_nodes(lobes.program, one.x[0], nodes[1])
                counts = np.int32(len(radial)), np.int32(len(around))
                sizes = [np.int32(rows), np.int32(levels)]
                arguments = [pyramid, *sizes, radial, counts[0], around, counts[1]]
                out[s : s + 1, some], seconds = self._shade(one.of(some), "environment", arguments)
                total += seconds
        return out, total

    def _pyramid(self, environment: Environment, channels: slice) -> Any:
        count = channels.stop - channels.start
        levels = []
        for level in environment.pyramid:
            wide = np.broadcast_to(level, (*level.shape[:2], max(level.shape[2], channels.stop)))
            texels = np.zeros((level.shape[0] * level.shape[1], TEXEL))
            texels[:, :count] = wide[:, :, channels].reshape(-1, count)
            levels.append(texels)
        return self._copy(np.concatenate(levels))

    def pixels(self, values: NDArray[Any]) -> Values:
        """Make pixels of points.

        Parameters
        ----------
        values : ndarray, shape (sets, C, parts, padded points)
            Numbers of the points.

        Returns
        -------
        tuple of ndarray and float
            The same of pixels, shape (sets, C, parts, M); and seconds.
        """
        if not self._taps:
            return values[..., : self.count], 0.0
        sets, channels, parts, points = values.shape
        n_taps, n_pixels = self._tap_shape
        run = self._run_length
        defines = f"#define N_TAPS {n_taps}\n#define RUN {run}"
        source = f"{shared_text('types.h')}\n{defines}\n{shared_text('fill.cl')}"
        kernel = self.device.kernel(source, "fill", self.options)
        sizes = np.int32(n_pixels), np.int32(channels * parts)
        arguments = [values, np.int32(points), *self._taps, *sizes]
        shape = (sets, channels, parts, n_pixels)
        made, seconds = self._run(kernel, (n_pixels // run, sets), arguments, shape)
        return made[..., : self.surface.pixels.size], seconds
