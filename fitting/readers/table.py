"""The rows of a file while the reader's rules work on them."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from lobefit.fitting.measurement import Dropped
from lobefit.kernels.errors import MeasurementError

__all__ = ["Table", "count_of", "lines_of"]

_ROWS_KEPT = 20


@dataclass(slots=True)
class Table:
    """Columns of one file, and what was done to them.

    Parameters
    ----------
    name : str
        The file.
    angles : dict of str to array, shape [N]
        theta_i, phi_i, theta_o and phi_o, in degrees once the units are known.
    values, sigmas : dict of str to array, shape [N]
        By channel; NaN where missing. `sigmas` is empty if the file gives none.
    lines : array, shape [N]
        Line number of each row.
    dropped : list of Dropped
        Rows removed so far.
    notes : list of str
        What else was done.
    """

    name: str
    angles: dict[str, NDArray[np.float64]]
    values: dict[str, NDArray[np.float64]]
    sigmas: dict[str, NDArray[np.float64]]
    lines: NDArray[np.uint32]
    dropped: list[Dropped] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    def keep(self, rows: NDArray[np.bool_]) -> None:
        """Keep the rows marked true, column by column to spare memory."""
        for columns in (self.angles, self.values, self.sigmas):
            for name in columns:
                columns[name] = columns[name][rows]
        self.lines = self.lines[rows]

    def drop(self, rows: NDArray[np.bool_], rule: str) -> None:
        """Remove the rows marked true and record the rule.

        Raises
        ------
        MeasurementError
            If no row is left.
        """
        count = int(np.count_nonzero(rows))
        if not count:
            return
        first = tuple(self.lines[rows][:_ROWS_KEPT].tolist())
        self.dropped.append(Dropped(rule, first, count))
        if count == len(self.lines):
            raise self.error(f"no row is left: {self.left_out}", row=first[0])
        self.keep(~rows)

    @property
    def left_out(self) -> str:
        """Say which rules removed how many rows; empty where none did."""
        return "; ".join(f"{count_of(d.count, 'row')} {d.rule}" for d in self.dropped)

    def error(
        self,
        message: str,
        *,
        row: int | None = None,
        column: str | None = None,
        text: str | None = None,
        expected: str | None = None,
    ) -> MeasurementError:
        """Make an error that names the file."""
        return MeasurementError(
            message, file=self.name, row=row, column=column, text=text, expected=expected
        )

    def refuse(self, rows: NDArray[np.bool_], column: str, problem: str, expected: str) -> None:
        """Raise for the first row marked true, if any.

        Parameters
        ----------
        rows : array of bool, shape [N]
            Where the column is wrong.
        column : str
            Its name.
        problem : str
            What is wrong, with ``{}`` for the number found.
        expected : str
            What should stand there.
        """
        count = int(np.count_nonzero(rows))
        if not count:
            return
        at = int(np.argmax(rows))
        column_values = (
            self.sigmas[column.removeprefix("sigma_")]
            if column.startswith("sigma_")
            else self.angles[column]
        )
        text = f"{column_values[at]:.10g}"
        more = f" ({count} such rows)" if count > 1 else ""
        raise self.error(
            problem.format(text) + more,
            row=int(self.lines[at]),
            column=column,
            text=text,
            expected=expected,
        )


def count_of(count: int, noun: str) -> str:
    """Write a count with its noun: 1 row, 2 rows."""
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"


def lines_of(lines: NDArray[np.uint32] | list[int], count: int | None = None) -> str:
    """Write the first line numbers: line 7; lines 7, 8, 9 and 12 more."""
    shown = [str(line) for line in lines[:5]]
    rest = (len(lines) if count is None else count) - len(shown)
    more = f" and {rest} more" if rest > 0 else ""
    return f"line{'s' if len(shown) > 1 or rest > 0 else ''} {', '.join(shown)}{more}"
