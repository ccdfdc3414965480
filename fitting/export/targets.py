"""Where a fitted model can go, and writing it there."""

from __future__ import annotations

from collections.abc import Callable
from difflib import get_close_matches
from pathlib import Path

from lobefit.fitting.export.fitted import Fitted
from lobefit.fitting.export.materialx import materialx_text
from lobefit.fitting.export.merl import merl_table
from lobefit.fitting.export.mitsuba import mitsuba_text
from lobefit.fitting.export.pbrt import pbrt_text
from lobefit.fitting.merl import write_merl
from lobefit.kernels.errors import LobefitError

__all__ = ["TARGETS", "TOLERANCE", "export_text", "write_export"]

TOLERANCE = 1e-3
"""Largest relative deviation of the BRDF that an export may have, if not asked otherwise."""

_TEXTS: dict[str, Callable[[Fitted, float], str]] = {
    "mitsuba": mitsuba_text,
    "pbrt": pbrt_text,
    "materialx": materialx_text,
}

TARGETS = (*_TEXTS, "merl")


def export_text(fitted: Fitted, target: str, tolerance: float = TOLERANCE) -> str:
    """Describe a fitted model in the language of a renderer.

    Parameters
    ----------
    fitted : Fitted
        The model.
    target : str
        "mitsuba", "pbrt" or "materialx".
    tolerance : float
        Largest relative deviation of the BRDF that is accepted.

    Returns
    -------
    str
        The description.

    Raises
    ------
    ExportError
        The target has no equal of the model.
    LobefitError
        No such target, or one that is no text.
    """
    _check(target)
    if target not in _TEXTS:
        raise LobefitError(f"a {target} table is no text; name a file to write it to (--out)")
    return _TEXTS[target](fitted, tolerance)


def write_export(
    fitted: Fitted, target: str, path: Path, tolerance: float = TOLERANCE
) -> tuple[Path, ...]:
    """Write a fitted model as a file, whole or not at all.

    Parameters
    ----------
    fitted, target, tolerance
        As for `export_text`, and "merl", whose table is accompanied by a text with what the
        table itself has no room for.
    path : Path
        The file.

    Returns
    -------
    tuple of Path
        What was written.

    Raises
    ------
    ExportError
        The target has no equal of the model.
    LobefitError
        No such target, or the file cannot be written.
    """
    from lobefit.fitting.artefacts import write_together

    _check(target)
    makers: dict[str, Callable[[Path], object]]
    if target == "merl":
        table = merl_table(fitted, tolerance)
        about = "\n".join(fitted.remarks()) + "\n"
        makers = {
            path.name: lambda place: write_merl(place, table),
            f"{path.name}.txt": lambda place: place.write_text(about, encoding="utf-8"),
        }
    else:
        text = export_text(fitted, target, tolerance)
        makers = {path.name: lambda place: place.write_text(text, encoding="utf-8")}
    write_together(path.parent, makers)
    return tuple(path.parent / name for name in makers)


def _check(target: str) -> None:
    if target not in TARGETS:
        near = get_close_matches(target, TARGETS, n=1)
        hint = f"; did you mean {near[0]!r}?" if near else ";"
        raise LobefitError(f"nothing can be exported to {target!r}{hint} It can be {_LISTED}")


_LISTED = ", ".join(TARGETS)
