"""The command ``lobefit export``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

__all__ = ["export"]


def export(
    report: Annotated[Path, typer.Argument(help="A report.json, or the folder of a fit.")],
    to: Annotated[str, typer.Option(help="mitsuba, pbrt, materialx or merl.")],
    model: Annotated[
        str | None, typer.Option(help="Which candidate; the recommended one if left out.")
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="The file to write; standard output if left out.")
    ] = None,
    tolerance: Annotated[
        float, typer.Option(help="Largest relative deviation of the BRDF that is accepted.")
    ] = 1e-3,
) -> None:
    """Write a fitted model for a renderer, or say why it has no equal there."""
    from lobefit.fitting.export import export_text, read_fitted, write_export
    from lobefit.kernels.errors import LobefitError

    if out is not None and out.is_dir():
        raise LobefitError(f"--out {out} is a folder; name a file")
    fitted = read_fitted(report, model)
    if out is None:
        typer.echo(export_text(fitted, to, tolerance), nl=False)
        return
    written = write_export(fitted, to, out, tolerance)
    names = ", ".join(path.name for path in written)
    typer.echo(f"{fitted.candidate} written for {to} to {out.parent}: {names}")
