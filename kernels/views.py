"""Rows that are seen along several directions at once, as through an instrument's aperture.

What a formula gives for such a row is a weighted sum over its *views*. The kernels add them up
where they evaluate the basis functions, so that everything that is summed over rows follows.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from lobefit.kernels.device import Device, opencl_errors
from lobefit.kernels.errors import ModelError
from lobefit.kernels.geometry import PLANES, Directions, Precision

__all__ = ["View", "Views"]

Array = NDArray[np.float64]

View = tuple[tuple[Array, Array, Array, Array], Array]
"""Angles theta_i, phi_i, theta_o, phi_o of one view of every row, and its weights, shape (N,)."""


class Views(Directions):
    """N rows on the device, each the weighted sum of Q views.

    Parameters
    ----------
    device : Device
        Where to keep them.
    nominal : tuple of ndarray, shape (N,)
        The four angles that the rows go by, in radians.
    views : sequence of View
        Angles in radians and weights; what is below the horizon contributes nothing.
    precision : {"single", "double"}
        As of `Directions`.

    Attributes
    ----------
    visible : ndarray of bool, shape (N,)
        Nominally above the horizon.

    Raises
    ------
    ModelError
        No view, or angles that are no directions.
    """

    def __init__(
        self,
        device: Device,
        nominal: tuple[Array, Array, Array, Array],
        views: Sequence[View],
        precision: Precision = "double",
    ) -> None:
        import pyopencl as cl

        if not views:
            raise ModelError("a row needs at least one view")
        super().__init__(device, *nominal, precision=precision)
        own = len(PLANES) * self.padded * self.dtype.itemsize
        size = own + self.padded * self.dtype.itemsize
        with opencl_errors("uploading directions"):
            every = cl.Buffer(device.context, cl.mem_flags.READ_WRITE, len(views) * size)
            for k, (angles, weights) in enumerate(views):
                part = Directions(device, *angles, precision=precision)
                cl.enqueue_copy(
                    device.queue, every, part.planes, byte_count=own, dst_offset=k * size
                )
                row = np.zeros(self.padded, dtype=self.dtype)
                np.copyto(row[: self.count], weights, where=part.visible, casting="same_kind")
                cl.enqueue_copy(device.queue, every, row, dst_offset=k * size + own)
                device.queue.finish()
                part.release()
        self._nominal, self.planes = self.planes, every
        self.options = (*self.options, f"-DVIEWS={len(views)}")

    def plane(self, name: str) -> Array:
        """Read one of the stored numbers back, of the nominal direction."""
        every, self.planes = self.planes, self._nominal
        try:
            return super().plane(name)
        finally:
            self.planes = every

    def release(self) -> None:
        """Free the device's memory."""
        self._nominal.release()
        super().release()
