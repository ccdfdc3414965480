"""The command line: every command of ``lobefit``, and what they share.

Answers go to standard output, progress and complaints to standard error. Exit status: 0 if all
went well, 2 for bad input (one line says what and where), 3 where a batch went on without
some of its items, 130 when interrupted.
Imports that take time are inside the commands, so that ``lobefit --help`` is quick.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from lobefit import __version__
from lobefit.service.batch import batch, texels
from lobefit.service.chart import chart
from lobefit.service.check import check
from lobefit.service.export import export
from lobefit.service.options import (
    AsJson,
    Choices,
    Device,
    MaxTheta,
    MeasurementFile,
    Models,
    Params,
    Student,
    Tolerance,
    measured,
    out_folder,
    pair,
    parameters,
    settings,
)
from lobefit.service.sample import posterior_lines, sample, sampled
from lobefit.service.scene import scene
from lobefit.service.serve import serve, token
from lobefit.service.terminal import counted, tell_written

__all__ = ["app", "main"]


class _Commands(TyperGroup):
    """The group of commands, which turns Lobefit's errors into one line and status 2."""

    def invoke(self, ctx: Any) -> Any:
        try:
            return super().invoke(ctx)
        except KeyboardInterrupt:
            typer.echo("Interrupted; nothing was written.", err=True)
            raise typer.Exit(130) from None
        except Exception as error:
            from lobefit.kernels.errors import LobefitError

            if not isinstance(error, LobefitError):
                raise
            typer.echo(f"Error: {error}", err=True)
            raise typer.Exit(2) from error


app = typer.Typer(
    name="lobefit",
    cls=_Commands,
    help="Fit reflectance models (BRDFs) to goniometer measurements.",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def main() -> None:
    """Run the command line; the entry point of the package."""
    for stream in (sys.stdout, sys.stderr):
        # A terminal that knows no ± shows a question mark, not a traceback.
        stream.reconfigure(errors="replace")  # type: ignore[union-attr]
    app(prog_name="lobefit")


def _version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"lobefit {__version__}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool,
        typer.Option("--version", callback=_version, is_eager=True, help="Show the version."),
    ] = False,
) -> None:
    pass


@app.command()
def fit(
    file: MeasurementFile,
    models: Models = "standard",
    metric: Annotated[
        str,
        typer.Option(
            help="How to weigh residuals: auto, chi2, relative, log, cube_root, cosine_log."
        ),
    ] = "auto",
    max_theta: MaxTheta = None,
    option: Choices = None,
    tolerance: Tolerance = None,
    student: Student = False,
    tilt: Annotated[
        bool, typer.Option("--tilt", help="Fit the tilt of the sample, two angles.")
    ] = False,
    veil: Annotated[
        bool, typer.Option("--veil", help="Fit a constant part of the signal in each channel.")
    ] = False,
    gain: Annotated[
        float | None,
        typer.Option(help="Relative uncertainty of each channel's calibration, as 0.02."),
    ] = None,
    aperture: Annotated[
        float | None, typer.Option(help="Full angle of the detector's aperture, in degrees.")
    ] = None,
    radiance: Annotated[
        bool,
        typer.Option(
            "--radiance",
            help="With --tilt, --veil or --aperture: the signal goes with f cos(theta_i), not "
            "f cos(theta_o).",
        ),
    ] = False,
    posterior: Annotated[
        bool, typer.Option("--posterior", help="Sample the posterior of the best model too.")
    ] = False,
    seed: Annotated[int, typer.Option(help="With --posterior: its seed.")] = 0,
    out: Annotated[
        Path | None,
        typer.Option(
            help="Folder for report.json, fit.png, lobes.exr, albedo.exr and samples.csv."
        ),
    ] = None,
    as_json: AsJson = False,
    device: Device = None,
) -> None:
    """Fit every candidate model to a measurement and rank them."""
    from dataclasses import replace

    from lobefit.fitting import fit as fit_models
    from lobefit.fitting.document import to_json
    from lobefit.fitting.instrument import Instrument
    from lobefit.kernels.errors import LobefitError
    from lobefit.service.texts import measurement_lines, result_lines, wrapped

    out_folder(out)
    measurement = measured(file, max_theta)
    digest = _sha256(file)
    instrument = None
    if tilt or veil or radiance or gain is not None or aperture is not None:
        instrument = Instrument(
            tilt=tilt,
            veil=veil,
            gain=gain,
            aperture_deg=aperture,
            reading="radiance" if radiance else "flux",
        )
        if posterior:
            raise LobefitError("--posterior accounts for no --tilt, --veil, --gain or --aperture")
    with counted() as progress:
        report = fit_models(
            measurement,
            models=models,
            metric=metric,
            options=dict(settings(option)),
            tolerance=tolerance,
            student=student,
            instrument=instrument,
            device=device,
            progress=progress,
        )
    added = {"sha256": digest} | ({} if max_theta is None else {"max_theta_deg": max_theta})
    report = replace(report, settings={**report.settings, **added})
    written = {} if out is None else report.save(out)
    found = None
    if posterior:
        found = sampled(report.best, measurement, out, seed=seed, device=device)
        written |= {} if out is None else found.save(out)
    if as_json:
        document = report.to_dict()
        typer.echo(
            to_json(document if found is None else {**document, "posterior": found.to_dict()})
        )
        return
    for line in measurement_lines(measurement):
        typer.echo(line)
    typer.echo("\n" + wrapped(report.verdict) + "\n")
    for line in result_lines(report):
        typer.echo(line)
    if found is not None:
        for line in ("", *posterior_lines(found)):
            typer.echo(line)
    tell_written(out, written.values())


app.command()(batch)
app.command()(texels)
app.command()(chart)
app.command()(check)
app.command()(export)
app.command()(sample)
app.command()(scene)
app.command()(serve)
app.command()(token)


@app.command()
def models(
    name: Annotated[str | None, typer.Argument(help="Show the manual page of this model.")] = None,
    as_json: AsJson = False,
    bench: Annotated[
        bool, typer.Option("--bench", help="Measure the cost in ns per direction.")
    ] = False,
    device: Annotated[
        str | None, typer.Option(help="With --bench: an OpenCL device; see `devices`.")
    ] = None,
) -> None:
    """List the models, or show the manual page of one."""
    from lobefit.kernels import get_model
    from lobefit.kernels import models as all_models
    from lobefit.service.texts import manual_page, model_document, model_list

    chosen = {name: get_model(name.partition(":")[0])} if name else all_models()
    costs: dict[str, Any] = {}
    if bench:
        from lobefit.kernels.cost import model_cost

        with counted() as progress:
            for k, (key, model) in enumerate(chosen.items()):
                if progress:
                    progress(k, len(chosen), key)
                costs[key] = model_cost(model, device=device)
    if as_json:
        from lobefit.fitting.document import to_json

        listed = [model_document(m, costs.get(key)) for key, m in chosen.items()]
        typer.echo(to_json({"models": listed}))
    elif name:
        typer.echo(manual_page(chosen[name], costs.get(name)))
    else:
        typer.echo(model_list(chosen.values(), list(costs.values())))
        typer.echo("\n`lobefit models NAME` shows the formula, its source and its parameters.")


@app.command()
def devices(
    as_json: AsJson = False,
) -> None:
    """List the OpenCL devices and mark the one that is used."""
    from dataclasses import asdict

    from lobefit.kernels import DeviceError, get_device
    from lobefit.kernels import devices as all_devices

    found = all_devices()
    used, trouble = None, None
    try:
        used = get_device().info
    except DeviceError as error:  # the list helps to choose another
        trouble = error
    if as_json:
        from lobefit.fitting.document import to_json

        listed = [{**asdict(info), "used": info == used} for info in found]
        typer.echo(to_json({"devices": listed}))
    else:
        for info in found:
            double = "" if info.double else ", no double precision"
            typer.echo(f"{'*' if info == used else ' '} {info.id}  {info.kind}  {info}{double}")
        if used:
            typer.echo("\n* is used; LOBEFIT_DEVICE or --device chooses another.")
    if trouble:
        raise trouble


@app.command()
def simulate(
    model: Annotated[str, typer.Argument(help="A model or a variant, such as ggx:k_s=1.")],
    out: Annotated[Path, typer.Option(help="The CSV to write; .csv.gz compresses.")],
    param: Params = None,
    geometry: Annotated[
        str,
        typer.Option(help="in-plane or hemisphere, also 'in-plane incidences=15,45 step=2.5'."),
    ] = "in-plane",
    noise: Annotated[
        str, typer.Option(help="Relative noise, and additive noise in 1/sr.")
    ] = "0.02,0.001",
    seed: Annotated[int, typer.Option(help="Seed of the noise.")] = 0,
    channels: Annotated[
        str | None, typer.Option(help="Channel names, separated by commas.")
    ] = None,
    option: Choices = None,
    sigma: Annotated[
        bool, typer.Option("--sigma", help="State the uncertainty in sigma_ columns.")
    ] = False,
    material: Annotated[
        str | None, typer.Option(help="What to call the surface in the file.")
    ] = None,
    device: Device = None,
) -> None:
    """Make the measurement that an instrument would give of a model surface."""
    from lobefit.fitting.artefacts import write_together
    from lobefit.fitting.simulate import simulate as simulate_model
    from lobefit.fitting.writers import write_measurement
    from lobefit.service.texts import size

    measurement = simulate_model(
        model,
        parameters(param),
        geometry=geometry,
        noise=pair(noise),
        seed=seed,
        channels=channels.split(",") if channels else None,
        options=dict(settings(option)) or None,
        sigma=sigma,
        device=device,
        metadata={"material": material} if material else None,
    )
    write_together(out.parent, {out.name: lambda path: write_measurement(measurement, path)})
    typer.echo(f"{out}: {size(measurement)}, simulated with {model}, seed {seed}")


def _sha256(file: Path) -> str | None:
    import hashlib

    if not file.is_file():  # a pipe is read once
        return None
    with file.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()
