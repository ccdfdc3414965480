"""What an instrument adds to a measurement: tilt, veil, gain and aperture; all off by default.

An instrument's reading is a signal divided by a cosine. Where a beam falls within the field of
view and the flux is measured ("flux"), the signal is f cos(theta_o); where the beam is wider
than the field of view and the radiance is measured ("radiance"), it is f cos(theta_i). The true
cosine enters the signal, the nominal one is divided by: so a tilt and an aperture weigh what they
see with the ratio of the two, and a constant veil of the signal has the inverse of the nominal
one as its angles.
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from lobefit.kernels.errors import FitError
from lobefit.kernels.geometry import above_horizon
from lobefit.kernels.views import View

__all__ = ["Instrument", "tilted", "views"]

Array = NDArray[np.float64]
Angles = tuple[Array, Array, Array, Array]

WIDEST_APERTURE = 30.0
# A disc's rings as (radius^2, weight), equally spaced points on each (Peirce 1957). Of a GGX peak
# the mean over an aperture of 2 degrees is right to 3e-3 at alpha 0.01 and to 3e-6 at 0.02, over
# one of 5 degrees to 1e-3 at 0.02 and to 2e-5 at 0.05.
RINGS = ((0.21132486540518712, 0.5), (0.7886751345948129, 0.5))
RING_POINTS = 8


@dataclass(frozen=True, slots=True, kw_only=True)
class Instrument:
    """Which properties of the instrument a fit accounts for.

    Parameters
    ----------
    tilt : bool
        The sample's normal is off the instrument's axis: two angles, fitted.
    veil : bool
        A constant part of the signal (stray light, a dark offset): one number for each
        channel, fitted, not negative.
    gain : float, optional
        Relative standard uncertainty of each channel's calibration factor, such as 0.02. It
        cannot be told from the scale of the reflectance, so that it is not fitted: it widens
        the errors.
    aperture_deg : float, optional
        Full angle of the detector's round aperture seen from the sample, in degrees. The lobe
        is convolved with it.
    reading : {"flux", "radiance"}
        What the signal is proportional to: f cos(theta_o) or f cos(theta_i). Of an ideal
        instrument both give f: it matters to a tilt, a veil and an aperture.

    Raises
    ------
    FitError
        A gain or an aperture that no instrument has; an unknown reading, or one of radiance
        where nothing depends on it.
    """

    tilt: bool = False
    veil: bool = False
    gain: float | None = None
    aperture_deg: float | None = None
    reading: Literal["flux", "radiance"] = "flux"

    def __post_init__(self) -> None:
        """Refuse what no instrument is."""
        if self.gain is not None and not 0.0 < self.gain < 1.0:
            raise FitError(f"gain is a relative uncertainty such as 0.02, not {self.gain!r}")
        if self.aperture_deg is not None and not 0.0 < self.aperture_deg <= WIDEST_APERTURE:
            raise FitError(
                f"aperture_deg is a full angle above 0, up to {WIDEST_APERTURE:g} degrees, "
                f"not {self.aperture_deg!r}"
            )
        if self.reading not in ("flux", "radiance"):
            raise FitError(f"reading is 'flux' or 'radiance', not {self.reading!r}")
        if self.reading == "radiance" and not (self.bends or self.veil):
            raise FitError(
                "a reading of radiance changes nothing by itself; give a tilt, a veil or an aperture "
                "too"
            )

    @property
    def bends(self) -> bool:
        """Whether a row is seen along other directions than the nominal one."""
        return self.tilt or self.aperture_deg is not None

    @property
    def cosine(self) -> str:
        """What the signal is divided by."""
        return "cos_theta_o" if self.reading == "flux" else "cos_theta_i"

    def to_dict(self) -> dict[str, Any]:
        """Give the settings as JSON-ready values."""
        return asdict(self)

    def signal_cosine(self, theta_i: Array, theta_o: Array) -> Array:
        """Give the cosine that the signal goes with; the nominal one is divided by."""
        cosine: Array = np.cos(theta_o if self.reading == "flux" else theta_i)
        return cosine


def tilted(vectors: Array, tilt: tuple[float, float]) -> Array:
    """Turn directions into the frame of a tilted sample.

    Parameters
    ----------
    vectors : ndarray, shape (N, 3)
        Unit vectors in the instrument's frame.
    tilt : (float, float)
        Radians by which the sample's normal leans towards x and y.

    Returns
    -------
    ndarray, shape (N, 3)
        In the sample's frame: the least rotation that takes its normal to z (Rodrigues).
    """
    angle = math.hypot(*tilt)
    if angle == 0.0:
        return vectors
    axis = np.array([tilt[1], -tilt[0], 0.0]) / angle
    turned: Array = (
        vectors * math.cos(angle)
        + np.cross(axis, vectors) * math.sin(angle)
        + np.outer(vectors @ axis, axis) * (1.0 - math.cos(angle))
    )
    return turned


def views(angles: Angles, instrument: Instrument, tilt: tuple[float, float]) -> list[View]:
    """Give the directions along which an instrument sees each row, with their weights.

    Parameters
    ----------
    angles : tuple of ndarray, shape (N,)
        Nominal theta_i, phi_i, theta_o, phi_o in radians.
    instrument : Instrument
    tilt : (float, float)
        Of the sample, in radians.

    Returns
    -------
    list of View
        One; with an aperture 16.
    """
    theta_i, phi_i, theta_o, phi_o = angles
    nominal = instrument.signal_cosine(theta_i, theta_o)
    wi = _angles(tilted(_vectors(theta_i, phi_i), tilt))
    found: list[View] = []
    for shifted, share in _disc(_vectors(theta_o, phi_o), instrument.aperture_deg):
        wo = _angles(tilted(shifted, tilt))
        true = instrument.signal_cosine(wi[0], wo[0])
        weight = np.where(above_horizon(wi[0], wo[0]), share * true / nominal, 0.0)
        found.append(((*wi, *wo), weight))
    return found


def _disc(wo: Array, aperture_deg: float | None) -> list[tuple[Array, float]]:
    """Give directions within the aperture and their share of its solid angle."""
    if aperture_deg is None:
        return [(wo, 1.0)]
    nodes = []
    # Equal shares of 1 - cos(rho) are equal solid angles.
    cap = 1.0 - math.cos(0.5 * math.radians(aperture_deg))
    horizontal = np.hypot(wo[:, 0], wo[:, 1])
    pole = horizontal < 1e-12
    safe = np.where(pole, 1.0, horizontal)
    across = np.stack(
        [np.where(pole, 0.0, -wo[:, 1] / safe), np.where(pole, 1.0, wo[:, 0] / safe), 0.0 * safe],
        axis=1,
    )
    up = np.cross(across, wo)
    for ring, (part, weight) in enumerate(RINGS):
        cosine = 1.0 - part * cap
        sine = math.sqrt(1.0 - cosine * cosine)
        for k in range(RING_POINTS):
            turn = 2.0 * math.pi * (k + 0.5 * (ring % 2)) / RING_POINTS
            aside = math.cos(turn) * up + math.sin(turn) * across
            nodes.append((cosine * wo + sine * aside, weight / RING_POINTS))
    return nodes


def _vectors(theta: Array, phi: Array) -> Array:
    sine = np.sin(theta)
    return np.stack([sine * np.cos(phi), sine * np.sin(phi), np.cos(theta)], axis=1)


def _angles(v: Array) -> tuple[Array, Array]:
    # arctan2 keeps the digits near the normal, where arccos loses them.
    return np.arctan2(np.hypot(v[:, 0], v[:, 1]), v[:, 2]), np.arctan2(v[:, 1], v[:, 0])
