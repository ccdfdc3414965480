"""The error of work on many processes."""

from __future__ import annotations

from lobefit.kernels.errors import LobefitError

__all__ = ["EngineError"]


class EngineError(LobefitError):
    """The work cannot go on: no workers, or all of them die; the message says what to do."""
