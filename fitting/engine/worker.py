"""What runs in a worker: its own OpenCL context, kept from chunk to chunk."""

from __future__ import annotations

import os
import platform
import signal
import threading
import time
import traceback
from collections.abc import Callable
from contextlib import AbstractContextManager, ExitStack
from dataclasses import dataclass
from typing import Any

from lobefit.kernels.errors import LobefitError

__all__ = ["Opener", "Outcome", "Runner", "prepare", "release", "run_chunk"]

Runner = Callable[[int, int, Any], Any]
"""Does units: called with (first, stop, what was sent), gives the result."""
Opener = Callable[[], AbstractContextManager[Runner]]

THREADS = "POCL_MAX_PTHREAD_COUNT"


@dataclass(frozen=True, slots=True)
class Outcome:
    """What a worker sends back.

    Attributes
    ----------
    result : Any
        None if there is an error.
    seconds : float
        Time that the units took, without what is done once in a worker.
    opening : float
        Time that was spent on that.
    worker : str
        Host and process.
    error : str
        What went wrong, for people.
    in_opening : bool
        It went wrong before the units' turn, and so would anywhere.
    """

    result: Any
    seconds: float
    opening: float
    worker: str
    error: str = ""
    in_opening: bool = False


# One piece of work is open at a time. Threads of a Dask worker take turns: a fitter is for one.
_turn = threading.Lock()
_opened: tuple[str, ExitStack, Runner] | None = None


def prepare(neighbours: int, parent: int) -> None:
    """Make a process of a local pool ready, before OpenCL starts.

    Parameters
    ----------
    neighbours : int
        Workers that share this machine's cores.
    parent : int
        The driver: when it is gone, so is this process, whatever it is doing.
    """
    # Ctrl-C reaches the whole group; the driver decides what becomes of its workers.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    share_cores(neighbours)
    threading.Thread(target=_follow, args=(parent,), daemon=True).start()


def share_cores(neighbours: int) -> None:
    """Give this process its share of the cores; works until OpenCL starts."""
    if THREADS not in os.environ:
        os.environ[THREADS] = str(max((os.cpu_count() or 1) // max(neighbours, 1), 1))


def _follow(parent: int) -> None:
    while os.getppid() == parent:
        time.sleep(0.5)
    os._exit(1)


def release() -> None:
    """Close what is open."""
    global _opened
    with _turn:
        if _opened is not None:
            _opened[1].close()
            _opened = None


def run_chunk(
    key: str, opener: Opener, first: int, stop: int, sent: Any, neighbours: int
) -> Outcome:
    """Do the units of a chunk; errors come back as text.

    Parameters
    ----------
    key, opener
        See `lobefit.fitting.engine.work.Work`.
    first, stop : int
        Units.
    sent : Any
        What came along.
    neighbours : int
        Workers that share this machine's cores.
    """
    worker = f"{platform.node()}:{os.getpid()}"
    began = time.perf_counter()
    with _turn:
        try:
            runner = _open(key, opener, neighbours)
        except Exception as error:  # noqa: BLE001
            return Outcome(None, 0.0, time.perf_counter() - began, worker, _text(error), True)
        opened = time.perf_counter()
        try:
            result, text = runner(first, stop, sent), ""
        except Exception as error:  # noqa: BLE001
            result, text = None, _text(error)
        return Outcome(result, time.perf_counter() - opened, opened - began, worker, text)


def _open(key: str, opener: Opener, neighbours: int) -> Runner:
    global _opened
    if _opened is None or _opened[0] != key:
        if _opened is not None:
            _opened[1].close()
            _opened = None
        share_cores(neighbours)
        with ExitStack() as stack:
            runner = stack.enter_context(opener())
            _opened = (key, stack.pop_all(), runner)
    return _opened[2]


def _text(error: Exception) -> str:
    """Say an expected error in its own words, and where an unexpected one came from."""
    if isinstance(error, LobefitError):
        return str(error)
    frames = traceback.extract_tb(error.__traceback__)
    where = f" ({os.path.basename(frames[-1].filename)}, line {frames[-1].lineno})"  # noqa: PTH119
    return f"{type(error).__name__}: {error}{where}"
