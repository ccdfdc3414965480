"""Scattered incidences pooled into bands of theta_i, so that there are lobes to show.

Where nearly every reading has an incidence of its own (a table over half and difference angles,
a hand-held instrument), no single incidence shows a lobe. On a surface whose azimuth does not
matter, readings of like theta_i do: each is turned to one azimuth of incidence.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lobefit.fitting.measurement import Measurement
from lobefit.fitting.result import FitResult
from lobefit.kernels.candidates import candidate

__all__ = ["Bands", "Groups", "is_isotropic", "is_scattered", "pool"]

Index = NDArray[np.intp]
Groups = dict[tuple[float, float], Index]

FEW_ROWS = 3
"""With fewer readings in the median incidence, incidences are scattered."""


@dataclass(frozen=True, eq=False)
class Bands:
    """Readings by bands of theta_i.

    Attributes
    ----------
    turned : Measurement
        All readings, with one azimuth of incidence.
    groups : dict
        The middle of a band in radians and that azimuth, ascending, to the indices of its rows.
    edges : dict
        The same keys to the band's lower and upper edge in degrees.
    width : float
        Degrees; bands at 0 and 90 degrees may be half as wide.
    """

    turned: Measurement
    groups: Groups
    edges: dict[tuple[float, float], tuple[float, float]]
    width: float


def is_isotropic(result: FitResult) -> bool:
    """Tell whether only the difference of the azimuths matters to a fitted model."""
    return candidate(result.candidate, dict(result.options)).isotropic


def is_scattered(measurement: Measurement, groups: Groups, *, isotropic: bool) -> bool:
    """Tell whether incidences have too few readings each, and pooling them is allowed.

    Parameters
    ----------
    measurement : Measurement
        What was measured.
    groups : dict
        Its rows by incidence.
    isotropic : bool
        Whether the model is; else the sample must not have been turned.
    """
    few = float(np.median([len(rows) for rows in groups.values()])) < FEW_ROWS
    return few and (isotropic or not measurement.has_azimuthal_evidence)


def pool(measurement: Measurement, width: float) -> Bands:
    """Sort the readings into bands of theta_i.

    Parameters
    ----------
    measurement : Measurement
        What was measured.
    width : float
        Of a band, in degrees; a divisor of 90. Bands begin at 0, unless the incidences stand
        close to multiples of `width`, which then are the middles.
    """
    m = measurement
    # A sample that was not turned keeps its azimuth: to an anisotropic model it matters.
    phi = 0.0 if m.has_azimuthal_evidence else float(m.phi_i[np.argmax(m.theta_i)])
    turned = replace(m, phi_i=np.full_like(m.phi_i, phi), phi_o=m.phi_o - m.phi_i + phi)
    steps = np.rad2deg(m.theta_i) / width
    # Readings of one incidence must not be parted by an edge that they scatter about.
    centred = np.abs(steps - np.rint(steps)).mean() < 0.1
    shift = 0.5 if centred else 0.0
    band = np.floor(steps + shift + 1e-9).astype(int)
    band = np.minimum(band, round(90.0 / width + 2 * shift) - 1)  # nothing begins at the horizon
    groups: Groups = {}
    edges = {}
    for number in np.unique(band).tolist():
        low = max((number - shift) * width, 0.0)
        high = min((number + 1 - shift) * width, 90.0)
        middle = number * width if centred and high < 90.0 else (low + high) / 2
        key = (float(np.deg2rad(middle)), phi)
        groups[key], edges[key] = np.flatnonzero(band == number), (low, high)
    return Bands(turned, groups, edges, width)
