"""Degrees and radians: angles whose range tells that they are the other unit.

The reader refuses what is certain; this looks for what it lets pass, and at measurements that
were not read from a file.
"""

from __future__ import annotations

from functools import partial

import numpy as np
from numpy.typing import NDArray

from lobefit.fitting.checks.finding import DataCheck
from lobefit.fitting.checks.view import View

__all__ = ["check_units"]

# A quarter and a full turn in radians, rounded generously.
QUARTER, FULL = 1.6, 6.3


def check_units(view: View) -> DataCheck:
    """Look at the ranges of polar angles and azimuths."""
    m = view.m
    theta = float(np.degrees(max(m.theta_i.max(), m.theta_o.max())))
    raw = float(max(np.abs(m.phi_i).max(), np.abs(m.phi_o).max()))
    azimuths = np.degrees(np.concatenate([m.phi_i, m.phi_o]))
    azimuths = np.abs(180.0 - np.mod(180.0 - azimuths, 360.0))
    phi = float(azimuths.max())
    figures = {"largest_theta_deg": theta, "largest_phi_deg": phi}
    answer = partial(DataCheck, name="degrees or radians", figures=figures)
    if m.metadata.get("small_angles", "no").lower() not in ("yes", "true") and 0 < theta <= QUARTER:
        return answer(
            verdict="suspicious",
            sentence=f"No polar angle is above {theta:.4g}°, as if radians had been taken for degrees.",
            remedy="declare `# angle_unit: rad`, or `# small_angles: yes` if these are degrees; "
            "in Python pass radians that were converted once",
        )
    if raw > 2.0 * FULL and _whole(raw):
        return answer(
            verdict="suspicious",
            figures=figures | {"largest_phi_rad": raw},
            sentence=f"Azimuths go up to {raw:.4g} radians, as if degrees had been taken for radians.",
            remedy="convert azimuths by numpy.deg2rad",
        )
    if 0.0 < phi <= FULL and theta > 10.0 * QUARTER:
        turns = azimuths / (0.5 * np.pi)
        right = (azimuths > 1.0) & (np.abs(turns - np.rint(turns)) < 1e-3)
        if right.any() or not _whole(azimuths):
            return answer(
                verdict="suspicious",
                sentence=f"Polar angles go up to {theta:.3g}°, azimuths only to {phi:.4g}°, "
                "as if azimuths were in radians.",
                remedy="write all four angles in one unit",
            )
        return answer(
            verdict="cannot tell",
            sentence=f"All azimuths lie within {phi:.3g}° of one direction.",
            remedy="make sure that azimuths are in the unit of the polar angles",
        )
    return answer(
        verdict="ok",
        sentence=f"Polar angles go up to {theta:.3g}° and azimuths to {phi:.3g}°, as degrees do.",
    )


def _whole(numbers: float | NDArray[np.float64]) -> bool:
    return bool(np.all(np.abs(numbers - np.rint(numbers)) < 1e-3))
