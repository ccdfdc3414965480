"""No more than a scene needs: the cheapest model and shading whose picture is good enough.

Every fitted model is shaded flat, after Gouraud and after Phong, at each subdivision level that
the scene names. Each picture is compared with a reference (`lobefit.fitting.scene_reference`) by
the scene's measure (`lobefit.fitting.scene_colour`), each frame is timed
(`lobefit.fitting.scene_cost`), and of those within the tolerance the cheapest is the answer
(`lobefit.fitting.scene_answer`).
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lobefit.fitting.export.fitted import Channels
from lobefit.fitting.scene_answer import Answer, Combination, answer_for
from lobefit.fitting.scene_candidates import Fits, ShadingModel, read_fits
from lobefit.fitting.scene_colour import Errors, Yardstick, exposure_factor, need_colour_science
from lobefit.fitting.scene_cost import Cost, counted_work, take_turns
from lobefit.fitting.scene_environment import read_environment
from lobefit.fitting.scene_file import SceneRequest, Tolerance, read_scene
from lobefit.fitting.scene_reference import Reference, make_reference
from lobefit.kernels.device import get_device
from lobefit.kernels.errors import SceneError
from lobefit.kernels.lights import DirectionalLight, Environment
from lobefit.kernels.mesh_file import read_mesh
from lobefit.kernels.render import CELLS, Prepared, Rendering
from lobefit.kernels.scene import Scene
from lobefit.kernels.surface import Shading

__all__ = ["Answer", "Combination", "Decision", "Shown", "decide"]

Progress = Callable[[int, int, str], None]
ROUNDS, TIMING = 3, 2.5


@dataclass(frozen=True, eq=False)
class Shown:
    """A combination's picture.

    Attributes
    ----------
    rendering : Rendering
    differences : ndarray, shape (H, W)
        Error of each pixel.
    """

    rendering: Rendering
    differences: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Decision:
    """The answer to a scene.

    Attributes
    ----------
    request : SceneRequest
    fits : Fits
    reference : Reference
    factor : float
        Exposure: what radiance is multiplied by.
    combinations : tuple of Combination
        All, from cheap to dear.
    answer : Answer
        For the scene's tolerance.
    chosen, cheaper : Shown or None
        Their pictures.
    channels : tuple of str
        Of the pictures.
    device : str
    seconds : float
        Wall time of everything.
    """

    request: SceneRequest
    fits: Fits
    reference: Reference
    factor: float
    combinations: tuple[Combination, ...]
    answer: Answer
    chosen: Shown | None
    cheaper: Shown | None
    channels: tuple[str, ...]
    device: str
    seconds: float

    def answer_for(self, tolerance: Tolerance) -> Answer:
        """Answer for another tolerance from the same pictures and times."""
        return answer_for(self.combinations, tolerance)

    @property
    def sentence(self) -> str:
        """The answer in words."""
        from lobefit.fitting.scene_texts import sentence

        return sentence(self)

    def table(self) -> str:
        """All combinations from cheap to dear, as text."""
        from lobefit.fitting.scene_texts import table

        return table(self)

    def to_dict(self) -> dict[str, Any]:
        """Give everything but pictures as JSON-ready values; the schema is versioned."""
        from lobefit.fitting.scene_texts import document

        return document(self)

    def save(self, folder: str | Path) -> dict[str, Path]:
        """Write decision.json, scene.png, beauty.png, scene.exr and albedo.exr.

        Returns
        -------
        dict of str to Path
            What was written, by kind: "decision", "figure", "picture", "layers", "albedo".
        """
        from lobefit.fitting.scene_artefacts import save_decision

        return save_decision(self, Path(folder))


def decide(
    scene: str | os.PathLike[str] | SceneRequest,
    report: str | os.PathLike[str],
    *,
    rounds: int = ROUNDS,
    timing_s: float = TIMING,
    device: str | None = None,
    progress: Progress | None = None,
) -> Decision:
    """Find the cheapest model and shading that a scene needs.

    Parameters
    ----------
    scene : path-like or SceneRequest
        A scene file, or what `read_scene` made of it.
    report : path-like
        The report.json of a fit, or its folder. samples.csv beside it, if there, may be the
        reference.
    rounds : int
        How often each frame is timed at least, after a first that is not.
    timing_s : float
        Frames are timed again, turn by turn, until this many seconds have passed.
    device : str, optional
        See `lobefit.kernels.get_device`.
    progress : callable, optional
        Called with (done, total, label).

    Raises
    ------
    SceneError
        A scene that cannot be rendered, or whose tolerance these data cannot be held to.
    LobefitError
        A report that cannot be read.
    """
    start = time.perf_counter()
    request = scene if isinstance(scene, SceneRequest) else read_scene(scene)
    if rounds < 3:
        raise SceneError("a spread takes 3 rounds at least")
    if request.tolerance.measure == "delta_e":
        need_colour_science()
    fits = read_fits(Path(report), request.models, device=device)
    models = fits.chosen(request.models)
    world = _world(request, fits.channels)
    reference = make_reference(request, world, fits, device=device)
    if not reference.mask.any():
        raise SceneError(
            f"{request.file.name}: /view: it does not show the object; move the eye or the object"
        )
    factor = exposure_factor(request.exposure, reference.picture, reference.mask)
    yardstick = Yardstick(request.tolerance.measure, reference.picture, reference.mask, factor)
    ways = [
        (model, shading, level)
        for level in request.levels
        for shading in request.shadings
        for model in models
    ]
    lights = len(world.lights) + (CELLS if world.environment is not None else 0)
    with ExitStack() as stack:
        scenes: dict[tuple[Shading, int], Prepared] = {}
        judged: list[tuple[Errors, int, int]] = []
        frames: dict[int, Callable[[], float]] = {}
        for k, (model, shading, level) in enumerate(ways):
            if progress:
                progress(k, len(ways), f"{model.name} + {shading}")
            if (shading, level) not in scenes:
                made = Prepared(world, shading=shading, subdivision=level, device=device)
                scenes[shading, level] = stack.enter_context(made)
            picture = _draw(scenes[shading, level], model)
            pixels, channels = int(picture.mask.sum()), len(picture.diffuse)
            work = counted_work(shading, picture.points, lights, pixels, channels)
            errors = yardstick.errors(picture.beauty, picture.mask)
            judged.append((errors, picture.points, work))
            frames[k] = partial(_seconds, scenes[shading, level], model)
        times = take_turns(frames, rounds, timing_s)
        found = [
            Combination(*way, Cost(times[k], points, work), errors)
            for k, (way, (errors, points, work)) in enumerate(zip(ways, judged, strict=True))
        ]
        combinations = tuple(sorted(found, key=lambda c: c.cost.fastest))
        answer = answer_for(combinations, request.tolerance)

        def show(c: Combination | None) -> Shown | None:
            if c is None:
                return None
            rendering = _draw(scenes[c.shading, c.level], c.model)
            return Shown(rendering, yardstick.differences(rendering.beauty))

        chosen, cheaper = show(answer.chosen), show(answer.cheaper)
    count = len(reference.picture)
    names = fits.channels if count == len(fits.channels) else ("R", "G", "B")
    return Decision(
        request=request,
        fits=fits,
        reference=reference,
        factor=factor,
        combinations=combinations,
        answer=answer,
        chosen=chosen,
        cheaper=cheaper,
        channels=tuple(names),
        device=str(get_device(device).info),
        seconds=time.perf_counter() - start,
    )


def _draw(prepared: Prepared, model: ShadingModel) -> Rendering:
    fitted = model.fitted
    return prepared.render(fitted.model, fitted.params, options=fitted.options, estimate=False)


def _seconds(prepared: Prepared, model: ShadingModel) -> float:
    return _draw(prepared, model).seconds


def _world(request: SceneRequest, channels: tuple[str, ...]) -> Scene:
    """Make what is rendered, and see that lights, data and measure go together."""
    name = request.file.name
    if request.tolerance.measure == "delta_e" and Channels.named(channels).kind != "rgb":
        raise SceneError(
            f"{name}: /tolerance/delta_e: ΔE2000 needs data of R, G and B; these have "
            f'{", ".join(channels)}. State {{"relative": {{"mean": 0.02, "p99": 0.1}}}}'
        )
    fitting = {1, len(channels)} | ({3} if len(channels) == 1 else set())
    for k, light in enumerate(request.lights):
        key = "irradiance" if isinstance(light, DirectionalLight) else "intensity"
        if light.row()[1].size not in fitting:
            raise SceneError(
                f"{name}: /lights/{k}/{key}: {light.row()[1].size} numbers, but the data have "
                f"{len(channels)} channels; give one number, or one for each"
            )
    if len(request.ambient) not in fitting:
        raise SceneError(
            f"{name}: /ambient: {len(request.ambient)} numbers, but the data have "
            f"{len(channels)} channels; give one number, or one for each"
        )
    environment = None
    if request.environment is not None:
        read = read_environment(request.environment, channels)
        environment = Environment(read.radiance * request.environment_scale)
    try:
        return Scene(
            shape=request.shape if request.mesh is None else read_mesh(request.mesh),
            lights=request.lights,
            ambient=request.ambient,
            environment=environment,
            camera=request.camera,
            transform=request.matrix,
        )
    except SceneError as error:
        raise SceneError(f"{name}: {error}") from error
