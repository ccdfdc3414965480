"""From a measurement to fitted models: read, fit, rank, sample, simulate.

The parts are imported at their first use.
"""

from typing import TYPE_CHECKING

from lobefit.kernels.lazy import load_lazily

# ruff: noqa: TC004 - these are imported at their first use
if TYPE_CHECKING:
    from lobefit.fitting.checks import DataCheck, DataChecks, check
    from lobefit.fitting.fit import fit
    from lobefit.fitting.instrument import Instrument
    from lobefit.fitting.measurement import Dropped, Measurement
    from lobefit.fitting.posterior import Posterior
    from lobefit.fitting.readers import read_measurement
    from lobefit.fitting.report import FitReport
    from lobefit.fitting.result import FitResult
    from lobefit.fitting.sample import sample
    from lobefit.fitting.scan_patterns import Hemisphere, InPlane
    from lobefit.fitting.simulate import simulate
    from lobefit.fitting.writers import write_measurement

__all__ = [
    "DataCheck",
    "DataChecks",
    "Dropped",
    "FitReport",
    "FitResult",
    "Hemisphere",
    "InPlane",
    "Instrument",
    "Measurement",
    "Posterior",
    "check",
    "fit",
    "read_measurement",
    "sample",
    "simulate",
    "write_measurement",
]

load_lazily(
    __name__,
    {
        "DataCheck": "checks",
        "DataChecks": "checks",
        "Dropped": "measurement",
        "FitReport": "report",
        "FitResult": "result",
        "Hemisphere": "scan_patterns",
        "InPlane": "scan_patterns",
        "Instrument": "instrument",
        "Measurement": "measurement",
        "Posterior": "posterior",
        "check": "checks",
        "fit": "fit",
        "read_measurement": "readers",
        "sample": "sample",
        "simulate": "simulate",
        "write_measurement": "writers",
    },
)
