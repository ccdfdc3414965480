"""The stated rules by which a table's rows become a measurement.

In this order, each counted in the measurement's `dropped` or `notes`:

1. A row with ``nan`` in an angle is dropped.
2. Angles must fit their unit. Radians declared as degrees, and the reverse, are errors, and so
   is a negative polar angle. Polar angles that are all at most 1.6 (and azimuths within 6.3)
   are taken for radians; a file in degrees that really is so narrow says ``# small_angles: yes``.
3. A row at or below the horizon (theta of 90 degrees, less half a thousandth) is dropped.
4. A fill value such as -1 or -999 becomes a missing value; other negative values stay.
5. Uncertainties must be positive and finite wherever there is a value.
6. A row without a value in any channel is dropped.
7. ``cosine-weighted brdf`` is divided by cos(theta_o), ``radiance factor`` by pi.
8. At the pole the azimuth means nothing: phi_i is set to 0 where theta_i is 0, phi_o where
   theta_o is 0. Rows of the same direction (to 1e-9 degrees) are averaged, see `merge`.
9. Every channel must have a positive value, and there must be at least 5 directions.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lobefit.fitting.readers.fill import blank_fill_values
from lobefit.fitting.readers.header import Header
from lobefit.fitting.readers.merge import merge_directions
from lobefit.fitting.readers.table import Table, count_of, lines_of

__all__ = ["MIN_DIRECTIONS", "apply_rules"]

MIN_DIRECTIONS = 5
"""Fewer distinct directions describe no surface; each model needs its own number besides."""

# Half of the third decimal: files round 90 degrees, and pi/2 as 1.5708 or 1.57079.
_HORIZON_DEG = 90 - 5e-4
# Beyond this an angle is in degrees, not radians: half and full turns, rounded generously.
_MAX_THETA_RAD = np.pi * 1.001
_MAX_PHI_RAD = 2 * np.pi * 1.001
_MAX_THETA_DEG = 180.0
_MAX_PHI_DEG = 360.0 * 1.000001
_THETA_LIKE_RAD = 1.6
_PHI_LIKE_RAD = 6.3


def apply_rules(table: Table, header: Header) -> None:
    """Bring a table to clean directions in degrees and BRDF in 1/sr, in place.

    Parameters
    ----------
    table : Table
        Rows as written in the file.
    header : Header
        Units, quantity and assertions of the file.

    Raises
    ------
    MeasurementError
        If a rule finds the table unusable; the message says where and what to do.
    """
    unknown = np.zeros(len(table.lines), dtype=bool)
    for angle in table.angles.values():
        unknown |= np.isnan(angle)
    table.drop(unknown, "with nan in an angle")
    _check_units(table, header)
    if header.angle_unit == "rad":
        for name in table.angles:
            table.angles[name] = np.rad2deg(table.angles[name])
    below = table.angles["theta_i"] >= _HORIZON_DEG
    below |= table.angles["theta_o"] >= _HORIZON_DEG
    table.drop(below, "at or below the horizon")
    for channel in table.values:
        blank_fill_values(table, channel)
    _check_sigmas(table)
    _drop_empty(table)
    _convert(table, header.quantity)
    for name in ("phi_i", "phi_o"):
        wrapped = np.mod(table.angles[name], 360.0)
        wrapped[wrapped == 360.0] = 0.0  # of a tiny negative azimuth
        wrapped[table.angles[name.replace("phi", "theta")] == 0] = 0.0
        table.angles[name] = wrapped
    merge_directions(table)
    _check_enough(table)


def _check_units(table: Table, header: Header) -> None:
    thetas = [table.angles["theta_i"], table.angles["theta_o"]]
    phis = [table.angles["phi_i"], table.angles["phi_o"]]
    radians = header.angle_unit == "rad"
    theta_limit = _MAX_THETA_RAD if radians else _MAX_THETA_DEG
    phi_limit = _MAX_PHI_RAD if radians else _MAX_PHI_DEG
    for name, angle in table.angles.items():
        polar = name.startswith("theta")
        beyond = np.abs(angle) > (theta_limit if polar else phi_limit)
        if radians:
            table.refuse(
                beyond,
                name,
                "{} is no angle in radians, as angle_unit declares; the file seems to be in degrees",
                "# angle_unit: deg, or angles in radians",
            )
        else:
            limits = "0 to 90" if polar else "-360 to 360"
            table.refuse(beyond, name, "{} is no angle in degrees", f"{limits} degrees")
    for name in ("theta_i", "theta_o"):
        azimuth, half = name.replace("theta", "phi"), "pi" if radians else "180"
        table.refuse(
            table.angles[name] < 0,
            name,
            "the polar angle {} is negative",
            f"the angle from the normal: write {name} = |{name}| and {azimuth} + {half}",
        )
    if radians or header.small_angles:
        return
    widest = max(float(angle.max()) for angle in thetas)
    if not 0 < widest <= _THETA_LIKE_RAD:
        return
    turn = max(float(np.abs(angle).max()) for angle in phis)
    distinct = np.unique(np.concatenate(thetas))
    if distinct.size >= 3 and np.any(distinct % 1):
        if turn <= _PHI_LIKE_RAD:
            name = "theta_o" if float(thetas[1].max()) == widest else "theta_i"
            at = int(np.argmax(table.angles[name]))
            raise table.error(
                f"the angles look like radians but are read as degrees: the largest polar angle is "
                f"{widest:.6g}, the largest azimuth {turn:.6g}",
                row=int(table.lines[at]),
                column=name,
                text=f"{widest:.10g}",
                expected="# angle_unit: rad, or # small_angles: yes if these are degrees",
            )
        table.notes.append(
            f"all polar angles are at most {widest:.6g} degrees; azimuths up to {turn:.6g} degrees "
            "say that they are not radians"
        )


def _check_sigmas(table: Table) -> None:
    for channel, sigma in table.sigmas.items():
        missing = np.isnan(table.values[channel])
        table.refuse(
            ~missing & ~(sigma > 0),
            f"sigma_{channel}",
            "the uncertainty of a value is {}",
            "a positive number wherever the channel has a value",
        )
        sigma[missing] = np.nan


def _drop_empty(table: Table) -> None:
    for channel, values in table.values.items():
        missing = np.isnan(values)
        count = int(np.count_nonzero(missing))
        if count == len(values):
            why = "".join(f" ({note})" for note in table.notes if f"channel {channel}:" in note)
            raise table.error(
                f"the channel has no value in any of {count_of(count, 'usable row')}{why}",
                column=channel,
                expected="a number in most rows; remove the column if it was not measured",
            )
        if count:
            table.notes.append(
                f"channel {channel}: {count_of(count, 'value')} missing "
                f"({lines_of(table.lines[missing])})"
            )
    empty = np.ones(len(table.lines), dtype=bool)
    for values in table.values.values():
        empty &= np.isnan(values)
    table.drop(empty, "without a value in any channel")


def _convert(table: Table, quantity: str) -> None:
    factor: float | NDArray[np.float64]
    if quantity == "cosine-weighted brdf":
        factor, how = 1 / np.cos(np.deg2rad(table.angles["theta_o"])), "divided by cos(theta_o)"
    elif quantity == "radiance factor":
        factor, how = 1 / np.pi, "divided by pi"
    else:
        return
    for columns in (table.values, table.sigmas):
        for values in columns.values():
            values *= factor
    table.notes.append(f"{quantity} converted to brdf [1/sr]: {how}")


def _check_enough(table: Table) -> None:
    for channel, values in table.values.items():
        if not np.any(values > 0):
            zero = not np.any(values < 0)
            raise table.error(
                "the channel is zero in every row" if zero else "the channel has no positive value",
                row=int(table.lines[0]),
                column=channel,
                text=f"{np.nanmax(values):.10g}",
                expected="a BRDF in 1/sr, positive somewhere; remove the column otherwise",
            )
    directions = len(table.lines)
    if directions < MIN_DIRECTIONS:
        why = f" (left out: {table.left_out})" if table.dropped else ""
        raise table.error(
            f"only {count_of(directions, 'distinct direction')}{why}",
            row=int(table.lines[0]),
            expected=f"at least {MIN_DIRECTIONS}, and more than a model has parameters",
        )
