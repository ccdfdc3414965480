"""What pictures are compared with: the measured data where they suffice, else a fit.

The data suffice if the fit found the surface isotropic, the scene has no environment (whose
integral takes directions that nobody measured), readings lie near `MOST` of the directions that
the picture needs, and readings left out are predicted within half the tolerance. The remaining
directions are filled from the fit. Else the reference is the richest sufficient fit
(`lobefit.fitting.scene_candidates`). Either is shaded at the true surface where that is known,
else per pixel on a mesh one level finer than any that is tried; an environment is integrated with
four times as many nodes as the pictures that are tried, and what that may still be off is said.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lobefit.fitting.scene_candidates import Fits, ShadingModel
from lobefit.fitting.scene_colour import MEASURES, Errors, Yardstick, exposure_factor
from lobefit.fitting.scene_data import Interpolation
from lobefit.fitting.scene_file import SceneRequest
from lobefit.kernels.lights import light_rows
from lobefit.kernels.render import Prepared
from lobefit.kernels.scene import Scene
from lobefit.kernels.shapes import EXACT, FINEST
from lobefit.kernels.surface import Surface

__all__ = ["Reference", "make_reference"]

Array = NDArray[np.float64]

MOST = 0.9
HALF = 0.5
MESH_FACES = 4_000_000
# Of an environment's quadrature: four times what the renderer takes by itself.
NODES, CELLS = (16, 48), 8192


@dataclass(frozen=True, eq=False)
class Reference:
    """The picture that others are compared with.

    Attributes
    ----------
    kind : {"data", "fit"}
    model : str
        The fit, or what fills the gaps of the data.
    why : str
        Why this and not the other, in a sentence.
    shading : str
        How it is shaded.
    picture : ndarray, shape (C, H, W)
        Radiance.
    mask : ndarray of bool, shape (H, W)
    left_out : Errors or None
        Of readings left out, as colours or relative radiance under the brightest light.
    covered : float or None
        Share of the directions of light and view that readings lie near.
    environment_error : Errors or None
        What the estimated error of the environment's integral would make of the picture.
    """

    kind: str
    model: str
    why: str
    shading: str
    picture: Array
    mask: NDArray[np.bool_]
    left_out: Errors | None
    covered: float | None
    environment_error: Errors | None

    def to_dict(self) -> dict[str, Any]:
        """Give everything but the pictures, JSON-ready."""
        return {
            "kind": self.kind,
            "model": self.model,
            "why": self.why,
            "shading": self.shading,
            "left_out": _errors(self.left_out),
            "covered": self.covered,
            "environment_error": _errors(self.environment_error),
        }


def _errors(found: Errors | None) -> dict[str, float] | None:
    if found is None:
        return None
    return {"mean": found.mean, "p99": found.p99, "largest": found.largest}


def make_reference(
    request: SceneRequest, scene: Scene, fits: Fits, *, device: str | None = None
) -> Reference:
    """Choose the reference and render it.

    Parameters
    ----------
    request : SceneRequest
        Tolerance and levels.
    scene : Scene
        What is rendered.
    fits : Fits
        The models, and the samples if they are there.
    device : str, optional
        See `lobefit.kernels.get_device`.
    """
    model = fits.reference
    shape, faces = scene.shape, 0
    exact = isinstance(shape, str) and shape in EXACT
    level = min(max(request.levels) + 1, FINEST)
    if not isinstance(shape, str):
        faces = len(shape.faces)
        while level > max(request.levels) and faces * 4**level > MESH_FACES:
            level -= 1
    prepared = Prepared(
        scene,
        shading="exact" if exact else "phong",
        subdivision=level,
        device=device,
        nodes=NODES,
        cells=CELLS,
    )
    with prepared:
        made = prepared.render(
            model.fitted.model, model.fitted.params, options=model.fitted.options
        )
        picture = made.beauty.astype(np.float64)
        surface = prepared.surface
    off = None
    if scene.environment is not None and made.mask.any():
        factor = exposure_factor(request.exposure, picture, made.mask)
        yardstick = Yardstick(request.tolerance.measure, picture, made.mask, factor)
        off = yardstick.errors(picture + made.error, made.mask)
    reference = Reference(
        kind="fit",
        model=model.name,
        why="",
        shading="the true surface, per pixel" if exact else f"per pixel, level {level}",
        picture=picture,
        mask=made.mask,
        left_out=None,
        covered=None,
        environment_error=off,
    )
    return _with_data(request, scene, fits, model, reference, surface, device)


def _with_data(
    request: SceneRequest,
    scene: Scene,
    fits: Fits,
    model: ShadingModel,
    fit: Reference,
    surface: Surface,
    device: str | None,
) -> Reference:
    """Give the reference from the data, or the fit and why the data do not suffice."""
    rest = f"so it is {_richest(fits, model)}"
    if fits.samples is None:
        return replace(fit, why=f"No samples.csv lies beside the report, {rest}.")
    if scene.environment is not None:
        why = f"An environment takes directions that were not measured, {rest}."
        return replace(fit, why=f"{why} {_environment(request, fit.environment_error)}".strip())
    if not model.fitted.isotropic:
        return replace(
            fit, why=f"The surface is anisotropic and was not measured at every azimuth, {rest}."
        )
    data = Interpolation(fits.samples)
    if not data.usable or not surface.pixels.size:
        return replace(fit, why=f"The readings are too few to interpolate between, {rest}.")
    values, covered = _shade(scene, surface, data, model)
    light = _ambient(scene, model, fit.shading, request, device)
    picture = np.zeros_like(fit.picture)
    picture.reshape(len(picture), -1)[:, surface.pixels] = values
    picture += light
    left = _left_out(request, scene, data, fit)
    excess = request.tolerance.excess(left.mean, left.p99)
    found = replace(fit, left_out=left, covered=covered)
    if covered < MOST:
        return replace(
            found, why=f"Readings lie near only {covered:.0%} of the directions needed, {rest}."
        )
    if excess > HALF:
        return replace(
            found,
            why="Readings left out are predicted by the others with an error (their own noise "
            f"included) of {excess:.2g} times the tolerance, more than half of it, {rest}.",
        )
    return replace(
        found,
        kind="data",
        picture=picture,
        why=f"Readings lie near {covered:.1%} of the directions needed (the rest is filled from "
        f"{model.name}), and readings left out are predicted within {excess:.2g} times the "
        "tolerance, so it is the measured data, interpolated in half-difference angles.",
    )


def _environment(request: SceneRequest, off: Errors | None) -> str:
    """Say how well the integral over the environment is known."""
    if off is None:
        return ""
    excess = request.tolerance.excess(off.mean, off.p99)
    text = (
        f"Its integral over the environment is estimated to be known within {excess:.2g} times the "
        f"tolerance (mean {MEASURES[request.tolerance.measure]} {off.mean:.2g}, 99th percentile "
        f"{off.p99:.2g})"
    )
    if excess > HALF:
        text += (
            ", which is too little to rely on the answer: replace what is small and bright in the "
            "environment by lights, or smooth it"
        )
    return f"{text}."


def _richest(fits: Fits, model: ShadingModel) -> str:
    text = f"the richest sufficient fit, {model.name}"
    if model.log10_rms is not None:
        text += f" (which is off the data by a factor of {10**model.log10_rms:.3f}, rms)"
    if not fits.described:
        text += "; the report says that none describes the surface"
    return text


def _shade(
    scene: Scene, surface: Surface, data: Interpolation, model: ShadingModel
) -> tuple[Array, float]:
    """Sum over the lights with interpolated data; give radiance (C, M) and the share covered."""
    channels = max(scene.channels, len(data.values))
    total = np.zeros((channels, len(surface.pixels)))
    theta_o = np.arccos(np.clip((surface.normal * surface.view).sum(axis=1), 0.0, 1.0))
    bitangent = np.cross(surface.normal, surface.tangent)

    def azimuth(vectors: Array) -> Array:
        across = (vectors * bitangent).sum(axis=1)
        return np.asarray(np.arctan2(across, (vectors * surface.tangent).sum(axis=1)))

    phi_o = azimuth(surface.view)
    pairs, reached = 0, 0
    for row in light_rows(scene.lights, channels):
        to = row[:3] - row[3] * surface.position
        squared = (to * to).sum(axis=1)
        to = to / np.sqrt(squared)[:, None]
        cosine = (to * surface.normal).sum(axis=1)
        lit = np.flatnonzero(cosine > 1e-6)
        if not lit.size:
            continue
        theta_i, phi_i = np.arccos(np.clip(cosine[lit], 0.0, 1.0)), azimuth(to)[lit]
        values, covered = data(theta_i, theta_o[lit], phi_o[lit] - phi_i)
        gaps = np.logical_not(covered)
        angles = (theta_i[gaps], phi_i[gaps], theta_o[lit][gaps], phi_o[lit][gaps])
        values[:, gaps] = model.fitted.evaluate(*angles)
        falloff = 1.0 / squared[lit] if row[3] else 1.0
        total[:, lit] += values * row[4:, None] * cosine[lit] * falloff
        pairs, reached = pairs + lit.size, reached + int(np.count_nonzero(covered))
    return total, reached / pairs if pairs else 0.0


def _ambient(
    scene: Scene, model: ShadingModel, shading: str, request: SceneRequest, device: str | None
) -> Array | float:
    """Give what ambient light adds: the data have no diffuse term, so the fit's is taken."""
    if not np.any(scene.ambient):
        return 0.0
    dark = replace(scene, lights=(), environment=None)
    level = min(max(request.levels) + 1, FINEST)
    kind = "exact" if shading.startswith("the true") else "phong"
    with Prepared(dark, shading=kind, subdivision=level, device=device) as prepared:  # type: ignore[arg-type]
        made = prepared.render(
            model.fitted.model, model.fitted.params, options=model.fitted.options
        )
        return np.asarray(made.beauty, dtype=np.float64)


def _left_out(request: SceneRequest, scene: Scene, data: Interpolation, fit: Reference) -> Errors:
    """Compare readings left out with their predictions, facing the brightest light."""
    found = data.left_out()
    channels = max(scene.channels, len(found.measured))
    centre = scene.matrix[:3, 3]
    powers = []
    for row in light_rows(scene.lights, channels):
        squared = float(((row[:3] - centre) ** 2).sum()) if row[3] else 1.0
        powers.append(row[4:] / max(squared, 1e-12))
    power = max(powers, key=lambda p: float(p.sum()))[:, None, None]
    measured, predicted = (
        v[:, None, :] * found.cos_theta_i * power for v in (found.measured, found.predicted)
    )
    factor = exposure_factor(request.exposure, fit.picture, fit.mask)
    everywhere = np.ones(measured.shape[1:], dtype=bool)
    yardstick = Yardstick(request.tolerance.measure, measured, everywhere, factor)
    return yardstick.errors(predicted, everywhere)
