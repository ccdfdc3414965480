"""All checks of a measurement, in the order in which to read them."""

from __future__ import annotations

from lobefit.fitting.checks.azimuths import check_anisotropy
from lobefit.fitting.checks.duplicates import check_duplicates
from lobefit.fitting.checks.finding import DataChecks
from lobefit.fitting.checks.grazing import check_grazing
from lobefit.fitting.checks.mirror import check_mirror
from lobefit.fitting.checks.negative import check_negative
from lobefit.fitting.checks.peak import check_peak
from lobefit.fitting.checks.pi_factor import check_pi_factor
from lobefit.fitting.checks.reciprocity import check_cosine_factor, check_reciprocity, exchange
from lobefit.fitting.checks.retro import check_retro
from lobefit.fitting.checks.saturation import check_saturation
from lobefit.fitting.checks.surface import Fitted, fitted_surface
from lobefit.fitting.checks.units import check_units
from lobefit.fitting.checks.view import View
from lobefit.fitting.measurement import Measurement
from lobefit.fitting.result import FitResult
from lobefit.kernels import Device
from lobefit.kernels.errors import MeasurementError

__all__ = ["check"]


def check(
    measurement: Measurement,
    result: FitResult | None = None,
    *,
    device: str | Device | None = None,
) -> DataChecks:
    """Ask whether a measurement can be what it is declared to be.

    Parameters
    ----------
    measurement : Measurement
        What was measured.
    result : FitResult, optional
        A model fitted to it, for the albedo; without one the quick candidates are fitted to
        a thinned copy, which takes a second or two.
    device : str, Device or None
        For that fit; see `lobefit.kernels.get_device`.

    Returns
    -------
    DataChecks
        For each check a verdict ("ok", "suspicious" or "cannot tell"), figures, a sentence
        and a remedy.

    Raises
    ------
    MeasurementError
        Something else than a measurement was given.
    DeviceError
        No usable device.

    Examples
    --------
    >>> from lobefit.fitting import check, simulate
    >>> surface = simulate("lambert", {"k_d": 0.3}, noise=(0.01, 0.0), seed=1)
    >>> check(surface)["reciprocity"].verdict
    'ok'
    """
    if not isinstance(measurement, Measurement):
        raise MeasurementError(
            f"check takes a Measurement, not {type(measurement).__name__}; "
            "read a file with read_measurement first"
        )
    view = View(measurement)
    surface: Fitted | None = result or fitted_surface(view, device)
    pairs = exchange(view, surface)
    return DataChecks(
        (
            check_units(view),
            check_mirror(view),
            check_reciprocity(pairs),
            check_cosine_factor(pairs),
            check_pi_factor(view, surface),
            check_peak(view),
            check_negative(view),
            check_saturation(view),
            check_duplicates(view),
            check_anisotropy(view),
            check_retro(view),
            check_grazing(view),
        )
    )
