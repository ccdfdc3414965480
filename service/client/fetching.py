"""Downloading one file: whole and checked, or not there; resumed where it broke off."""

from __future__ import annotations

import hashlib
import os
import re
from contextlib import suppress
from pathlib import Path

from lobefit.service.client.base import writing
from lobefit.service.client.errors import ServiceError
from lobefit.service.client.job_records import Artefact
from lobefit.service.client.retries import AGAIN, Retries, pause, refusal, retry_after
from lobefit.service.client.wire import (
    Close,
    Dropped,
    Open,
    Operation,
    Reply,
    Request,
    Stream,
    Take,
    Work,
)

__all__ = ["fetch"]


def fetch(retries: Retries, path: str, artefact: Artefact, target: Path) -> Operation[Path]:
    """Download a file.

    Parameters
    ----------
    retries : Retries
        How often to try again without a byte of progress.
    path : str
        Of the file in the service.
    artefact : Artefact
        Its size and digest.
    target : Path
        Where it goes. Until it is whole it has another name, which holds its digest, so that
        another call can go on with it.

    Raises
    ------
    LobefitError
        It cannot be written.
    ServiceError
        What arrives is not what the service promised.
    """
    if (yield Work(lambda: target.is_file() and _digest(target) == artefact.sha256)):
        return target
    part = target.with_name(f".{target.name}.{artefact.sha256[:16]}.part")
    failures = 0
    while True:
        with writing(part), part.open("ab"):
            pass
        before = part.stat().st_size
        trouble, after = (
            (None, 0.0)
            if before == artefact.bytes
            else (yield from _receive(path, artefact, part, before))
        )
        size = part.stat().st_size
        if size == artefact.bytes:
            if (yield Work(lambda: _digest(part) == artefact.sha256)):
                with writing(target):
                    yield Work(lambda: _settle(part, target))
                return target
            trouble = _mismatch(artefact, "has another SHA-256")
        elif size > artefact.bytes:
            trouble = _mismatch(artefact, f"has more than {artefact.bytes} bytes")
        if size >= artefact.bytes:
            part.unlink()
        progressed = before < size < artefact.bytes
        failures = 1 if progressed else failures + 1
        yield from pause(retries, failures, trouble or Dropped("the file ended early"), after)


def _receive(
    path: str, artefact: Artefact, part: Path, start: int
) -> Operation[tuple[ServiceError | Dropped | None, float]]:
    """Append what is missing; gives what went wrong, and how long the service asked to wait."""
    headers = {"Accept-Encoding": "identity"}
    if start:
        # What is there was named by this digest, which is the ETag.
        headers |= {"Range": f"bytes={start}-", "If-Range": f'"{artefact.sha256}"'}
    try:
        stream: Stream = yield Open(Request(path=path, headers=headers))
    except Dropped as error:
        return error, 0.0
    try:
        if stream.status not in (200, 206):
            content = bytearray()
            while (chunk := (yield Take(stream))) is not None:
                content += chunk
            reply = Reply(stream.status, stream.headers, bytes(content))
            trouble = refusal(reply)
            if stream.status == 416:  # what is there cannot be a part of it
                part.unlink()
                part.touch()
            elif stream.status not in AGAIN:
                raise trouble
            return Dropped(str(trouble)), retry_after(reply)
        at = _start(stream)
        if at not in (0, start):
            return Dropped("another part of the file was sent than was asked for"), 0.0
        with writing(part), part.open("r+b") as file:
            file.truncate(at)
            file.seek(at)
            while (chunk := (yield Take(stream))) is not None:
                file.write(chunk)
                if file.tell() > artefact.bytes:
                    break
    except Dropped as error:
        return error, 0.0
    finally:
        yield Close(stream)
    return None, 0.0


def _start(stream: Stream) -> int:
    if stream.status == 200:
        return 0
    found = re.match(r"bytes (\d+)-", stream.headers.get("content-range", ""))
    return int(found[1]) if found else -1


def _digest(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _settle(part: Path, target: Path) -> None:
    """Give the file its name when its content is on the disk."""
    with part.open("rb") as file:
        os.fsync(file.fileno())
    # Another call may have put the same content there first.
    with suppress(FileNotFoundError):
        part.replace(target)
    target.stat()


def _mismatch(artefact: Artefact, what: str) -> ServiceError:
    return ServiceError(f"{artefact.name} as it arrived {what}; expected {artefact.sha256}")
