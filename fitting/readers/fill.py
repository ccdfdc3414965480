"""Fill values: numbers that instruments write where there is no reading."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lobefit.fitting.readers.table import Table, count_of, lines_of

__all__ = ["blank_fill_values"]

_MAX_KINDS = 3
_APART = 10.0
_HUGE = 1e30  # the fill values of netCDF (9.97e36) and of plotting programs (1e30)


def blank_fill_values(table: Table, channel: str) -> None:
    """Make the fill values of one channel missing, in place, and note it.

    Dark subtraction leaves negative values that scatter; a fill value is a whole negative
    number, repeated exactly (or -1, -9, -99, -999... even once), ten times larger than every
    other negative value, in a channel that is not made of whole numbers. Magnitudes of 1e30
    and above are fill values too.

    Parameters
    ----------
    table : Table
        The file's rows.
    channel : str
        Which channel.
    """
    values = table.values[channel]
    missing = np.abs(values) >= _HUGE
    found = [f"{fill:.7g}" for fill in np.unique(values[missing])[:_MAX_KINDS]]
    for fill in _whole_negatives(values[~missing]):
        missing |= values == fill
        found.append(f"{fill:.7g}")
    if found:
        table.notes.append(
            f"channel {channel}: {count_of(int(np.count_nonzero(missing)), 'cell')} with the fill "
            f"value {', '.join(found)} taken as missing ({lines_of(table.lines[missing])})"
        )
        values[missing] = np.nan
    _note_suspicions(table, channel)


def _whole_negatives(values: NDArray[np.float64]) -> list[float]:
    negative = values[values < 0]
    whole = negative == np.rint(negative)
    kinds, counts = np.unique(negative[whole], return_counts=True)
    if not 0 < kinds.size <= _MAX_KINDS:
        return []
    scatter = float(np.max(-negative[~whole], initial=0.0))
    if float(-kinds.max()) < _APART * scatter:
        return []
    # In a table of whole numbers -1 may be a count below the dark level; -999 is not.
    readings = values[~(values < 0) & ~np.isnan(values)]
    counts_only = bool(np.all(readings == np.rint(readings)))
    return [
        float(kind)
        for kind, count in zip(kinds, counts, strict=True)
        if _customary(kind) or (not counts_only and (count > 1 or kind == -1))
    ]


def _customary(fill: float) -> bool:
    return set(f"{-fill:.0f}") == {"9"}


def _note_suspicions(table: Table, channel: str) -> None:
    """Point out what may be a fill value but is kept."""
    values = table.values[channel]
    negative = np.unique(values[values < 0])
    if negative.size == 1 and (count := int(np.count_nonzero(values == negative[0]))) > 2:
        table.notes.append(
            f"channel {channel}: {count} cells are exactly {negative[0]:.7g}, the only negative "
            "value; kept (write nan if it means missing)"
        )
    top = float(np.max(values, initial=-np.inf, where=~np.isnan(values)))
    if top > 0 and _customary(-top):
        at = values == top
        rest = float(np.max(values, initial=0.0, where=~np.isnan(values) & ~at))
        if top >= _APART * rest:
            table.notes.append(
                f"channel {channel}: {count_of(int(np.count_nonzero(at)), 'cell')} exactly "
                f"{top:.7g}, {'far above the rest' if rest else 'all others are not positive'}; "
                "kept (write nan if it means missing)"
            )
