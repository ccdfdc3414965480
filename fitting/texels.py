"""Fits of thousands of surfaces at once that were measured in the same directions."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from lobefit.fitting.measurement import DIRECTION_COLUMNS, Measurement
from lobefit.fitting.texel_chunk import ChunkFitter
from lobefit.fitting.texel_model import TexelModel, refusal
from lobefit.fitting.texel_noise import texel_noise
from lobefit.fitting.texel_result import TexelFit
from lobefit.fitting.texel_solve import TexelSolver
from lobefit.fitting.texel_source import CHUNK, ArraySource, TexelSource
from lobefit.kernels import Candidate, Device, MeasurementError, ModelError, candidates, get_device
from lobefit.kernels.geometry import Directions, Precision
from lobefit.kernels.library import SETS

__all__ = ["TexelFit", "fit_texel_chunks", "fit_texels"]

MOST_CHANNELS = 4
Progress = Callable[[int, int], None]


def fit_texels(
    directions: ArrayLike | Mapping[str, ArrayLike] | Measurement,
    values: Any,
    models: str | Sequence[str] = "quick",
    *,
    noise: str | tuple[float, float] = "relative",
    options: Mapping[str, str] | None = None,
    chunk: int = CHUNK,
    precision: Precision = "single",
    device: str | Device | None = None,
    progress: Progress | None = None,
) -> TexelFit:
    """Fit models to every texel and choose the simplest sufficient one for each.

    A texel is a diffuse term and a lobe (or what else a candidate is) with up to 3 nonlinear
    parameters that its channels share. Every texel is scanned over nodes of these, refined by
    safeguarded Gauss-Newton steps with the linear parameters solved exactly inside their
    physical bounds, and handed to NLopt where that does not converge. A texel's result depends on its own
    readings alone: not on its neighbours, nor on `chunk`.

    Parameters
    ----------
    directions : array_like, shape (4, N), mapping or Measurement
        theta_i, phi_i, theta_o, phi_o in radians; see `lobefit.kernels.evaluate`.
    values : array_like, shape (T, N, C), or TexelSource
        BRDF in 1/sr, C = 1 to 4 channels; NaN is a missing reading. Arrays on disk
        (`lobefit.fitting.texel_source.open_texels`) are read chunk by chunk.
    models : str or sequence of str
        A set ("quick", "standard", "all"), of which what texels cannot be fitted with and
        anisotropic models are left out, or names.
    noise : {"relative", "constant"} or (relative, additive)
        What readings are weighed with: noise that is proportional to the model's value (1 % of
        the channel's mean at least), the same for all, or the root of the sum of the squares of
        a relative part and an additive one in 1/sr. The size of the noise is estimated
        from each texel's scatter in any case.
    options : mapping of str to str, optional
        Pieces that every model which knows them is compiled with.
    chunk : int
        Texels that are read at a time.
    precision : {"single", "double"}
        Of the device's computations.
    device : str, Device or None
        See `lobefit.kernels.get_device`.
    progress : callable, optional
        Called with (done, total) texels after each chunk.

    Returns
    -------
    TexelFit

    Raises
    ------
    ModelError
        An unknown model, or one that texels cannot be fitted with.
    MeasurementError
        Directions and values that do not fit together.
    FitError
        An unknown noise.
    DeviceError
        No usable device.
    """
    parts = []
    source = _source(values)
    for first, part in fit_texel_chunks(
        directions, source, models, noise=noise, options=options, chunk=chunk,
        precision=precision, device=device,
    ):  # fmt: skip
        parts.append(part)
        if progress is not None:
            progress(first + len(part), source.shape[0])
    return TexelFit.join(parts)


def fit_texel_chunks(
    directions: ArrayLike | Mapping[str, ArrayLike] | Measurement,
    values: Any,
    models: str | Sequence[str] = "quick",
    *,
    noise: str | tuple[float, float] = "relative",
    options: Mapping[str, str] | None = None,
    chunk: int = CHUNK,
    precision: Precision = "single",
    device: str | Device | None = None,
) -> Iterator[tuple[int, TexelFit]]:
    """Fit chunk by chunk: as `fit_texels`, yielding (first texel, its results) as they finish.

    Parameters
    ----------
    directions, values, models, noise, options, chunk, precision, device
        As for `fit_texels`.
    """
    source = _source(values)
    angles = direction_angles(directions)
    check_shapes(angles, source.shape)
    channels = source.shape[2]
    wanted = eligible(models, channels, options)
    settings = {
        "models": models if isinstance(models, str) else list(models),
        "noise": noise if isinstance(noise, str) else list(noise),
        "options": dict(options or {}),
        "precision": precision,
    }
    with chunk_fitter(angles, wanted, channels, noise, precision, device, settings) as fitter:
        for first, block in source.chunks(max(int(chunk), 1)):
            yield first, fitter.fit(block)


def check_shapes(angles: np.ndarray[Any, Any], shape: tuple[int, int, int]) -> None:
    """Raise a `MeasurementError` for directions (4, N) and values (T, N, C) that do not agree."""
    texels, n, channels = shape
    if n != angles.shape[1]:
        raise MeasurementError(
            f"there are {angles.shape[1]} directions and {n} readings per texel",
            expected="values of shape (texels, directions, channels)",
        )
    if not 1 <= channels <= MOST_CHANNELS:
        raise MeasurementError(
            f"there are {channels} channels", expected=f"1 to {MOST_CHANNELS}, the last axis"
        )
    if not texels:
        raise MeasurementError("there is no texel", expected="values of shape (T, N, C)")


@contextmanager
def chunk_fitter(
    angles: np.ndarray[Any, np.dtype[np.float64]],
    wanted: Sequence[Candidate],
    channels: int,
    noise: str | tuple[float, float],
    precision: Precision,
    device: str | Device | None,
    settings: Mapping[str, Any],
) -> Iterator[ChunkFitter]:
    """Open a device for fits of chunks, and free its memory at the end.

    Parameters
    ----------
    angles : ndarray, shape (4, N)
        Directions in radians.
    wanted : sequence of Candidate
        What is fitted; see `eligible`.
    channels, noise, precision, device
        As for `fit_texels`.
    settings : mapping
        For the record.
    """
    weighing = texel_noise(noise)
    opened = get_device(device)
    theta_i, phi_i, theta_o, phi_o = angles
    double = Directions(opened, theta_i, phi_i, theta_o, phi_o)
    working = (
        double
        if precision == "double"
        else Directions(opened, theta_i, phi_i, theta_o, phi_o, precision)
    )
    try:
        if not working.visible.all():
            at = int(np.argmin(working.visible))
            raise MeasurementError(
                f"direction {at} lies at or below the horizon",
                expected="directions above the surface; leave the others out, and their readings",
            )
        fitter = ChunkFitter(
            [
                TexelSolver(TexelModel(c, channels, precision), working, double, weighing)
                for c in wanted
            ],
            {**settings, "device": opened.info.id},
        )
        try:
            yield fitter
        finally:
            fitter.release()
    finally:
        for d in {working, double}:
            d.release()


def eligible(
    models: str | Sequence[str], channels: int, options: Mapping[str, str] | None = None
) -> list[Candidate]:
    """Give the candidates that texels of so many channels can be fitted with.

    Parameters
    ----------
    models : str or sequence of str
        Of a set, what cannot be fitted and anisotropic models are left out.
    channels : int
        C.
    options : mapping of str to str, optional
        Choices for every candidate that knows them.

    Raises
    ------
    ModelError
        A named candidate cannot be fitted (the message says why), or none is left.
    """
    found = [c.choose(options or {}) for c in candidates(models)]
    if isinstance(models, str) and models in SETS:
        return [c for c in found if c.isotropic and not refusal(c, channels)]
    for c in found:
        reason = refusal(c, channels)
        if reason:
            raise ModelError(reason)
    return found


def direction_angles(
    directions: ArrayLike | Mapping[str, ArrayLike] | Measurement,
) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Give theta_i, phi_i, theta_o, phi_o in radians, shape (4, N).

    Raises
    ------
    MeasurementError
        Not four rows of finite numbers of one length, or zenith angles beyond pi.
    """
    if isinstance(directions, Measurement):
        rows: Any = [getattr(directions, name) for name in DIRECTION_COLUMNS]
    elif isinstance(directions, Mapping):
        missing = [name for name in DIRECTION_COLUMNS if name not in directions]
        if missing:
            raise MeasurementError(
                f"the directions lack {', '.join(missing)}",
                expected=f"{', '.join(DIRECTION_COLUMNS)} in radians",
            )
        rows = [directions[name] for name in DIRECTION_COLUMNS]
    else:
        rows = directions
    try:
        angles = np.array([np.asarray(row, np.float64) for row in rows])
    except (TypeError, ValueError) as error:
        raise MeasurementError(
            f"the directions do not fit together: {error}", expected="an array of shape (4, N)"
        ) from error
    if angles.ndim != 2 or len(angles) != 4 or not angles.size or not np.isfinite(angles).all():
        raise MeasurementError(
            f"the directions have shape {angles.shape}"
            if np.isfinite(angles).all()
            else "a direction is not finite",
            expected=f"four rows, {', '.join(DIRECTION_COLUMNS)}, in radians",
        )
    if angles[::2].min() < 0.0 or angles[::2].max() > np.pi:
        raise MeasurementError(
            "theta_i and theta_o are zenith angles in radians, 0 to pi; convert degrees"
        )
    return angles


def _source(values: Any) -> TexelSource:
    return values if isinstance(values, TexelSource) else ArraySource(values)
