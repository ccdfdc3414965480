"""Waking workers that sleep: one named pipe each, so that idle ones need not poll."""

from __future__ import annotations

import os
import select
from contextlib import suppress
from pathlib import Path

from lobefit.service.database import store_error

__all__ = ["Sleeper", "wake_all"]


def wake_all(folder: Path) -> None:
    """Wake every sleeper of a folder; one that is gone or awake already is no error."""
    with suppress(OSError):
        for entry in os.scandir(folder):
            with suppress(OSError):
                fd = os.open(entry.path, os.O_WRONLY | os.O_NONBLOCK)
                try:
                    os.write(fd, b".")
                finally:
                    os.close(fd)


class Sleeper:
    """Sleeps until it is woken, or some time has passed.

    Parameters
    ----------
    folder : Path
        Where the pipe is made.
    name : str
        Its own name in there.
    """

    def __init__(self, folder: Path, name: str) -> None:
        self._path = folder / name
        try:
            self._path.unlink(missing_ok=True)
            os.mkfifo(self._path, 0o600)
            # Open for writing too: a pipe without a writer would be at its end all the time.
            self._fd = os.open(self._path, os.O_RDWR | os.O_NONBLOCK)
        except OSError as error:
            raise store_error(error, "cannot use the data folder") from error

    def sleep(self, seconds: float) -> bool:
        """Give True where it was woken."""
        ready, _, _ = select.select([self._fd], [], [], seconds)
        if ready:
            with suppress(BlockingIOError):
                os.read(self._fd, 4096)
        return bool(ready)

    def wake(self) -> None:
        """Wake it from a signal handler or another thread."""
        with suppress(OSError):
            os.write(self._fd, b".")

    def close(self) -> None:
        """Remove the pipe."""
        with suppress(OSError):
            os.close(self._fd)
        self._path.unlink(missing_ok=True)
