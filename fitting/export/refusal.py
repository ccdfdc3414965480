"""The error of a target that cannot express a model."""

from __future__ import annotations

from lobefit.kernels.errors import LobefitError

__all__ = ["ExportError"]


class ExportError(LobefitError):
    """A model that a target has no equal of, or a report that holds none.

    Parameters
    ----------
    what : str
        The candidate or the file.
    target : str
        Where it should go.
    reason : str
        Why it cannot.
    remedy : str
        What to fit or export instead.
    """

    def __init__(self, what: str, target: str, reason: str, remedy: str) -> None:
        self.what = what
        self.target = target
        self.reason = reason
        self.remedy = remedy
        super().__init__(f"{what} cannot be exported to {target}: {reason}; {remedy}")
