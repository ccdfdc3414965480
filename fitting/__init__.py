"""From a measurement to fitted models: read, fit, rank, sample, simulate."""

from lobefit.fitting.checks import DataCheck, DataChecks, check
from lobefit.fitting.fit import fit
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
    "Measurement",
    "Posterior",
    "check",
    "fit",
    "read_measurement",
    "sample",
    "simulate",
    "write_measurement",
]
