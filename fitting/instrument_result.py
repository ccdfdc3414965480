"""What a fit found of the instrument, kept apart from what it found of the surface."""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lobefit.fitting.instrument import Instrument, views
from lobefit.fitting.instrument_nuisance import MOUNTING
from lobefit.fitting.point import PointFit
from lobefit.fitting.problem import Problem
from lobefit.fitting.result import FitResult, ParameterEstimate, Status
from lobefit.kernels.veil import VEIL

__all__ = [
    "InstrumentFit",
    "instrument_fit",
    "readings",
    "surface_alone",
    "tilt_rows",
    "without_veil",
]

Array = NDArray[np.float64]

# A tilt whose error is so much of what was believed before is not determined by the data.
UNDETERMINED = 0.5


@dataclass(frozen=True, slots=True, kw_only=True)
class InstrumentFit:
    """What a fit accounted for, and what it found.

    Attributes
    ----------
    settings : Instrument
        What was asked for.
    estimates : tuple of ParameterEstimate
        "tilt_x" and "tilt_y": by how many degrees the sample's normal leans towards the x and
        y axes of the angles (azimuth 0 and 90 degrees); "undetermined" where no reading tells,
        as across the plane of a scan in one plane. "veil" of each channel in 1/sr: the constant
        part of f cos(theta_o), for a reading of radiance of f cos(theta_i).
    sentences : tuple of str
        What else the user should know.
    """

    settings: Instrument
    estimates: tuple[ParameterEstimate, ...]
    sentences: tuple[str, ...]

    def __getitem__(self, name: str) -> ParameterEstimate:
        """Give an estimate by its name, with the channel in brackets where it has one."""
        for e in self.estimates:
            if name in (e.name, e.label):
                return e
        raise KeyError(name)

    @property
    def tilt(self) -> tuple[float, float]:
        """The tilt in radians; 0 where it was not fitted."""
        found = {e.name: float(np.radians(e.value)) for e in self.estimates}
        return found.get("tilt_x", 0.0), found.get("tilt_y", 0.0)

    def to_dict(self) -> dict[str, Any]:
        """Give everything as JSON-ready values."""
        return {
            "settings": self.settings.to_dict(),
            "estimates": [asdict(e) for e in self.estimates],
            "sentences": list(self.sentences),
        }


def tilt_rows(fit: PointFit, covariance: Array) -> tuple[ParameterEstimate, ...]:
    """Give the tilt's two angles with their errors.

    Parameters
    ----------
    fit : PointFit
    covariance : ndarray, shape (2, 2) or (0, 0)
        In radians squared.
    """
    if fit.nuisance is None or not len(fit.nuisance.tilt):
        return ()
    found = []
    for name, towards, value, variance in zip(
        ("tilt_x", "tilt_y"),
        ("azimuth 0", "azimuth 90 degrees"),
        np.degrees(fit.nuisance.tilt),
        np.diag(covariance),
        strict=True,
    ):
        known = 0.0 < variance < (UNDETERMINED * MOUNTING) ** 2
        status: Status = "free" if known else "undetermined"
        found.append(
            ParameterEstimate(
                name=name,
                channel=None,
                value=float(value),
                standard_error=float(np.degrees(np.sqrt(variance))) if known else None,
                status=status,
                unit="deg",
                meaning=f"tilt of the sample's normal towards {towards}",
            )
        )
    return tuple(found)


def instrument_fit(instrument: Instrument, tilts: tuple[ParameterEstimate, ...]) -> InstrumentFit:
    """Put together what was found of the instrument, but for the veil; see `without_veil`."""
    return InstrumentFit(
        settings=instrument, estimates=tilts, sentences=tuple(_sentences(instrument, tilts))
    )


def readings(
    result: FitResult, theta_i: Array, phi_i: Array, theta_o: Array, phi_o: Array
) -> Array:
    """Predict what the instrument reads of the fitted surface.

    Parameters
    ----------
    result : FitResult
    theta_i, phi_i, theta_o, phi_o : ndarray, shape (N,)
        Nominal directions in radians.

    Returns
    -------
    ndarray, shape (C, N)
        In 1/sr; what `FitResult.predict` gives where the fit accounted for no instrument.
    """
    found = result.instrument
    if found is None:
        return result.predict(theta_i, phi_i, theta_o, phi_o)
    angles = (theta_i, phi_i, theta_o, phi_o)
    seen = views(angles, found.settings, found.tilt)
    total = sum((weight * result.predict(*at) for at, weight in seen), np.zeros(1))
    veils = np.array([e.value for e in found.estimates if e.name == VEIL])
    nominal = found.settings.signal_cosine(theta_i, theta_o)
    return total + veils[:, None] / nominal if len(veils) else total


def surface_alone(problem: Problem, c: Array) -> Array:
    """Give the coefficients (C, K) of the surface, with no veil."""
    products = problem.candidate.model.coefficients
    if (VEIL,) not in products:
        return c
    alone = c.copy()
    alone[:, products.index((VEIL,))] = 0.0
    return alone


def without_veil(result: FitResult) -> FitResult:
    """Move the veil out of a result's parameters into what was found of the instrument.

    Parameters
    ----------
    result : FitResult
        As fitted.

    Returns
    -------
    FitResult
        Parameters, estimates and covariance are the surface's alone.
    """
    if result.instrument is None or VEIL not in result.params:
        return result
    rows = [e for e in result.estimates if not e.held]
    kept = [k for k, e in enumerate(rows) if e.name != VEIL]
    veils = tuple(e for e in result.estimates if e.name == VEIL)
    return replace(
        result,
        params={name: value for name, value in result.params.items() if name != VEIL},
        estimates=tuple(e for e in result.estimates if e.name != VEIL),
        covariance=result.covariance[np.ix_(kept, kept)],
        instrument=replace(result.instrument, estimates=(*result.instrument.estimates, *veils)),
    )


def _sentences(instrument: Instrument, tilts: tuple[ParameterEstimate, ...]) -> list[str]:
    said = []
    vague = [e.name for e in tilts if e.status == "undetermined"]
    if vague:
        said.append(
            f"{' and '.join(vague)} cannot be told from these readings; scans in another plane would"
        )
    if instrument.gain is not None:
        said.append(
            f"errors include {100 * instrument.gain:g} % of each channel's calibration, "
            "which no reading can tell from the scale of the reflectance"
        )
    if instrument.aperture_deg is not None:
        said.append(f"lobes were convolved with an aperture of {instrument.aperture_deg:g} degrees")
    return said
