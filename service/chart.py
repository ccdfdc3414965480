"""The command ``lobefit chart``."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from collections.abc import Callable

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
    max_theta: Annotated[
        float | None,
        typer.Option(help="Leave out rows with theta_i or theta_o above this, in degrees."),
    ] = None,
    param: Annotated[
        list[str] | None,
        typer.Option(help="A model's parameter, as alpha=0.3 or F0=0.9,0.6,0.5; repeatable."),
    ] = None,
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
    as_json: Annotated[
        bool, typer.Option("--json", help="Print the chart as one JSON document.")
    ] = False,
    device: Annotated[
        str | None, typer.Option(help="OpenCL device: an id or part of a name; see `devices`.")
    ] = None,
) -> None:
    """Chart speed against accuracy: what each choice costs, and how far off it is."""
    from lobefit.fitting.document import to_json
    from lobefit.fitting.tradeoff import chart as measure
    from lobefit.fitting.tradeoff_compare import compare as compared
    from lobefit.kernels.errors import LobefitError

    if out is not None and out.exists() and not out.is_dir():
        raise LobefitError(f"--out {out} is a file; name a folder")
    other = None if compare is None else read_chart(compare)
    about = _subject(subject, param, geometry, noise, seed, max_theta, device)
    with _line() as tell:
        made = measure(
            about,
            models=models,
            metric=metric,
            tolerance=tolerance,
            groups=[g.strip() for g in groups.split(",") if g.strip()],
            repeats=repeats,
            seed=seed,
            device=device,
            progress=tell,
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
    if written:
        names = ", ".join(path.name for path in written.values())
        typer.echo(f"\nWritten to {out}: {names}")


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
    from lobefit.fitting import read_measurement
    from lobefit.fitting.tradeoff_subject import held_out, simulated
    from lobefit.kernels import models
    from lobefit.kernels.errors import LobefitError

    file = Path(name)
    is_model = name.partition(":")[0].partition("+")[0] in models()
    if param or (is_model and not file.exists()):
        if max_theta is not None:
            raise LobefitError("--max-theta is for a file; --geometry says how far a model is seen")
        try:
            relative, additive = (float(part) for part in noise.split(","))
        except ValueError:
            raise LobefitError(f"--noise {noise!r} is not RELATIVE,ADDITIVE") from None
        return simulated(
            name,
            _parameters(param or []),
            geometry=geometry,
            noise=(relative, additive),
            seed=seed,
            device=device,
        )
    measurement = read_measurement(file)
    if max_theta is not None:
        measurement = measurement.within(math.radians(max_theta))
    return held_out(measurement)


def _parameters(texts: list[str]) -> dict[str, float | list[float]]:
    from lobefit.kernels.errors import LobefitError

    found: dict[str, float | list[float]] = {}
    for text in texts:
        name, _, numbers = text.partition("=")
        try:
            values = [float(part) for part in numbers.split(",")]
        except ValueError:
            raise LobefitError(f"--param {text!r} is not NAME=NUMBER") from None
        found[name.strip()] = values[0] if len(values) == 1 else values
    return found


@contextmanager
def _line() -> Iterator[Callable[[int, int, str], None] | None]:
    """Keep one line of standard error up to date; nothing where nobody watches."""
    if not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console
    from rich.status import Status

    with Status("measuring", console=Console(stderr=True)) as status:
        yield lambda done, total, label: status.update(f"{label} ({done + 1} of {total})")
