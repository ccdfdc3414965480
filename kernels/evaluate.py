"""Values of a BRDF model at given directions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lobefit.kernels.device import Device, get_device, opencl_errors
from lobefit.kernels.geometry import Directions, Precision
from lobefit.kernels.parameters import coefficients_of, complete, nonlinear_of
from lobefit.kernels.program import ModelProgram, model_program
from lobefit.kernels.registry import Model, get_model

__all__ = ["Params", "basis_values", "evaluate"]

Params = Mapping[str, float | Sequence[float]]


def basis_values(
    program: ModelProgram, directions: Directions, x: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Evaluate the basis functions of a model.

    Parameters
    ----------
    program : ModelProgram
        The model and its options.
    directions : Directions
        N directions on a device.
    x : ndarray, shape (P, n_x)
        P sets of nonlinear parameters.

    Returns
    -------
    ndarray, shape (P, n_basis, N)
        In 1/sr; 0 at and below the horizon.
    """
    import pyopencl as cl

    device, d = directions.device, directions
    sets = len(x)
    kernel = device.kernel(program.values_source, "basis_values", d.options)
    out = np.empty((sets, program.n_basis, d.padded), dtype=d.dtype)
    with opencl_errors(f"evaluating {program.model.name}"):
        flags = cl.mem_flags
        x_host = np.ascontiguousarray(x, dtype=d.dtype) if x.size else np.zeros(1, d.dtype)
        x_buffer = cl.Buffer(device.context, flags.READ_ONLY | flags.COPY_HOST_PTR, hostbuf=x_host)
        result = cl.Buffer(device.context, flags.WRITE_ONLY, out.nbytes)
        kernel(
            device.queue,
            (d.n_vectors, sets),
            None,
            d.planes,
            np.int32(d.n_vectors),
            x_buffer,
            result,
        )
        cl.enqueue_copy(device.queue, out, result)
        x_buffer.release()
        result.release()
    values = out[:, :, : d.count].astype(np.float64)
    values[:, :, ~d.visible] = 0.0
    return values


def evaluate(
    model: str | Model,
    params: Params,
    theta_i: ArrayLike,
    phi_i: ArrayLike,
    theta_o: ArrayLike,
    phi_o: ArrayLike,
    *,
    options: Mapping[str, str] | None = None,
    precision: Precision = "double",
    device: str | Device | None = None,
) -> NDArray[np.float64]:
    """Evaluate a model's BRDF.

    Parameters
    ----------
    model : str or Model
        A registered model, such as "ggx", or a sum, such as "ggx+ggx".
    params : mapping of str to float or sequence of float
        Parameters by name; per-channel ones may be one number or one per
        channel. What is left out takes the record's default.
    theta_i, phi_i, theta_o, phi_o : array_like, shape (N,)
        Zenith and azimuth in radians; both directions point away from the
        surface. Scalars broadcast.
    options : mapping of str to str, optional
        Pieces the model is compiled with, such as ``{"masking": "smith_separable",
        "fresnel": "conductor"}``; a choice may bring parameters of its own.
    precision : {"single", "double"}
        Of the computation; the result is float64 either way.
    device : str, Device or None
        See `lobefit.kernels.get_device`.

    Returns
    -------
    ndarray, shape (channels, N)
        BRDF in 1/sr; 0 at and below the horizon.

    Raises
    ------
    ModelError
        Unknown model, parameter or option; a value outside its bounds; angles
        that are no directions.
    DeviceError
        No usable OpenCL device.

    Examples
    --------
    >>> import numpy as np
    >>> float(evaluate("lambert", {"k_d": 0.5}, 0.0, 0.0, 0.3, 0.0)[0, 0].round(6))
    0.159155
    """
    known = (model if isinstance(model, Model) else get_model(model)).choose(options)
    program = model_program(known)
    full = complete(known, params)
    directions = Directions(get_device(device), theta_i, phi_i, theta_o, phi_o, precision)
    try:
        basis = basis_values(program, directions, nonlinear_of(known, full))
    finally:
        directions.release()
    coefficients = coefficients_of(known, full)
    # One set of nonlinear parameters for all channels, or one for each.
    channels = max(len(basis), len(coefficients))
    basis = np.broadcast_to(basis, (channels, *basis.shape[1:]))
    coefficients = np.broadcast_to(coefficients, (channels, coefficients.shape[1]))
    values: NDArray[np.float64] = np.einsum("ck,ckn->cn", coefficients, basis)
    return values
