"""The ledger, ranges of units and the sizes of chunks."""

from __future__ import annotations

import sqlite3
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lobefit.fitting.engine import EngineError, Ledger, Row
from lobefit.fitting.engine.ranges import Ranges, without
from lobefit.fitting.engine.sizes import Sizes

UNITS = st.sets(st.integers(0, 30))


def ranges(units: set[int]) -> list[tuple[int, int]]:
    """Cut a set into ranges, neighbours joined."""
    found: list[tuple[int, int]] = []
    for unit in sorted(units):
        if found and found[-1][1] == unit:
            found[-1] = (found[-1][0], unit + 1)
        else:
            found.append((unit, unit + 1))
    return found


def members(listed: list[tuple[int, int]]) -> list[int]:
    return [unit for first, stop in listed for unit in range(first, stop)]


@given(UNITS, UNITS)
def test_what_is_left_is_the_difference(wanted: set[int], taken: set[int]) -> None:
    assert members(without(ranges(wanted), ranges(taken))) == sorted(wanted - taken)


@given(UNITS, st.lists(st.integers(1, 9)))
def test_everything_is_taken_once(units: set[int], sizes: list[int]) -> None:
    left, taken = Ranges(ranges(units)), []
    for size in sizes:
        if left.count:
            taken.append(left.take(size))
            assert taken[-1][1] - taken[-1][0] <= size
    while left.count:
        taken.append(left.take(1000))
    assert members(taken) == sorted(units)


def test_a_chunk_takes_the_time_it_should_and_the_last_ones_less() -> None:
    sizes = Sizes(3.0, 10, 5000)
    assert sizes.next(10**6, 2) == 10  # nothing is known yet
    sizes.saw(10, 0.01)
    assert sizes.next(10**6, 2) == 3000
    assert sizes.next(4000, 2) == 1000
    assert sizes.next(8, 2) == 10
    sizes.saw(10, 0.0)
    for _ in range(100):
        sizes.saw(10, 0.0)
    assert sizes.next(10**6, 2) == 5000


def test_units_are_settled_once(tmp_path: Path) -> None:
    with Ledger(tmp_path / "ledger.sqlite") as ledger:
        assert ledger.settle([Row(0, 10, {"a": 1}, "", 2.0, "here")]) == 10
        assert ledger.settle([Row(5, 6), Row(10, 12)]) == 2
        assert ledger.seconds() == 2.0
        assert ledger.settle([Row(12, 13, None, "broken")]) == 1
        assert ledger.missing([(0, 20)]) == [(13, 20)]
        assert [(r.first, r.stop, r.record) for r in ledger.rows("done")] == [
            (0, 10, {"a": 1}),
            (10, 12, None),
        ]
        assert [(r.first, r.reason) for r in ledger.rows("failed")] == [(12, "broken")]
        ledger.forget([12])
        assert ledger.missing([(0, 20)]) == [(12, 20)]
    with Ledger(tmp_path / "ledger.sqlite") as ledger:  # it is on the disk
        assert ledger.missing([(0, 20)]) == [(12, 20)]


def test_items_keep_their_numbers_and_changed_ones_are_done_again(tmp_path: Path) -> None:
    with Ledger(tmp_path / "ledger.sqlite") as ledger:
        a, b = ledger.number([("a", "1"), ("b", "1")])
        ledger.settle([Row(a, a + 1), Row(b, b + 1)])
        assert ledger.number([("c", "1"), ("b", "2"), ("a", "1")])[1:] == [b, a]
        assert ledger.missing([(a, b + 1)]) == [(b, b + 1)]


def test_a_ledger_of_other_work_is_refused_and_so_is_what_is_none(tmp_path: Path) -> None:
    with Ledger(tmp_path / "ledger.sqlite", {"kind": "texels"}):
        pass
    with pytest.raises(EngineError, match="holds other work"):
        Ledger(tmp_path / "ledger.sqlite", {"kind": "batch"})
    (tmp_path / "text").write_text("no ledger" * 1000)
    with pytest.raises(EngineError, match="cannot use the ledger"):
        Ledger(tmp_path / "text")
    with pytest.raises(EngineError, match="cannot use the ledger"):
        Ledger(tmp_path / "text" / "ledger.sqlite")


def test_a_transaction_that_fails_leaves_nothing(tmp_path: Path) -> None:
    with Ledger(tmp_path / "ledger.sqlite") as ledger:
        with pytest.raises(EngineError):
            ledger.settle([Row(0, 1), Row(5, 5)])  # an empty range
        assert ledger.rows() == []
    with sqlite3.connect(tmp_path / "ledger.sqlite") as db:
        assert db.execute("PRAGMA integrity_check").fetchone() == ("ok",)
    db.close()
