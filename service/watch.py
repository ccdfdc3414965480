"""One poller for everybody who waits for the store to change.

Workers are other processes; SQLite says with one cheap question whether any of them has written.
While nobody waits nothing is asked.
"""

from __future__ import annotations

import asyncio

from lobefit.service.rows import StoreError
from lobefit.service.store import Store

__all__ = ["Watch"]


class Watch:
    """Wakes who waits for a change of the store.

    Parameters
    ----------
    store : Store
        What is watched.
    interval : float
        Seconds between two looks.
    """

    def __init__(self, store: Store, interval: float) -> None:
        self._store = store
        self._interval = interval
        self._waiting: set[asyncio.Future[None]] = set()
        self._poller: asyncio.Task[None] | None = None

    def version(self) -> int:
        """Give a number that differs after every change; ask before reading, then wait on it."""
        row = self._store.database.one("PRAGMA data_version")
        return 0 if row is None else int(row[0])

    async def changed(self, version: int, seconds: float) -> bool:
        """Wait for a change.

        Parameters
        ----------
        version : int
            What `version` gave before the store was read.
        seconds : float
            How long to wait.

        Returns
        -------
        bool
            Whether there was a change in that time.
        """
        future = asyncio.get_running_loop().create_future()
        self._waiting.add(future)
        try:
            if self.version() != version:
                return True
            # Tests have a loop for each request; a poller of another loop never runs again.
            poller = self._poller
            if poller is None or poller.done() or poller.get_loop() is not future.get_loop():
                self._poller = asyncio.create_task(self._poll(version))
            async with asyncio.timeout(max(0.0, seconds)):
                await future
            return True
        except TimeoutError:
            return False
        finally:
            self._waiting.discard(future)

    async def _poll(self, version: int) -> None:
        while self._waiting:
            await asyncio.sleep(self._interval)
            try:
                now = self.version()
            except StoreError:
                self.wake()  # who waits reads the store next and tells what is wrong with it
                return
            if now == version:
                continue
            version = now
            self.wake()

    def wake(self) -> None:
        """Wake everybody, as after a change."""
        for future in self._waiting:
            if not future.done():
                future.set_result(None)
