"""Readers: from a file to a `Measurement`, or to an error that names the place."""

from __future__ import annotations

from lobefit.fitting.readers.csv import read_measurement

__all__ = ["read_measurement"]
