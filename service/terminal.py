"""What commands show while they run, and say once they have written."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import typer

if TYPE_CHECKING:
    from rich.progress import Progress

__all__ = ["bar", "counted", "status_line", "tell_written"]


@contextmanager
def status_line(first: str) -> Iterator[Callable[[str], None] | None]:
    """Keep one line of standard error up to date; nothing where nobody watches.

    Parameters
    ----------
    first : str
        What it says at the beginning.
    """
    if not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console
    from rich.status import Status

    with Status(first, console=Console(stderr=True)) as status:
        yield status.update


def bar() -> Progress:
    """Make a bar on standard error, with counts and a description, which goes when done."""
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn

    columns = (BarColumn(), MofNCompleteColumn(), TextColumn("{task.description}"))
    return Progress(*columns, console=Console(stderr=True), transient=True)


@contextmanager
def counted() -> Iterator[Callable[[int, int, str], None] | None]:
    """Show how much of something is done in a bar; nothing where nobody watches."""
    if not sys.stderr.isatty():
        yield None
        return
    with bar() as shown:
        task = shown.add_task("", total=None)
        yield lambda done, total, label: shown.update(
            task, completed=done, total=total, description=label
        )


def tell_written(out: Path | None, paths: Iterable[Path]) -> None:
    """Say what was written into a folder; nothing where nothing was.

    Parameters
    ----------
    out : Path or None
        The folder.
    paths : iterable of Path
        Files in it.
    """
    if names := ", ".join(path.name for path in paths):
        typer.echo(f"\nWritten to {out}: {names}")
