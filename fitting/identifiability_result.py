"""What comes of the question what the data cannot determine."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

__all__ = ["Advice", "Combination", "Identifiability", "Limit"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Combination:
    """Parameters that the data cannot tell apart, and what they do say of them.

    Attributes
    ----------
    parameters : tuple of str
        Two or more that change together.
    channel : str or None
        Of which channel; None where all are shared.
    error : float
        Relative standard error of the least known of them.
    correlation : float
        Of the two least known.
    product : str
        What is known, such as "k_s F0"; empty where it has no simple form.
    value : float or None
        Of the product.
    product_error : float or None
        Relative standard error of the product.
    """

    parameters: tuple[str, ...]
    channel: str | None
    error: float
    correlation: float
    product: str
    value: float | None
    product_error: float | None

    @property
    def hopeless(self) -> bool:
        """An error of half the value: the estimate itself is then a matter of chance."""
        return self.error > 0.5


@dataclass(frozen=True, slots=True, kw_only=True)
class Limit:
    """A one-sided limit of 95 %, in place of an error.

    Attributes
    ----------
    parameter : str
    channel : str or None
        None where it is shared.
    kind : {"upper", "lower"}
        The parameter is below it, or above it.
    value : float
        In the parameter's unit.
    method : {"profile", "first order"}
        From the likelihood with all other parameters fitted again, or from its curvature.
    """

    parameter: str
    channel: str | None
    kind: Literal["upper", "lower"]
    value: float
    method: Literal["profile", "first order"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Advice:
    """The further angle of incidence that would help most.

    Attributes
    ----------
    parameter : str
        The least known one.
    channel : str or None
    theta_i_deg : float
        Degrees.
    factor : float
        What its standard error is divided by.
    enough : (float, float) or None
        The least angle that brings its relative error below 10 %, and what it then is.
    factors : tuple of (float, float)
        The same for every angle that was tried.
    """

    parameter: str
    channel: str | None
    theta_i_deg: float
    factor: float
    enough: tuple[float, float] | None
    factors: tuple[tuple[float, float], ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Identifiability:
    """What the data cannot determine, and what would help.

    Attributes
    ----------
    worst : str
        The least known parameter, as ``name`` or ``name[channel]``; empty if none is free.
    worst_error : float
        Its relative standard error, all others being free; where it is not on a relative scale,
        the share of its range.
    combinations : tuple of Combination
    limits : tuple of Limit
    advice : Advice or None
        None where nothing is vague.
    sentences : tuple of str
        All that in words; empty where everything is determined.
    """

    worst: str
    worst_error: float
    combinations: tuple[Combination, ...]
    limits: tuple[Limit, ...]
    advice: Advice | None
    sentences: tuple[str, ...]

    def limit(self, parameter: str, channel: str | None) -> Limit | None:
        """Give the limit of a parameter, if it has one."""
        found = (x for x in self.limits if (x.parameter, x.channel) == (parameter, channel))
        return next(found, None)
