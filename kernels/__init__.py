"""Reflectance models as OpenCL kernels: evaluate them, sum over measurements, integrate them.

Importing this package does no device work; the first evaluation opens a device. Its parts are
imported at their first use, so that its errors can be caught where numpy is not installed.
"""

from typing import TYPE_CHECKING

from lobefit.kernels.errors import (
    DeviceError,
    FitError,
    LobefitError,
    MeasurementError,
    ModelError,
    SceneError,
)
from lobefit.kernels.lazy import load_lazily

# ruff: noqa: TC004 - these are imported at their first use
if TYPE_CHECKING:
    from lobefit.kernels.albedo import directional_albedo
    from lobefit.kernels.camera import Camera
    from lobefit.kernels.candidates import Candidate, candidate, candidates
    from lobefit.kernels.device import Device, DeviceInfo, devices, get_device
    from lobefit.kernels.evaluate import evaluate
    from lobefit.kernels.library import Lobe, Parameter
    from lobefit.kernels.lights import DirectionalLight, Environment, PointLight
    from lobefit.kernels.mesh_file import read_mesh
    from lobefit.kernels.metals import conductor, metals
    from lobefit.kernels.registry import Model, get_model, models
    from lobefit.kernels.render import Rendering, render
    from lobefit.kernels.scene import Scene

__all__ = [
    "Camera",
    "Candidate",
    "Device",
    "DeviceError",
    "DeviceInfo",
    "DirectionalLight",
    "Environment",
    "FitError",
    "Lobe",
    "LobefitError",
    "MeasurementError",
    "Model",
    "ModelError",
    "Parameter",
    "PointLight",
    "Rendering",
    "Scene",
    "SceneError",
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
    "read_mesh",
    "render",
]

load_lazily(
    __name__,
    {
        "Camera": "camera",
        "Candidate": "candidates",
        "Device": "device",
        "DeviceInfo": "device",
        "DirectionalLight": "lights",
        "Environment": "lights",
        "Lobe": "library",
        "Model": "registry",
        "Parameter": "library",
        "PointLight": "lights",
        "Rendering": "render",
        "Scene": "scene",
        "candidate": "candidates",
        "candidates": "candidates",
        "conductor": "metals",
        "devices": "device",
        "directional_albedo": "albedo",
        "evaluate": "evaluate",
        "get_device": "device",
        "get_model": "registry",
        "metals": "metals",
        "models": "registry",
        "read_mesh": "mesh_file",
        "render": "render",
    },
)
