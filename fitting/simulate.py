"""Simulated measurements: any model, on any directions, with the noise of an instrument."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lobefit import __version__
from lobefit.fitting.measurement import DIRECTION_COLUMNS, Measurement
from lobefit.fitting.scan_patterns import Angles, Pattern, pattern
from lobefit.kernels import Candidate, Device, candidate, evaluate
from lobefit.kernels.errors import MeasurementError, ModelError
from lobefit.kernels.evaluate import Params
from lobefit.kernels.parameters import complete

__all__ = ["Geometry", "simulate"]

Array = NDArray[np.float64]
Geometry = str | Pattern | Measurement | Mapping[str, ArrayLike] | Sequence[ArrayLike]


def simulate(
    model: str,
    params: Params,
    geometry: Geometry = "in-plane",
    noise: tuple[float, float] = (0.02, 1e-3),
    seed: int = 0,
    *,
    channels: Sequence[str] | None = None,
    options: Mapping[str, str] | None = None,
    sigma: bool = False,
    device: str | Device | None = None,
    metadata: Mapping[str, str] | None = None,
) -> Measurement:
    """Make the measurement that an instrument would give of a model surface.

    Parameters
    ----------
    model : str
        A registered model or one of its variants, such as ``ggx:k_s=1``.
    params : mapping of str to float or sequence of float
        Parameters by name, lists per channel; what is left out takes the
        record's default.
    geometry : str, Pattern, Measurement, mapping or sequence
        Where to measure: ``in-plane`` or ``hemisphere`` (with parameters, see
        `lobefit.fitting.scan_patterns`; the sample is turned if the model is
        anisotropic), a pattern, the directions of another measurement, or the
        four angles theta_i, phi_i, theta_o, phi_o in radians.
    noise : (float, float)
        Relative and additive part (the latter in 1/sr): independent Gaussian
        noise with ``sigma^2 = (relative f)^2 + additive^2``. Values that it
        makes negative stay, as they do after dark subtraction.
    seed : int
        Of numpy's PCG64; the same seed gives the same noise.
    channels : sequence of str, optional
        Names, by default ``brdf`` for one, ``R,G,B`` for three, else ``c1,c2,...``.
    options : mapping of str to str, optional
        Pieces the model is compiled with.
    sigma : bool
        Whether the measurement states its uncertainty, which is then the true one.
    device : str, Device or None
        See `lobefit.kernels.get_device`.
    metadata : mapping of str to str, optional
        More to say about it; how it was simulated is recorded besides.

    Returns
    -------
    Measurement
        Whose metadata say how it was made.

    Raises
    ------
    ModelError
        Unknown model, parameter or option; a value outside its bounds or
        against the variant; lists and channels that do not fit together.
    MeasurementError
        A geometry or noise that no instrument has.

    Examples
    --------
    >>> copper = simulate("ggx:k_s=1", {"k_d": 0.0, "F0": [0.95, 0.64, 0.54], "alpha": 0.3})
    >>> copper.channels
    ('R', 'G', 'B')
    """
    chosen = candidate(model, options)
    full = _parameters(chosen, params)
    angles, where = _directions(geometry, chosen)
    relative, additive = _noise(noise)
    clean = evaluate(chosen.model, full, *angles, device=device)
    names = _channels(channels, len(clean))
    clean = np.broadcast_to(clean, (len(names), clean.shape[1]))
    spread = np.hypot(relative * clean, additive)
    if sigma and not spread.all():
        raise MeasurementError(
            "the uncertainty would be 0 where the BRDF or the noise is 0",
            expected="noise with an additive part, or sigma=False",
        )
    values = clean + spread * _generator(seed).standard_normal(clean.shape)
    record = {
        "simulated_with": f"lobefit {__version__}",
        "simulated_model": model,
        "simulated_params": json.dumps(full),
        "simulated_options": json.dumps(dict(options)) if options else "",
        "simulated_noise": f"{relative:.9g},{additive:.9g}",
        "simulated_seed": str(seed),
        "simulated_geometry": where,
    }
    return Measurement(
        *angles,
        values=values,
        channels=names,
        sigma=spread if sigma else None,
        metadata={**(metadata or {}), **{key: value for key, value in record.items() if value}},
    )


def _parameters(chosen: Candidate, params: Params) -> dict[str, float | list[float]]:
    """Complete the parameters, and hold them to the variant."""
    given = dict(params)
    for name, value in chosen.fixed.items():
        if np.any(np.asarray(given.setdefault(name, value)) != value):
            raise ModelError(
                f"{chosen.name} holds {name} at {value:g}, not {given[name]}; "
                f"leave it out, or use {chosen.model.name}"
            )
    for name, leader in chosen.tied.items():
        follows = given.get(leader, complete(chosen.model, given)[leader].item())
        if given.setdefault(name, follows) != follows:
            raise ModelError(
                f"in {chosen.name} {name} equals {leader} ({follows}), not {given[name]}; "
                f"leave it out, or use {chosen.model.name}"
            )
    arrays = complete(chosen.model, given)
    return {
        name: value.item() if value.size == 1 else value.tolist() for name, value in arrays.items()
    }


def _directions(geometry: Geometry, chosen: Candidate) -> tuple[Angles, str]:
    """Give the four angles in radians, and a text that says which."""
    if isinstance(geometry, str):
        known = pattern(geometry)
        # An anisotropic surface that is not turned could not be told from an isotropic one.
        geometry = known if chosen.isotropic or "azimuths=" in geometry else known.turned()
    if isinstance(geometry, Pattern):
        return geometry.angles(), str(geometry)
    if isinstance(geometry, Measurement):
        source = geometry.source or "a measurement"
        angles = _given({name: getattr(geometry, name) for name in DIRECTION_COLUMNS})
        return angles, f"the {geometry.n_directions} directions of {source}"
    if isinstance(geometry, Mapping):
        angles = _given(geometry)
    elif isinstance(geometry, Sequence | np.ndarray) and len(geometry) == 4:
        angles = _given(dict(zip(DIRECTION_COLUMNS, geometry, strict=True)))
    else:
        raise MeasurementError(
            f"the geometry is {type(geometry).__name__}",
            expected="a scan pattern, a measurement, or theta_i, phi_i, theta_o, phi_o in radians",
        )
    return angles, f"{angles[0].size} given directions"


def _given(columns: Mapping[str, ArrayLike]) -> Angles:
    if not set(DIRECTION_COLUMNS) <= set(columns):
        raise MeasurementError(
            f"the geometry has {', '.join(map(str, columns)) or 'no angles'}",
            expected=f"{', '.join(DIRECTION_COLUMNS)} in radians",
        )
    try:
        arrays = np.broadcast_arrays(
            *(np.atleast_1d(np.asarray(columns[n], dtype=np.float64)) for n in DIRECTION_COLUMNS)
        )
    except (TypeError, ValueError) as error:
        raise MeasurementError(
            f"the angles do not fit together: {error}", expected="four arrays of one length"
        ) from error
    for name, angle in zip(DIRECTION_COLUMNS, arrays, strict=True):
        if angle.ndim != 1 or not angle.size:
            raise MeasurementError(
                f"{name} has shape {angle.shape}", expected="one number for each direction"
            )
        wrong = ~np.isfinite(angle)
        if name.startswith("theta"):
            wrong |= (angle < 0) | (angle >= np.pi / 2)
        if wrong.any():
            at = int(np.argmax(wrong))
            raise MeasurementError(
                f"{name} of direction {at} is {angle[at]:.6g} rad: no direction above the surface",
                expected="theta from 0 to below pi/2, in radians; numpy.deg2rad converts degrees",
            )
    theta_i, phi_i, theta_o, phi_o = arrays
    return theta_i, phi_i, theta_o, phi_o


def _noise(noise: tuple[float, float]) -> tuple[float, float]:
    try:
        relative, additive = (float(part) for part in noise)
    except (TypeError, ValueError):
        relative = additive = np.nan
    if not (0 <= relative < np.inf and 0 <= additive < np.inf):
        raise MeasurementError(
            f"the noise is {noise!r}",
            expected="(relative, additive): two numbers, 0 or more; the additive one in 1/sr",
        )
    return relative, additive


def _generator(seed: int) -> np.random.Generator:
    # numpy takes None for "some seed", which would make the result unrepeatable.
    if not isinstance(seed, int | np.integer) or seed < 0:
        raise MeasurementError(f"the seed is {seed!r}", expected="a whole number, 0 or more")
    return np.random.Generator(np.random.PCG64(int(seed)))


def _channels(channels: Sequence[str] | None, count: int) -> tuple[str, ...]:
    if channels is None:
        usual = {1: ("brdf",), 3: ("R", "G", "B")}
        return usual.get(count, tuple(f"c{k + 1}" for k in range(count)))
    names = tuple(channels.split(",")) if isinstance(channels, str) else tuple(channels)
    if count not in (1, len(names)):
        raise ModelError(
            f"the parameters have lists for {count} channels, but {len(names)} are named "
            f"({', '.join(names)}); give one name for each"
        )
    return names
