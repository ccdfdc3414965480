"""The commands ``lobefit serve`` and ``lobefit token``."""

from __future__ import annotations

import os
import socket
import sys
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from lobefit.kernels.errors import LobefitError
from lobefit.service.rows import MEBIBYTE, Limits
from lobefit.service.settings import VARIABLE, Settings, is_loopback
from lobefit.service.tokens import add_token, given_tokens, read_tokens, remove_token

__all__ = ["serve", "settings_for", "token"]

_TOKEN = "LOBEFIT_TOKEN"
_LOCAL = ("localhost", "127.0.0.1", "::1")
_USUAL = Settings(Path())


def _default_folder() -> Path:
    base = os.environ.get("XDG_DATA_HOME") or Path.home() / ".local" / "share"
    return Path(base) / "lobefit"


DataDir = Annotated[
    Path | None,
    typer.Option(
        "--data-dir",
        help="Folder for uploads and results, on a local disk.  [default: ~/.local/share/lobefit]",
        show_default=False,
    ),
]


def serve(
    host: Annotated[
        str, typer.Option(help="Address to listen on; any but loopback needs a token.")
    ] = _USUAL.host,
    port: Annotated[int, typer.Option(min=0, max=65535, help="0 takes a free one.")] = _USUAL.port,
    data_dir: DataDir = None,
    workers: Annotated[
        int, typer.Option(min=1, max=64, help="Processes that fit, side by side.")
    ] = 2,
    token: Annotated[
        list[str] | None,
        typer.Option(
            help="A token to ask for, TOKEN or NAME=TOKEN; repeatable. Safer: `lobefit token`, "
            f"or the environment variable {_TOKEN}."
        ),
    ] = None,
    upload_mib: Annotated[
        int, typer.Option(min=1, help="Largest measurement, after decompression.")
    ] = _USUAL.upload_bytes // MEBIBYTE,
    queue: Annotated[
        int, typer.Option(min=1, help="Most fits and charts that wait.")
    ] = _USUAL.limits.queue,
    fit_seconds: Annotated[
        float, typer.Option(min=1, help="Most time for one fit or chart.")
    ] = _USUAL.limits.wall,
    worker_mib: Annotated[int, typer.Option(min=256, help="Most memory of one worker.")] = (
        _USUAL.limits.memory // MEBIBYTE
    ),
) -> None:
    """Serve the HTTP interface and the page, until SIGTERM or Ctrl-C."""
    from lobefit.service.supervisor import supervise

    texts = [*(token or ()), *os.environ.pop(_TOKEN, "").split()]
    settings = settings_for(
        Settings(
            data_dir=data_dir or _default_folder(),
            limits=Limits(queue=queue, wall=fit_seconds, memory=worker_mib * MEBIBYTE),
            host=host.strip("[]"),
            port=port,
            upload_bytes=upload_mib * MEBIBYTE,
        ),
        texts,
    )
    settings = replace(settings, port=_free_port(settings.host, port))
    shown = f"[{settings.host}]" if ":" in settings.host else settings.host
    typer.echo(f"Lobefit serves http://{shown}:{settings.port} (data in {settings.data_dir})")
    sys.stdout.flush()
    status = supervise(
        settings.data_dir,
        [sys.executable, "-m", "lobefit.service.server"],
        workers=workers,
        limits=settings.limits,
        environment={VARIABLE: settings.to_json()},
    )
    raise typer.Exit(status)


def settings_for(settings: Settings, tokens: list[str]) -> Settings:
    """Add the tokens, and what follows from having none.

    Parameters
    ----------
    settings : Settings
        As the command line gave them.
    tokens : list of str
        Given on the command line or in the environment; those of the data folder are added.

    Raises
    ------
    LobefitError
        A token cannot be one, or an address that others can reach has none.
    """
    try:
        known = read_tokens(settings.data_dir) | given_tokens(tokens)
    except (ValueError, OSError) as error:
        raise LobefitError(str(error)) from error
    if known:
        return replace(settings, tokens=known)
    if not is_loopback(settings.host):
        raise LobefitError(
            f"{settings.host} can be reached by others, so a token is needed: make one with "
            "`lobefit token NAME`, or give --token or LOBEFIT_TOKEN"
        )
    # All are one owner, who may have the whole queue.
    limits = replace(settings.limits, queue_per_owner=settings.limits.queue)
    return replace(settings, limits=limits, hosts=tuple({*_LOCAL, settings.host}))


def _free_port(host: str, port: int) -> int:
    """Make sure that the port can be had, so that nothing starts in vain."""
    try:
        family, _, _, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
        with socket.socket(family, socket.SOCK_STREAM) as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            probe.bind(address)
            found: int = probe.getsockname()[1]
    except OSError as error:
        raise LobefitError(
            f"cannot listen on {host} port {port}: {error.strerror or error}; give another --port"
        ) from error
    return found


def token(
    name: Annotated[
        str | None,
        typer.Argument(help="Whom or what the token is for; a known name gets a new one."),
    ] = None,
    data_dir: DataDir = None,
    remove: Annotated[bool, typer.Option("--remove", help="Forget the token.")] = False,
) -> None:
    """Make an access token for the service, or list the names there are.

    The token is printed once and kept as a hash. A running service reads tokens when it starts.
    """
    folder = data_dir or _default_folder()
    try:
        if name is None:
            for known in read_tokens(folder):
                typer.echo(known)
        elif remove:
            remove_token(folder, name)
        else:
            typer.echo(add_token(folder, name))
    except (ValueError, OSError) as error:
        raise LobefitError(str(error)) from error
