"""A fitted model as a report holds it, taken apart into what is summed."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lobefit.fitting.document import SCHEMA
from lobefit.kernels.candidates import candidate
from lobefit.kernels.errors import LobefitError
from lobefit.kernels.evaluate import evaluate
from lobefit.kernels.parameters import complete
from lobefit.kernels.registry import get_model

__all__ = ["Channels", "Fitted", "Part", "read_fitted"]

Array = NDArray[np.float64]

_WAVELENGTH = re.compile(r"([0-9]+(?:\.[0-9]*)?)\s*nm", re.IGNORECASE)


_COLOURS = ("red", "green", "blue")


@dataclass(frozen=True)
class Channels:
    """What a renderer can make of the channels.

    Attributes
    ----------
    kind : str
        "grey" for a single channel, "rgb" for R, G, B, "wavelengths" for names such as 550nm,
        "unknown" for anything else.
    names : tuple of str
    wavelengths : tuple of float
        In nanometres, in the channels' order; empty unless the kind is "wavelengths".
    """

    kind: Literal["grey", "rgb", "wavelengths", "unknown"]
    names: tuple[str, ...]
    wavelengths: tuple[float, ...] = ()

    @classmethod
    def named(cls, names: tuple[str, ...]) -> Channels:
        """Tell by the channels' names."""
        found = [_WAVELENGTH.fullmatch(name.strip()) for name in names]
        if len(names) == 1:
            return cls("grey", names)
        if tuple(name.strip().lower() for name in names) in (("r", "g", "b"), _COLOURS):
            return cls("rgb", names)
        if all(found):
            return cls("wavelengths", names, tuple(float(match[1]) for match in found if match))
        return cls("unknown", names)


@dataclass(frozen=True, eq=False)
class Part:
    """One term of a model's sum.

    Attributes
    ----------
    lobe : str
        Name of its record.
    options : mapping of str to str
        What it was compiled with.
    params : mapping of str to ndarray, shape (C,)
        Its parameters under the record's names, one number per channel.
    """

    lobe: str
    options: Mapping[str, str]
    params: Mapping[str, Array]

    @property
    def strength(self) -> Array:
        """What scales it: k_s of a lobe, the albedo of a diffuse term; 1 where it has neither."""
        for name in ("k_s", "k_d", "rho"):
            if name in self.params:
                return self.params[name]
        return np.ones_like(next(iter(self.params.values())))


@dataclass(frozen=True, eq=False)
class Fitted:
    """A model with its parameters.

    Attributes
    ----------
    candidate, model : str
        The form that was fitted, and its registered model.
    options : mapping of str to str
        What it was compiled with.
    params : mapping of str to float or list of float
        All parameters.
    channels : tuple of str
    convention : str
        The normalisation of the model by name.
    origin : str
        Where the numbers come from, for the comment of an export.
    """

    candidate: str
    model: str
    options: Mapping[str, str]
    params: Mapping[str, float | list[float]]
    channels: tuple[str, ...]
    convention: str
    origin: str

    @property
    def parts(self) -> tuple[Part, ...]:
        """The terms of the sum, those of zero strength left out."""
        model = get_model(self.model, dict(self.options))
        full = complete(model, self.params)
        wide = {name: np.broadcast_to(v, len(self.channels)) for name, v in full.items()}
        parts = []
        for term in model.terms:
            names = zip(term.lobe.parameters, term.parameters, strict=True)
            parts.append(
                Part(
                    lobe=term.lobe.name,
                    options={key: choice[0] for key, choice in term.lobe.options.items()},
                    params={own.name: wide[here.name] for own, here in names},
                )
            )
        return tuple(part for part in parts if np.any(part.strength != 0.0))

    @property
    def isotropic(self) -> bool:
        """Whether only the difference of the azimuths matters."""
        return candidate(self.candidate, dict(self.options)).isotropic

    @property
    def reciprocal(self) -> bool:
        """Whether light and view can be swapped."""
        return get_model(self.model, dict(self.options)).reciprocal

    def evaluate(
        self, theta_i: ArrayLike, phi_i: ArrayLike, theta_o: ArrayLike, phi_o: ArrayLike
    ) -> Array:
        """Evaluate the BRDF at directions in radians, shape (C, N) in 1/sr."""
        values = evaluate(
            self.model, self.params, theta_i, phi_i, theta_o, phi_o, options=self.options
        )
        return np.broadcast_to(values, (len(self.channels), values.shape[1]))

    def remarks(self) -> list[str]:
        """Say in lines what this is: model, convention and the fitted numbers."""
        from lobefit import __version__

        shown = []
        for name, value in self.params.items():
            numbers = value if isinstance(value, list) else [value]
            shown.append(f"{name} = {', '.join(f'{number:.9g}' for number in numbers)}")
        chosen = ", ".join(f"{key}={value}" for key, value in self.options.items())
        lines = [
            f"{self.candidate}{f' ({chosen})' if chosen else ''}, fitted by Lobefit {__version__}",
            f"convention: {self.convention}",
            f"parameters: {'; '.join(shown)}",
            f"channels: {', '.join(self.channels)}",
            f"from: {self.origin}",
        ]
        # File and channel names are anyone's: no line may break, nor hold what no text may.
        return ["".join(c if c.isprintable() else " " for c in line) for line in lines]


def read_fitted(path: str | os.PathLike[str], name: str | None = None) -> Fitted:
    """Read a fitted model from a report.

    Parameters
    ----------
    path : path-like
        A report.json, or the folder that a fit wrote it to.
    name : str, optional
        Which candidate; the recommended one where left out.

    Returns
    -------
    Fitted
        The model.

    Raises
    ------
    LobefitError
        No such file, no report, a report of another schema, or no such candidate in it.
    """
    file = Path(path)
    if file.is_dir():
        file = file / "report.json"
    document = _document(file)
    results = document["results"]
    if not results:
        raise LobefitError(
            f"{file}: the report holds no fitted model; no candidate could be fitted"
        )
    known = {entry["candidate"]: entry for entry in results}
    if name is not None and name not in known:
        raise LobefitError(f"{file}: no result is called {name!r}; it has {', '.join(known)}")
    entry = known[name] if name is not None else results[0]
    measured = document["measurement"]
    digest = measured.get("sha256")
    origin = str(measured.get("file") or "a measurement without a file")
    try:
        return Fitted(
            candidate=entry["candidate"],
            model=entry["model"],
            options=entry["options"],
            params=entry["params"],
            channels=tuple(entry["channels"]),
            convention=entry["convention"],
            origin=origin + (f", sha256 {digest}" if digest else ""),
        )
    except KeyError as error:
        raise LobefitError(f"{file}: the report lacks {error}; fit anew") from None


def _document(file: Path) -> dict[str, Any]:
    try:
        document = json.loads(file.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise LobefitError(
            f"{file}: there is no such report; `lobefit fit FILE --out DIR` writes DIR/report.json"
        ) from None
    except OSError as error:
        raise LobefitError(f"{file}: cannot be read: {error.strerror or error}") from error
    except ValueError as error:
        raise LobefitError(f"{file}: is no report.json of `lobefit fit` ({error})") from None
    schema = document.get("schema") if isinstance(document, dict) else None
    if schema != SCHEMA or not {"results", "measurement"} <= set(document):
        raise LobefitError(
            f"{file}: is no report.json of `lobefit fit`: its schema is {schema!r}, expected "
            f"{SCHEMA!r}"
        )
    found: dict[str, Any] = document
    return found
