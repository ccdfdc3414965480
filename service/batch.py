"""The commands ``lobefit batch`` and ``lobefit texels``."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from lobefit.service.options import (
    Choices,
    Device,
    MaxTheta,
    Models,
    Student,
    Tolerance,
    pair,
    settings,
)
from lobefit.service.terminal import bar

if TYPE_CHECKING:  # importing it loads the fitting, which --help need not wait for
    from lobefit.fitting.engine import Status

__all__ = ["batch", "texels"]

# Seconds between lines of progress where nobody watches, as in a cluster's log.
LINE_EVERY = 30.0
SOME_FAILED = 3
# What the flags of texels mean, where their names alone do not say it.
TOLD = {
    "on_bound": "a parameter on a bound",
    "polished": "finished by NLopt",
    "gaps": "some readings missing",
    "unconverged": "minimum not reached",
    "failed: too_few": "no result, too few readings",
    "failed: constant": "no result, all readings the same",
    "failed: huge": "no result, readings too large",
    "failed: dark": "no result, no reading above zero",
    "failed: not_finite": "no result, every model ended in no number",
    "failed: crashed": "no result, the fit crashed",
}

Jobs = Annotated[
    int | None, typer.Option(help="Processes on this machine; by default as many as cores.")
]
Scheduler = Annotated[
    str | None, typer.Option(help="Take the workers of a Dask scheduler, as tcp://host:8786.")
]
Retry = Annotated[bool, typer.Option("--retry", help="Try again what failed before.")]
Patience = Annotated[float, typer.Option(help="Seconds to wait for workers when there is none.")]


def batch(
    inputs: Annotated[
        list[str],
        typer.Argument(
            help="Measurements, patterns such as 'scans/*.csv', or manifests: CSVs with a column "
            "file and any of name, models, metric, options, tolerance, student, max_theta."
        ),
    ],
    out: Annotated[Path, typer.Option(help="Folder for reports, table and picture.")],
    models: Models = "standard",
    metric: Annotated[str, typer.Option(help="How to weigh residuals; see `fit`.")] = "auto",
    max_theta: MaxTheta = None,
    option: Choices = None,
    tolerance: Tolerance = None,
    student: Student = False,
    jobs: Jobs = None,
    scheduler: Scheduler = None,
    retry: Retry = False,
    patience: Patience = 120.0,
    device: Device = None,
) -> None:
    """Fit many measurements: a report for each, a table, a picture.

    What is done is noted in the folder: after any interruption the same command does the
    rest. Items that cannot be fitted are listed and do not stop the others.

    Exit status: 0 if all were fitted, 3 if some failed, 2 for bad input, 130 when interrupted.
    """
    from lobefit.fitting.batch import fit_many

    with _resumable(out), _watching("items") as progress:
        found = fit_many(
            inputs,
            out,
            models,
            metric=metric,
            options=dict(settings(option)),
            tolerance=tolerance,
            student=student,
            max_theta=max_theta,
            jobs=jobs,
            scheduler=scheduler,
            retry=retry,
            device=device,
            patience=patience,
            progress=progress,
        )
    done = len(found) - len(found.failed)
    typer.echo(f"{done} of {len(found)} fitted; see table.csv and summary.png in {out}")
    _list_failed({name: reason for name, reason in found.failed.items()})


def texels(
    source: Annotated[
        Path,
        typer.Argument(
            help="Readings of shape (texels, directions, channels): .npy, .npz, Zarr; or .exr with a "
            "part for each pair of directions, or a folder of such files."
        ),
    ],
    out: Annotated[Path, typer.Option(help="Folder for the maps, one .npy for each.")],
    models: Annotated[str, typer.Option(help="quick, or candidates such as ggx:k_s=1.")] = "quick",
    array: Annotated[str, typer.Option(help="Name of the readings in the file.")] = "values",
    directions: Annotated[
        Path | None,
        typer.Option(
            help="A .npy of shape (4, N): theta_i, phi_i, theta_o, phi_o in radians, "
            "where the file has none."
        ),
    ] = None,
    noise: Annotated[
        str, typer.Option(help="relative, constant, or RELATIVE,ADDITIVE with the latter in 1/sr.")
    ] = "relative",
    option: Choices = None,
    image: Annotated[
        str | None, typer.Option(help="HEIGHTxWIDTH: write maps.exr too, as is done for .exr.")
    ] = None,
    jobs: Jobs = None,
    scheduler: Scheduler = None,
    shared_disk: Annotated[
        bool,
        typer.Option("--shared-disk", help="The scheduler's workers read the file themselves."),
    ] = False,
    retry: Retry = False,
    patience: Patience = 120.0,
    device: Device = None,
) -> None:
    """Fit every texel of a surface: a map of each parameter and its error.

    What is done is noted in the folder: after any interruption the same command does the rest.

    Exit status: 0 if every texel came back, with a result or a flag that says why its readings have
    none; 3 if the fit of some crashed; 2 for bad input; 130 when interrupted.
    """
    from lobefit.fitting.texel_batch import fit_texel_file

    with _resumable(out), _watching("texels") as progress:
        found = fit_texel_file(
            source,
            out,
            models if models in ("quick", "standard", "all") else models.split(","),
            array=array,
            directions=None if directions is None else _angles(directions),
            noise=_noise(noise),
            options=dict(settings(option)),
            jobs=jobs,
            scheduler=scheduler,
            shares_disk=shared_disk,
            retry=retry,
            device=device,
            patience=patience,
            image=None if image is None else _size(image),
            progress=progress,
        )
        fit = found.fit
        if found.image is not None:
            fit.save_exr(out / "maps.exr", *found.image)
    maps = "*.npy" if found.image is None else "*.npy and maps.exr"
    lost = len(fit.failures)
    typer.echo(f"{len(fit) - lost} of {len(fit)} texels fitted; see {maps} in {out}")
    counts = fit.counts
    for name, count in counts.items():
        if count and name != "failed":
            typer.echo(f"  {TOLD.get(name, name)}: {count}")
    _list_failed({f"texel {texel}": reason for texel, reason in found.failed.items()})


def _list_failed(failed: dict[str, str]) -> None:
    if failed:
        for name, reason in failed.items():
            typer.echo(f"  {name}: {reason}", err=True)
        typer.echo(f"{len(failed)} failed; --retry tries them again", err=True)
        raise typer.Exit(SOME_FAILED)


@contextmanager
def _resumable(out: Path) -> Iterator[None]:
    try:
        yield
    except KeyboardInterrupt:
        typer.echo(
            f"Interrupted; what is done is in {out}. The same command goes on from there.", err=True
        )
        raise typer.Exit(130) from None


@contextmanager
def _watching(what: str) -> Iterator[Callable[[Status], None]]:
    """Show progress on standard error: a bar for people, a line now and then for a log."""
    if not sys.stderr.isatty():
        yield _lines(what)
        return
    with bar() as shown:
        task = shown.add_task(what, total=None)

        def show(status: Status) -> None:
            shown.update(
                task,
                completed=status.done,
                total=status.total,
                description=f"{what}, {_rest(status)}",
            )
            if status.message:
                shown.console.print(status.message, markup=False, highlight=False)

        yield show


def _lines(what: str) -> Callable[[Status], None]:
    last = time.monotonic()

    def show(status: Status) -> None:
        nonlocal last
        if status.message:
            typer.echo(status.message, err=True)
        elif time.monotonic() - last > LINE_EVERY:
            last = time.monotonic()
            typer.echo(f"{status.done} of {status.total} {what}, {_rest(status)}", err=True)

    return show


def _rest(status: Status) -> str:
    """Say how long it will take, who works, and what failed."""
    parts = [f"{status.workers} workers"]
    if status.left is not None:
        minutes, seconds = divmod(round(status.left), 60)
        hours, minutes = divmod(minutes, 60)
        parts.insert(0, f"{hours}:{minutes:02}:{seconds:02} left")
    if status.failed:
        parts.append(f"{status.failed} failed")
    return ", ".join(parts)


def _noise(text: str) -> str | tuple[float, float]:
    return pair(text) if "," in text else text


def _size(text: str) -> tuple[int, int]:
    height, _, width = text.casefold().partition("x")
    if not (height.isdecimal() and width.isdecimal()):
        raise typer.BadParameter(f"{text!r} is not HEIGHTxWIDTH", param_hint="--image")
    return int(height), int(width)


def _angles(path: Path) -> Any:
    import numpy as np

    from lobefit.kernels.errors import MeasurementError

    try:
        return np.load(path, allow_pickle=False)
    except (OSError, ValueError) as error:
        raise MeasurementError(f"cannot be read: {error}", file=str(path)) from error
