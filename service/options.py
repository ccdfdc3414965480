"""Options that several commands have, and how their texts are read."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from lobefit.kernels.errors import LobefitError

if TYPE_CHECKING:  # importing it loads the fitting, which --help need not wait for
    from lobefit.fitting import Measurement

__all__ = [
    "AsJson",
    "Choices",
    "Device",
    "MaxTheta",
    "MeasurementFile",
    "Models",
    "Params",
    "Student",
    "Tolerance",
    "measured",
    "out_folder",
    "pair",
    "parameters",
    "settings",
]

MeasurementFile = Annotated[
    Path, typer.Argument(help="Measurement: a CSV, .csv.gz or MERL .binary.")
]
Models = Annotated[
    str,
    typer.Option(help="quick, standard, all, or candidates such as ggx,ggx:conductor,ggx+ggx."),
]
MaxTheta = Annotated[
    float | None,
    typer.Option(help="Leave out rows with theta_i or theta_o above this, in degrees."),
]
Choices = Annotated[
    list[str] | None,
    typer.Option(help="A choice for every model that has it, as fresnel=f82; repeatable."),
]
Params = Annotated[
    list[str] | None,
    typer.Option(help="A model's parameter, as alpha=0.3 or k_d=0.1,0.2,0.3; repeatable."),
]
Tolerance = Annotated[
    float | None,
    typer.Option(help="Relative error of radiance that does not matter, as 0.01."),
]
Student = Annotated[
    bool, typer.Option("--student", help="Student's t instead of a Gaussian, for outliers.")
]
AsJson = Annotated[bool, typer.Option("--json", help="Print the answer as one JSON document.")]
Device = Annotated[
    str | None, typer.Option(help="OpenCL device: an id or part of a name; see `devices`.")
]


def out_folder(out: Path | None) -> None:
    """Refuse a file where a folder is to be written, before any work is done.

    Parameters
    ----------
    out : Path or None
        What --out says; None where it is left out.

    Raises
    ------
    LobefitError
        It is a file.
    """
    if out is not None and out.exists() and not out.is_dir():
        raise LobefitError(f"--out {out} is a file; name a folder")


def measured(file: Path, max_theta: float | None) -> Measurement:
    """Read a measurement up to an angle in degrees.

    Parameters
    ----------
    file : Path
    max_theta : float or None
        What --max-theta says.
    """
    from lobefit.fitting import read_measurement

    measurement = read_measurement(file)
    return measurement if max_theta is None else measurement.within(math.radians(max_theta))


def settings(texts: Iterable[str] | None, flag: str = "--option") -> Iterator[tuple[str, str]]:
    """Split texts such as ``fresnel=f82`` into name and value.

    Parameters
    ----------
    texts : iterable of str or None
    flag : str
        The option they were given with, for the complaint.

    Raises
    ------
    LobefitError
        A text is something else.
    """
    for text in texts or ():
        key, equals, value = text.partition("=")
        if not (key and equals and value):
            raise LobefitError(f"{flag} {text!r} is not NAME=VALUE")
        yield key.strip(), value.strip()


def parameters(texts: Iterable[str] | None) -> dict[str, float | list[float]]:
    """Read texts such as ``alpha=0.3`` and ``k_d=0.1,0.2,0.3``.

    Parameters
    ----------
    texts : iterable of str or None
        Given with --param.

    Raises
    ------
    LobefitError
        A text is something else.
    """
    found: dict[str, float | list[float]] = {}
    for key, value in settings(texts, "--param"):
        try:
            numbers = [float(part) for part in value.split(",")]
        except ValueError:
            text = f"'{key}={value}' is not NAME=NUMBER: {value!r} is not a number"
            raise LobefitError(f"--param {text}") from None
        found[key] = numbers[0] if len(numbers) == 1 else numbers
    return found


def pair(text: str) -> tuple[float, float]:
    """Read the two numbers of --noise.

    Parameters
    ----------
    text : str
        Relative noise and additive noise in 1/sr, such as ``0.02,0.001``.

    Raises
    ------
    LobefitError
        It is something else.
    """
    try:
        relative, additive = (float(part) for part in text.split(","))
    except ValueError:
        raise LobefitError(f"--noise {text!r} is not RELATIVE,ADDITIVE") from None
    return relative, additive
