"""The progress of a fit, as one line on a terminal or in a notebook."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from lobefit.service.client.resources import Fit

__all__ = ["showing"]


@contextmanager
def showing(progress: bool | Callable[[Fit], object]) -> Iterator[Callable[[Fit], object]]:
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

        def tell(fit: Fit) -> None:
            running = fit.progress if fit.state == "running" else None
            bar.update(
                task,
                description=str(running or fit),
                completed=running.done if running else 0,
                total=running.total if running and running.total else None,
            )

        yield tell
