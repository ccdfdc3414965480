"""Rows that measure the same direction become one.

The value is the plain mean of those present, channel by channel. With uncertainties s the
mean's is sqrt(sum s²) / n, as for independent readings; but readings that agree to the last
digit are taken for copies of one, whose uncertainty (the largest given) stays.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lobefit.fitting.readers.table import Table, count_of, lines_of

__all__ = ["merge_directions"]

_PER_DEGREE = 1e9


def merge_directions(table: Table) -> None:
    """Average rows of one direction, in place, and note how many; the first row's place is kept.

    Parameters
    ----------
    table : Table
        Azimuths wrapped to one turn and set to 0 at the pole; angles in degrees.
    """
    rows = _candidates(table)
    if not rows.size:
        return
    keys = np.stack([_key(angle[rows]) for angle in table.angles.values()])
    order = np.lexsort(keys)
    rows, keys = rows[order], keys[:, order]
    new = np.append(True, np.any(np.diff(keys, axis=1) != 0, axis=0))
    starts = np.flatnonzero(new)
    sizes = np.diff(starts, append=rows.size)
    firsts = rows[starts]
    spread = np.zeros(starts.size)
    for channel, values in table.values.items():
        sigma = table.sigmas.get(channel)
        mean, error, apart = _mean(values[rows], None if sigma is None else sigma[rows], starts)
        spread = np.maximum(spread, apart)
        values[firsts] = mean
        if sigma is not None:
            sigma[firsts] = error
    pole = (table.angles["theta_i"][firsts] == 0) | (table.angles["theta_o"][firsts] == 0)
    for chosen, what in (
        (pole, "at the pole, whatever the azimuth,"),
        (~pole, "of equal direction"),
    ):
        groups = chosen & (sizes > 1)  # equal hashes of different directions stay alone
        _note(table, what, firsts[groups], sizes[groups], spread[groups])
    keep = np.ones(len(table.lines), dtype=bool)
    keep[rows[~new]] = False
    table.keep(keep)


def _key(degrees: NDArray[np.float64]) -> NDArray[np.uint64]:
    return np.rint(degrees * _PER_DEGREE).astype(np.uint64)


def _candidates(table: Table) -> NDArray[np.intp]:
    """Find rows that may repeat a direction: those whose hash repeats.

    Sorting one hash is several times faster than sorting rows of four angles.
    """
    mixed = np.zeros(len(table.lines), dtype=np.uint64)
    for angle in table.angles.values():
        mixed ^= mixed >> np.uint64(29)
        mixed *= np.uint64(0x9E3779B97F4A7C15)
        mixed ^= _key(angle)
    ordered = np.sort(mixed)
    repeated = np.unique(ordered[1:][ordered[1:] == ordered[:-1]])
    if not repeated.size:
        return np.empty(0, dtype=np.intp)
    return np.flatnonzero(np.isin(mixed, repeated))


def _mean(
    values: NDArray[np.float64], sigma: NDArray[np.float64] | None, starts: NDArray[np.intp]
) -> tuple[NDArray[np.float64], NDArray[np.float64] | None, NDArray[np.float64]]:
    """Average each group; give mean, uncertainty and the spread as a share of the larger."""
    present = ~np.isnan(values)
    count = np.add.reduceat(present.astype(np.float64), starts)
    total = np.add.reduceat(np.where(present, values, 0.0), starts)
    low = np.fmin.reduceat(values, starts)
    high = np.fmax.reduceat(values, starts)
    some = np.maximum(count, 1.0)
    same = low == high
    mean = np.where(same, low, total / some)
    mean[count == 0] = np.nan
    spread = np.zeros(starts.size)
    larger = np.fmax(np.abs(low), np.abs(high))
    np.divide(high - low, larger, out=spread, where=low < high)
    error = None
    if sigma is not None:
        squares = np.add.reduceat(np.where(present, sigma, 0.0) ** 2, starts)
        largest = np.maximum.reduceat(np.where(present, sigma, 0.0), starts)
        error = np.where(same, largest, np.sqrt(squares) / some)
        error[count == 0] = np.nan
    return mean, error, spread


def _note(
    table: Table,
    what: str,
    firsts: NDArray[np.intp],
    sizes: NDArray[np.intp],
    spread: NDArray[np.float64],
) -> None:
    if not firsts.size:
        return
    where = lines_of(table.lines[np.sort(firsts)])
    widest = float(spread.max())
    apart = f"; values differ by up to {100 * widest:.3g} % of the larger" if widest else ""
    table.notes.append(
        f"{count_of(int(sizes.sum()), 'row')} {what} averaged into {firsts.size} "
        f"(the first of each: {where}){apart}"
    )
