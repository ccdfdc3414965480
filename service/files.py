"""Files of the data folder: whole or not there, under names that are ours alone."""

from __future__ import annotations

import hashlib
import os
import re
import secrets
import shutil
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Self

from lobefit.service.database import store_error
from lobefit.service.rows import NotFound, StoreError

__all__ = ["Files", "Upload", "digest_of", "sync"]

DIGEST = re.compile(r"[0-9a-f]{64}\Z")
TICKET = re.compile(r"[0-9a-z-]{1,64}\Z")
NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,99}\Z")


class Upload:
    """A file on its way in; gone at the end of the ``with`` unless a store adopted it.

    Attributes
    ----------
    path : Path
        Where it lies meanwhile.
    bytes : int
        How much was written.
    sha256 : str
        Of what was written.
    """

    def __init__(self, folder: Path) -> None:
        self.path = folder / f"upload-{secrets.token_hex(16)}"
        self.bytes = 0
        self._digest = hashlib.sha256()
        try:
            self._fd = os.open(self.path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
        except OSError as error:
            raise store_error(error, "cannot keep the upload") from error

    @property
    def sha256(self) -> str:
        """Digest of what was written so far, in hex."""
        return self._digest.hexdigest()

    def write(self, data: bytes) -> None:
        """Append to the file.

        Raises
        ------
        StoreFull, StoreError
            The file is removed at the end of the ``with``.
        """
        self._digest.update(data)
        view = memoryview(data)
        try:
            while view:
                view = view[os.write(self._fd, view) :]
        except OSError as error:
            raise store_error(error, "cannot keep the upload") from error
        self.bytes += len(data)

    def finish(self) -> tuple[Path, str]:
        """Bring everything to the disk; give the path and the digest."""
        try:
            os.fsync(self._fd)
        except OSError as error:
            raise store_error(error, "cannot keep the upload") from error
        self._close()
        return self.path, self.sha256

    def _close(self) -> None:
        if self._fd >= 0:
            os.close(self._fd)
            self._fd = -1

    def __enter__(self) -> Self:
        """Give itself."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Remove the file, unless it was moved away."""
        self._close()
        with suppress(OSError):
            self.path.unlink(missing_ok=True)


class Files:
    """The folders ``measurements``, ``jobs``, ``tmp`` and ``wake`` below the data folder.

    Parameters
    ----------
    root : Path
        The data folder; made with mode 0700 where it does not exist.
    """

    def __init__(self, root: Path) -> None:
        self.root = Path(root)
        self.measurements = self.root / "measurements"
        self.jobs = self.root / "jobs"
        self.tmp = self.root / "tmp"
        self.wake = self.root / "wake"
        try:
            self.root.mkdir(mode=0o700, parents=True, exist_ok=True)
            for folder in (self.measurements, self.jobs, self.tmp, self.wake):
                folder.mkdir(mode=0o700, exist_ok=True)
        except OSError as error:
            raise store_error(error, f"cannot use the data folder {root}") from error
        if not os.access(self.root, os.W_OK | os.X_OK):
            raise StoreError(f"cannot use the data folder {root}: it is not writable")

    def upload(self, name: str) -> Path:
        """Say where an upload lies on its way in."""
        if not TICKET.match(name):
            raise NotFound("there is no such upload")
        return self.tmp / name

    def free(self) -> tuple[int, int]:
        """Give the free bytes of the disk, and all of it."""
        try:
            found = os.statvfs(self.root)
        except OSError as error:
            raise store_error(error, "cannot use the data folder") from error
        return found.f_bavail * found.f_frsize, found.f_blocks * found.f_frsize

    def measurement(self, digest: str) -> Path:
        """Say where content lies."""
        if not DIGEST.match(digest):
            raise NotFound("there is no such measurement")
        return self.measurements / digest[:2] / digest

    def job(self, ticket: str) -> Path:
        """Say where a job's files lie."""
        if not TICKET.match(ticket):
            raise NotFound("there is no such job")
        return self.jobs / ticket

    def attempt(self, ticket: str, fence: int) -> Path:
        """Say where the files of one attempt lie; no other attempt writes there."""
        return self.job(ticket) / str(int(fence))

    def artefact(self, ticket: str, fence: int, name: str) -> Path:
        """Say where an artefact lies."""
        if not NAME.match(name):
            raise NotFound("there is no such artefact")
        return self.attempt(ticket, fence) / name

    def place(self, upload: Path, digest: str) -> Path:
        """Move a finished file to where its content belongs, for good."""
        path = self.measurement(digest)
        try:
            if not path.parent.exists():
                path.parent.mkdir(mode=0o700)
                sync(self.measurements)
            upload.replace(path)
            sync(path.parent)
        except OSError as error:
            raise store_error(error, "cannot keep the measurement") from error
        return path

    def remove_measurement(self, digest: str) -> None:
        """Remove content; nothing happens where there is none."""
        with suppress(OSError):
            self.measurement(digest).unlink(missing_ok=True)

    def remove_job(self, ticket: str) -> None:
        """Remove all files of a job."""
        shutil.rmtree(self.job(ticket), ignore_errors=True)

    def prune(self, ticket: str, keep: set[tuple[int, str]], only: int | None = None) -> None:
        """Remove files of a job's attempts that are no artefacts, and folders left empty.

        Parameters
        ----------
        ticket : str
            The job.
        keep : set of (int, str)
            Fence and name of every artefact.
        only : int, optional
            Look at this attempt alone.
        """
        kept = {str(self.artefact(ticket, fence, name)) for fence, name in keep}
        folder = self.job(ticket)
        for attempt in _entries(folder) if only is None else [self.attempt(ticket, only)]:
            entries = _entries(attempt) if attempt.is_dir() else [attempt]
            for path in entries:
                if str(path) not in kept:
                    _remove(path)
            with suppress(OSError):  # not empty, or no folder
                attempt.rmdir()
        with suppress(OSError):
            folder.rmdir()

    def sweep(self, measurements: set[str], jobs: set[str]) -> int:
        """Remove what belongs to nothing; only before anything else uses the folder.

        Parameters
        ----------
        measurements, jobs : set of str
            Which there are.

        Returns
        -------
        int
            Files and folders removed.
        """
        stale = [p for p in (*_entries(self.tmp), *_entries(self.wake))]
        stale += [p for p in _entries(self.jobs) if p.name not in jobs]
        for folder in _entries(self.measurements):
            stale += [p for p in _entries(folder) if p.name not in measurements]
        for path in stale:
            _remove(path)
        return len(stale)


def sync(path: Path) -> None:
    """Bring a file or the entries of a folder to the disk."""
    fd = os.open(path, os.O_RDONLY)
    try:
        os.fsync(fd)
    finally:
        os.close(fd)


def digest_of(path: Path) -> str:
    """Give the SHA-256 of a file in hex."""
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def _remove(path: Path) -> None:
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path, ignore_errors=True)
    else:
        with suppress(OSError):
            path.unlink(missing_ok=True)


def _entries(folder: Path) -> list[Path]:
    try:
        return list(folder.iterdir())
    except OSError:
        return []
