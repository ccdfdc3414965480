"""The progress of what goes on, as one line on a terminal or in a notebook."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TypeVar

from lobefit.service.client.ongoing import Ongoing

__all__ = ["showing"]

Kept = TypeVar("Kept", bound=Ongoing)


@contextmanager
def showing(progress: bool | Callable[[Kept], object]) -> Iterator[Callable[[Kept], object]]:
    """Give whom to tell of news.

    Parameters
    ----------
    progress : bool or callable
        True for a line that disappears at the end, on standard error; nothing is written where
        nobody watches. A callable is told itself.
    """
    if callable(progress):
        yield progress
        return
    if not progress:
        yield lambda _: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    console = Console(stderr=True)
    if not (console.is_terminal or console.is_jupyter):
        yield lambda _: None
        return
    # No markup: names of fits and models are not ours.
    columns = (BarColumn(), TextColumn("{task.description}", markup=False), TimeElapsedColumn())
    with Progress(*columns, console=console, transient=True) as bar:
        task = bar.add_task("", total=None)

        def tell(what: Kept) -> None:
            done, total = what.extent or (0, 0)
            bar.update(task, description=what.news, completed=done, total=total or None)

        yield tell
