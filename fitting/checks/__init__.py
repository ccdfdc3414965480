"""Checks of a measurement: whether its numbers can be what they are declared to be."""

from lobefit.fitting.checks.finding import DataCheck, DataChecks
from lobefit.fitting.checks.run import check

__all__ = ["DataCheck", "DataChecks", "check"]
