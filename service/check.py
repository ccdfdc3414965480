"""The command ``lobefit check``."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator
from typing import TYPE_CHECKING

import typer

from lobefit.service.options import AsJson, Device, MeasurementFile

if TYPE_CHECKING:  # importing it loads the fitting, which --help need not wait for
    from lobefit.fitting import DataChecks

__all__ = ["check", "check_lines"]


def check(
    file: MeasurementFile,
    as_json: AsJson = False,
    device: Device = None,
) -> None:
    """Ask whether a measurement can be what it is declared to be.

    A file that can be read gives status 0, whatever is found; the findings are not errors.
    """
    from lobefit.fitting import check as check_data
    from lobefit.fitting import read_measurement
    from lobefit.fitting.document import to_json
    from lobefit.service.texts import measurement_lines

    measurement = read_measurement(file)
    found = check_data(measurement, device=device)
    if as_json:
        typer.echo(to_json({"file": measurement.source, **found.to_dict()}))
        return
    for line in measurement_lines(measurement):
        typer.echo(line)
    typer.echo("")
    for line in check_lines(found):
        typer.echo(line)


def check_lines(found: DataChecks) -> Iterator[str]:
    """Give a table of name, verdict and sentence with the remedy below, then the count.

    Parameters
    ----------
    found : DataChecks
        What the checks found.
    """
    name = max(len(c.name) for c in found) + 2
    verdict = max(len(c.verdict) for c in found) + 2
    for c in found:
        mark = "!" if c.verdict == "suspicious" else " "
        first = f"{mark} {c.name:{name}}{c.verdict:{verdict}}"
        yield from _paragraph(first, c.sentence)
        if c.remedy and c.verdict == "suspicious":
            yield from _paragraph(" " * len(first), f"Remedy: {c.remedy}.")
    counts = [
        f"{sum(c.verdict == kind for c in found)} {kind}"
        for kind in ("suspicious", "cannot tell", "ok")
    ]
    yield "\n" + ", ".join(counts)


def _paragraph(start: str, text: str) -> list[str]:
    return textwrap.wrap(
        text,
        100,
        initial_indent=start,
        subsequent_indent=" " * len(start),
        break_on_hyphens=False,
        break_long_words=False,
    )
