"""Settings of the server: where it listens, what it keeps and what it refuses.

The supervisor hands them to the server process as one JSON text in an environment variable, in
which tokens are already hashed: arguments of a process can be read by every user of a machine.
"""

from __future__ import annotations

import ipaddress
import json
import os
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path

from lobefit.service.rows import MEBIBYTE, Limits

__all__ = ["VARIABLE", "Settings", "is_loopback"]

VARIABLE = "LOBEFIT_SERVER"
"""Name of the environment variable with the settings of a server process."""


@dataclass(frozen=True, slots=True)
class Settings:
    """What the server listens on and what it accepts.

    Attributes
    ----------
    data_dir : Path
        Folder of the store.
    limits : Limits
        Of the store: queue, attempts, time and memory of a job.
    host, port : str, int
        Where to listen; port 0 takes any free one.
    hosts : tuple of str
        Names by which requests may address the server; empty accepts every name. Without tokens
        the list keeps a web page from reaching a loopback server through a name of its own.
    tokens : mapping of str to str
        Name and SHA-256, in hexadecimal, of every accepted token. Empty lets everybody in.
    upload_bytes : int
        Most bytes of a measurement, as sent and after decompression.
    json_bytes, json_depth : int
        Most bytes and most levels of a JSON body.
    uploads : int
        Uploads that are received at once; more are answered 429.
    body_seconds : float
        A body that brings nothing for so long is given up.
    quick_seconds : float
        How long the answer of an inspection or evaluation is awaited.
    poll_seconds : float
        How often the store is asked whether something has changed, while somebody waits.
    keep_alive_seconds : float
        Silence after which an event stream sends a comment.
    header_seconds : float
        A connection whose request line and headers take longer is closed.
    """

    data_dir: Path
    limits: Limits = field(default_factory=Limits)
    host: str = "127.0.0.1"
    port: int = 8000
    hosts: tuple[str, ...] = ()
    tokens: Mapping[str, str] = field(default_factory=dict)
    upload_bytes: int = 64 * MEBIBYTE
    json_bytes: int = MEBIBYTE
    json_depth: int = 64
    uploads: int = 32
    body_seconds: float = 30.0
    quick_seconds: float = 120.0
    poll_seconds: float = 0.01
    keep_alive_seconds: float = 15.0
    header_seconds: float = 5.0

    def to_json(self) -> str:
        """Give the text that `from_environment` reads."""
        return json.dumps(asdict(self), default=str)

    @classmethod
    def from_environment(cls) -> Settings:
        """Read what the supervisor left in `VARIABLE`.

        Raises
        ------
        KeyError
            The variable is not set.
        """
        values = json.loads(os.environ[VARIABLE])
        known = {f.name for f in fields(cls)}
        values = {key: value for key, value in values.items() if key in known}
        values["data_dir"] = Path(values["data_dir"])
        values["limits"] = Limits(**values.get("limits", {}))
        values["hosts"] = tuple(values.get("hosts", ()))
        return cls(**values)


def is_loopback(host: str) -> bool:
    """Tell whether only this machine can reach the address.

    Parameters
    ----------
    host : str
        A name or an address. Of names only ``localhost`` is known to be one.
    """
    try:
        return ipaddress.ip_address(host.strip("[]")).is_loopback
    except ValueError:
        return host.lower() == "localhost"
