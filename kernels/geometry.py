"""Directions on the device: the few numbers per measurement that the formulas need.

They are computed once, in double precision, in forms that do not cancel near
the mirror direction; see ``cl/geometry.h`` for the list.
"""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lobefit.kernels.device import Device, opencl_errors
from lobefit.kernels.errors import ModelError
from lobefit.kernels.program import BLOCK, build_options, shared_text

__all__ = ["MIN_COSINE", "Directions", "Precision", "above_horizon"]

Precision = Literal["single", "double"]

# At and below the horizon every BRDF is 0. Cosines under this are taken as the
# horizon: they are rounding of 90 degrees, and 1/(n.i n.o) would overflow.
MIN_COSINE = 1e-7
# The fields of `geometry` in cl/geometry.h, in their order.
PLANES = (
    "cos_theta_i",
    "cos_theta_o",
    "i_x",
    "i_y",
    "o_x",
    "o_y",
    "slope_x",
    "slope_y",
    "one_minus_cos_d",
    "log2_cos_h",
    "log2_cos_r",
    "back_slope_x",
    "back_slope_y",
)
# Directions per work-item on a CPU: enough to hide a launch, few enough to share out.
BLOCKS_PER_CHUNK = 8


def above_horizon(theta_i: NDArray[np.float64], theta_o: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Tell which pairs of zenith angles (radians) lie above the horizon."""
    above: NDArray[np.bool_] = np.maximum(theta_i, theta_o) < np.arccos(MIN_COSINE)
    return above


class Directions:
    """N pairs of directions, uploaded once, used by every model.

    Parameters
    ----------
    device : Device
        Where to keep them.
    theta_i, phi_i, theta_o, phi_o : array_like, shape (N,)
        Zenith and azimuth of incidence and observation in radians; scalars
        broadcast.
    precision : {"single", "double"}
        Of the stored numbers; they are computed in double either way.

    Attributes
    ----------
    count : int
        N.
    padded : int
        N rounded up to whole chunks; the padding looks along the normal.
    visible : ndarray of bool, shape (N,)
        Above the horizon on both sides.
    options : tuple of str
        What kernels that read the planes are compiled with.

    Raises
    ------
    ModelError
        Angles that do not broadcast, are not finite, or are no directions.
    """

    def __init__(
        self,
        device: Device,
        theta_i: ArrayLike,
        phi_i: ArrayLike,
        theta_o: ArrayLike,
        phi_o: ArrayLike,
        precision: Precision = "double",
    ) -> None:
        import pyopencl as cl

        if precision not in ("single", "double"):
            raise ModelError(f"precision is 'single' or 'double', not {precision!r}")
        try:
            angles = np.broadcast_arrays(
                *(np.asarray(a, dtype=np.float64) for a in (theta_i, phi_i, theta_o, phi_o))
            )
        except (ValueError, TypeError) as error:
            raise ModelError(f"the four angles do not fit together: {error}") from error
        if angles[0].ndim > 1:
            raise ModelError(
                f"angles are vectors of N directions, not {angles[0].ndim}-dimensional"
            )
        flat = [np.atleast_1d(a) for a in angles]
        for name, a in zip(("theta_i", "phi_i", "theta_o", "phi_o"), flat, strict=True):
            if not np.isfinite(a).all():
                raise ModelError(f"{name} holds values that are not finite")
            if name.startswith("theta") and a.size and (a.min() < 0.0 or a.max() > np.pi):
                raise ModelError(f"{name} is a zenith angle in radians, 0 to pi; convert degrees")
        self.device = device
        self.precision: Precision = precision
        self.dtype: np.dtype[Any] = np.dtype(np.float64 if precision == "double" else np.float32)
        self.width = device.width(precision)
        self.options: tuple[str, ...] = build_options(self.width, precision)
        self.count = flat[0].size
        self.visible = above_horizon(flat[0], flat[2])
        self._share_out()

        with opencl_errors("uploading directions"):
            self.planes = cl.Buffer(
                device.context,
                cl.mem_flags.READ_WRITE,
                len(PLANES) * self.padded * self.dtype.itemsize,
            )
            angles_buffer = cl.Buffer(
                device.context, cl.mem_flags.READ_ONLY, 4 * self.padded * flat[0].itemsize
            )
            for k, a in enumerate(flat):
                # What is not visible, and the padding, looks along the normal: harmless.
                row = np.zeros(self.padded)
                np.copyto(row[: self.count], a, where=self.visible)
                cl.enqueue_copy(device.queue, angles_buffer, row, dst_offset=k * row.nbytes)
            source = f"{shared_text('types.h')}\n{shared_text('geometry.cl')}"
            store = 64 if precision == "double" else 32
            width = device.width("double")
            n = self.padded // width
            kernel = device.kernel(
                source,
                "directions_to_planes",
                (*build_options(width, "double"), f"-DSTORE={store}"),
            )
            kernel(
                device.queue,
                (n,),
                None,
                angles_buffer,
                np.int32(n),
                self.planes,
            )
            device.queue.finish()
            angles_buffer.release()

    def _share_out(self) -> None:
        """Fix how many chunks, blocks and vectors the directions are padded to."""
        block = BLOCK * self.width
        n_blocks = max(1, -(-self.count // block))
        if self.device.is_cpu:
            self.blocks_per_chunk = min(BLOCKS_PER_CHUNK, n_blocks)
            self.n_chunks = -(-n_blocks // self.blocks_per_chunk)
        else:
            self.n_chunks = min(n_blocks, 256)
            self.blocks_per_chunk = -(-n_blocks // self.n_chunks)
        self.n_vectors = self.n_chunks * self.blocks_per_chunk * BLOCK
        self.padded = self.n_vectors * self.width

    def plane(self, name: str) -> NDArray[np.float64]:
        """Read one of the stored numbers back.

        Parameters
        ----------
        name : str
            A field of ``geometry`` in ``cl/geometry.h``.

        Returns
        -------
        ndarray, shape (N,)
        """
        import pyopencl as cl

        row = np.empty(self.padded, dtype=self.dtype)
        with opencl_errors("reading directions"):
            offset = PLANES.index(name) * row.nbytes
            cl.enqueue_copy(self.device.queue, row, self.planes, src_offset=offset)
        return row[: self.count].astype(np.float64)

    def release(self) -> None:
        """Free the device's memory."""
        self.planes.release()
