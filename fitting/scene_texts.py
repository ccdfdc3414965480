"""The answer to a scene in words: a sentence, a table, a JSON document."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from lobefit import __version__
from lobefit.fitting.scene_answer import SAME
from lobefit.fitting.scene_colour import MEASURES

if TYPE_CHECKING:  # that module loads this one when it is asked for words
    from lobefit.fitting.scene import Decision
    from lobefit.fitting.scene_answer import Answer, Combination
    from lobefit.fitting.scene_file import Tolerance

__all__ = ["SCHEMA", "document", "next_one", "seconds_text", "sentence", "table"]

SCHEMA = "lobefit.decision/1"
SHADINGS = {"flat": "flat shading", "gouraud": "Gouraud shading", "phong": "Phong shading"}
COST = (
    "Cost: measured seconds a frame on the device (shading and filling the pixels; neither finding "
    "what is seen nor compiling), the fastest of interleaved rounds, since a busy machine only adds "
    f"to it. Costs within a factor of {SAME:g} count as the same; of the same cost the simplest is "
    "chosen: the model of fewest parameters, of its ways of shading those of the least counted "
    f"work (within a factor of {SAME:g}), of these flat before Gouraud before Phong, then the "
    "coarser mesh, then the smaller error."
)


def seconds_text(seconds: float) -> str:
    """Write a time in milliseconds to three digits."""
    return f"{seconds * 1e3:.3g} ms"


def _times(factor: float) -> str:
    return f"{factor:.2g}" if factor < 10.0 else f"{factor:.0f}"


def _measured(c: Combination, measure: str) -> str:
    return f"mean {MEASURES[measure]} {c.errors.mean:.3g}, 99th percentile {c.errors.p99:.3g}"


def _named(c: Combination) -> str:
    return f"{c.model.name} with {SHADINGS[c.shading]}"


def sentence(decision: Decision) -> str:
    """Answer: what is enough, what the next cheaper one lacks, and what more would cost."""
    answer, measure = decision.answer, decision.request.tolerance.measure
    tolerance, levels = answer.tolerance, len(decision.request.levels) > 1
    allowed = f"allowed are {tolerance.mean:g} and {tolerance.p99:g}"

    def where(c: Combination) -> str:
        return f" at level {c.level}" if levels else ""

    if answer.chosen is None:
        c = answer.cheaper
        assert c is not None
        return (
            f"Nothing stays within the tolerance: {_named(c)}{where(c)} comes nearest, "
            f"{_measured(c, measure)} where {allowed}, {_times(c.excess(tolerance))} times too much."
        )
    c = answer.chosen
    text = (
        f"{_named(c)}{where(c)} is enough: {_measured(c, measure)} where {allowed}, at "
        f"{seconds_text(c.cost.fastest)} a frame (median {seconds_text(c.cost.median)}; "
        f"{c.cost.points} shaded points)"
    )
    if answer.equals:
        count = len(answer.equals) + 1
        text += f", the simplest of {count} whose costs are the same within a factor of {SAME:g}"
    if answer.cheaper is None:
        text += "; nothing that was tried is cheaper or simpler"
    else:
        b = answer.cheaper
        text += (
            f"; the {next_one(answer)}, {_named(b)}{where(b)} ({seconds_text(b.cost.fastest)}, "
            f"{b.cost.points} points), is {_times(b.excess(tolerance))} times over the tolerance "
            f"({_measured(b, measure)})"
        )
    return f"{text}{_richer(answer, where)}."


def next_one(answer: Answer) -> str:
    """Call the next cheaper combination so, or simpler where it costs the same or a bit more."""
    chosen, other = answer.chosen, answer.cheaper
    if chosen is None or other is None:
        return "nearest"
    return "next cheaper" if other.cost.fastest < chosen.cost.fastest else "next simpler"


def _richer(answer: Answer, where: Callable[[Combination], str]) -> str:
    if not answer.richer or answer.chosen is None:
        return ""
    dearest = answer.richer[-1]
    named = f"{_named(dearest)}{where(dearest)}"
    if len(answer.richer) == 1:
        text = f"; {named} is within it too, "
    else:
        text = f"; {len(answer.richer)} others are within it too, up to {named} "
    more = dearest.cost.fastest / answer.chosen.cost.fastest
    return f"{text}at {seconds_text(dearest.cost.fastest)}, {_times(more)} times the time"


def table(decision: Decision) -> str:
    """List all combinations from cheap to dear."""
    tolerance = decision.answer.tolerance
    name = max(len("model"), *(len(c.model.name) for c in decision.combinations))
    measure = f"mean {MEASURES[tolerance.measure]}"
    head = f"  {'model':{name}}  shading  level  parameters  points  {'ms/frame, median (quartiles)':<29}  "
    lines = [f"{head}{measure:>20}  {'99 %':>7}  x tolerance"]
    for c in decision.combinations:
        mark = "*" if c is decision.answer.chosen else " "
        low, high = (1e3 * s for s in c.cost.quartiles)
        median, fastest = 1e3 * c.cost.median, 1e3 * c.cost.fastest
        times = f"{fastest:<7.3g} {median:.3g} ({low:.3g} to {high:.3g})"
        excess = c.excess(tolerance)
        lines.append(
            f"{mark} {c.model.name:{name}}  {c.shading:<7}  {c.level:>5}  {c.model.n_parameters:>10}"
            f"  {c.cost.points:>6}  {times:<29}  {c.errors.mean:>20.4g}  {c.errors.p99:>7.4g}"
            f"  {excess:>11.3g}{'' if excess <= 1 else ' over'}"
        )
    return "\n".join(lines)


def document(decision: Decision) -> dict[str, Any]:
    """Give everything but pictures as JSON-ready values."""
    request, tolerance = decision.request, decision.request.tolerance
    camera, light = request.camera, decision.reference
    nearby = {"tightened_tenfold": 0.1, "loosened_tenfold": 10.0}
    shown = [c.errors.clipped for c in (decision.answer.chosen,) if c is not None]
    return {
        "schema": SCHEMA,
        "lobefit": __version__,
        "sentence": decision.sentence,
        "scene": {
            "file": request.file.name,
            "sha256": request.sha256,
            "description": request.description,
            "shape": request.shape,
            "levels": list(request.levels),
            "width": camera.width,
            "height": camera.height,
        },
        "report": {
            "file": decision.fits.report.name,
            "channels": list(decision.fits.channels),
            "models": len(decision.fits.models),
            "described": decision.fits.described,
        },
        "tolerance": _limits(tolerance),
        "colour": None
        if tolerance.measure != "delta_e"
        else {
            "space": "linear sRGB, D65",
            "difference": "CIE ΔE2000",
            "exposure": decision.factor,
            "exposed": "by the factor that the scene states"
            if request.exposure.factor is not None
            else f"so that percentile {request.exposure.percentile:g} of the reference's "
            f"brightest channel is {request.exposure.level:g}",
            "clipping": "to 0 to 1 after exposure, before encoding",
            "clipped_share": shown[0] if shown else None,
        },
        "reference": light.to_dict(),
        "cost": COST,
        "device": decision.device,
        "seconds": decision.seconds,
        "answer": _answer(decision.answer),
        "other_tolerances": {
            key: _answer(decision.answer_for(tolerance.scaled(factor)))
            for key, factor in nearby.items()
        },
        "combinations": [_combination(c, tolerance) for c in decision.combinations],
    }


def _limits(tolerance: Tolerance) -> dict[str, Any]:
    return {"measure": tolerance.measure, "mean": tolerance.mean, "p99": tolerance.p99}


def _answer(answer: Answer) -> dict[str, Any]:
    def maybe(c: Combination | None) -> dict[str, Any] | None:
        return None if c is None else _combination(c, answer.tolerance)

    return {
        "tolerance": _limits(answer.tolerance),
        "chosen": maybe(answer.chosen),
        "same_cost": [_combination(c, answer.tolerance) for c in answer.equals],
        "next_cheaper": maybe(answer.cheaper),
        "richer": [_combination(c, answer.tolerance) for c in answer.richer],
    }


def _combination(c: Combination, tolerance: Tolerance) -> dict[str, Any]:
    excess = c.excess(tolerance)
    return {
        "model": c.model.name,
        "origin": c.model.origin,
        "shading": c.shading,
        "level": c.level,
        "n_parameters": c.model.n_parameters,
        "points": c.cost.points,
        "work": c.cost.work,
        "seconds": c.cost.median,
        "seconds_fastest": c.cost.fastest,
        "seconds_quartiles": list(c.cost.quartiles),
        "rounds": len(c.cost.seconds),
        "mean": c.errors.mean,
        "p99": c.errors.p99,
        "largest": c.errors.largest,
        "clipped_share": c.errors.clipped,
        "times_tolerance": excess if math.isfinite(excess) else None,
        "within": excess <= 1.0,
    }
