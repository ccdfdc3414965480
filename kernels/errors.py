"""The errors of Lobefit, one tree, importable without OpenCL.

::

    LobefitError
    |-- MeasurementError   a file or table that cannot be used (file, row, column, text, expected)
    |-- ModelError         an unknown model, parameter or option; a broken model file
    |-- DeviceError        no OpenCL device, no linker, no double precision, a failed build
    |-- FitError           a fit that cannot be done with these data and this model
    +-- SceneError         a scene, mesh or picture that cannot be used

Every message says what was found, what was expected and what to do.
"""

from __future__ import annotations

__all__ = [
    "DeviceError",
    "FitError",
    "LobefitError",
    "MeasurementError",
    "ModelError",
    "SceneError",
]


class LobefitError(Exception):
    """Base of every error that Lobefit raises on purpose."""


class MeasurementError(LobefitError):
    """A measurement that cannot be used.

    Parameters
    ----------
    message : str
        What is wrong and what to do about it, in one sentence.
    file : str, optional
        Name of the file.
    row : int, optional
        Line in the file, counted from 1 as editors do.
    column : str, optional
        Name of the column.
    text : str, optional
        The offending text as it stands in the file.
    expected : str, optional
        What was expected instead.
    """

    def __init__(
        self,
        message: str,
        *,
        file: str | None = None,
        row: int | None = None,
        column: str | None = None,
        text: str | None = None,
        expected: str | None = None,
    ) -> None:
        self.message = message
        self.file = file
        self.row = row
        self.column = column
        self.text = text
        self.expected = expected
        super().__init__(message)

    def __str__(self) -> str:
        """Give place, problem and expectation in one line."""
        place = [self.file] if self.file else []
        if self.row is not None:
            place.append(f"line {self.row}")
        if self.column is not None:
            place.append(f"column {self.column}")
        line = f"{', '.join(place)}: {self.message}" if place else self.message
        return f"{line} (expected {self.expected})" if self.expected else line


class ModelError(LobefitError):
    """An unknown model, parameter or option, or a model file that breaks the schema."""


class DeviceError(LobefitError):
    """The OpenCL device cannot be used; the message says what to install or choose."""


class FitError(LobefitError):
    """A fit that cannot be done with these data and this model."""


class SceneError(LobefitError):
    """A scene that cannot be rendered: a light, view, mesh or picture that is none."""
