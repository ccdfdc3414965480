"""Which column of a table is what, from the names in its header row."""

from __future__ import annotations

import re
from dataclasses import dataclass
from difflib import get_close_matches
from typing import Protocol

from lobefit.fitting.measurement import DIRECTION_COLUMNS
from lobefit.kernels.errors import MeasurementError

__all__ = ["Columns", "assign_columns"]

_SIGMA = "sigma_"
_MAX_COLUMNS = 4096
_NUMBER = re.compile(r"[+-]?[\d.]+([eE][+-]?\d+)?")
_DIRECTIONAL = re.compile(r"(theta|phi|θ|φ|azimuth|zenith)", re.IGNORECASE)
_UNCERTAINTY = r"(sigma|std|stdev|sd|err|error|unc|uncertainty|u)"
# Columns that measurement programs write and that are no channel. Read as one, they would be
# fitted without a word.
_NO_CHANNEL = {
    "wavelength": "give every wavelength a column of its own, e.g. 400nm,410nm",
    "wavelength_nm": "give every wavelength a column of its own, e.g. 400nm,410nm",
    "lambda": "give every wavelength a column of its own, e.g. 400nm,410nm",
    **dict.fromkeys(("index", "id", "row", "time", "date", "temperature"), "remove it"),
    **dict.fromkeys(
        ("sigma", "std", "stdev", "error", "uncertainty", "weight", "weights"),
        "name an uncertainty sigma_<channel>, or remove it",
    ),
}


class _ErrorMaker(Protocol):
    def __call__(
        self, message: str, column: str | None = ..., text: str | None = ..., expected: str = ...
    ) -> MeasurementError: ...


@dataclass(frozen=True)
class Columns:
    """Column numbers by role.

    Parameters
    ----------
    names : tuple of str
        All names, in the file's order.
    angles : tuple of int
        Where theta_i, phi_i, theta_o and phi_o stand.
    channels : tuple of int
        Where the channels stand.
    sigmas : tuple of int
        Where the uncertainty of each channel stands; empty if there is none.
    """

    names: tuple[str, ...]
    angles: tuple[int, ...]
    channels: tuple[int, ...]
    sigmas: tuple[int, ...]


def assign_columns(cells: list[str], file: str, line: int) -> Columns:
    """Tell directions, channels and uncertainties apart.

    Parameters
    ----------
    cells : list of str
        The header row, split.
    file, line : str, int
        Where it stands, for errors.

    Returns
    -------
    Columns
        The roles.

    Raises
    ------
    MeasurementError
        If a column is missing, misspelt, repeated or cannot be a channel.
    """

    def error(
        message: str, column: str | None = None, text: str | None = None, expected: str = ""
    ) -> MeasurementError:
        return MeasurementError(
            message, file=file, row=line, column=column, text=text, expected=expected or None
        )

    names = tuple(_unquoted(cell.strip()) for cell in cells)
    _check_names(names, error)
    missing = [name for name in DIRECTION_COLUMNS if name not in names]
    if missing:
        found = _guess(missing[0], [name for name in names if name not in DIRECTION_COLUMNS])
        hint = f"; {found!r} looks like it: rename that column" if found else ""
        raise error(
            f"the column is missing{hint}",
            missing[0],
            found,
            ",".join(DIRECTION_COLUMNS) + " and one column per channel",
        )
    sigmas = {
        name.removeprefix(_SIGMA): k for k, name in enumerate(names) if name.startswith(_SIGMA)
    }
    channels = [
        k
        for k, name in enumerate(names)
        if name not in DIRECTION_COLUMNS and not name.startswith(_SIGMA)
    ]
    channel_names = [names[k] for k in channels]
    for channel in sigmas:
        if channel not in channel_names:
            found = next(iter(get_close_matches(channel, channel_names, 1, 0.5)), None)
            hint = f"; did you mean {_SIGMA}{found}?" if found else ""
            raise error(
                f"there is no channel {channel!r}{hint}",
                f"{_SIGMA}{channel}",
                f"{_SIGMA}{channel}",
                "sigma_<channel> beside a column of that channel",
            )
    if not channels:
        raise error(
            "there is no channel column, only directions",
            expected="one column per channel after the directions, e.g. brdf or R,G,B",
        )
    for name in channel_names:
        _check_channel(name, channel_names, error)
    without = [name for name in channel_names if name not in sigmas]
    if sigmas and without:
        raise error(
            f"the channel has no {_SIGMA}{without[0]}, but others have an uncertainty",
            without[0],
            without[0],
            "sigma_<channel> for every channel or for none",
        )
    return Columns(
        names=names,
        angles=tuple(names.index(name) for name in DIRECTION_COLUMNS),
        channels=tuple(channels),
        sigmas=tuple(sigmas[name] for name in channel_names) if sigmas else (),
    )


def _unquoted(name: str) -> str:
    """Take R's quotes off a name; a name that holds a separator keeps a stray quote."""
    if len(name) > 2 and name[0] == name[-1] == '"' and '"' not in name[1:-1]:
        return name[1:-1].strip()
    return name


def _check_names(names: tuple[str, ...], error: _ErrorMaker) -> None:
    if len(names) > _MAX_COLUMNS:
        raise error(f"{len(names)} columns", expected=f"at most {_MAX_COLUMNS}")
    if all(_NUMBER.fullmatch(name) for name in names):
        raise error(
            "the header row is missing: the first row is numbers",
            text=",".join(names),
            expected=",".join(DIRECTION_COLUMNS) + " and one column per channel",
        )
    for k, name in enumerate(names):
        if not name:
            end = ": the header row ends in a separator" if k == len(names) - 1 else ""
            raise error(f"column {k + 1} has no name{end}", text="", expected="a column name")
        if '"' in name or any(ord(letter) < 32 for letter in name):
            raise error(
                f"column {k + 1} is named {name!r}",
                name,
                name,
                "a name without quotes, separators and control characters",
            )
        if name in names[:k]:
            raise error(
                f"the column stands twice, as columns {names.index(name) + 1} and {k + 1}",
                name,
                name,
                "every column once",
            )


def _check_channel(name: str, channels: list[str], error: _ErrorMaker) -> None:
    if _DIRECTIONAL.match(name):
        raise error(
            "an angle, but not one of the four",
            name,
            name,
            ",".join(DIRECTION_COLUMNS) + " and channels; remove other angles",
        )
    if name.lower() in _NO_CHANNEL:
        raise error(f"not a channel: {_NO_CHANNEL[name.lower()]}", name, name, "")
    for other in channels:
        mark = re.escape(other)
        pattern = rf"{_UNCERTAINTY}[_ -]{mark}|{mark}[_ -]{_UNCERTAINTY}|sigma{mark}"
        if re.fullmatch(pattern, name, re.IGNORECASE):
            raise error(
                f"looks like the uncertainty of {other!r}",
                name,
                name,
                f"{_SIGMA}{other}",
            )


def _guess(wanted: str, names: list[str]) -> str | None:
    """Find a misspelt direction column."""
    plain = {_simplified(name): name for name in reversed(names)}
    # theta_h is another angle, not a misspelt theta_i.
    plain = {
        key: name
        for key, name in plain.items()
        if key == _simplified(wanted) or not re.fullmatch("(theta|phi)[a-z]", key)
    }
    match = get_close_matches(_simplified(wanted), plain, 1, 0.8)
    return plain[match[0]] if match else None


def _simplified(name: str) -> str:
    """Reduce spellings such as Theta-R or θ_out to thetao."""
    name = name.lower().replace("θ", "theta").replace("φ", "phi").replace("ϕ", "phi")
    name = re.sub(r"[^a-z]", "", re.sub(r"[\[(].*", "", name))
    name = re.sub(r"^(theta|phi)(incident|incoming|inc|in|l|light|source)$", r"\1i", name)
    return re.sub(r"^(theta|phi)(outgoing|out|reflected|refl|r|s|v|view|e)$", r"\1o", name)
