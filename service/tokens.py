"""Access tokens: several, each with a name, kept as hashes.

A token is a long random text, so one round of SHA-256 keeps it as well as a slow hash would; what
is shorter than `SHORTEST` characters is refused. Comparison takes the same time whether or not
the first letters agree.
"""

from __future__ import annotations

import hashlib
import hmac
import json
import os
import re
import secrets
from collections.abc import Iterable, Mapping
from pathlib import Path

from starlette.datastructures import Headers

from lobefit.service.problems import Problem

__all__ = ["SHORTEST", "add_token", "given_tokens", "owner_of", "read_tokens", "remove_token"]

SHORTEST = 16
"""Least characters of a token that somebody made up."""

_FILE = "tokens.json"
_NAME = re.compile(r"[A-Za-z0-9_.-]{1,40}")
_CHALLENGE = 'Bearer realm="lobefit"'


def _hashed(token: str) -> str:
    return hashlib.sha256(token.encode("utf-8", "surrogatepass")).hexdigest()


def read_tokens(data_dir: Path) -> dict[str, str]:
    """Read the tokens of a data folder, name to SHA-256.

    Raises
    ------
    ValueError
        The file cannot be read as such.
    """
    path = data_dir / _FILE
    if not path.exists():
        return {}
    kept = json.loads(path.read_text(encoding="utf-8"))
    if not isinstance(kept, dict) or not all(isinstance(v, str) for v in kept.values()):
        raise ValueError(f"{path} is no list of tokens")
    return kept


def _write(data_dir: Path, kept: Mapping[str, str]) -> None:
    data_dir.mkdir(mode=0o700, parents=True, exist_ok=True)
    path = data_dir / f".{_FILE}.new"
    path.unlink(missing_ok=True)
    with os.fdopen(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "w") as stream:
        json.dump(kept, stream, indent=1)
        stream.flush()
        os.fsync(stream.fileno())
    path.replace(data_dir / _FILE)


def add_token(data_dir: Path, name: str) -> str:
    """Make a token and keep its hash.

    Parameters
    ----------
    data_dir : Path
        The data folder.
    name : str
        Letters, digits, dots, dashes and underscores; a name that is there gets a new token.

    Returns
    -------
    str
        The token, which is kept nowhere.

    Raises
    ------
    ValueError
        The name cannot be one.
    """
    _check_name(name)
    token = secrets.token_urlsafe(32)
    _write(data_dir, read_tokens(data_dir) | {name: _hashed(token)})
    return token


def remove_token(data_dir: Path, name: str) -> None:
    """Forget a token.

    Raises
    ------
    ValueError
        There is none of that name.
    """
    kept = read_tokens(data_dir)
    if kept.pop(name, None) is None:
        raise ValueError(f"there is no token {name!r}; there are: {', '.join(kept) or 'none'}")
    _write(data_dir, kept)


def given_tokens(texts: Iterable[str]) -> dict[str, str]:
    """Hash tokens given as ``TOKEN`` or ``NAME=TOKEN``.

    Raises
    ------
    ValueError
        A token is too short, or a name cannot be one.
    """
    found: dict[str, str] = {}
    for text in texts:
        name, equals, token = text.partition("=")
        if not equals or not _NAME.fullmatch(name) or not token:
            name, token = ("default" if not found else f"token{len(found) + 1}"), text
        if len(token) < SHORTEST:
            raise ValueError(
                f"the token {name!r} has {len(token)} characters; {SHORTEST} or more are expected, "
                "as `lobefit token NAME` makes them"
            )
        found[name] = _hashed(token)
    return found


def _check_name(name: str) -> None:
    if not _NAME.fullmatch(name):
        raise ValueError(
            f"{name!r} cannot name a token; up to 40 letters, digits, dots, dashes and underscores"
        )


def owner_of(headers: Headers, tokens: Mapping[str, str]) -> str:
    """Give the name of the token that a request carries.

    It stands in the header ``Authorization: Bearer TOKEN``.

    Parameters
    ----------
    headers : Headers
        Of the request.
    tokens : mapping of str to str
        Names and hashes.

    Raises
    ------
    Problem
        "unauthorized": none, or none of these.
    """
    scheme, _, credentials = headers.get("authorization", "").partition(" ")
    credentials = credentials.strip()
    if scheme.lower() != "bearer":
        credentials = ""
    digest, owner = _hashed(credentials), None
    for name, kept in tokens.items():  # all of them, so that time tells nothing
        if hmac.compare_digest(digest.encode(), kept.encode()):
            owner = name
    if owner is None or not credentials:
        said = "is not known" if credentials else "is missing"
        raise Problem(
            "unauthorized",
            f"the token {said}; send the header `Authorization: Bearer TOKEN`",
            headers={"WWW-Authenticate": _CHALLENGE},
        )
    return owner
