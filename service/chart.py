"""The command ``lobefit chart``."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from lobefit.service.options import (
    AsJson,
    Device,
    MaxTheta,
    Params,
    measured,
    out_folder,
    pair,
    parameters,
)
from lobefit.service.terminal import status_line, tell_written

if TYPE_CHECKING:
    from lobefit.fitting.tradeoff import Chart
    from lobefit.fitting.tradeoff_subject import Subject

__all__ = ["chart", "chart_lines", "read_chart"]


def chart(
    subject: Annotated[
        str, typer.Argument(help="A measurement's file, or with --param a model to simulate.")
    ],
    out: Annotated[Path | None, typer.Option(help="Folder for chart.png and chart.json.")] = None,
    tolerance: Annotated[
        float, typer.Option(help="Relative error of the prediction that would do, as 0.02.")
    ] = 0.02,
    groups: Annotated[
        str, typer.Option(help="Of fit, evaluation, albedo, posterior; fit is always measured.")
    ] = "fit,evaluation,albedo,posterior",
    repeats: Annotated[int, typer.Option(help="Timed runs of each choice.")] = 5,
    models: Annotated[str, typer.Option(help="A set or candidates, as for `fit`.")] = "all",
    metric: Annotated[str, typer.Option(help="The usual metric, as for `fit`.")] = "auto",
    max_theta: MaxTheta = None,
    param: Params = None,
    geometry: Annotated[
        str, typer.Option(help="With a model: where it is measured, as for `simulate`.")
    ] = "in-plane",
    noise: Annotated[
        str, typer.Option(help="With a model: relative noise, and additive noise in 1/sr.")
    ] = "0.02,0.001",
    seed: Annotated[int, typer.Option(help="Of the noise and of the posteriors.")] = 0,
    compare: Annotated[
        Path | None,
        typer.Option(help="A chart.json of another run: say whether the fronts agree."),
    ] = None,
    as_json: AsJson = False,
    device: Device = None,
) -> None:
    """Chart speed against accuracy: what each choice costs, and how far off it is."""
    from lobefit.fitting.document import to_json
    from lobefit.fitting.tradeoff import chart as measure
    from lobefit.fitting.tradeoff_compare import compare as compared

    out_folder(out)
    other = None if compare is None else read_chart(compare)
    about = _subject(subject, param, geometry, noise, seed, max_theta, device)
    with status_line("measuring") as show:
        made = measure(
            about,
            models=models,
            metric=metric,
            tolerance=tolerance,
            groups=[g.strip() for g in groups.split(",") if g.strip()],
            repeats=repeats,
            seed=seed,
            device=device,
            progress=None
            if show is None
            else lambda done, total, label: show(f"{label} ({done + 1} of {total})"),
        )
    agreements = [] if other is None else compared(other, made)
    written = {} if out is None else made.save(out)
    if as_json:
        document = made.to_dict()
        if other is not None:
            document["compared"] = [
                {"panel": a.panel, "says": str(a), "disputed": list(a.disputed)} for a in agreements
            ]
        typer.echo(to_json(document))
        return
    for line in chart_lines(made):
        typer.echo(line)
    for agreement in agreements:
        typer.echo(f"\nBeside {compare}: {agreement}")
        for sentence in agreement.disputed:
            typer.echo(f"  {sentence}")
    tell_written(out, written.values())


def read_chart(path: Path) -> Chart:
    """Read a chart.json.

    Parameters
    ----------
    path : Path
        The file, or the folder that it is in.

    Raises
    ------
    LobefitError
        It cannot be read, or is no chart.
    """
    from lobefit.fitting.tradeoff import Chart
    from lobefit.kernels.errors import LobefitError

    file = path / "chart.json" if path.is_dir() else path
    try:
        return Chart.from_dict(json.loads(file.read_text(encoding="utf-8")))
    except OSError as error:
        raise LobefitError(f"{file} cannot be read: {error.strerror or error}") from error
    except ValueError as error:
        if isinstance(error, LobefitError):
            raise LobefitError(f"{file}: {error}") from error
        raise LobefitError(f"{file} is no JSON: {error}") from error
    except LobefitError as error:
        raise LobefitError(f"{file}: {error}") from error


def chart_lines(made: Chart) -> Iterator[str]:
    """Write a chart for people: what was asked for, then each panel's front and finding.

    Parameters
    ----------
    made : Chart
    """
    from lobefit.fitting.tradeoff_points import front
    from lobefit.fitting.tradeoff_texts import duration, share
    from lobefit.service.texts import wrapped

    yield f"{made.name}: {made.panels[0].notes[0]}"
    yield f"\n{wrapped(made.answer)}"
    for panel in made.panels:
        chain = [panel.points[k] for k in front(panel.points)]
        yield f"\n{panel.title}: the Pareto front of {len(panel.points)} choices"
        width = max(len(p.label) for p in chain)
        for p in chain:
            spread = f"{duration(p.seconds.low)} to {duration(p.seconds.high)}"
            took = f"{duration(p.seconds.median)} ({spread})"
            yield f"  {p.label:{width}}  {took:30}  error {share(p.error.median, panel.percent)}"
        yield wrapped(panel.finding)
        if panel.failed:
            yield f"{len(panel.failed)} could not be measured: {', '.join(panel.failed)}"


def _subject(
    name: str,
    param: list[str] | None,
    geometry: str,
    noise: str,
    seed: int,
    max_theta: float | None,
    device: str | None,
) -> Subject:
    from lobefit.fitting.tradeoff_subject import held_out, simulated
    from lobefit.kernels import models
    from lobefit.kernels.errors import LobefitError

    file = Path(name)
    is_model = name.partition(":")[0].partition("+")[0] in models()
    if param or (is_model and not file.exists()):
        if max_theta is not None:
            raise LobefitError("--max-theta is for a file; --geometry says how far a model is seen")
        return simulated(
            name,
            parameters(param),
            geometry=geometry,
            noise=pair(noise),
            seed=seed,
            device=device,
        )
    return held_out(measured(file, max_theta))
