"""Reflectance models as OpenCL kernels: evaluate them, sum over measurements, integrate them.

Importing this package does no device work; the first evaluation opens a device.
"""

from lobefit.kernels.albedo import directional_albedo
from lobefit.kernels.candidates import Candidate, candidate, candidates
from lobefit.kernels.device import Device, DeviceInfo, devices, get_device
from lobefit.kernels.errors import (
    DeviceError,
    FitError,
    LobefitError,
    MeasurementError,
    ModelError,
)
from lobefit.kernels.evaluate import evaluate
from lobefit.kernels.library import Lobe, Parameter
from lobefit.kernels.metals import conductor, metals
from lobefit.kernels.registry import Model, get_model, models

__all__ = [
    "Candidate",
    "Device",
    "DeviceError",
    "DeviceInfo",
    "FitError",
    "Lobe",
    "LobefitError",
    "MeasurementError",
    "Model",
    "ModelError",
    "Parameter",
    "candidate",
    "candidates",
    "conductor",
    "devices",
    "directional_albedo",
    "evaluate",
    "get_device",
    "get_model",
    "metals",
    "models",
]
