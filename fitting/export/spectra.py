"""Numbers per channel as renderers write them, and remarks in XML."""

from __future__ import annotations

import re
from typing import Any
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from lobefit.fitting.export.fitted import Channels

__all__ = ["VISIBLE", "comment", "extended", "numbers"]

VISIBLE = (360.0, 830.0)
"""The range, in nanometres, over which renderers ask for a spectrum."""


def numbers(values: NDArray[np.float64], separator: str = " ") -> str:
    """Write numbers with nine digits, more than single precision holds."""
    return separator.join(f"{value:.9g}" for value in values)


def extended(channels: Channels, values: NDArray[np.float64]) -> list[tuple[float, float]]:
    """Give a spectrum's nodes in ascending order, the ends repeated out to the visible range.

    Renderers take a spectrum as 0 where it is not given, which no one has measured.
    """
    nodes = sorted(zip(channels.wavelengths, map(float, values), strict=True))
    if nodes[0][0] > VISIBLE[0]:
        nodes.insert(0, (VISIBLE[0], nodes[0][1]))
    if nodes[-1][0] < VISIBLE[1]:
        nodes.append((VISIBLE[1], nodes[-1][1]))
    return nodes


def comment(remark: str) -> Any:
    """Give a comment in XML, in which two hyphens may not follow each other."""
    spaced = re.sub("-(?=-)", "- ", remark)
    return ElementTree.Comment(f" {spaced} ")
