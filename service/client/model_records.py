"""Models as the service lists them, and the values it computes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Self

from lobefit.service.client import html
from lobefit.service.client.documents import record

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

__all__ = ["ModelParameter", "ModelRecord", "Values"]


@dataclass(frozen=True, slots=True, kw_only=True)
class ModelParameter:
    """A parameter of a model; see `lobefit.kernels.Parameter`."""

    name: str
    unit: str
    meaning: str
    low: float | None
    high: float | None
    default: float | None
    per_channel: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class ModelRecord:
    """A model.

    Attributes
    ----------
    name, title : str
    parameters : tuple of ModelParameter
    options : mapping
        What can be chosen, such as the Fresnel term.
    sets : tuple of str
        Sets of candidates it belongs to.
    reciprocal, isotropic : bool or None
    source : str
        Where its formula was published.
    document : mapping
        All of the service's answer.
    """

    name: str
    title: str
    parameters: tuple[ModelParameter, ...]
    options: Mapping[str, Any] = field(default_factory=dict)
    sets: tuple[str, ...] = ()
    reciprocal: bool | None = None
    isotropic: bool | None = None
    source: str = ""
    document: Mapping[str, Any] = field(repr=False, default_factory=dict)

    @classmethod
    def read(cls, document: Mapping[str, Any]) -> Self:
        """Make it of the service's answer."""
        return record(
            cls,
            document,
            parameters=tuple(record(ModelParameter, p) for p in document.get("parameters", ())),
            sets=tuple(document.get("sets", ())),
            document=document,
        )

    def _repr_html_(self) -> str:
        rows = [(p.name, p.default, p.low, p.high, p.unit, p.meaning) for p in self.parameters]
        head = ("parameter", "default", "low", "high", "unit", "")
        title = html.heading(f"{self.name}: {self.title}")
        return title + html.paragraph(self.source) + html.table(head, rows)


@dataclass(frozen=True, slots=True, kw_only=True)
class Values:
    """BRDF values in 1/sr; `numpy.asarray` takes them as they are.

    Attributes
    ----------
    channels : tuple of str
        C names.
    shape : tuple of int
        Of the directions of one channel.
    values : tuple of tuple of float
        By channel, flat, the last angle fastest.
    """

    channels: tuple[str, ...]
    shape: tuple[int, ...]
    values: tuple[tuple[float, ...], ...] = field(repr=False)

    @classmethod
    def read(cls, document: Mapping[str, Any]) -> Self:
        """Make it of the service's answer."""
        return record(
            cls,
            document,
            channels=tuple(document.get("channels", ())),
            shape=tuple(document.get("shape", ())),
            values=tuple(tuple(row) for row in document.get("values", ())),
        )

    def __getitem__(self, channel: str) -> tuple[float, ...]:
        """Give the values of a channel."""
        if channel not in self.channels:
            raise KeyError(f"{channel!r} is no channel; these are: {', '.join(self.channels)}")
        return self.values[self.channels.index(channel)]

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray[np.float64]:
        """Give an array of shape (C, *shape)."""
        import numpy as np

        if copy is False:
            raise ValueError("the values are no array; making one copies them")
        found = np.array(self.values, dtype or np.float64)
        return found.reshape(len(self.channels), *self.shape)

    def _repr_html_(self) -> str:
        size = " x ".join(map(str, self.shape))
        title = html.heading(f"{size} values in 1/sr, {', '.join(self.channels)}")
        count = len(self.values[0]) if self.values else 0
        shown = min(count, 10)
        rows = [
            [name, *(f"{v:.5g}" for v in row[:shown])]
            for name, row in zip(self.channels, self.values, strict=True)
        ]
        more = html.paragraph(f"the first {shown} of {count}") if shown < count else ""
        return title + html.table(["channel", *range(shown)], rows) + more
