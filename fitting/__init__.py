"""From a measurement to fitted models: read, fit, rank, simulate."""

from lobefit.fitting.fit import fit
from lobefit.fitting.measurement import Dropped, Measurement
from lobefit.fitting.readers import read_measurement
from lobefit.fitting.report import FitReport
from lobefit.fitting.result import FitResult
from lobefit.fitting.scan_patterns import Hemisphere, InPlane
from lobefit.fitting.simulate import simulate
from lobefit.fitting.writers import write_measurement

__all__ = [
    "Dropped",
    "FitReport",
    "FitResult",
    "Hemisphere",
    "InPlane",
    "Measurement",
    "fit",
    "read_measurement",
    "simulate",
    "write_measurement",
]
