"""``lobefit sample`` and the posterior of ``lobefit fit --posterior``."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from lobefit.service.options import (
    AsJson,
    Choices,
    Device,
    MaxTheta,
    MeasurementFile,
    Student,
    measured,
    out_folder,
    settings,
)
from lobefit.service.terminal import status_line, tell_written

if TYPE_CHECKING:
    from lobefit.fitting import FitResult, Measurement
    from lobefit.fitting.posterior import Posterior
    from lobefit.fitting.sampler import SamplingProgress

__all__ = ["posterior_lines", "progress_text", "sample", "sampled"]

CHAIN = "chain.h5"


def sample(
    file: MeasurementFile,
    model: Annotated[
        str | None,
        typer.Option(help="A candidate such as ggx or ggx:k_s=1; left out, the best one."),
    ] = None,
    metric: Annotated[
        str, typer.Option(help="How the point fit before it weighs residuals; see `fit`.")
    ] = "auto",
    max_theta: MaxTheta = None,
    option: Choices = None,
    seed: Annotated[int, typer.Option(help="Seed: the same gives the same chain.")] = 0,
    steps: Annotated[
        int, typer.Option(help="Most steps, the warm-up included; it ends once they are enough.")
    ] = 10_000,
    ensembles: Annotated[int, typer.Option(help="Independent ensembles of walkers.")] = 4,
    walkers: Annotated[int | None, typer.Option(help="Walkers in each ensemble.")] = None,
    noise: Annotated[
        str, typer.Option(help="auto, fit, scaled, given or fixed: what is sampled of the noise.")
    ] = "auto",
    student: Student = False,
    saturation: Annotated[
        float | None, typer.Option(help="Readings at or above it, in 1/sr, were saturated.")
    ] = None,
    floor: Annotated[
        float | None, typer.Option(help="Readings at or below it, in 1/sr, are not detected.")
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(help="Folder for posterior.nc, pictures, summary and the chain."),
    ] = None,
    fresh: Annotated[
        bool, typer.Option("--fresh", help="Start anew where the folder has a chain.")
    ] = False,
    as_json: AsJson = False,
    device: Device = None,
) -> None:
    """Sample the posterior of a model: what is known of its parameters, not only the best ones."""
    from lobefit.fitting import fit
    from lobefit.fitting.document import to_json

    out_folder(out)
    measurement = measured(file, max_theta)
    report = fit(
        measurement,
        models=model or "standard",
        metric=metric,
        options=dict(settings(option)),
        student=student,
        device=device,
    )
    posterior = sampled(
        report.best,
        measurement,
        out,
        seed=seed,
        max_steps=steps,
        ensembles=ensembles,
        walkers=walkers,
        noise=noise,
        student=student,
        saturation=saturation,
        floor=floor,
        resume=not fresh,
        device=device,
    )
    written = {} if out is None else posterior.save(out)
    if as_json:
        typer.echo(to_json(posterior.to_dict()))
        return
    for line in posterior_lines(posterior):
        typer.echo(line)
    if out is not None:
        tell_written(out, [*written.values(), out / CHAIN])


def sampled(
    result: FitResult, measurement: Measurement, out: Path | None, **settings: Any
) -> Posterior:
    """Sample with progress on standard error; Ctrl-C says what is kept and how to go on.

    Parameters
    ----------
    result : FitResult
    measurement : Measurement
    out : Path or None
        Folder of the chain; None keeps none.
    **settings
        Of `lobefit.fitting.sample`.
    """
    from lobefit.fitting.sample import sample as sample_posterior

    chain = None if out is None else out / CHAIN
    last: list[SamplingProgress] = []
    try:
        with status_line("warming up") as show:

            def tell(state: SamplingProgress) -> None:
                last[:] = [state]
                if show is not None:
                    show(progress_text(state))

            return sample_posterior(result, measurement, file=chain, progress=tell, **settings)
    except KeyboardInterrupt:
        made = f" after {last[0].steps} steps" if last else ""
        kept = (
            f"the chain is kept in {chain}; the same command goes on from there"
            if chain is not None and chain.exists()
            else "nothing was kept; with --out DIR the chain would be, to go on from"
        )
        typer.echo(f"Interrupted{made}; {kept}.", err=True)
        raise typer.Exit(130) from None


def progress_text(state: SamplingProgress) -> str:
    """Write where a run stands in one line."""
    parts = [f"step {state.steps} of at most {state.max_steps}"]
    if math.isfinite(state.tau):
        parts += [f"tau {state.tau:.1f}", f"{state.ess:.0f} effective samples"]
    parts.append(f"acceptance {state.acceptance:.2f}")
    if math.isfinite(state.seconds_left):
        parts.append(f"about {state.seconds_left:.0f} s to go")
    return ", ".join(parts)


def posterior_lines(posterior: Posterior) -> Iterator[str]:
    """Write the summary, whether to trust it, and what was decided."""
    p = posterior
    yield (
        f"Posterior of {p.result.candidate}: {p.chain.shape[1]} ensembles of {p.chain.shape[2]} "
        f"walkers, {len(p.chain)} steps after a warm-up of {p.warm_up}, "
        f"acceptance {p.acceptance:.2f}, {p.seconds:.1f} s"
    )
    yield ""
    yield p.table()
    yield ""
    yield f"{'Converged' if p.converged else 'NOT CONVERGED'}: {p.reason}."
    yield from p.notes
