"""The command ``lobefit scene``."""

from __future__ import annotations

import textwrap
from pathlib import Path
from typing import Annotated

import typer

from lobefit.service.options import AsJson, Device, out_folder
from lobefit.service.terminal import tell_written

__all__ = ["scene"]


def scene(
    file: Annotated[Path, typer.Argument(help="Scene file, JSON of schema lobefit.scene/1.")],
    fit: Annotated[Path, typer.Option(help="A report.json, or the folder of a fit.")],
    out: Annotated[
        Path | None,
        typer.Option(
            help="Folder for decision.json, scene.png, beauty.png, scene.exr and albedo.exr."
        ),
    ] = None,
    timing: Annotated[
        float, typer.Option(min=0.0, max=3600.0, help="Seconds to spend on timing frames.")
    ] = 2.5,
    as_json: AsJson = False,
    device: Device = None,
) -> None:
    """Find the cheapest model and shading that is good enough for a scene."""
    from lobefit.fitting.document import to_json
    from lobefit.fitting.scene import decide
    from lobefit.fitting.scene_texts import COST

    out_folder(out)
    decision = decide(file, fit, timing_s=timing, device=device)
    written = {} if out is None else decision.save(out)
    if as_json:
        typer.echo(to_json(decision.to_dict()))
        return
    for text in (decision.sentence, f"Reference: {decision.reference.why}"):
        typer.echo(textwrap.fill(text, 100, break_long_words=False) + "\n")
    typer.echo(decision.table())
    typer.echo("\n" + textwrap.fill(COST, 100))
    tell_written(out, written.values())
