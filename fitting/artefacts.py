"""Files of a fit: report, picture, lobes, albedo and samples, whole or not at all."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from lobefit.fitting.albedo_picture import write_albedo
from lobefit.fitting.document import to_json
from lobefit.fitting.figure import write_figure
from lobefit.fitting.lobes import write_lobes
from lobefit.fitting.report import FitReport
from lobefit.fitting.writers import write_measurement
from lobefit.kernels.errors import LobefitError

__all__ = ["Makers", "save_report", "save_together", "write_json", "write_together"]

Makers = Mapping[str, tuple[str, Callable[[Path], object]]]
"""By kind, a file's name and what writes it at the path it is given."""


def save_report(report: FitReport, folder: Path) -> dict[str, Path]:
    """Write everything about a fit into a folder.

    All files are made in a temporary folder beside their places and moved there together,
    the report last: whoever finds a report finds its companions, and an interrupted run
    leaves what was there before.

    Parameters
    ----------
    report : FitReport
        The fit.
    folder : Path
        Made if it does not exist. Files of an earlier fit are replaced.

    Returns
    -------
    dict of str to Path
        "report" (report.json), "fit" (fit.png), "lobes" (lobes.exr), "albedo" (albedo.exr) and
        "samples" (samples.csv, the measurement as it was used).

    Raises
    ------
    LobefitError
        The folder cannot be made or written to.
    """
    makers: Makers = {
        "fit": ("fit.png", lambda path: write_figure(path, report)),
        "lobes": ("lobes.exr", lambda path: write_lobes(path, report.best, report.measurement)),
        "albedo": ("albedo.exr", lambda path: write_albedo(path, [report.best])),
        "samples": ("samples.csv", lambda path: write_measurement(report.measurement, path)),
        "report": ("report.json", lambda path: write_json(path, report.to_dict())),
    }
    return save_together(folder, makers)


def save_together(folder: Path, makers: Makers) -> dict[str, Path]:
    """Write files as `write_together` does; gives their paths by kind."""
    write_together(folder, dict(makers.values()))
    return {kind: folder / name for kind, (name, _) in makers.items()}


def write_json(path: Path, document: Mapping[str, Any]) -> None:
    """Write a document as strict JSON, see `lobefit.fitting.document.to_json`."""
    path.write_text(to_json(document) + "\n", encoding="utf-8")


def write_together(folder: Path, makers: Mapping[str, Callable[[Path], object]]) -> None:
    """Make files in a temporary folder beside their places, then move them there.

    Parameters
    ----------
    folder : Path
        Made if it does not exist.
    makers : mapping of str to callable
        File names, and what writes the file at the path it is given.

    Raises
    ------
    LobefitError
        The folder cannot be made or written to.
    """
    new = not folder.exists()
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(prefix=".lobefit-", dir=folder) as temporary:
            for name, make in makers.items():
                make(Path(temporary) / name)
            for name in makers:
                (Path(temporary) / name).replace(folder / name)
    except OSError as error:
        reason = error.strerror or error
        raise LobefitError(f"cannot write to the folder {folder}: {reason}") from error
    finally:
        if new:
            with suppress(OSError):  # an empty folder is of no use to anyone
                folder.rmdir()
